"""Flights whose outcome must be alike on every real autopilot."""

from __future__ import annotations

import signal

from tests.e2e.field import Field

HEIGHT_M = 25.0
SILENT_M = 6.0


def lands_where_it_chose(field: Field, error_m: float, *settings: str) -> list[str]:
    """Fly the main job, see that it ends on the chosen point and safe ground; return what was said."""
    with field:
        field.run_companion(*settings)
        field.pilot.take_off(HEIGHT_M)
        outcome = field.land()
    assert outcome.summary["landed"]
    assert outcome.safe
    assert outcome.error_m is not None
    assert outcome.error_m <= error_m
    return outcome.said


def climbs_without_lidar(field: Field, *settings: str) -> None:
    """Silence the LiDAR in the autopilot's landing: it climbs, holds and calls the pilot."""
    landing, guided = field.landing_mode, field.guided_mode
    with field:
        pilot = field.pilot
        field.run_companion(*settings)
        pilot.take_off(HEIGHT_M)
        pilot.until(lambda: pilot.mode == landing and pilot.height_m < SILENT_M, 400, f"{landing} at 6 m")
        field.lidar.send_signal(signal.SIGSTOP)
        lowest_m = pilot.height_m

        def climbs() -> bool:
            nonlocal lowest_m
            lowest_m = min(lowest_m, pilot.height_m)
            return pilot.mode == guided and pilot.height_m > 12.0

        pilot.until(climbs, 60, "climb")
        pilot.until(lambda: pilot.hears("take over"), 60, "call for the pilot")
        field.lidar.send_signal(signal.SIGCONT)
        assert pilot.armed
        assert pilot.mode == guided
        assert lowest_m > 3.0
        assert pilot.hears("LiDAR lost")
