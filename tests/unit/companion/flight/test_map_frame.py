"""Change of the map's frame far from its origin, with conversion of the kept positions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from companion.flight.app import Companion
from companion.flight.landing.situation import COMMANDING, Phase
from companion.flight.sensing import Sources
from slz import LocalFrame
from tests.unit.companion.flight.landing.flight import Flight, zone

HOME = LocalFrame(47.0, 8.0, 400.0)
MS = 1_000_000
POINT = np.array([2400.0, 15.0, 3.0])

SOURCES = Sources("livox:127.0.0.1:56301")


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> Iterator[Companion]:
    """Return a companion that flew 30 m of its way from HOME to the north-east."""
    companion = Companion("udpin:127.0.0.1:14550", SOURCES, params.load(), auto=False)
    monkeypatch.setattr(companion.link, "send", lambda _message: None)
    fly(companion, 0.0, 30.0)
    yield companion
    companion.mapping.worker.close()


def fly(companion: Companion, begin_m: float, end_m: float) -> None:
    """Let the autopilot tell a straight way east at 50 m/s."""
    for east_m in np.arange(begin_m, end_m, 2.0):
        stamp_ns = round(east_m / 50.0 * 1e9)
        lat, lon, alt = HOME.lla([east_m, 0.0, 20.0])
        companion.sensing.history.add_attitude(stamp_ns, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        companion.sensing.history.add_position(stamp_ns, float(lat), float(lon), float(alt), (0.0, 50.0, 0.0))


def in_home(companion: Companion, enu_m: NDArray[np.float64]) -> NDArray[np.float64]:
    frame = companion.sensing.history.frame
    assert frame is not None
    return HOME.enu_m(*frame.lla(enu_m).T)


def test_near_its_origin_a_frame_stays(made: Companion) -> None:
    fly(made, 30.0, 1400.0)
    frame, epoch = made.sensing.history.frame, made.sensing.history.epoch
    assert not made.deciding.loop.begin_frame_if_far()
    assert (made.sensing.history.frame, made.sensing.history.epoch) == (frame, epoch)


def test_far_from_its_origin_another_begins_and_the_pilot_is_told(made: Companion) -> None:
    told: list[str] = []
    made.link.on_text.subscribe(lambda text, _severity: told.append(text))
    fly(made, 30.0, 2400.0)
    assert made.deciding.loop.begin_frame_if_far()
    assert told == ["SLZ: far from the map's origin: mapping anew"]
    pose = made.sensing.history.latest(round(2398 / 50.0 * 1e9))
    assert pose is not None
    np.testing.assert_allclose(pose.position_enu_m, 0.0, atol=1e-6)
    assert made.sensing.history.jumps == 0
    assert not made.deciding.loop.begin_frame_if_far()


@pytest.mark.parametrize("phase", sorted(COMMANDING, key=lambda phase: phase.value))
def test_from_the_hand_over_to_the_landing_the_frame_stays(made: Companion, phase: Phase) -> None:
    fly(made, 30.0, 2400.0)
    frame, made.executive.progress.phase = made.sensing.history.frame, phase
    assert not made.deciding.loop.begin_frame_if_far()
    assert made.sensing.history.frame == frame


def test_the_selection_and_the_path_follow(made: Companion) -> None:
    situation = Flight([zone(1, 5.0, 5.0)]).situation
    made.executive.step(situation())
    made.executive.orders.select_point(POINT)
    made.executive.step(situation())
    for east_m in (0.0, 1000.0, 2398.0):
        made.deciding.path.enu_m.append(np.array([east_m, 0.0, 0.0]))
    old = made.sensing.history.frame
    assert old is not None
    fly(made, 30.0, 2400.0)
    assert made.deciding.loop.begin_frame_if_far()
    commands = made.executive.step(replace(situation(), epoch=made.sensing.history.epoch))
    assert [text for _, text in commands.texts] == []  # no jump, no selection lost
    assert commands.select_enu_m is not None
    expected = HOME.enu_m(*old.lla(POINT).T)
    np.testing.assert_allclose(in_home(made, commands.select_enu_m), expected, atol=1e-3)
    path = in_home(made, made.deciding.path.enu_m.array())
    np.testing.assert_allclose(path[:, 0], [0.0, 1000.0, 2398.0], atol=0.02)


async def test_the_map_begins_anew_and_the_recording_tells(
    made: Companion, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames: list[Any] = []
    made.telling.recordings.recorder = SimpleNamespace(frame_begun=frames.append)  # type: ignore[assignment]
    begun: list[str] = []
    monkeypatch.setattr(made.mapping.worker, "reset", lambda: begun.append("map"))
    fly(made, 30.0, 2400.0)
    made.deciding.loop.run_once()
    made.deciding.loop.run_once()
    assert begun == ["map"]
    assert frames == [made.sensing.history.frame]
    made.telling.recordings.recorder = None
