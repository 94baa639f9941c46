"""Parameters: accepted and refused values, and the texts of refusals."""

from __future__ import annotations

from pathlib import Path

import pytest

import params
from params import ParameterError, airworthy, check_airworthy, grounded


def test_helicopter_profile_has_the_values_of_the_sources() -> None:
    heli = params.load("helicopter")
    table = {
        "window_s": 1.0,
        "worst_slope_deg": 40,
        "safe_slope_deg": 4,
        "histogram_bins": 300,
        "histogram_threshold": 0.9,
        "min_boundary_points": 200,
        "min_square_m": 24,
        "confidence_factor": 0.86,
        "repeat_ratio": 0.8,
        "area_ratio": 0.9,
        "cell_m": 1,
        "far_cell_m": 10,
        "zone_m": 5000,
    }
    assert {name: getattr(heli, name) for name in table} == table


def test_quadcopter_profile_is_the_table_s_default() -> None:
    assert params.load("quadcopter") == params.Parameters()


def test_every_row_fits_the_wire_and_explains_itself() -> None:
    table = params.rows()
    assert len({row.mavlink for row in table}) == len(table)
    for row in table:
        assert len(row.mavlink) <= 16
        assert row.mavlink.startswith("SLZ_")
        assert row.sentence.endswith(".")
        assert row.source
        assert row.choices or (row.low is not None and row.high is not None)


def test_later_settings_win_and_mavlink_names_work() -> None:
    config = params.load("helicopter", ["cell_m=0.5", "SLZ_CELL_M=2", "fusing=max"])
    assert config.cell_m == 2
    assert config.fusing == "max"


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("cell_m=0", ["cell_m", "'0'", "0.05 to 50 m"]),
        ("cell_m=nan", ["cell_m", "nan"]),
        ("cell_m=true", ["cell_m", "'true'", "0.05 to 50 m"]),
        ("cell_m=wide", ["cell_m", "'wide'", "a number"]),
        ("histogram_bins=2.5", ["histogram_bins", "whole number"]),
        ("fusing=median", ["fusing", "mean or max"]),
        ("cel_m=1", ["'cel_m'", "did you mean 'cell_m'"]),
        ("max_slope_deg=30", ["'max_slope_deg' is called 'worst_slope_deg' now"]),
        ("SLZ_MAX_SLOPE=30", ["'SLZ_MAX_SLOPE' is called 'SLZ_WORST_SLOPE' now"]),
        ("cell_m", ["name=value"]),
        ("lidar_min_m=90", ["lidar_min_m", "lidar_max_m"]),
    ],
)
def test_bad_settings_are_refused_in_one_line(setting: str, words: list[str]) -> None:
    with pytest.raises(ParameterError) as refused:
        params.load("quadcopter", [setting])
    message = str(refused.value)
    assert "\n" not in message
    for word in words:
        assert word in message


def test_file_starts_from_the_profile_it_names(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('profile = "helicopter"\ncell_m = 2.0\n')
    config = params.load(str(path))
    assert (config.cell_m, config.min_square_m) == (2.0, 24.0)


@pytest.mark.parametrize(
    ("content", "word"),
    [
        ("cell_m = ", "TOML"),
        ("cel_m = 1.0", "did you mean"),
        ("max_slope_deg = 30", "'worst_slope_deg' now"),
        ('profile = "plane"', "plane"),
        ("cell_m = 99", "99"),
        ("cell_m = true", "cell_m = True is refused: it must be a number from 0.05 to 50 m"),
        ("histogram_bins = true", "histogram_bins = True is refused: it must be a whole number from 10"),
        ("fusing = false", "fusing = False is refused: it must be mean or max"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path: Path, content: str, word: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(content)
    with pytest.raises(ParameterError, match=word):
        params.load(str(path))


@pytest.mark.parametrize("name", ["airship", "/nowhere/x.toml"])
def test_unknown_profile_is_refused(name: str) -> None:
    with pytest.raises(ParameterError, match=name):
        params.load(name)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["surround_m=500"], ("surround_m (500.0)", "1000 cells")),
        (["coverage_m=50"], ("coverage_m (50.0)", "100 cells")),
        (["range_noise_m=0.05"], ("range_noise_m (0.05)", "height_noise_m")),
        (["hold_s=400"], ("hold_s (400.0)", "max_age_s")),
        (["min_square_m=50", "zone_m=40"], ("min_square_m (50.0)", "zone_m")),
    ],
)
def test_combinations_that_map_nothing_or_everything_are_refused(
    settings: list[str], words: tuple[str, ...]
) -> None:
    with pytest.raises(params.ParameterError) as refused:
        params.load("quadcopter", settings)
    assert all(word in str(refused.value) for word in words)


# ---- gear ---------------------------------------------------------------------------------------


def test_a_slope_beyond_the_tip_limit_is_refused_with_both_names() -> None:
    with pytest.raises(ParameterError, match=r"\(20\.0\) must not exceed tip_limit_deg \(15\.0\)"):
        params.load("quadcopter", ["safe_slope_deg=20", "tip_limit_deg=15"])
    for other in ("gear=none", "mode=source"):
        params.load("quadcopter", ["safe_slope_deg=20", "tip_limit_deg=15", other])


def test_without_a_tip_limit_the_vehicle_may_tilt_five_degrees_more_than_the_ground() -> None:
    assert params.load("quadcopter").greatest_tilt_deg == 15
    assert params.load("quadcopter", ["safe_slope_deg=20"]).greatest_tilt_deg == 25
    assert params.load("helicopter").greatest_tilt_deg == 10


def test_without_sizes_the_gear_follows_the_footprint() -> None:
    assert params.load("quadcopter").gear_size_m == pytest.approx((0.57, 0.57))
    assert params.load("helicopter").gear_size_m == pytest.approx((3.0, 2.2))
    assert params.load("helicopter", ["footprint_m=2"]).gear_size_m == pytest.approx((1.2, 0.88))
    assert params.load("quadcopter", ["gear_width_m=0.4"]).gear_size_m == pytest.approx((0.57, 0.4))


def test_a_footprint_that_does_not_hold_the_gear_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"footprint_m \(1\.5\) must hold the gear: 1\.76 m across"):
        params.load("quadcopter", ["footprint_m=1.5", "gear_length_m=1.2", "gear_width_m=1.2"])


def test_a_gear_too_small_to_stand_on_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"gear_width_m \(0\.01\) must be 0 or at least 0\.1 m"):
        params.load("quadcopter", ["gear_width_m=0.01"])


@pytest.mark.parametrize("profile", params.PROFILES)
def test_every_profiles_limits_agree_with_its_gear(profile: str) -> None:
    """On ground at its limit of slope or relief, the gear is within its own."""
    p = params.load(profile)
    assert p.gear == "none" or p.safe_slope_deg <= p.greatest_tilt_deg
    assert p.gear == "none" or p.relief_m <= p.clearance_m


# ---- disc, tail and D -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["rotor_diameter_m", "rotor_height_m", "tail_length_m", "tail_width_m", "d_value_m"]
)
@pytest.mark.parametrize("value", ["nan", "-1", "inf"])
def test_sizes_of_disc_and_tail_that_are_no_sizes_are_refused(name: str, value: str) -> None:
    with pytest.raises(ParameterError, match=f"parameter {name} = '{value}' is refused"):
        params.load("helicopter", [f"{name}={value}"])


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("rotor_diameter_m=0.05", r"rotor_diameter_m \(0\.05\) must be 0 or at least 0\.1 m"),
        ("d_value_m=0.05", r"d_value_m \(0\.05\) must be 0 or at least 0\.1 m"),
        (
            "rotor_diameter_m=2.5",
            r"rotor_diameter_m \(2\.5\) must be 0 or no less than the gear, which is 3 m",
        ),
        ("tail_length_m=1.4", r"tail_length_m \(1\.4\) must be 0 or beyond the gear, which ends 1\.5 m"),
        ("rotor_height_m=0.2", r"rotor_height_m \(0\.2\) must exceed rotor_clearance_m \(0\.3\)"),
        ("tail_height_m=0.3", r"tail_height_m \(0\.3\) must exceed rotor_clearance_m \(0\.3\)"),
        ("d_value_m=11", r"d_value_m \(11\.0\) must be 0 or at least 11\.7 m"),
        ("cell_m=0.02", "cell_m"),
    ],
)
def test_a_disc_a_tail_and_a_d_that_contradict_the_vehicle_are_refused(setting: str, words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        params.load("helicopter", [setting])


def test_d_is_that_of_disc_and_tail_where_it_is_not_given() -> None:
    assert params.load("quadcopter").greatest_dimension_m == 0
    assert params.load("helicopter", ["d_value_m=0"]).greatest_dimension_m == pytest.approx(11.7)
    assert params.load("helicopter", ["d_value_m=12.5"]).greatest_dimension_m == 12.5
    hexacopter = params.load("quadcopter", ["rotor_diameter_m=1.4", "rotor_height_m=0.4"])
    assert hexacopter.greatest_dimension_m == pytest.approx(1.4)


def test_source_mode_judges_no_disc() -> None:
    params.load("helicopter", ["mode=source", "rotor_height_m=0.1"])


# Values that must not fly: named in the table, refused by one check.


@pytest.mark.parametrize("profile", params.PROFILES)
def test_every_profile_and_every_default_may_fly(profile: str) -> None:
    flown = params.load(profile)
    assert check_airworthy(flown) is flown
    assert airworthy(flown) == flown
    assert all(row.default not in row.grounded for row in params.rows())
    assert all(set(row.grounded) < set(row.choices) for row in params.rows() if row.grounded)


def test_all_grounded_values_are_refused_in_one_line_with_reason_and_remedy() -> None:
    given = params.load("quadcopter", ["odometry=autopilot", "mode=source"])
    assert [(one.row.name, one.value) for one in grounded(given)] == [
        ("mode", "source"),
        ("odometry", "autopilot"),
    ]
    with pytest.raises(ParameterError) as refused:
        check_airworthy(given)
    text = str(refused.value)
    assert "\n" not in text
    assert "an unobserved axis counts as observed" in text
    assert "use off or map" in text
    assert "use default" in text
    assert airworthy(given) == params.Parameters()


@pytest.mark.parametrize("row", [row for row in params.rows() if row.grounded], ids=lambda row: row.mavlink)
def test_what_the_pilot_reads_first_fits_one_message(row: params.Row) -> None:
    for value in row.grounded:
        assert len(f"SLZ: {row.mavlink}: {value} must not fly") <= 50
