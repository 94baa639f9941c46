"""Vehicle selection in telemetry logs of more than one system."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.desk.replay import replay_run
from companion.desk.replay.recording_type import RecordingOptions
from companion.runtime.errors import UsageError
from tests.unit.companion.desk.replay import flights
from tests.unit.companion.desk.replay.flights import BEGIN_NS, HOME

TRACKER, ROVER, COPTER, HELICOPTER = 5, 10, 2, 4
MS = 1_000_000


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a flight's log, by quaternions and by angles, and its capture."""
    folder = tmp_path_factory.mktemp("flight")
    flights.write_tlog(folder / "flight.tlog")
    flights.write_tlog(folder / "angles.tlog", angles=True)
    flights.write_pcap(folder / "lidar.pcap")
    return folder


def beside(log: Path, out: Path, messages: list[tuple[int, Any]], system: int, component: int = 1) -> Path:
    """Write a log with more messages (ms since the beginning) of another sender, in order of time."""
    sender = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
    data, entries, at = log.read_bytes(), [], 0
    while at < len(data):
        end = at + 8 + 12 + data[at + 9]
        entries.append((struct.unpack_from(">Q", data, at)[0], data[at + 8 : end]))
        at = end
    entries += [((BEGIN_NS + ms * MS) // 1000, bytes(message.pack(sender))) for ms, message in messages]
    entries.sort(key=lambda entry: entry[0])
    out.write_bytes(b"".join(struct.pack(">Q", us) + frame for us, frame in entries))
    return out


def other(kind: int, begin_ms: int = -2000) -> list[tuple[int, Any]]:
    """Return what another vehicle 1.1 km north tells, level and still."""
    lat, lon, alt = (float(v) for v in HOME.lla([0.0, 1111.0, 0.0]))
    found: list[tuple[int, Any]] = []
    for ms in range(begin_ms, 5400, 50):
        if ms % 1000 == 0:
            found.append((ms, mavlink.MAVLink_heartbeat_message(kind, 3, 81, 0, 4, 3)))
        found.append((ms, mavlink.MAVLink_attitude_quaternion_message(ms + 90_000, 1, 0, 0, 0, 0, 0, 0)))
        place = round(lat * 1e7), round(lon * 1e7), round(alt * 1e3)
        found.append((ms, mavlink.MAVLink_global_position_int_message(ms + 90_000, *place, 0, 0, 0, 0, 0)))
    return found


def again(log: Path, files: Path, **more: Any) -> dict[str, Any]:
    asked = ["cell_m=0.5", "zone_m=200"]
    given = RecordingOptions(points=str(files / "lidar.pcap"), **more)
    return replay_run.run(log, asked, None, 0.0, (0.0, 1e9), options=given)


@pytest.mark.parametrize("kind", [TRACKER, ROVER])
def test_a_tracker_or_rover_heard_first_changes_nothing(files: Path, tmp_path: Path, kind: int) -> None:
    log = beside(files / "flight.tlog", tmp_path / "first.tlog", other(kind), system=2)
    alone = again(files / "flight.tlog", files)
    assert alone["zones"]
    assert again(log, files) == alone | {"file": str(log)}


@pytest.mark.parametrize("begin_ms", [-2000, 4000])
def test_two_aircraft_are_refused_by_name_and_the_one_that_is_named_is_mapped(
    files: Path, tmp_path: Path, begin_ms: int
) -> None:
    log = beside(files / "flight.tlog", tmp_path / "two.tlog", other(HELICOPTER, begin_ms), system=255)
    with pytest.raises(UsageError, match=r"system 1 \(quadrotor\) and system 255 \(helicopter\).*--system"):
        again(log, files)
    found = again(log, files, system=1)
    assert found["source"]["system"] == 1
    assert found["zones"] == again(files / "flight.tlog", files)["zones"]
    assert found["zones"]


def test_a_system_that_is_not_in_the_log_is_refused_with_those_that_are(files: Path, tmp_path: Path) -> None:
    log = beside(files / "flight.tlog", tmp_path / "log.tlog", other(TRACKER), system=2)
    with pytest.raises(
        UsageError, match=r"no autopilot of system 7.*system 1 \(quadrotor\).*antenna tracker"
    ):
        again(log, files, system=7)


def test_a_log_of_a_tracker_alone_says_so(files: Path, tmp_path: Path) -> None:
    (tmp_path / "nothing.tlog").write_bytes(b"")
    log = beside(tmp_path / "nothing.tlog", tmp_path / "tracker.tlog", other(TRACKER), system=2)
    with pytest.raises(UsageError, match=r"no aircraft, only system 2 \(antenna tracker\)"):
        again(log, files)


def test_the_attitude_of_a_gimbal_does_not_stand_in_for_the_vehicle_s(files: Path, tmp_path: Path) -> None:
    """A log whose autopilot tells angles, and whose gimbal, component 154, tells quaternions."""
    gimbal = [
        (ms, mavlink.MAVLink_attitude_quaternion_message(ms + 60_000, 0.7071, 0, -0.7071, 0, 0, 0, 0))
        for ms in range(-390, 5400, 20)
    ]
    log = beside(files / "angles.tlog", tmp_path / "gimbal.tlog", gimbal, system=1, component=154)
    alone = again(files / "angles.tlog", files)
    assert alone["zones"]
    assert again(log, files) == alone | {"file": str(log)}


def test_a_named_system_belongs_to_a_log(files: Path, tmp_path: Path) -> None:
    own = flights.write_own(tmp_path / "own.mcap", flights.recorded())
    with pytest.raises(UsageError, match="leave out --points, --system"):
        replay_run.run(own, [], None, 0.0, (0.0, 1e9), options=RecordingOptions(system=1))
