"""The ROS node of a flight, over a real network and read by independent decoders."""

from __future__ import annotations

import asyncio
import math
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace

import numpy as np
import pytest

import params
from companion.flight.app import Companion
from companion.flight.geometry.pose import Pose
from companion.flight.rmw.attachment import unpack
from companion.flight.rmw.zenoh_url import ZenohUrl
from companion.flight.ros2.ros_node import (
    DIAGNOSTICS,
    DISPLAY,
    LANDING_POINT,
    MAP,
    ODOMETRY,
    TF,
    TOPICS,
    ZONES,
    RosNode,
)
from companion.flight.sensing import Sources
from slz import Pipeline, PointState, Report, TerrainMaps, Windower
from slz.grid import Box, Grid
from tests.unit.companion.flight.landing.flight import FRAME, Flight, zone
from tests.unit.companion.flight.mapping.test_pipeline_worker import scan
from tests.unit.companion.flight.rmw.test_message_types import PUBLISHED
from tests.unit.companion.flight.rmw.zenoh_network import Client, router, until
from tests.unit.companion.flight.ros2.independent_decoders import decoded

SECOND = 1_000_000_000
BY_NAME = {topic.name: topic for topic in TOPICS}


def made(endpoint: str) -> Companion:
    return Companion(
        "udpin:127.0.0.1:14550",
        Sources("livox:127.0.0.1:56301", ros2=ZenohUrl(endpoint, 7)),
        params.load(),
        auto=False,
    )


@asynccontextmanager
async def node_and_listener() -> AsyncIterator[tuple[Companion, RosNode, Client]]:
    """Run a node, and a client that hears all its topics."""
    with router() as endpoint:
        companion = made(endpoint)
        node, session = companion.telling.ros_node, companion.sensing.ros
        assert node is not None
        assert session is not None
        task = asyncio.create_task(node.run())
        await until(session.is_connected)
        client = Client(endpoint)
        client.listen("7/**")
        await until(lambda: all(one.has_listener() for one in session.publishers))
        try:
            yield companion, node, client
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            node.close()
            client.close()
            companion.mapping.worker.close()


def report_with(state: PointState = PointState.SAFE) -> Report:
    """Return a report with a zone and a selected point."""
    flight = Flight([zone(12, 5.0, 6.0)])
    flight.selected = np.array([5.0, 6.0, 0.0])
    flight.state = lambda _height, _point: state
    report = flight.situation().report
    assert report is not None
    corners = np.array([[0.0, 0, 1], [4, 0, 1], [4, 4, 1]])
    zones = tuple(replace(one, corners_enu_m=corners) for one in report.zones)
    return replace(report, near=replace(report.near, zones=zones))


def flown(at_ns: int) -> Pose:
    """Return a pose: 3 m east, 4 m north, 20 m up, heading east, flying north at 2 m/s."""
    half = math.radians(90) / 2
    quat = np.array([math.cos(half), 0, 0, math.sin(half)])
    return Pose(at_ns, np.array([3.0, 4.0, 20.0]), np.array([0.0, 2.0, 0.0]), quat, 0)


async def test_all_topics_are_read_by_independent_decoders() -> None:
    async with node_and_listener() as (companion, node, client):
        node.use_report(report_with())
        node.pose(flown(10 * SECOND), FRAME)
        node.clear()
        samples = await client.by_topic(len(TOPICS))
        assert companion.sensing.ros is not None
        tokens = client.tokens("@ros2_lv/7/*/*/*/MP/**")
        gids = {one.topic.name: one.gid for one in companion.sensing.ros.publishers}
        messages = {name: decoded(sample) for name, sample in samples.items()}
    assert set(samples) == set(BY_NAME)
    for name, sample in samples.items():
        topic = BY_NAME[name]
        key_hash = str(sample.key_expr).rpartition("/")[2]
        if topic.type in PUBLISHED:
            assert key_hash == f"RIHS01_{PUBLISHED[topic.type]}"
        attachment = unpack(bytes(sample.attachment))
        assert attachment is not None
        assert (attachment.number, attachment.gid) == (1, gids[name])
        assert any(f"/{name.replace('/', '%')}/" in one and one.endswith(topic.qos.token()) for one in tokens)
    assert len(tokens) == len(TOPICS)
    point = messages[LANDING_POINT.name]
    assert point.header.frame_id == "map"
    assert (point.pose.position.x, point.pose.position.y, point.pose.orientation.w) == (5.0, 6.0, 1.0)
    names = {status.name for status in messages[DIAGNOSTICS.name].status}
    assert names == {f"slz: {name}" for name in ("landing", "map", "LiDAR", "MAVLink", "ROS 2")}
    (transform,) = messages[TF.name].transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("map", "base_link")
    assert math.isnan(messages[MAP.name].data[0].data[0])


async def test_the_vehicle_is_in_the_axes_of_rep_103() -> None:
    async with node_and_listener() as (_, node, client):
        node.pose(flown(10 * SECOND), FRAME)
        odometry = decoded(await client.next_of(ODOMETRY.name))
        tf = decoded(await client.next_of(TF.name))
    place, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
    assert (place.x, place.y, place.z) == (3.0, 4.0, 20.0)
    # It heads east, as ENU's x does: forward-left-up is not turned at all.
    assert (turn.x, turn.y, turn.z, abs(turn.w)) == pytest.approx((0, 0, 0, 1))
    moves = odometry.twist.twist.linear
    assert (moves.x, moves.y, moves.z) == pytest.approx((0, 2, 0))  # north is to its left
    assert odometry.child_frame_id == "base_link"
    assert np.diag(np.reshape(odometry.twist.covariance, (6, 6))).tolist() == [0, 0, 0, 1e6, 1e6, 1e6]
    at = tf.transforms[0].transform
    assert (at.translation.x, at.translation.y, at.translation.z) == (3.0, 4.0, 20.0)
    assert abs(at.rotation.w) == pytest.approx(1)


async def test_zones_are_closed_outlines_and_replace_those_before() -> None:
    async with node_and_listener() as (_, node, client):
        node.use_report(report_with())
        first, outline, label, ball = decoded(await client.next_of(ZONES.name)).markers
    assert first.action == 3
    assert (outline.ns, outline.id, outline.type, outline.header.frame_id) == ("zones", 12, 4, "map")
    corners = [(p.x, p.y, round(p.z, 6)) for p in outline.points]
    assert corners == [(0, 0, 1.3), (4, 0, 1.3), (4, 4, 1.3), (0, 0, 1.3)]
    assert (outline.lifetime.sec, outline.pose.orientation.w) == (5, 1.0)
    assert label.text == "12: 100 m2, 0.990"
    assert (ball.ns, ball.type, ball.color.b) == ("landing_point", 2, 1.0)


@pytest.mark.parametrize("state", [PointState.UNSAFE, PointState.UNKNOWN])
async def test_a_point_that_is_not_safe_is_never_published_as_landing_point(state: PointState) -> None:
    async with node_and_listener() as (_, node, client):
        node.use_report(report_with(state))
        node.pose(flown(10 * SECOND), FRAME)
        names = set()
        while TF.name not in names:  # the last that was put
            names |= set(await client.by_topic(1))
    assert LANDING_POINT.name not in names


async def test_nor_is_one_onto_which_something_came(monkeypatch: pytest.MonkeyPatch) -> None:
    async with node_and_listener() as (companion, node, client):
        flight = Flight([])
        flight.selected = np.array([5.0, 6.0, 0.0])
        flight.state = lambda _height, _point: PointState.UNSAFE
        monkeypatch.setattr(companion.deciding.situations, "situation", flight.situation)
        node.use_report(report_with())
        node.pose(flown(10 * SECOND), FRAME)
        names = set()
        while TF.name not in names:
            names |= set(await client.by_topic(1))
    assert LANDING_POINT.name not in names


async def test_without_a_router_messages_are_lost_and_counted_and_nobody_waits() -> None:
    companion = made("tcp/127.0.0.1:1")
    node, session = companion.telling.ros_node, companion.sensing.ros
    assert node is not None
    assert session is not None
    task = asyncio.create_task(node.run())
    await until(lambda: session.statistics()["lost"] >= 1)  # diagnostics
    before = session.statistics()["lost"]
    for _ in range(200):
        node.use_report(report_with())
    await until(lambda: sum(session.statistics()[n] for n in ("lost", "replaced")) >= before + 2 * 200)
    assert session.statistics()["sent"] == 0
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    node.close()
    companion.mapping.worker.close()


async def test_a_message_that_cannot_be_made_costs_only_itself(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("planted")

    async with node_and_listener() as (_, node, client):
        monkeypatch.setattr("companion.flight.ros2.zone_markers.markers", fail)
        node.use_report(report_with())
        await client.next_of(LANDING_POINT.name)
    assert "planted" in caplog.text


async def test_the_map_around_the_vehicle_is_published(monkeypatch: pytest.MonkeyPatch) -> None:
    pipeline = Pipeline(params.load())
    windower = Windower(1.0)
    for second in range(3):
        for window in windower.add(scan(second)):
            pipeline.process(window)
    wanted = pipeline.maps()
    assert wanted is not None
    async with node_and_listener() as (companion, node, client):
        show = companion.mapping.worker.display_hooks[DISPLAY]
        show(pipeline)  # no report yet: nothing
        monkeypatch.setattr(companion.sensing.history, "latest", lambda at_ns: flown(at_ns))
        node.use_report(report_with())
        show(pipeline)
        show(pipeline)  # too soon
        message = decoded(await client.next_of(MAP.name))
        assert companion.sensing.ros is not None
        (of_map,) = (one for one in companion.sensing.ros.publishers if one.topic == MAP)
        assert of_map.number == 1
    info = message.info
    assert (info.resolution, info.length_x, info.length_y) == pytest.approx((wanted.grid.cell_m, 80.0, 80.0))
    assert math.hypot(info.pose.position.x - 3.0, info.pose.position.y - 4.0) < 2 * info.resolution
    elevation = np.array(message.data[0].data).reshape(400, 400)[::-1, ::-1]  # rows to the north
    row = round((wanted.south_m - (info.pose.position.y - info.length_y / 2)) / info.resolution)
    col = round((wanted.west_m - (info.pose.position.x - info.length_x / 2)) / info.resolution)
    rows, cols = wanted.height_m.shape
    np.testing.assert_array_equal(elevation[row : row + rows, col : col + cols], wanted.height_m)
    assert np.isfinite(elevation).sum() == np.isfinite(wanted.height_m).sum() > 0


async def test_a_map_that_is_withdrawn_while_it_is_copied_is_not_published(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with node_and_listener() as (companion, node, client):

        class Withdrawn:
            """A pipeline whose map is withdrawn while it is read."""

            def maps(self, box: Box) -> TerrainMaps:
                if not cleared.is_set():
                    loop.call_soon_threadsafe(node.clear)
                    cleared.wait(10)
                ones = np.ones(box.shape, np.float32)
                layers = dict.fromkeys(("height_m", "slope_deg", "roughness"), ones)
                grid = Grid(-200.0, -200.0, 0.2, 2000, 2000)
                return TerrainMaps(FRAME, grid, box, layers, np.ones(box.shape, np.uint8))

        loop, cleared = asyncio.get_running_loop(), threading.Event()
        clear = node.clear
        monkeypatch.setattr(node, "clear", lambda: (clear(), cleared.set()))
        monkeypatch.setattr(companion.sensing.history, "latest", lambda at_ns: flown(at_ns))
        node.use_report(report_with())
        await asyncio.to_thread(companion.mapping.worker.display_hooks[DISPLAY], Withdrawn())
        node.pose(flown(10 * SECOND), FRAME)
        shown = []
        while f"{TF.name}/" not in str((sample := await client.next()).key_expr):  # the last that was put
            shown += [decoded(sample)] if f"{MAP.name}/" in str(sample.key_expr) else []
    assert shown
    assert all(math.isnan(message.data[0].data[0]) for message in shown)


async def test_a_withdrawn_map_is_replaced_for_those_who_come_later_too() -> None:
    async with node_and_listener() as (_, node, client):
        node.clear()
        await client.next_of(MAP.name)
        client.listen_late("7/slz/map/*/*")
        message = decoded(await client.next_of(MAP.name))
    assert list(message.layers) == ["elevation", "slope", "roughness", "safe"]
    assert all(math.isnan(layer.data[0]) for layer in message.data)
