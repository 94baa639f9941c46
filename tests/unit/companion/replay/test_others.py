"""Flights that other programs recorded: bags, telemetry logs with captures; and what is none of them."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from companion.errors import UsageError
from companion.replay import command
from companion.replay.cloud_folder import stamp_of
from companion.replay.flown import Beside, kind_of
from companion.replay.point_cloud import BadCloudError, decode
from companion.replay.ros_pose import ned_from_frd
from companion.replay.stored_cloud import since_1970_ns
from tests.unit.companion.replay import flights
from tests.unit.companion.replay.flights import BEGIN_NS, HOME, Bag

ORIGIN = f"{HOME.lat_deg},{HOME.lon_deg},{HOME.alt_m}"
GROUND_M = HOME.alt_m  # of the plain


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


def again(path: Path, *settings: str, **beside: Any) -> dict[str, Any]:
    asked = ["cell_m=0.5", "zone_m=200", *settings]
    return command.run(path, asked, None, 0.0, (0.0, 1e9), beside=Beside(**beside))


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
    late = again(files / "yesterday.tlog", points=str(cloud))  # poses of no help, but none is needed
    assert late["windows"] == summary["windows"]


@pytest.mark.parametrize(
    ("day", "gps_s"),
    [
        ("2020-01-01T00:00:00", 1_261_872_018),
        ("2010-06-01T00:00:00", 959_385_615),
        ("2017-01-01T00:00:00", 1_167_264_018),
    ],
)
def test_times_of_gps_are_ahead_of_the_time_of_day_by_leap_seconds(day: str, gps_s: int) -> None:
    at_ns = int(np.datetime64(day, "ns").astype(np.int64))
    assert since_1970_ns(np.array([gps_s - 1e9]), "standard", at_ns) == at_ns
    for near_s in (0, 200_000):
        found = since_1970_ns(np.array([gps_s % 604_800.0]), "week", at_ns + near_s * 10**9)
        assert found == at_ns


def test_a_placed_cloud_without_times_is_refused(files: Path, tmp_path: Path) -> None:
    cloud = flights.write_laz(tmp_path / "cloud.laz", timed=False)
    with pytest.raises(UsageError, match="have no times"):
        again(files / "flight.tlog", points=str(cloud))


def test_a_folder_of_scans_is_placed_by_their_names(files: Path, tmp_path: Path) -> None:
    summary = again(files / "flight.tlog", points=str(flights.write_pcds(tmp_path / "scans")))
    check_zones(summary)
    assert summary["source"]["clouds"] == 50


@pytest.mark.parametrize(
    ("name", "stamp_ns"),
    [
        ("1750000000.pcd", 1_750_000_000 * 10**9),
        ("1750000000.5.pcd", 1_750_000_000 * 10**9 + 500_000_000),
        ("1750000000_000000001.pcd", 1_750_000_000 * 10**9 + 1),
        ("1750000000123.pcd", 1_750_000_000 * 10**9 + 123_000_000),
        ("1750000000123456.pcd", 1_750_000_000 * 10**9 + 123_456_000),
        ("1750000000123456789.pcd", 1_750_000_000 * 10**9 + 123_456_789),
    ],
)
def test_names_of_scans_are_times(name: str, stamp_ns: int) -> None:
    assert stamp_of(Path(name)) == stamp_ns


@pytest.mark.parametrize("name", ["000001.pcd", "scan.pcd", "17500000001.pcd", "1750000000123.5.pcd"])
def test_a_name_that_is_no_time_is_refused(name: str) -> None:
    with pytest.raises(UsageError, match="its name is no time"):
        stamp_of(Path(name))


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
    areas = [sum(zone["area_m2"] for zone in summary["zones"]) for summary in (odometry, fix)]
    assert areas[0] == pytest.approx(areas[1], rel=0.05)


def test_points_without_times_have_that_of_their_message(tmp_path: Path) -> None:
    path = flights.write_bag(tmp_path / "bag", Bag("pose", timed=False))
    summary = again(path, origin=ORIGIN)
    assert summary["source"]["clouds_without_point_times"] == summary["source"]["clouds"] == 50


def test_several_clouds_want_a_name_and_points_of_the_body_no_mount(tmp_path: Path) -> None:
    path = flights.write_bag(tmp_path / "bag", Bag(second_cloud=True, points_frame="base_link"))
    with pytest.raises(UsageError, match="/other, /points"):
        again(path, origin=ORIGIN)
    feed, rerun = command.opened(path, (), Beside("/other", origin=ORIGIN))
    assert rerun.parameters.lidar_pitch_deg == 0.0
    assert feed.told()["points"] == "/other"
    _, rerun = command.opened(path, ("lidar_pitch_deg=20",), Beside("/other", origin=ORIGIN))
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
    assert again(tmp_path / "flight.tlog", points=str(tmp_path / "lidar.pcap"))["windows"] >= 1
    said, summary = "", {}
    try:
        summary = again(next(tmp_path.glob("*.mcap")))
    except UsageError as error:
        said = str(error)
    assert "\n" not in said
    assert said or summary["cut"]


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
    assert kind_of(files / "flight.tlog") == "tlog"
    assert kind_of(files / "odometry") == kind_of(next((files / "fix").glob("*.mcap"))) == "bag"
    assert kind_of(Path("absent.mcap")) == "own"


def test_ros_orientations_are_turned_into_ours() -> None:
    rng = np.random.default_rng(1)
    for rotation in Rotation.random(20, rng=rng):
        w, x, y, z = ned_from_frd(*rotation.as_quat())
        wanted = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]) @ rotation.as_matrix() @ np.diag([1, -1, -1])
        np.testing.assert_allclose(Rotation.from_quat([x, y, z, w]).as_matrix(), wanted, atol=1e-12)


POINTS = np.array([[1.0, 2, 3], [4, 5, 6]], np.float32)
AFTER = np.array([5_000, 90_000_000])


def with_time(name: str, form: str, code: int, times: np.ndarray) -> Any:
    """Return a cloud of two points whose times are of another type."""
    message = flights.cloud(POINTS, AFTER, BEGIN_NS)
    table = np.zeros(2, [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), (name, form)])
    for k, axis in enumerate("xyz"):
        table[axis] = POINTS[:, k]
    table[name] = times
    (field,) = {type(f) for f in message.fields}
    message.fields = [*message.fields[:3], field(name, 12, code, 1)]
    message.point_step = table.itemsize
    message.data = np.frombuffer(table.tobytes(), np.uint8)
    return message


@pytest.mark.parametrize(
    ("name", "form", "code", "times", "within_ns"),
    [
        ("t", "<u4", 6, AFTER, 0),
        ("time", "<f4", 7, AFTER * 1e-9, 10),
        ("time", "<f4", 7, (AFTER - 90_000_000) * 1e-9, 10),
        ("timestamp", "<f8", 8, (BEGIN_NS + AFTER) * 1e-9, 500),
        ("timestamp", "<f8", 8, BEGIN_NS + AFTER, 500),
        ("offset_time", "<u4", 6, AFTER, 0),
    ],
)
def test_times_of_points_are_taken_as_they_can_only_be_meant(
    name: str, form: str, code: int, times: np.ndarray, within_ns: int
) -> None:
    returns, timed = decode(with_time(name, form, code, times), BEGIN_NS)
    assert timed
    wanted = AFTER if times[0] >= 0 else AFTER - 90_000_000
    np.testing.assert_allclose(returns.stamp_ns - BEGIN_NS, wanted, atol=max(within_ns, 1))
    np.testing.assert_array_equal(returns.xyz_sensor_m, POINTS)


def test_times_that_make_no_sense_are_not_used() -> None:
    returns, timed = decode(with_time("timestamp", "<f8", 8, np.array([1e300, np.nan])), BEGIN_NS)
    assert not timed
    assert (returns.stamp_ns == BEGIN_NS).all()


def test_clouds_that_contradict_themselves_are_refused() -> None:
    for name, value in (("width", 3), ("point_step", 10), ("point_step", 0), ("height", 7), ("fields", [])):
        message = flights.cloud(POINTS, AFTER, BEGIN_NS)
        setattr(message, name, value)
        with pytest.raises(BadCloudError):
            decode(message, BEGIN_NS)


def test_rows_with_padding_are_read() -> None:
    message = flights.cloud(np.repeat(POINTS, 2, axis=0), np.arange(4), BEGIN_NS)
    rows = message.data.reshape(2, -1)
    message.data = np.concatenate([rows, np.full((2, 8), 255, np.uint8)], axis=1).ravel()
    message.height, message.width, message.row_step = 2, 2, 48
    returns, _ = decode(message, BEGIN_NS)
    np.testing.assert_array_equal(returns.xyz_sensor_m, np.repeat(POINTS, 2, axis=0))
