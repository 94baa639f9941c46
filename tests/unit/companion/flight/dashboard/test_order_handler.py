"""Orders of the page, handled in the same way as MAVLink's."""

import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import params
from companion.flight.app import Companion
from companion.flight.dashboard.browser_orders import Command, parse
from companion.flight.dashboard.order_handler import FlightOrderHandler
from companion.flight.landing.situation import Phase, Reply
from companion.flight.link.autopilots.ardupilot import ARDUPILOT
from companion.flight.link.link import Link
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.sensing import Sources
from companion.runtime.clock import now_ns
from companion.runtime.state_directory import StateDir
from slz import PointState
from slz.landing_point.judgement import unknown
from tests.unit.companion.flight.landing.flight import Flight, zone

FLYING = VehicleState(
    sysid=1, autopilot=ARDUPILOT, vehicle_type=2, armed=True, reported_landed="in_air", mode="GUIDED"
)


class Seat:
    """A companion in flight over two zones, without sockets."""

    def __init__(self, state: StateDir | None, patch: pytest.MonkeyPatch) -> None:
        self.companion = Companion(
            "udpin:127.0.0.1:14550", Sources("livox:127.0.0.1:56301"), params.load(), auto=False, state=state
        )
        self.desk = FlightOrderHandler(self.companion.telling.view)
        self.report = Flight([zone(1, 5.0, 5.0), zone(2, 30.0, 0.0)]).situation().report
        assert self.report is not None
        now = now_ns()
        self.companion.link.connected = True
        self.vehicle = replace(FLYING, last_heartbeat_ns=now)
        patch.setattr(Link, "vehicle", property(lambda _link: self.vehicle))
        self.companion.sensing.history.add_attitude(now, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self.companion.sensing.history.add_position(now, 47.0, 8.0, 400.0, (0.0, 0.0, 0.0))
        self.companion.mapping.feed.last_scan_ns = now
        self.show(None)

    def show(self, east_m: float | None, state: PointState = PointState.SAFE) -> None:
        """Let a report come, with the point under watch there."""
        assert self.report is not None
        selected = None
        if east_m is not None:
            selected = replace(unknown(np.array([east_m, 5.0, 0.0])), state=state, judged_by="near")
        self.companion.mapping.latest.use_report(replace(self.report, selected=selected))

    async def order(self, **fields: Any) -> Reply:
        message = parse(json.dumps({"id": 1, **fields}))
        assert isinstance(message, Command)
        return await self.desk.carry_out(message)


@asynccontextmanager
async def seat(folder: Path | None = None) -> AsyncIterator[Seat]:
    with pytest.MonkeyPatch.context() as patch:
        made = Seat(None if folder is None else StateDir(folder), patch)
        yield made
        made.companion.mapping.worker.close()


async def test_a_zone_is_selected_judged_and_confirmed() -> None:
    async with seat() as s:
        assert (await s.order(do="select_zone", zone=1)).accepted
        assert s.companion.executive.phase is Phase.IDLE
        assert not (await s.order(do="confirm", east_m=5.0, north_m=5.0)).accepted  # not judged yet
        s.companion.deciding.loop.run_once()
        s.show(5.0)
        assert (await s.order(do="confirm", east_m=5.0, north_m=5.0)).accepted
        assert s.companion.executive.phase is Phase.SURVEY


async def test_only_the_point_that_the_sender_saw_is_confirmed() -> None:
    """Two operators: one confirms while the other selects."""
    async with seat() as s:
        await s.order(do="select_zone", zone=1)
        s.companion.deciding.loop.run_once()
        s.show(5.0)
        assert not (await s.order(do="confirm", east_m=5.2, north_m=5.0)).accepted
        await s.order(do="select_zone", zone=2)
        refused = await s.order(do="confirm", east_m=5.0, north_m=5.0)
        assert not refused.accepted
        assert "selection" in refused.reason
        assert s.companion.executive.phase is Phase.IDLE


async def test_nothing_is_flown_before_the_hand_over() -> None:
    async with seat() as s:
        s.vehicle = replace(s.vehicle, mode="LOITER")
        reply = await s.order(do="land_best")
        assert (reply.accepted, reply.reason) == (False, "set GUIDED first")


async def test_a_point_of_the_map_is_watched_where_it_was_tapped() -> None:
    async with seat() as s:
        assert (await s.order(do="select_point", east_m=-7.25, north_m=3.5)).accepted
        asked = s.companion.executive.step(s.companion.deciding.situations.situation()).select_enu_m
        assert asked is not None
        assert np.allclose(asked[:2], (-7.25, 3.5), atol=0.01)
        far = await s.order(do="select_point", east_m=90_000, north_m=0)
        assert (far.accepted, far.reason) == (False, "the point is too far away")


async def test_an_abort_breaks_off_and_says_so_when_there_is_nothing_to() -> None:
    async with seat() as s:
        assert (await s.order(do="abort")).reason == "nothing to abort"
        await s.order(do="land_best")
        assert (await s.order(do="abort")).accepted
        assert s.companion.executive.phase is Phase.HOLD


async def test_parameters_are_set_by_the_rules_of_the_parameter_server() -> None:
    async with seat() as s:
        assert (await s.order(do="set", name="survey_s", value=9)).accepted
        assert s.companion.parameters.survey_s == 9
        assert not (await s.order(do="set", name="survey_s", value=1e9)).accepted
        assert not (await s.order(do="set", name="survey_s", value="soon")).accepted
        assert not (await s.order(do="set", name="model_config", value=1)).accepted
        assert "'worst_slope_deg'" in (await s.order(do="set", name="max_slope_deg", value=30)).reason
        assert s.companion.parameters.survey_s == 9


async def test_a_recording_is_begun_and_ended_in_flight(tmp_path: Path) -> None:
    async with seat(tmp_path) as s:
        assert not (await s.order(do="record", on=False)).accepted
        assert (await s.order(do="record", on=True)).accepted
        assert not (await s.order(do="record", on=True)).accepted
        assert (await s.order(do="record", on=False)).accepted
        files = list((tmp_path / "recordings").glob("slz-*.mcap"))
        assert len(files) == 1
        assert files[0].stat().st_size > 0


async def test_a_zone_that_is_gone_is_refused() -> None:
    async with seat() as s:
        assert (await s.order(do="select_zone", zone=99)).reason == "no zone 99"


async def test_a_replay_is_not_controlled_in_flight() -> None:
    async with seat() as s:
        assert not (await s.order(do="replay", speed=0)).accepted


async def test_a_point_cannot_be_watched_before_there_is_a_position() -> None:
    async with seat() as s:
        s.companion.sensing.history.frame = None
        reply = await s.order(do="select_point", east_m=1, north_m=2)
        assert (reply.accepted, reply.reason) == (False, "no position yet")
