"""Map blocks for a browser: equal to the maps."""

import gzip

import numpy as np
import pytest

import params
from companion.flight.dashboard import map_block as blocks
from companion.flight.dashboard.map_block import HEAD, SIDE, STEP_M
from companion.flight.dashboard.tile_pyramid import TilePyramid, TilePyramids
from slz import UNKNOWN, UNSAFE, Drawn, DrawnTile, LocalFrame, Pipeline, Window
from slz.terrain.terrain_view import DISPLAYED

TILE = 64


def tile(key: tuple[int, int] = (0, 0), height_m: float = 100.0, state: int = 1) -> DrawnTile:
    full = np.full((TILE, TILE), 1.0, np.float32)
    rows = np.arange(TILE, dtype=np.float32)[:, None]
    known = {
        "height_m": height_m + 0.1 * rows * full, "slope_deg": 3 * full, "relief_m": 0.12 * full,
        "certainty": 0.9 * full,
    }  # fmt: skip
    layers = {name: known.get(name, full) for name in DISPLAYED}
    return DrawnTile(key, layers, np.full((TILE, TILE), state, np.uint8))


def changed(made: DrawnTile, state: np.ndarray, **layers: np.ndarray) -> DrawnTile:
    return DrawnTile(made.key, {**made.layers, **layers}, state)


def drawn(*tiles: DrawnTile, serial: int = 1, gone: tuple[tuple[int, int], ...] = ()) -> Drawn:
    return Drawn(serial, -50.0, -60.0, 0.2, tiles, gone, 0)


def decoded(data: bytes) -> tuple[tuple[float, ...], np.ndarray, dict[str, np.ndarray]]:
    """Read a block as the browser does; written apart from what writes it."""
    raw = gzip.decompress(data)
    _, side, *head = HEAD.unpack_from(raw)
    planes = np.frombuffer(raw, np.uint8, offset=HEAD.size).reshape(-1, side, side)
    number = np.cumsum(planes[0].astype(np.int64) + 256 * planes[1].astype(np.int64), axis=1) % 65_536
    height = np.where(number == 0, np.nan, head[3] + number * head[4])
    return tuple(head), height, dict(zip([*DISPLAYED[1:], "state"], planes[2:], strict=True))


def test_a_block_comes_back_within_half_a_step() -> None:
    pyramid = TilePyramid()
    pyramid.apply_changes(drawn(tile((1, 2))))
    data = pyramid.encoded(0, 0, 0)
    assert data is not None
    (west, south, cell, _, step), height, planes = decoded(data)
    assert (west, south, cell, step) == (-50.0, -60.0, 0.2, STEP_M)
    here = slice(64, 128), slice(128, 192)
    assert np.abs(height[here] - tile().layers["height_m"]).max() <= STEP_M / 2 + 1e-4
    for name, number in {"slope_deg": 12, "relief_m": 12, "certainty": 180, "state": 1}.items():
        assert (planes[name][here] == number).all()
    assert np.isnan(height[:64]).all()
    assert (planes["state"][:64] == UNKNOWN).all()


def test_tiles_west_and_south_of_the_corner_have_blocks_of_their_own() -> None:
    pyramid = TilePyramid()
    pyramid.apply_changes(drawn(tile((-1, -4))))
    assert pyramid.encoded(0, 0, 0) is None
    data = pyramid.encoded(0, -1, -1)
    assert data is not None
    head, height, _ = decoded(data)
    assert head[:2] == (-50.0 - SIDE * 0.2, -60.0 - SIDE * 0.2)
    assert np.isfinite(height[192:, :64]).all()


def test_what_did_not_change_is_not_told_again() -> None:
    """Maps are drawn anew as they age; browsers fetch only what differs."""
    pyramid = TilePyramid()
    pyramid.apply_changes(drawn(tile()))
    before = pyramid.clock
    pyramid.apply_changes(drawn(tile()))
    assert pyramid.clock == before
    assert pyramid.since(before) == []
    pyramid.apply_changes(drawn(tile(height_m=101.0)))
    assert [place[:2] for place in pyramid.since(before)] == [(0, 0)]


def test_ground_that_was_given_up_is_unknown_again() -> None:
    pyramid = TilePyramid()
    pyramid.apply_changes(drawn(tile()))
    pyramid.apply_changes(drawn(gone=((0, 0),)))
    cell = pyramid.cell(-49.0, -59.0)
    assert cell is not None
    assert (cell.state, set(cell.values.values())) == ("unknown", {None})


def test_another_map_begins_anew() -> None:
    pyramid = TilePyramid()
    pyramid.apply_changes(drawn(tile()))
    pyramid.apply_changes(drawn(tile((40, 40)), serial=2))
    assert pyramid.cell(-49.0, -59.0) is None
    assert [place[:2] for place in pyramid.since(0)] == [(10, 10)]


def test_a_coarser_block_keeps_the_worst_of_four_cells() -> None:
    fine = tile()
    state, certainty = fine.state.copy(), fine.layers["certainty"].copy()
    slope = fine.layers["slope_deg"].copy()
    state[0, 0], state[10, 11] = UNSAFE, UNKNOWN
    certainty[0, 0], slope[0, 1] = 0.2, 30.0
    pyramid = TilePyramid()
    pyramid.apply_changes(drawn(changed(fine, state, slope_deg=slope, certainty=certainty)))
    data = pyramid.encoded(1, 0, 0)
    assert data is not None
    head, height, planes = decoded(data)
    states = planes["state"]
    assert head[2] == pytest.approx(0.4)
    assert states[0, 0] == UNSAFE
    assert states[5, 5] == UNKNOWN
    assert states[1, 1] == 1
    assert planes["certainty"][0, 0] == 40
    assert planes["slope_deg"][0, 0] == 120
    assert height[3, 3] == pytest.approx(100.0 + 0.1 * 6.5, abs=STEP_M)
    assert (states[32:, 32:] == UNKNOWN).all()


def test_the_near_map_answers_for_a_point_and_the_far_one_where_that_knows_nothing() -> None:
    pyramids = TilePyramids()
    pyramids.apply_changes("far", drawn(tile(height_m=90.0), tile((0, 1), height_m=90.0)))
    pyramids.apply_changes("near", drawn(tile()))
    near, far = pyramids.cell(-49.9, -59.9), pyramids.cell(-50 + 70 * 0.2, -59.9)
    assert near is not None
    assert far is not None
    assert (near[0], near[1].values["height_m"]) == ("near", 100.0)
    assert (far[0], far[1].values["height_m"]) == ("far", 90.0)
    assert pyramids.cell(500.0, 500.0) is None


@pytest.mark.parametrize("mode", ["default", "source"])
def test_what_the_pipeline_hands_over_makes_up_its_maps(mode: str) -> None:
    rng = np.random.default_rng(5)
    pipeline = Pipeline(params.build({"mode": mode, "zone_m": 60.0, "min_boundary_points": 4}))
    held: dict[tuple[int, int], DrawnTile] = {}
    serial = 0
    for step in range(3):
        points = np.column_stack([rng.uniform(-20, 20 + 4 * step, (40_000, 2)), rng.normal(0, 0.02, 40_000)])
        frame = LocalFrame(47.0, 8.0, 400.0)
        start = step * 1_000_000_000
        stamps = np.linspace(start, start + 900_000_000, len(points)).astype(np.int64)
        sensor = np.array([0.0, 0.0, 20.0])
        pipeline.process(Window(points, stamps, sensor, frame, start, start + 900_000_000))
        while True:
            part = pipeline.drawn("near", 7)
            assert part is not None
            if part.serial != serial:  # another map took its place
                serial, held = part.serial, {}
            held.update({found.key: found for found in part.tiles})
            if not part.left:
                break
    maps = pipeline.maps(which="near")
    assert maps is not None
    row, col = (min(key[axis] for key in held) for axis in (0, 1))
    shape = [TILE * (1 + max(key[axis] - low for key in held)) for axis, low in ((0, row), (1, col))]
    state, height = np.full(shape, UNKNOWN, np.uint8), np.full(shape, np.nan, np.float32)
    for key, found in held.items():
        south, west = TILE * (key[0] - row), TILE * (key[1] - col)
        state[south : south + TILE, west : west + TILE] = found.state
        height[south : south + TILE, west : west + TILE] = found.layers["height_m"]
    first_row = round((maps.south_m - part.south_m) / part.cell_m) - TILE * row
    first_col = round((maps.west_m - part.west_m) / part.cell_m) - TILE * col
    rows, cols = maps.state.shape
    here = slice(first_row, first_row + rows), slice(first_col, first_col + cols)
    assert np.array_equal(state[here], maps.state)
    assert np.array_equal(height[here], maps.height_m, equal_nan=True)
    again = pipeline.drawn("near", 10_000)
    assert again is not None
    assert not again.tiles
    anew = pipeline.drawn("near", 10_000, anew=True)
    assert anew is not None
    assert {found.key for found in anew.tiles} >= set(held)


def test_values_out_of_reach_and_unknown_ones_are_numbers_of_their_own() -> None:
    made = tile(height_m=0.0)
    height, slope, state = made.layers["height_m"].copy(), made.layers["slope_deg"].copy(), made.state.copy()
    height[0, :4] = np.nan, -1e6, 1e6, 10.0
    slope[0, :3], state[0, 0] = (np.nan, 1e3, 0.0), UNKNOWN
    block = blocks.empty(0.0)
    assert blocks.write(block, 0, 0, changed(made, state, height_m=height, slope_deg=slope))
    assert block.height[0, :4].tolist() == [0, 1, 65_535, 2000]
    assert block.planes["slope_deg"][0, :3].tolist() == [255, 254, 0]
    assert block.planes["certainty"][0, :2].tolist() == [255, 180]
    assert (block.state[64:] == UNKNOWN).all()


def test_ground_given_up_that_was_never_drawn_is_no_change() -> None:
    pyramid = TilePyramid()
    pyramid.apply_changes(drawn(tile()))
    before = pyramid.clock
    pyramid.apply_changes(drawn(gone=((40, 40),)))
    assert pyramid.clock == before
    assert pyramid.encoded(0, 10, 10) is None


def test_a_far_view_has_what_is_known_of_its_corners_and_follows_changes() -> None:
    pyramid = TilePyramid()
    pyramid.apply_changes(drawn(tile((0, 0), height_m=100.0), tile((12, 12), height_m=200.0)))

    def seen() -> tuple[float, float, float]:
        """Return heights near two opposite corners of a block of four by four, and between them."""
        data = pyramid.encoded(2, 0, 0)
        assert data is not None
        _, height, _ = decoded(data)
        return height[0, 0], height[192, 192], height[0, 192]

    middle = 0.1 * 1.5  # of the four rows that a cell of this level is the mean of
    assert seen() == pytest.approx((100 + middle, 200 + middle, np.nan), abs=2 * STEP_M, nan_ok=True)
    pyramid.apply_changes(drawn(tile((12, 12), height_m=201.0)))  # of the two halves one only
    assert seen() == pytest.approx((100 + middle, 201 + middle, np.nan), abs=2 * STEP_M, nan_ok=True)
    assert pyramid.encoded(2, 1, 0) is None
