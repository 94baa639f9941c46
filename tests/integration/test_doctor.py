"""The doctor beside the simulated vehicle, on simulated time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import params
from companion.flight.doctor import examination
from companion.flight.doctor.examination import Examination
from companion.flight.doctor.finding import Finding, healthy
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.wire.signing import Signing
from companion.runtime.lockstep_loop import LockstepLoop
from sitl import faults
from sitl.simulation import Simulation
from tests.ports import free_port


@pytest.fixture(autouse=True)
def machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the speed of the machine that runs the tests out of them."""
    monkeypatch.setattr(examination, "machine_findings", lambda parameters, late_ms: [])


def examined(
    height_m: float | None = None,
    lidar: bool = True,
    beside: Callable[[Simulation], object] = lambda _sim: None,
    system: int | None = None,
    seconds: float = 8.0,
    own: tuple[str, ...] = (),
    keys: tuple[bytes | None, bytes | None] = (None, None),
    **autopilot: float,
) -> list[Finding]:
    """Examine a simulated vehicle with some of its parameters changed; `keys`: the vehicle's and ours."""
    mavlink, points = free_port(), free_port()
    more: dict[str, Any] = {"parameters": autopilot, "pilot_height_m": height_m, "mavlink_key": keys[0]}
    signing = None if keys[1] is None else Signing(keys[1])
    sim = Simulation.build(
        "plain",
        mavlink=[f"udpout:127.0.0.1:{mavlink}"],
        lidar_to=("127.0.0.1", points) if lidar else None,
        point_rate_hz=20_000,
        tick_ns=10_000_000,
        **more,
    )
    beside(sim)
    loop = LockstepLoop(sim.advance)
    urls = f"udpin:127.0.0.1:{mavlink}", f"livox:127.0.0.1:{points}"
    try:
        parameters = params.load("quadcopter", own)
        return loop.run_until_complete(Examination(*urls, parameters, seconds, signing, system).run())
    finally:
        sim.close()
        loop.close()


def test_a_vehicle_set_up_for_us_is_healthy() -> None:
    findings = examined(height_m=10.0, PRX1_TYPE=2.0)
    assert healthy(findings), [finding for finding in findings if finding.state != "ok"]
    checks = {finding.check for finding in findings}
    assert {"autopilot", "rate of ATTITUDE_QUATERNION", "residual of the clocks", "PLND_TYPE"} <= checks
    files = {row.name for row in ARDUPILOT.required()}
    others = {
        "LAND_SPD_MS",
        "LAND_ALT_LOW_M",
        "LAND_SPD_HIGH_MS",
        "WP_SPD_DN",
        "PLND_ORIENT",
        "RTL_ALT_FINAL_M",
        "RNGFND1_MAX_CM",
    }
    assert files - others <= checks  # other versions have these


def test_the_fence_is_read_and_named() -> None:
    findings = examined(height_m=10.0, PRX1_TYPE=2.0, FENCE_ENABLE=1.0, FENCE_RADIUS=25.0, FENCE_TYPE=3.0)
    (fence,) = (finding for finding in findings if finding.check == "fence")
    assert (fence.state, fence.found) == ("ok", "circle of 25 m, flown up to 96 m; 4 m kept from it")


def test_the_time_to_identify_the_vehicle_is_not_taken_off_the_time_to_listen() -> None:
    findings = examined(height_m=10.0, PRX1_TYPE=2.0, seconds=5.5)
    assert healthy(findings), [finding for finding in findings if finding.state != "ok"]


def test_what_is_set_wrong_is_named_with_its_remedy() -> None:
    findings = examined(PLND_TYPE=0.0, AVOID_ENABLE=0.0)
    bad = {finding.check: finding for finding in findings if finding.state in ("fail", "warn")}
    assert bad["PLND_TYPE"].state == "fail"
    assert "set PLND_TYPE to 1" in bad["PLND_TYPE"].remedy
    assert bad["AVOID_ENABLE"].state == "warn"
    assert not healthy(findings)


def test_an_odometry_that_must_not_fly_fails_and_the_autopilot_is_examined_without_it() -> None:
    findings = examined(height_m=10.0, PRX1_TYPE=2.0, own=("odometry=autopilot",))
    assert [finding.check for finding in findings if finding.state == "fail"] == ["SLZ_ODOMETRY"]
    assert "VISO_DELAY_MS" not in {finding.check for finding in findings}


KEY, OTHER = b"k" * 32, b"o" * 32


@pytest.mark.parametrize(
    ("keys", "found", "what_to_do"),
    [
        ((KEY, None), "vehicle signs, no --mavlink-key", "by --mavlink-key FILE"),
        ((None, KEY), "vehicle does not sign, we do", "or start slz without --mavlink-key"),
        ((KEY, OTHER), "vehicle signs with another key", "by --mavlink-key FILE"),
    ],
)
def test_keys_that_do_not_match_are_one_fault_that_names_the_option(
    keys: tuple[bytes | None, bytes | None], found: str, what_to_do: str
) -> None:
    findings = examined(height_m=10.0, PRX1_TYPE=2.0, keys=keys)
    (fault,) = (finding for finding in findings if finding.state == "fail")
    assert (fault.check, fault.state, fault.found) == ("signing", "fail", found)
    assert what_to_do in fault.remedy
    assert {"firmware", "PLND_TYPE", "time synchronisation"}.isdisjoint(finding.check for finding in findings)


def test_a_vehicle_that_signs_with_our_key_is_healthy() -> None:
    findings = examined(height_m=10.0, PRX1_TYPE=2.0, keys=(KEY, KEY))
    assert healthy(findings), [finding for finding in findings if finding.state != "ok"]
    assert "signing" not in {finding.check for finding in findings}


def test_a_lidar_that_is_silent_fails() -> None:
    findings = {finding.check: finding for finding in examined(lidar=False)}
    assert findings["LiDAR packets"].state == "fail"
    assert findings["PLND_TYPE"].state == "ok"


class OtherVehicle:
    """Another copter on the line from the beginning."""

    def __init__(self, sim: Simulation) -> None:
        self.fault = faults.build("second_vehicle", np.random.default_rng(1))
        self.fault.start(sim)
        sim.every_tick.append(self.fault.on_tick)


def test_two_vehicles_fail_by_name_and_the_named_one_is_examined() -> None:
    findings = {finding.check: finding for finding in examined(height_m=10.0, beside=OtherVehicle)}
    assert findings["autopilot"].state == "fail"
    assert "system 1 (quadrotor) and system 2 (quadrotor)" in findings["autopilot"].found
    assert "--system" in findings["autopilot"].remedy
    assert findings["LiDAR packets"].state == "ok"
    assert findings["parameters"].state == "skipped"
    named = examined(height_m=10.0, beside=OtherVehicle, system=1, PRX1_TYPE=2.0)
    assert healthy(named), [finding for finding in named if finding.state != "ok"]
