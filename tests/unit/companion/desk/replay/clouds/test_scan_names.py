"""Times in the names of files, decimals or whole nanoseconds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from companion.desk.replay.cloud_folder import stamps_of
from companion.runtime.errors import UsageError

BEGIN_S = 1_750_000_000


def paths(*names: str) -> list[Path]:
    return [Path(f"{name}.pcd") for name in names]


@pytest.mark.parametrize(
    ("name", "stamp_ns"),
    [
        ("1750000000", BEGIN_S * 10**9),
        ("1750000000.5", BEGIN_S * 10**9 + 500_000_000),
        ("1750000000_000000001", BEGIN_S * 10**9 + 1),
        ("1750000000123", BEGIN_S * 10**9 + 123_000_000),
        ("1750000000123456", BEGIN_S * 10**9 + 123_456_000),
        ("1750000000123456789", BEGIN_S * 10**9 + 123_456_789),
    ],
)
def test_names_of_scans_are_times(name: str, stamp_ns: int) -> None:
    assert stamps_of(paths(name)) == [stamp_ns]


@pytest.mark.parametrize("name", ["000001", "scan", "17500000001", "1750000000123.5"])
def test_a_name_that_is_no_time_is_refused(name: str) -> None:
    with pytest.raises(UsageError, match="its name is no time"):
        stamps_of(paths("1750000000", name))


TIMES_NS = BEGIN_S * 10**9 + np.arange(20_000_000, 3_000_000_000, 50_000_000)  # 20 scans a second


@pytest.mark.parametrize("between", [".", "_"])
@pytest.mark.parametrize("per_second", [10**9, 10**6, 10**3])
def test_whole_numbers_after_the_seconds_need_no_leading_zeros(between: str, per_second: int) -> None:
    count = TIMES_NS // (10**9 // per_second)
    names = [f"{n // per_second}{between}{n % per_second}" for n in count.tolist()]
    assert stamps_of(paths(*names)) == TIMES_NS.tolist()


@pytest.mark.parametrize("form", ["{:.9f}", "{:.6f}", "{:.4f}", "{:.3f}", "{}"])
def test_decimals_may_have_lost_their_trailing_zeros(form: str) -> None:
    names = [form.format(float(ns) * 1e-9) for ns in TIMES_NS]
    np.testing.assert_allclose(stamps_of(paths(*names)), TIMES_NS, atol=500)


@pytest.mark.parametrize(
    "fractions",
    [
        ("123456789", "12345678"),  # both are possible
        ("50000000", "50000001"),  # whole numbers of less than a tenth of a second, or decimals
        ("012", "10"),  # decimals keep no zero behind, whole numbers none before
        ("1234567", "1230"),  # whole numbers of what?
    ],
)
def test_fractions_that_may_be_either_are_refused_in_one_line(fractions: tuple[str, ...]) -> None:
    with pytest.raises(UsageError) as caught:
        stamps_of(paths(*(f"{BEGIN_S}.{fraction}" for fraction in fractions)))
    assert "decimals or nanoseconds: write all with nine" in str(caught.value)
    assert "\n" not in str(caught.value)
