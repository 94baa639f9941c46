"""Main mission in the built-in simulator: survey, choice and landing."""

import asyncio
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.desk.replay import replay_run as replay
from companion.flight.landing.situation import Phase
from sitl.autopilot.modes import Mode
from sitl.intruders import DrivenCar
from sitl.sensors import ouster_os1, ouster_packets, vlp16
from tests.campaign.sortie import AUTOPILOT
from tests.e2e.brief import brief
from tests.e2e.harness import POINT_RATE_HZ, Mission

RATE_HZ = {"vlp16": round(vlp16.RATE_HZ)}  # its own: thinned to 50,000 it takes specks of dust for objects
ON_REQUEST = [  # for their time
    pytest.param(
        "plain", 3, "mid360", marks=pytest.mark.bench
    ),  # as tests/e2e/test_external_odometry.py flies it
    pytest.param("plain", 3, "ouster", marks=pytest.mark.bench),
    pytest.param("plain", 4, "sf45", marks=pytest.mark.bench),
    pytest.param("plain", 2, "vlp16", marks=pytest.mark.bench),
    pytest.param("stadium", 2, "vlp16", marks=pytest.mark.bench),
]


@pytest.mark.parametrize(("scene", "seed", "lidar"), ON_REQUEST)
@pytest.mark.timeout(600)  # a flight of 200,000 packets and its replay, on whatever else the computer does
def test_surveys_chooses_and_lands_on_safe_ground_and_again_in_the_replay(
    scene: str, seed: int, lidar: str, tmp_path: Path
) -> None:
    recording, metadata = tmp_path / "flight.mcap", tmp_path / "ouster.json"
    metadata.write_text(ouster_packets.metadata(ouster_os1.ELEVATION_DEG, ouster_os1.COLUMNS))
    here = {"lidar": lidar, "metadata": metadata, "record": recording}
    rate = {"point_rate_hz": RATE_HZ.get(lidar, POINT_RATE_HZ)}
    mission = Mission(scene, seed=seed, height_m=13.0, survey_s=5.0, simulated=rate, **here)

    async def script(m: Mission) -> None:
        await m.until_phase(Phase.LANDED)
        await m.until(lambda: not m.sim.autopilot.armed, 10)

    mission.fly(script)
    assert mission.touchdown_safe()
    assert mission.touchdown_error_m() <= 0.5
    again = replay.run(recording, [], None, 0.0, (0.0, 1e9))
    assert again["identical"] == again["windows"] == mission.companion.mapping.worker.reports > 20
    assert (again["different"], again["lost_messages"], again["cut"]) == (0, 0, "")
    assert again["zones"] == mission.companion.summary["zones"]


@pytest.mark.long
@pytest.mark.timeout(600)
def test_with_odometry_it_lands_by_the_map_and_again_in_the_replay(tmp_path: Path) -> None:
    """Between the stands the place is observed: the replay has the same corrections, or other windows."""
    recording = tmp_path / "flight.mcap"
    sensor = {"point_rate_hz": 50_000, "parameters": AUTOPILOT}
    flown = {"height_m": 11.0, "survey_s": 3.0, "zone_m": 80.0}
    mission = Mission("stadium", seed=2, simulated=sensor, record=recording, odometry="map", **flown)

    async def script(m: Mission) -> None:
        await m.until_phase(Phase.LANDED)
        await m.until(lambda: not m.sim.autopilot.armed, 10)

    mission.fly(script)
    assert mission.touchdown_safe()
    odometry = mission.companion.sensing.odometry
    assert odometry is not None
    assert odometry.updates > 100
    assert abs(mission.companion.sensing.history.correction.shift_enu_m[2]) > 0.02  # the barometer drifted
    again = replay.run(recording, [], None, 0.0, (0.0, 1e9))
    assert again["identical"] == again["windows"] == mission.companion.mapping.worker.reports > 20


def test_a_vlp16_finds_a_zone_in_the_climb() -> None:
    """Its packets through the whole program; landings with it are flown on request."""
    mission = Mission(seed=2, lidar="vlp16", auto=False)

    async def script(m: Mission) -> None:
        await m.until(
            lambda: bool(m.companion.mapping.latest.zones_seen),
            60,
        )

    mission.fly(script)
    told = mission.companion.summary["lidar"]
    assert told["packets"] > 100
    assert told["malformed"] == 0


def test_a_car_that_drives_onto_the_point_makes_it_land_elsewhere() -> None:
    """It is seen as it drives in, and not by the window that is over half a second later."""
    mission = Mission(seed=4)
    car = DrivenCar(9.0)
    mission.sim.intruders.append(car)

    async def script(m: Mission) -> None:
        await m.until(lambda: bool(m.companion.executive.tally.aborts))
        assert car.started_ns is not None
        assert not car.arrived
        await m.until_phase(Phase.LANDED)

    mission.fly(script)
    assert mission.companion.executive.tally.aborts >= 1
    assert mission.touchdown_safe()
    aborts = [text for text in mission.heard if "abort: " in text]
    assert aborts
    assert all("point unsafe" in text or "way in blocked" in text for text in aborts)


def test_the_pilot_s_mode_ends_every_command_and_lidar_silence_a_descent() -> None:
    """In a mode of the pilot's nothing is commanded; silence breaks the next descent off and is told."""
    mission = Mission(seed=5, **brief())

    async def script(m: Mission) -> None:
        assert m.sim.pilot is not None
        await m.until_phase(Phase.DESCEND)
        m.sim.pilot.set_mode(Mode.LOITER)
        await m.until_phase(Phase.IDLE, 3)
        height = m.height_m
        await asyncio.sleep(10)
        assert m.sim.autopilot.mode is Mode.LOITER
        assert abs(m.height_m - height) < 2
        assert m.phase is Phase.IDLE
        assert any("hands off" in text for text in m.heard)
        m.sim.pilot.set_mode(Mode.GUIDED)
        await m.until_phase(Phase.FINAL)
        await m.until(lambda: m.height_m < 8)
        m.sim.lidar_on = False
        await m.until_phase(Phase.CLIMB, 5)
        await m.until(lambda: any("take over" in text for text in m.heard), 60)
        assert m.height_m > 10
        assert m.sim.autopilot.mode is Mode.GUIDED
        m.sim.lidar_on = True
        await m.until(lambda: m.companion.deciding.situations.situation().lidar_ok, 10)

    mission.fly(script)
    assert mission.sim.touchdown is None


@pytest.mark.long
def test_a_cut_link_is_healed_and_a_restarted_companion_takes_up_the_job() -> None:
    mission = Mission(seed=8, **brief())

    async def script(m: Mission) -> None:
        await m.until_phase(Phase.SURVEY)
        m.sim.router.model.cut = True
        await m.until(lambda: not m.companion.link.connected, 10)
        await asyncio.sleep(5)
        m.sim.router.model.cut = False
        await m.until(lambda: m.companion.link.connected, 10)
        await m.until_phase(Phase.APPROACH)
        await m.stop()
        await asyncio.sleep(6)
        assert m.sim.autopilot.mode is Mode.GUIDED
        assert abs(float(m.sim.vehicle.truth.vel_enu_ms[0])) < 0.5
        m.companion = m.new_companion()
        m.start()
        await m.until_phase(Phase.LANDED)

    mission.fly(script)
    assert mission.touchdown_safe()
    assert any("companion stops, take over" in text for text in mission.heard)


def test_the_operator_orders_by_mav_cmd_user_1() -> None:
    mission = Mission(seed=9, auto=False, **brief())

    async def script(m: Mission) -> None:
        assert m.sim.pilot is not None
        await m.until(lambda: bool(m.companion.mapping.latest.zones_seen))
        await m.until(lambda: m.height_m > 11)
        await asyncio.sleep(5)
        assert m.phase is Phase.IDLE
        m.sim.pilot.command(mavlink.MAV_CMD_USER_1, 1, component=191)
        await m.until_phase(Phase.APPROACH, 20)
        m.sim.pilot.command(mavlink.MAV_CMD_USER_1, 0, component=191)
        await m.until_phase(Phase.HOLD, 5)
        m.sim.pilot.command(mavlink.MAV_CMD_USER_1, 1, component=191)
        await m.until_phase(Phase.LANDED)
        assert (mavlink.MAV_CMD_USER_1, 0) in m.sim.pilot.acks

    mission.fly(script)
    assert mission.touchdown_safe()
