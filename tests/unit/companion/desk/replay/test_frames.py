"""Flights far from their first position and near latitude 0, longitude 0: their maps against the truth."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.desk.replay import replay_run
from companion.desk.replay.own_replay import Replay
from companion.desk.replay.recording_reader import Raw
from companion.desk.replay.recording_type import RecordingOptions, open_recording
from companion.flight.recorder import journal
from companion.flight.recorder.journal import BadRecordError
from companion.runtime.errors import UsageError
from sitl import scenes
from slz import LocalFrame, TerrainMaps
from tests.unit.companion.desk.replay import flights
from tests.unit.companion.desk.replay.flights import BEGIN_NS, HEADER, PARAMETERS

MS = 1_000_000
SETTINGS = ("cell_m=0.5", "zone_m=200")
OWN_ERROR_M = -0.053  # of this flight and its sensor, near the first position too
NULL_ISLAND = LocalFrame(0.0, 0.0, 400.0)


@pytest.fixture(scope="module")
def pcap(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return flights.write_pcap(tmp_path_factory.mktemp("capture") / "lidar.pcap")


def logged(at_ms: float, message: Any) -> bytes:
    """Return a message of the vehicle's autopilot as a log holds it."""
    frame = message.pack(mavlink.MAVLink(None, srcSystem=1, srcComponent=1))
    return struct.pack(">Q", round((BEGIN_NS + at_ms * MS) / 1000)) + bytes(frame)


def beat(at_ms: float) -> bytes:
    return logged(at_ms, mavlink.MAVLink_heartbeat_message(2, 3, 217, 4, 4, 3))


def fix(at_ms: float, kind: int) -> bytes:
    return logged(at_ms, mavlink.MAVLink_gps_raw_int_message(0, kind, 0, 0, 0, 70, 110, 0, 0, 9))


def at(at_ms: float, place: LocalFrame, boot_ms: int, north_cms: int = 0) -> bytes:
    e7 = round(place.lat_deg * 1e7), round(place.lon_deg * 1e7), round(place.alt_m * 1000)
    return logged(
        at_ms, mavlink.MAVLink_global_position_int_message(boot_ms, *e7, 20_000, north_cms, 0, 0, 65535)
    )


def log(out: Path, begin: bytes) -> Path:
    """Write the flight's log behind what comes before it."""
    flights.write_tlog(out)
    out.write_bytes(begin + out.read_bytes())
    return out


def maps(path: Path, pcap: Path) -> TerrainMaps:
    feed, rerun = open_recording(path, SETTINGS, RecordingOptions(points=str(pcap)))
    for _, act in feed.steps(rerun):
        rerun.hand_over(act)
    rerun.finish()
    found = rerun.maps()
    assert found is not None
    assert rerun.report is not None
    assert rerun.report.zones
    return found


def heights_m(found: TerrainMaps, home: LocalFrame) -> tuple[np.ndarray, np.ndarray]:
    """Return places (n, 2) east and north of home and heights over it of all cells that are known."""
    row, col = np.nonzero(np.isfinite(found.height_m))
    x = found.west_m + (col + 0.5) * found.grid.cell_m
    y = found.south_m + (row + 0.5) * found.grid.cell_m
    lat, lon, alt = found.frame.lla(np.column_stack([x, y, found.height_m[row, col]])).T
    enu = home.enu_m(lat, lon, alt)
    return enu[:, :2], enu[:, 2]


def check_truth(found: TerrainMaps, home: LocalFrame) -> None:
    """See that the ground of the plain lies where it is, to centimetres and without a slope of its own."""
    world = scenes.build("plain", 1).world
    places, up = heights_m(found, home)
    assert len(up) > 3000
    error = up - [world.height_m(east, north) for east, north in places]
    tilt = np.linalg.lstsq(np.column_stack([places, np.ones(len(up))]), error, rcond=None)[0][:2]
    assert np.median(error) == pytest.approx(OWN_ERROR_M, abs=0.01)
    assert np.abs(tilt).max() < 0.001  # 2 cm over 20 m
    assert np.quantile(np.abs(error - OWN_ERROR_M), 0.95) < 0.06


BEFORE = {
    "nothing": lambda home: b"",
    "30 km south ten minutes ago": lambda home: (
        beat(-600_500)
        + b"".join(
            at(-600_000 + k * 40, home.shifted(0.0, -30_000.0 + 2 * k), 60_000 - 600_000 % 50_000 + k, 5000)
            for k in range(3)
        )
    ),
    "a degree east until just now": lambda home: (
        beat(-900)
        + b"".join(at(-800 + k * 40, home.shifted(76_000.0, 0.0), 59_200 + k * 40) for k in range(10))
    ),
    "five degrees away": lambda home: (
        beat(-900)
        + b"".join(
            at(-800 + k * 40, LocalFrame(home.lat_deg + 5, home.lon_deg + 5, 0.0), 59_200 + k * 40)
            for k in range(10)
        )
    ),
    "beside 0, 0 before the fix": lambda home: (
        beat(-900)
        + fix(-850, 1)
        + b"".join(at(-800 + k * 40, LocalFrame(1e-7, -2e-7 * k, 0.0), 59_200 + k * 40) for k in range(10))
        + fix(-410, 3)
    ),
}


@pytest.mark.parametrize("name", BEFORE)
def test_a_flight_far_from_its_first_position_is_mapped_where_it_is(
    name: str, tmp_path: Path, pcap: Path
) -> None:
    path = log(tmp_path / "far.tlog", BEFORE[name](flights.HOME))
    check_truth(maps(path, pcap), flights.HOME)


@pytest.mark.parametrize("told", [True, False])
def test_a_flight_beside_0_0_is_mapped(
    told: bool, tmp_path: Path, pcap: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(flights, "HOME", NULL_ISLAND)
    begin = beat(-900) + (fix(-850, 3) if told else b"")
    check_truth(maps(log(tmp_path / "null.tlog", begin), pcap), NULL_ISLAND)


def test_a_flight_without_a_fix_says_why_it_has_no_map(tmp_path: Path, pcap: Path) -> None:
    path = log(tmp_path / "unfixed.tlog", beat(-900) + fix(-850, 1))
    with pytest.raises(UsageError, match="no fix"):
        replay_run.run(path, SETTINGS, None, 0.0, (0.0, 1e9), options=RecordingOptions(points=str(pcap)))


# ---- our own recordings ---------------------------------------------------------------------------


def test_a_frame_that_began_in_flight_begins_in_its_replay() -> None:
    origin = flights.HOME.shifted(300.0, -200.0)
    messages = flights.recorded()
    begun = Raw(journal.EVENT, messages[len(messages) // 2].at_ns, journal.pack_frame(origin))
    replay = Replay(HEADER, PARAMETERS)
    for message in (*messages[: len(messages) // 2], begun, *messages[len(messages) // 2 :]):
        replay.process_message(message)
    assert replay.outcome.bad == 0
    assert replay.history.frame == origin
    assert replay.history.jumps == 0
    pose = replay.history.latest(messages[-1].at_ns)
    assert pose is not None
    lat, lon, alt = origin.lla(pose.position_enu_m)
    there = flights.path(flights.SECONDS + 0.4)[0][0]
    np.testing.assert_allclose(flights.HOME.enu_m(lat, lon, alt), there, atol=0.3)


def test_a_frame_is_read_as_it_was_written() -> None:
    frame = LocalFrame(-33.8567844, 151.2152967, 12.345)
    assert journal.unpack_event(journal.pack_frame(frame)) == frame


@pytest.mark.parametrize("frame", [[], [1.0, 2.0], [91.0, 0.0, 0.0], ["a", 0, 0], None, [1, 2, 3, 4]])
def test_a_frame_that_is_none_is_refused(frame: Any) -> None:
    with pytest.raises(BadRecordError):
        journal.unpack_event(json.dumps({"frame": frame}).encode())
