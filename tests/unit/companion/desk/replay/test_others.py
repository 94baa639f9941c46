"""Flights recorded by other programs: bags, telemetry logs with captures; and unusable files."""

from __future__ import annotations

import shutil
import struct
from pathlib import Path
from typing import Any

import dpkt
import laspy
import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pyproj import CRS
from scipy.spatial.transform import Rotation

from companion.desk.replay import replay_run
from companion.desk.replay.foreign_replay import Rerun
from companion.desk.replay.recording_type import RecordingOptions, open_recording, recording_type_of
from companion.desk.replay.ros.ros_pose import ned_from_frd
from companion.desk.replay.stored_cloud import StoredCloud
from companion.desk.replay.telemetry_log import TelemetryLog
from companion.flight.link.command_server import CommandServer
from companion.runtime.errors import UsageError
from slz import Scan, join
from tests.unit.companion.desk.replay import flights
from tests.unit.companion.desk.replay.flights import BEGIN_NS, HOME, Bag
from tests.unit.companion.desk.survey import clouds, packing

ORIGIN = f"{HOME.lat_deg},{HOME.lon_deg},{HOME.alt_m}"
GROUND_M = HOME.alt_m  # of the plain
SPAN_NS = (BEGIN_NS, BEGIN_NS + round(flights.SECONDS * 1e9))


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of one flight as several programs record it."""
    folder = tmp_path_factory.mktemp("flight")
    flights.write_tlog(folder / "flight.tlog")
    flights.write_tlog(folder / "angles.tlog", angles=True)
    flights.write_tlog(folder / "yesterday.tlog", shift_ns=-86_400 * 10**9)
    flights.write_pcap(folder / "lidar.pcap")
    flights.write_pcap(folder / "cut_up.pcap", cut_up=True)
    flights.write_bag(folder / "odometry", Bag())
    flights.write_bag(folder / "fix", Bag("fix", timed=True, mcap=True))
    return folder


def again(path: Path, *settings: str, until_s: float = 1e9, **beside: Any) -> dict[str, Any]:
    asked = ["cell_m=0.5", "zone_m=200", *settings]
    return replay_run.run(path, asked, None, 0.0, (0.0, until_s), options=RecordingOptions(**beside))


def check_zones(summary: dict[str, Any]) -> None:
    """See that the plain is mapped where it is, level and in one piece."""
    assert summary["windows"] >= 4
    assert (summary["failed"], summary["unreadable_messages"], summary["cut"]) == (0, 0, "")
    zone = max(summary["zones"], key=lambda zone: zone["area_m2"])
    assert zone["area_m2"] > 100
    assert zone["slope_deg"] < 3
    east, north, up = HOME.enu_m(zone["lat"], zone["lon"], zone["alt_m"])
    assert abs(east) < 50
    assert abs(north) < 60
    assert abs(up) < 0.4
    counts = summary["returns"]
    assert counts["without_pose"] + counts["stale"] < 0.03 * counts["read"]


@pytest.mark.parametrize(
    ("log", "capture"),
    [("flight.tlog", "lidar.pcap"), ("angles.tlog", "lidar.pcap"), ("flight.tlog", "cut_up.pcap")],
)
def test_a_telemetry_log_and_a_capture_are_mapped_as_in_flight(files: Path, log: str, capture: str) -> None:
    summary = again(files / log, points=str(files / capture))
    check_zones(summary)
    assert summary["source"]["lidar"] == "livox"
    assert summary["source"]["no_udp"] > 0


@pytest.mark.parametrize("week", [False, True])
def test_a_placed_cloud_is_mapped_by_its_times_beside_the_log(
    files: Path, tmp_path: Path, week: bool
) -> None:
    cloud = flights.write_laz(tmp_path / "cloud.laz", week=week)
    summary = again(files / "flight.tlog", points=str(cloud))
    check_zones(summary)
    assert summary["source"]["crs"] == "EPSG:32632"
    assert summary["source"]["points"] == summary["returns"]["read"] + summary["source"]["before_position"]
    assert (summary["source"]["points_outside_log"], summary["source"]["before_position"]) == (0, 0)
    with pytest.raises(UsageError, match="none of its .* points was measured during the flight"):
        again(files / "yesterday.tlog", points=str(cloud))


def test_a_cloud_of_heights_above_the_ellipsoid_is_refused_beside_a_log(files: Path, tmp_path: Path) -> None:
    """The log's heights are above mean sea level, 47 m less here: the ground would be above the vehicle."""
    three = CRS.from_epsg(32632).to_3d().to_wkt()
    cloud = flights.write_laz(tmp_path / "ellipsoid.laz", crs=three, up_m=47.6)
    with pytest.raises(UsageError, match="heights are above the ellipsoid .* those of the log above mean"):
        again(files / "flight.tlog", points=str(cloud))


def test_ground_above_the_vehicle_that_flies_over_it_is_told(files: Path, tmp_path: Path) -> None:
    plain = again(files / "flight.tlog", points=str(flights.write_laz(tmp_path / "plain.laz")))
    assert not any("above the vehicle" in line for line in plain["warnings"])
    assert "unknown" in plain["source"]["vertical_datum"]
    cloud = flights.write_laz(tmp_path / "silent.laz", up_m=47.6)
    summary = again(files / "flight.tlog", points=str(cloud))
    assert any("points lie above the vehicle that measured them" in line for line in summary["warnings"])
    named = flights.write_laz(tmp_path / "named.laz", crs="EPSG:32632+5773")
    source = again(files / "flight.tlog", points=str(named))["source"]
    assert source["vertical_datum"] == "EGM96 geoid"


def test_times_of_another_epoch_say_which_offset_would_fit(files: Path, tmp_path: Path) -> None:
    late = flights.write_tlog(tmp_path / "late.tlog", shift_ns=1024 * 604_800 * 10**9)
    with pytest.raises(UsageError, match=r"an offset of \+1 x 1024 weeks .* would fit"):
        again(late, points=str(flights.write_laz(tmp_path / "cloud.laz")))
    with pytest.raises(UsageError, match=r"clocks are not the same, an offset of -1 days would fit"):
        again(files / "yesterday.tlog", points=str(files / "lidar.pcap"))


def test_a_placed_cloud_without_times_is_refused(files: Path, tmp_path: Path) -> None:
    cloud = flights.write_laz(tmp_path / "cloud.laz", timed=False)
    with pytest.raises(UsageError, match="have no times"):
        again(files / "flight.tlog", points=str(cloud))


def test_a_folder_of_scans_is_placed_by_their_names(files: Path, tmp_path: Path) -> None:
    summary = again(files / "flight.tlog", points=str(flights.write_pcds(tmp_path / "scans")))
    check_zones(summary)
    assert summary["source"]["clouds"] == 50


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
def test_scans_whose_points_have_times_are_taken_as_the_clouds_of_a_bag(
    files: Path, tmp_path: Path, data: str
) -> None:
    after_ns = np.linspace(0, 97_000_000, 50).round()
    false = np.isin(np.arange(50), (5, 31))
    columns = {
        "intensity": np.full(50, 7.0),
        "x": np.full(50, 1.0),
        "y": after_ns * 1e-8,
        "z": np.full(50, 20.0),
    }
    columns["t"] = np.where(false, FALSE, after_ns * 1e-3)
    for k in range(5):
        name = f"{BEGIN_NS // 10**9 + 1}.{k}00000000.pcd"
        (tmp_path / name).write_bytes(packing.pcd_of(columns, data))
    feed, rerun = open_recording(files / "flight.tlog", (), RecordingOptions(str(tmp_path)))
    for _, act in feed.steps(rerun):
        rerun.hand_over(act)
    told = feed.summary()
    assert (told["point_times"], told["points_with_false_times"]) == ("t: us since the stamp", 10)
    assert (told["clouds"], told["clouds_without_point_times"], rerun.returns) == (5, 0, 240)
    assert rerun.span_ns == (BEGIN_NS + 10**9, BEGIN_NS + 10**9 + 4 * 10**8 + 97_000_000)


def test_bags_give_the_map_of_the_same_flight(files: Path) -> None:
    odometry = again(files / "odometry", origin=ORIGIN)
    check_zones(odometry)
    assert odometry["source"]["poses"] == ["/odom"]
    assert odometry["source"]["clouds_without_point_times"] == 0
    single = next((files / "odometry").glob("*.db3"))
    assert again(single, origin=ORIGIN)["zones"] == odometry["zones"]
    fix = again(files / "fix", points="/points", poses=("/imu", "/fix"))
    check_zones(fix)
    assert fix["source"]["poses"] == ["/fix", "/imu"]
    until_s = flights.SECONDS - 0.3  # up to which both have poses
    odometry = again(files / "odometry", origin=ORIGIN, until_s=until_s)
    fix = again(files / "fix", points="/points", poses=("/imu", "/fix"), until_s=until_s)
    areas = [sum(zone["area_m2"] for zone in summary["zones"]) for summary in (odometry, fix)]
    assert areas[0] == pytest.approx(areas[1], rel=0.05)


def test_the_maps_of_another_program_s_flight_are_drawn(
    files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[np.ndarray] = []

    def save_flight(out: Path, _maps: Any, _zones: Any, flown: np.ndarray, *_: Any) -> list[Path]:
        drawn.append(flown)
        return [out / "dsm.png"]

    monkeypatch.setattr("companion.desk.figures.save_flight", save_flight)
    out, options = tmp_path / "out", RecordingOptions(origin=ORIGIN)
    summary = replay_run.run(files / "odometry", ["cell_m=0.5"], out, 0.0, (0.0, 1e9), options=options)
    assert summary["files"] == {"dsm": str(out / "dsm.png")}
    assert [len(flown) for flown in drawn] == [summary["windows"]]


def test_points_without_times_have_that_of_their_message(tmp_path: Path) -> None:
    path = flights.write_bag(tmp_path / "bag", Bag("pose", timed=False))
    summary = again(path, origin=ORIGIN)
    assert summary["source"]["clouds_without_point_times"] == summary["source"]["clouds"] == 50


def test_several_clouds_want_a_name_and_points_of_the_body_no_mount(tmp_path: Path) -> None:
    path = flights.write_bag(tmp_path / "bag", Bag(second_cloud=True, points_frame="base_link"))
    with pytest.raises(UsageError, match="/other, /points"):
        again(path, origin=ORIGIN)
    feed, rerun = open_recording(path, (), RecordingOptions("/other", origin=ORIGIN))
    assert rerun.parameters.lidar_pitch_deg == 0.0
    assert feed.summary()["points"] == "/other"
    _, rerun = open_recording(path, ("lidar_pitch_deg=20",), RecordingOptions("/other", origin=ORIGIN))
    assert rerun.parameters.lidar_pitch_deg == 20


def test_points_that_are_placed_already_are_refused(tmp_path: Path) -> None:
    path = flights.write_bag(tmp_path / "bag", Bag(points_frame="odom"))
    with pytest.raises(UsageError, match="placed already"):
        again(path, origin=ORIGIN)


@pytest.mark.parametrize(
    ("name", "beside", "says"),
    [
        ("odometry", {}, "--origin"),
        ("odometry", {"origin": "1,2"}, "LAT,LON,ALT"),
        ("odometry", {"origin": "91,0,0"}, "LAT,LON,ALT"),
        ("odometry", {"origin": ORIGIN, "lidar": "livox"}, "--lidar"),
        ("odometry", {"origin": ORIGIN, "points": "/none"}, "no message is on /none"),
        ("odometry", {"origin": ORIGIN, "points": "/odom"}, "which --points does not take"),
        ("odometry", {"origin": ORIGIN, "poses": ("/points",)}, "which --pose does not take"),
        ("odometry", {"origin": ORIGIN, "poses": ("/odom", "/odom")}, "one topic of poses"),
        ("fix", {"origin": ORIGIN}, "leave out --origin"),
        ("flight.tlog", {}, "a capture (.pcap)"),
        ("flight.tlog", {"points": "cloud.ply"}, "when it was measured"),
        ("flight.tlog", {"points": "cloud.laz", "lidar": "livox"}, "--lidar goes with packets"),
        ("flight.tlog", {"points": "absent.pcap"}, "No such file"),
        ("flight.tlog", {"points": "flight.tlog"}, "no pcap"),
        ("flight.tlog", {"points": "lidar.pcap", "poses": ("/odom",)}, "leave out --pose"),
        ("flight.tlog", {"points": "lidar.pcap", "lidar": "sonar"}, "'sonar' is no sensor"),
        ("flight.tlog", {"points": "lidar.pcap", "lidar": "velodyne"}, "no return of the LiDAR"),
        ("yesterday.tlog", {"points": "lidar.pcap"}, "their clocks are not the same"),
    ],
)
def test_what_is_missing_or_too_much_is_one_line(
    files: Path, monkeypatch: pytest.MonkeyPatch, name: str, beside: dict[str, Any], says: str
) -> None:
    monkeypatch.chdir(files)
    with pytest.raises(UsageError) as caught:
        again(Path(name), **beside)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("name", ["flight.tlog", "flight.db3", "flight.bag", "flight.mcap", "folder"])
@pytest.mark.parametrize("content", [b"", b"nonsense", bytes(5000)])
def test_what_is_no_recording_is_one_line(tmp_path: Path, name: str, content: bytes) -> None:
    path = tmp_path / name
    if name == "folder":
        path.mkdir()
        (path / "metadata.yaml").write_bytes(content)
    else:
        path.write_bytes(content)
    with pytest.raises(UsageError) as caught:
        again(path, points="x.pcap") if name.endswith("tlog") else again(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("share", [0.31, 0.6, 0.9])
def test_files_cut_off_give_what_is_before_or_one_line(files: Path, tmp_path: Path, share: float) -> None:
    for name in ("flight.tlog", "lidar.pcap", "fix"):
        source = files / name
        if source.is_dir():
            shutil.copytree(source, tmp_path / name)
            source = next((tmp_path / name).glob("*.mcap"))
            path = tmp_path / source.name
        else:
            path = tmp_path / name
        content = source.read_bytes()
        path.write_bytes(content[: int(share * len(content))])
    summary = again(tmp_path / "flight.tlog", points=str(tmp_path / "lidar.pcap"))
    assert summary["windows"] >= 1
    assert "lidar.pcap: it ends within a packet: its last" in summary["cut"]
    said, summary = "", {}
    try:
        summary = again(next(tmp_path.glob("*.mcap")))
    except UsageError as error:
        said = str(error)
    assert "\n" not in said
    assert said or summary["cut"]


def test_a_log_that_ends_within_a_time_of_day_is_not_whole(files: Path, tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    path.write_bytes((files / "flight.tlog").read_bytes() + bytes(5))
    log = TelemetryLog(path)
    assert len(list(log.messages())) > 0
    assert "in the middle" in log.cut


def test_damaged_frames_of_a_log_are_counted_and_the_rest_is_read(files: Path, tmp_path: Path) -> None:
    content = bytearray((files / "flight.tlog").read_bytes())
    content[400:430] = bytes(30)
    content[3000] ^= 0x10
    path = tmp_path / "damaged.tlog"
    path.write_bytes(content)
    summary = again(path, points=str(files / "lidar.pcap"))
    assert 1 <= summary["unreadable_messages"] <= 4
    assert summary["zones"]


def test_kinds_are_told_by_name_and_profile(files: Path) -> None:
    assert recording_type_of(files / "flight.tlog") == "tlog"
    assert (
        recording_type_of(files / "odometry")
        == recording_type_of(next((files / "fix").glob("*.mcap")))
        == "bag"
    )
    assert recording_type_of(Path("absent.mcap")) == "own"


def test_ros_orientations_are_turned_into_ours() -> None:
    rng = np.random.default_rng(1)
    for rotation in Rotation.random(20, rng=rng):
        w, x, y, z = ned_from_frd(*rotation.as_quat())
        wanted = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]) @ rotation.as_matrix() @ np.diag([1, -1, -1])
        np.testing.assert_allclose(Rotation.from_quat([x, y, z, w]).as_matrix(), wanted, atol=1e-12)


POINTS = np.array([[1.0, 2, 3], [4, 5, 6]], np.float32)
AFTER = np.array([5_000, 90_000_000])


# ---- topics of a bag ------------------------------------------------------------------------------

ODOMETRY, POSE = "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped"
FIX, IMU, CLOUD = "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/Imu", "sensor_msgs/msg/PointCloud2"


def bag(folder: Path, **kinds: str) -> Path:
    """Write a bag of a message a topic; slashes before the names are left out here."""
    cloud = flights.cloud(POINTS, AFTER, BEGIN_NS)
    return flights.write_messages(
        folder / "bag",
        {
            f"/{name}": (kind, [(BEGIN_NS, cloud if kind == CLOUD else flights.pose(kind, 0))])
            for name, kind in kinds.items()
        },
    )


def test_the_topic_of_poses_is_named_where_there_are_several(tmp_path: Path) -> None:
    path = bag(tmp_path, points=CLOUD, odom=ODOMETRY, pose=POSE)
    with pytest.raises(UsageError, match=r"topics of poses are /odom, /pose: name one"):
        again(path, origin=ORIGIN)
    feed, _ = open_recording(path, (), RecordingOptions(poses=("/pose",), origin=ORIGIN))
    assert feed.summary()["poses"] == ["/pose"]


@pytest.mark.parametrize(
    ("kinds", "says"),
    [
        ({"odom": ODOMETRY}, "it has no message of sensor_msgs/PointCloud2"),
        ({"points": CLOUD}, "it has no message of a pose"),
        ({"points": CLOUD, "imu": IMU}, "topics of poses are /imu"),
        ({"points": CLOUD, "fix": FIX, "imu": IMU, "imu2": IMU}, "topics of poses are /fix, /imu, /imu2"),
    ],
)
def test_a_bag_that_lacks_points_or_poses_says_which(
    tmp_path: Path, kinds: dict[str, str], says: str
) -> None:
    with pytest.raises(UsageError, match=says):
        again(bag(tmp_path, **kinds), origin=ORIGIN)


@pytest.mark.parametrize("topic", ["/points", "/odom"])
def test_a_topic_of_which_no_message_can_be_read_is_named(tmp_path: Path, topic: str) -> None:
    good = {"/points": flights.cloud(POINTS, AFTER, BEGIN_NS), "/odom": flights.pose(ODOMETRY, 0)}
    kinds = {"/points": CLOUD, "/odom": ODOMETRY}
    lines = {name: (kinds[name], [(BEGIN_NS, b"\0\1" if name == topic else good[name])]) for name in good}
    path = flights.write_messages(tmp_path / "bag", lines)
    with pytest.raises(UsageError, match=f"no message on {topic} can be read"):
        again(path, origin=ORIGIN)


def test_messages_that_cannot_be_read_are_counted_and_the_others_are_taken(tmp_path: Path) -> None:
    cloud, wide = (flights.cloud(POINTS, AFTER, BEGIN_NS) for _ in range(2))
    wide.width = 1000
    odometry = [(BEGIN_NS + ms * 10**6, flights.pose(ODOMETRY, ms)) for ms in range(-100, 400, 50)]
    points = [(BEGIN_NS, cloud), (BEGIN_NS + 1, b"\0\1"), (BEGIN_NS + 2, wide), (BEGIN_NS + 3, cloud)]
    path = flights.write_messages(
        tmp_path / "bag", {"/odom": (ODOMETRY, odometry), "/points": (CLOUD, points)}
    )
    feed, rerun = open_recording(path, (), RecordingOptions(origin=ORIGIN))
    for _, act in feed.steps(rerun):
        rerun.hand_over(act)
    assert feed.bad == 2
    assert (feed.summary()["clouds"], rerun.returns) == (2, 4)


FALSE = 3_604_361_924  # written by a driver where a column's packet was lost


@pytest.mark.parametrize(
    ("unit_ns", "false", "unit"), [(1, (), "ns"), (1000, (), "us"), (1, (5, 31), "ns"), (1000, (5, 31), "us")]
)
def test_points_of_a_bag_have_their_own_times(
    tmp_path: Path, unit_ns: int, false: tuple[int, ...], unit: str
) -> None:
    after_ns = np.linspace(0, 97_000_000, 50).round().astype(np.int64)
    times = after_ns // unit_ns
    times[list(false)] = FALSE
    points = np.full((50, 3), [1.0, 2.0, 20.0], np.float32)
    stamps = [BEGIN_NS + k * 10**8 for k in range(5)]
    clouds = [(stamp, flights.cloud(points, times, stamp)) for stamp in stamps]
    odometry = [(BEGIN_NS + ms * 10**6, flights.pose(ODOMETRY, ms)) for ms in range(-100, 700, 50)]
    path = flights.write_messages(
        tmp_path / "bag", {"/odom": (ODOMETRY, odometry), "/points": (CLOUD, clouds)}
    )
    feed, rerun = open_recording(path, (), RecordingOptions(origin=ORIGIN))
    for _, act in feed.steps(rerun):
        rerun.hand_over(act)
    assert rerun.span_ns == (BEGIN_NS, BEGIN_NS + 4 * 10**8 + 97_000_000)
    assert (rerun.returns, rerun.assembler.stale) == (5 * (50 - len(false)), 0)
    told = feed.summary()
    assert (told["point_times"], told["points_with_false_times"]) == (
        f"t: {unit} since the stamp",
        5 * len(false),
    )
    assert told["clouds_without_point_times"] == 0


# ---- a log and what lies beside it ----------------------------------------------------------------


def test_a_log_of_two_links_is_read_once_though_copies_come_seconds_late(tmp_path: Path) -> None:
    log = flights.write_tlog(tmp_path / "copies.tlog", again_ns=(200_000_000, 1_500_000_000, 5_000_000_000))
    summary = again(log, points=str(flights.write_pcap(tmp_path / "lidar.pcap")))
    check_zones(summary)
    copies = summary["source"]["frames_repeated"]
    assert copies == 3 * 291  # the station's only frame tells nothing of its numbers
    assert any(f"{copies} frames of the log came once more" in line for line in summary["warnings"])


@pytest.mark.parametrize("begin_s", [95, 946_684_900])
def test_a_flight_recorded_without_a_clock_is_read(tmp_path: Path, begin_s: int) -> None:
    """A companion without a clock chip begins in 1970, or at the date of its image: both files do."""
    shift_ns = begin_s * 10**9 - BEGIN_NS
    log = flights.write_tlog(tmp_path / "flight.tlog", shift_ns=shift_ns)
    check_zones(again(log, points=str(flights.write_pcap(tmp_path / "lidar.pcap", shift_ns=shift_ns))))


YEAR_NS = 31_536_000 * 10**9


@pytest.mark.parametrize("early_ns", [2 * 10**9, -3 * 10**9, -10_800 * 10**9, YEAR_NS, -25 * YEAR_NS])
def test_a_clock_that_is_set_in_flight_costs_nothing(tmp_path: Path, early_ns: int) -> None:
    """GNSS or NTP sets the recorder's clock, and the times of both files step at once."""
    log = flights.write_tlog(tmp_path / "flight.tlog", early_ns=early_ns)
    summary = again(log, points=str(flights.write_pcap(tmp_path / "lidar.pcap", early_ns=early_ns)))
    check_zones(summary)
    assert summary["source"]["packets"]["clock_resets"] == 0
    steps = [step["step_ns"] for step in summary["source"]["clock_steps"]]
    assert steps == pytest.approx([-early_ns] * (abs(early_ns) != 3 * 10**9), abs=10**6)


def test_points_beside_a_log_whose_clock_is_set_are_on_the_clock_of_its_end(
    files: Path, tmp_path: Path
) -> None:
    early_ns = -10 * YEAR_NS
    log = flights.write_tlog(tmp_path / "flight.tlog", early_ns=early_ns)
    check_zones(again(log, points=str(files / "lidar.pcap")))  # of a computer that had the time
    check_zones(again(log, points=str(flights.write_laz(tmp_path / "cloud.laz"))))
    scans = flights.write_pcds(tmp_path / "scans", early_ns=early_ns)
    assert again(log, points=str(scans))["returns"]["without_pose"] == 0


def test_frames_of_the_older_mavlink_are_read_alike(tmp_path: Path) -> None:
    logs = [TelemetryLog(flights.write_tlog(tmp_path / f"{old}.tlog", old=old)) for old in (False, True)]
    new, old = ([(m.at_ns, m.message.to_dict()) for m in log.messages()] for log in logs)
    assert new == old
    assert (logs[1].bad, logs[1].cut) == (0, "")


def test_orders_in_a_log_are_not_carried_out_again(
    files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The log's ground station spoke to a companion such as this one."""
    asked: list[Any] = []
    monkeypatch.setattr(CommandServer, "handle_command", lambda _server, message, *_: asked.append(message))
    station = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    order = mavlink.MAVLink_command_long_message(1, 191, mavlink.MAV_CMD_USER_1, 0, 1, 0, 0, 0, 0, 0, 0)
    stamp = struct.pack(">Q", (BEGIN_NS + 10**9) // 1000)
    content = (files / "flight.tlog").read_bytes()
    path = tmp_path / "orders.tlog"
    path.write_bytes(content + 3 * (stamp + order.pack(station)))
    plain = again(files / "flight.tlog", points=str(files / "lidar.pcap"))
    assert again(path, points=str(files / "lidar.pcap")) == plain | {"file": str(path)}
    assert asked == []


def test_a_vehicle_without_a_position_places_nothing_and_that_is_said(files: Path, tmp_path: Path) -> None:
    sender = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    heartbeat = mavlink.MAVLink_heartbeat_message(2, 3, 217, 4, 4, 3).pack(sender)
    path = tmp_path / "still.tlog"
    path.write_bytes(struct.pack(">Q", BEGIN_NS // 1000) + heartbeat)
    with pytest.raises(UsageError, match="no attitude, or no position"):
        again(path, points=str(files / "lidar.pcap"))


def test_returns_that_are_all_out_of_range_are_said_to_be(files: Path) -> None:
    with pytest.raises(UsageError, match=r"none of (\d+) returns could be placed: \d{4,} out of range"):
        again(files / "flight.tlog", "lidar_min_m=5", "lidar_max_m=6", points=str(files / "lidar.pcap"))


def test_times_that_are_none_of_day_are_told_in_seconds(tmp_path: Path) -> None:
    """Such are those of a simulation, which begin with zero."""
    odometry = [(ms * 10**6, flights.pose(ODOMETRY, ms)) for ms in range(0, 400, 50)]
    cloud = flights.cloud(POINTS, AFTER, 12_500_000_000)
    lines = {"/odom": (ODOMETRY, odometry), "/points": (CLOUD, [(10**9, cloud)])}
    with pytest.raises(UsageError, match=r"returns of 12\.500 s to 12\.590 s .* 2025-06-15 "):
        again(flights.write_messages(tmp_path / "bag", lines), origin=ORIGIN)


def test_a_capture_of_no_known_sensor_wants_its_name(files: Path, tmp_path: Path) -> None:
    path = tmp_path / "strange.pcap"
    with path.open("wb") as file:
        writer = dpkt.pcap.Writer(file, linktype=101)
        for k in range(3):
            udp = bytes(dpkt.udp.UDP(sport=1, dport=2, data=b"strange", ulen=15))
            ip = dpkt.ip.IP(src=bytes(4), dst=bytes(4), p=17, len=35, data=udp)
            writer.writepkt(bytes(ip), BEGIN_NS * 1e-9 + k)
    with pytest.raises(UsageError, match="none of its 3 UDP packets is of a known LiDAR"):
        again(files / "flight.tlog", points=str(path))
    with pytest.raises(UsageError, match=r"--lidar ouster\?meta=absent: "):
        again(files / "flight.tlog", points=str(path), lidar="ouster?meta=absent")


def test_a_folder_without_scans_is_one_line(files: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("no scan")
    with pytest.raises(UsageError, match=r"it holds no \.pcd file"):
        again(files / "flight.tlog", points=str(tmp_path))


def test_placed_points_before_the_first_position_are_counted_and_left_out(tmp_path: Path) -> None:
    cloud = StoredCloud(flights.write_laz(tmp_path / "cloud.laz"), SPAN_NS)
    rerun = Rerun(flights.PARAMETERS)
    steps = list(cloud.steps(rerun, ()))
    for _, act in steps[:3]:
        rerun.hand_over(act)
    assert rerun.returns == 0
    before = cloud.summary()["before_position"]
    rerun.history.add_position(BEGIN_NS, HOME.lat_deg, HOME.lon_deg, HOME.alt_m, (0.0, 0.0, 0.0))
    for _, act in steps[3:]:
        rerun.hand_over(act)
    assert cloud.summary()["before_position"] == before > 0
    assert rerun.returns == cloud.summary()["points"] - before


def test_a_placed_cloud_brings_intensity_and_return_numbers(tmp_path: Path) -> None:
    path = flights.write_laz(tmp_path / "cloud.laz")
    las = laspy.read(path)
    n = len(las.points)
    las.intensity = np.arange(n) % 60_000
    las.return_number = np.where(np.arange(n) % 5 == 0, 0, 1)  # 0 contradicts the standard
    las.number_of_returns = np.full(n, 2)
    las.write(path)
    scans: list[Scan] = []
    rerun = Rerun(flights.PARAMETERS)
    rerun.add_placed = scans.append  # type: ignore[method-assign]
    rerun.history.add_position(BEGIN_NS, HOME.lat_deg, HOME.lon_deg, HOME.alt_m, (0.0, 0.0, 0.0))
    for _, act in StoredCloud(path, SPAN_NS).steps(rerun, ()):
        rerun.hand_over(act)
    window = join(scans)
    assert window.attributes is not None
    assert len(window) == n
    in_order = np.argsort(las.gps_time, kind="stable")
    np.testing.assert_array_equal(window.attributes.intensity, (np.arange(n) % 60_000)[in_order])
    np.testing.assert_array_equal(window.attributes.echoes, np.where(in_order % 5 == 0, 0, 2))
    assert not window.attributes.lost_enu_m.size


def test_points_of_a_cloud_that_were_measured_before_the_flight_are_left_out_and_counted(
    files: Path, tmp_path: Path
) -> None:
    path = flights.write_laz(tmp_path / "cloud.laz")
    las = laspy.read(path)
    times = np.array(las.gps_time)
    times[::10] -= 7 * 86_400
    times[1] = np.nan
    las.gps_time = times
    las.write(path)
    summary = again(files / "flight.tlog", points=str(path))
    check_zones(summary)
    left_out = len(times[::10]) + 1
    assert summary["source"]["points_outside_log"] == left_out
    assert summary["returns"]["read"] == len(times) - left_out


def test_a_cloud_whose_points_are_not_on_the_earth_is_one_line(tmp_path: Path) -> None:
    points = np.array([[1e9, 5e6, 0.0], [1e9 + 1, 5e6, 0.0]])
    gps_s = BEGIN_NS * 1e-9 + AFTER * 1e-9
    path = clouds.write(tmp_path / "far.las", points, "EPSG:32632", gps_time=gps_s)
    with pytest.raises(UsageError, match="points are not on the Earth in EPSG:32632"):
        StoredCloud(path, SPAN_NS)


def test_a_cloud_whose_heights_contradict_themselves_asks_for_their_unit(tmp_path: Path) -> None:
    """Its CRS says US feet; the record of GeoTIFF keys beside it says metres."""
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.add_crs(CRS("EPSG:32632+6360"))
    keys = [(1024, 1), (3072, 32632), (4099, 9001)]
    record = struct.pack("<4H", 1, 1, 0, len(keys))
    record += b"".join(struct.pack("<4H", key, 0, 1, value) for key, value in keys)
    header.vlrs.append(laspy.VLR("LASF_Projection", 34735, "", record))
    header.scales, header.offsets = np.full(3, 0.001), np.array([5e5, 5e6, 0.0])
    las = laspy.LasData(header)
    las.x, las.y, las.z = np.array([[5e5, 5e6, 100.0], [5e5 + 1, 5e6, 100.0]]).T
    las.gps_time = BEGIN_NS * 1e-9 + AFTER * 1e-9
    las.write(tmp_path / "a.las")
    with pytest.raises(UsageError, match=r"US survey foot by .*, but m by .*9001: .*--vertical-unit"):
        StoredCloud(tmp_path / "a.las", SPAN_NS)
    assert StoredCloud(tmp_path / "a.las", SPAN_NS, "m").summary()["points"] == 2
