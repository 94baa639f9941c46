"""Memory of the services, and the conditions for rally points."""

from __future__ import annotations

import asyncio
import os
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

import params
from companion.flight.link.link import Link
from companion.flight.link.mission_protocol import RallyPoint
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.link.wire.signing import MARGIN_TICKS, Signing, wall_ticks
from companion.flight.mapping.latest_report import LatestReport
from companion.flight.mapping.window_pace import WindowPace
from companion.flight.services.services import RALLY_FILE, SIGNING_FILE, Services, start_signing
from companion.flight.services.settings import Settings
from companion.runtime.clock import now_ns
from companion.runtime.state_directory import StateDir
from slz import LandingPoint, LocalFrame, SurfaceHere
from tests.unit.companion.flight.link.messages import received


def test_signing_goes_on_from_the_timestamp_that_was_kept(tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_bytes(bytes(range(32)))
    key.chmod(0o600)
    state = StateDir(tmp_path)
    first = start_signing(key, state)
    assert first.next_tick() >= wall_ticks() - 100_000
    ahead = first.tick + 10**9  # the date is set back by almost three hours
    state.write(SIGNING_FILE, f"{ahead}\n")
    second = start_signing(key, state)
    assert (second.secret, second.next_tick()) == (bytes(range(32)), ahead + MARGIN_TICKS + 1)


@pytest.mark.parametrize(
    "damaged",
    [b"", b"\0" * 16, b"\xff\xfe\x80", b"-1\n", b"%d\n" % 2**48, b"9" * 5000],
    ids=lambda b: repr(b[:20]),
)
def test_a_damaged_timestamp_is_told_and_signing_begins_with_the_date(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, damaged: bytes
) -> None:
    key = tmp_path / "key"
    key.write_bytes(bytes(range(32)))
    key.chmod(0o600)
    (tmp_path / SIGNING_FILE).write_bytes(damaged)
    signing = start_signing(key, StateDir(tmp_path))
    assert wall_ticks() - 1_000_000 <= signing.next_tick() <= wall_ticks() + 1_000_000
    (line,) = (record.getMessage() for record in caplog.records if record.levelname == "WARNING")
    assert line.startswith(f"{tmp_path / SIGNING_FILE}: ")
    assert "is no timestamp" in line


def services(
    state: StateDir | None = None,
    signing: Signing | None = None,
    latest: LatestReport | None = None,
    **values: Any,
) -> tuple[Services, Settings, Any]:
    link = SimpleNamespace(
        connected=True,
        key_mismatch=None,
        system_id=1,
        component_id=191,
        vehicle=VehicleState(sysid=1, position_lla=(47.0, 8.0, 400.0), relative_alt_m=0.0, armed=True),
        subscribe=lambda *_, **__: None,
        on_command=lambda *_: None,
    )
    settings = Settings(params.build(values))
    return Services(cast(Link, link), settings, signing, state, latest), settings, link


def report() -> Any:
    best = LandingPoint(np.zeros(3), 2.0, 4.0, 1.0, 0.99, surface=SurfaceHere())
    return SimpleNamespace(
        frame=LocalFrame(47.0, 8.0, 400.0),
        near=SimpleNamespace(zones=(SimpleNamespace(best=best),)),
        zones=(),
    )


async def wanted(served: Services) -> tuple[RallyPoint, ...] | None:
    """Return the points that one tick asks for."""
    asked: list[tuple[RallyPoint, ...] | None] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(served.rally, "poll", lambda _now_ns, points, *_: asked.append(points) or [])
        task = asyncio.create_task(served.run())
        await asyncio.sleep(0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
    (points,) = asked
    return points


async def test_points_are_wanted_while_armed_and_switched_on_and_none_are_touched_without_a_report() -> None:
    latest = LatestReport(params.load(), WindowPace(params.load()))
    served, settings, link = services(latest=latest)
    latest.use_report(report())
    assert await wanted(served) == ()
    assert settings.change("rally", "on").accepted
    points = await wanted(served)
    assert points is not None
    assert [p.alt_m for p in points] == [20]
    latest.begin_map()
    assert await wanted(served) is None
    link.vehicle = VehicleState(sysid=1, position_lla=(47.0, 8.0, 400.0), relative_alt_m=0.0)
    assert await wanted(served) == ()


async def test_the_fence_is_not_read_while_another_station_transfers(monkeypatch: pytest.MonkeyPatch) -> None:
    served, _, link = services()
    quiets: list[bool] = []
    monkeypatch.setattr(served.fence, "poll", lambda *_, quiet: quiets.append(quiet) or [])
    await wanted(served)
    count = received(
        mavlink.MAVLink_mission_count_message(1, 1, 4, mavlink.MAV_MISSION_TYPE_MISSION), 255, 190
    )
    served.rally.on_message(count, now_ns(), link.vehicle.sysid, (link.system_id, link.component_id))
    await wanted(served)
    assert quiets == [True, False]


def test_points_of_an_earlier_run_are_read_and_a_broken_line_is_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    state = StateDir(tmp_path)
    state.write(RALLY_FILE, "470000000 80000000 20\nhome\n9999999999 0 0\n1 2\n")
    served, _, _ = services(state)
    assert served.rally.ours == (RallyPoint(470_000_000, 80_000_000, 20),)
    assert len(caplog.records) == 3


def test_points_of_which_only_bytes_are_left_are_none(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / RALLY_FILE).write_bytes(b"\xff\xfe\x80\0\0")
    served, _, _ = services(StateDir(tmp_path))
    assert served.rally.ours == ()
    assert len(caplog.records) == 1


async def test_what_is_remembered_survives_a_power_cut_and_the_event_loop_never_waits_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[tuple[str, bool]] = []

    def fsync(descriptor: int) -> None:
        name = Path(f"/proc/self/fd/{descriptor}").readlink().name.lstrip(".").partition(".")[0]
        synced.append((name, threading.current_thread() is threading.main_thread()))

    monkeypatch.setattr(os, "fsync", fsync)
    served, _, _ = services(StateDir(tmp_path), Signing(bytes(32), wall=lambda: 10**9))
    monkeypatch.setattr(served.rally, "ours", (RallyPoint(470_000_000, 80_000_000, 20),))
    monkeypatch.setattr(served.rally, "poll", lambda *_: [])
    task = asyncio.create_task(served.run())
    async with asyncio.timeout(5):
        while len(synced) < 2:
            await asyncio.sleep(0)
    assert synced == [("rally", False), ("signing", False)]
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    assert synced[2:] == [("signing", True)]  # the last one, when nothing flies any more
    assert StateDir(tmp_path).read(SIGNING_FILE) == f"{10**9}\n"


async def test_points_and_timestamps_that_cannot_be_kept_are_warned_of_and_the_flight_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    state = StateDir(tmp_path)
    served, _, link = services(state, cast(Signing, SimpleNamespace(tick=7, to_save=lambda: 7)))
    sent: list[str] = []
    link.send = sent.append
    monkeypatch.setattr(state, "write", lambda *_, **__: "No space left on device")
    monkeypatch.setattr(served.rally, "ours", (RallyPoint(470_000_000, 80_000_000, 20),))
    monkeypatch.setattr(served.rally, "poll", lambda *_: ["a message"])
    task = asyncio.create_task(served.run())
    async with asyncio.timeout(5):
        while len(caplog.records) < 2:
            await asyncio.sleep(0)
    assert not task.done()
    assert sent == ["a message"]
    assert [record.getMessage() for record in caplog.records] == [
        "our rally points are not remembered: No space left on device",
        "the timestamp of signing is not kept: No space left on device",
    ]
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
