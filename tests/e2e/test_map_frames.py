"""Flight with a change of the map's frame: landing at the chosen point, and bit-exact replay."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.desk.replay import replay_run
from companion.flight.fusion import pose_history
from companion.flight.landing.situation import Phase
from slz import LocalFrame
from tests.e2e.harness import Mission

pytestmark = pytest.mark.long

A_STEP_RAD = 3e-8  # 0.2 m: what a climbing vehicle drifts


def test_frames_that_begin_before_the_hand_over_change_neither_the_landing_nor_its_replay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pose_history, "MOST_TURN_RAD", A_STEP_RAD)
    frames: list[LocalFrame | None] = []

    async def flight(mission: Mission) -> None:
        for phase in (Phase.SURVEY, Phase.APPROACH, Phase.DESCEND, Phase.FINAL):
            await mission.until_phase(phase)
            frames.append(mission.companion.sensing.history.frame)
        await mission.until_phase(Phase.LANDED)

    mission = Mission(record=tmp_path / "flight.mcap", height_m=13.0, survey_s=5.0).fly(flight)
    assert sum("far from the map's origin" in text for text in mission.heard) >= 2
    assert len(set(frames)) == 1  # that of the hand-over
    assert mission.touchdown_safe()
    assert mission.touchdown_error_m() < 0.5
    again = replay_run.run(tmp_path / "flight.mcap", [], None, 0.0, (0.0, 1e9))
    assert again["windows"] - 1 <= again["identical"] > 10  # a frame may begin while a window is computed
    assert (again["different"], again["without_scans"], again["unreadable_messages"]) == (0, 0, 0)
    assert (again["lost_messages"], again["cut"]) == (0, "")
    assert again["zones"] == mission.companion.summary["zones"]
