"""Time stamps in file names: seconds since 1970 with a fraction, or one whole number.

After a whole number of seconds some programs write decimals, others nanoseconds (or milliseconds,
microseconds) without leading zeros: 899.11149430 is 899.011149430. The fractions of all files together
distinguish them: decimals lack trailing zeros, whole numbers lack leading ones.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from companion.runtime.errors import UsageError

# Unit of a whole number since 1970, from its number of digits in this century.
UNITS_NS = {10: 1_000_000_000, 13: 1_000_000, 16: 1_000, 19: 1}
NAME = re.compile(r"(\d{10,19})(?:[._](\d{1,9}))?")
EXAMPLE = "1763000000.123456789.pcd, seconds since 1970"
WHOLE_DIGITS = frozenset({3, 6, 9})  # digits of the largest whole number of ms, us, ns in a second
EITHER = WHOLE_DIGITS | {1, 2}  # lengths that are unambiguous if all fractions share them


def stamps_of(paths: Sequence[Path]) -> list[int]:
    """Return the times in the names of files, ns since 1970.

    Raises
    ------
    UsageError
        A name is no time, or the meaning of the fractions is ambiguous.
    """
    parts = [_parts(path) for path in paths]
    digits = _whole_digits(paths, [fraction for _, fraction in parts if fraction])
    return [begin_ns + _fraction_ns(fraction, digits) for begin_ns, fraction in parts]


def _parts(path: Path) -> tuple[int, str]:
    """Return the whole number of a name (ns) and the digits of its fraction of a second."""
    found = NAME.fullmatch(path.stem)
    unit_ns = UNITS_NS.get(len(found[1])) if found else None
    if found is None or unit_ns is None or (found[2] and unit_ns != UNITS_NS[10]):
        raise UsageError(f"{path}: its name is no time: write {EXAMPLE}")
    return int(found[1]) * unit_ns, found[2] or ""


def _whole_digits(paths: Sequence[Path], fractions: list[str]) -> int | None:
    """Return the number of digits of a full second if fractions are whole numbers; None for decimals."""
    lengths = {len(fraction) for fraction in fractions}
    if not lengths or (len(lengths) == 1 and lengths <= EITHER):
        return None
    several = [fraction for fraction in fractions if len(fraction) > 1]
    before, behind = (any(test(one, "0") for one in several) for test in (str.startswith, str.endswith))
    if before and (len(lengths) == 1 or not behind):
        return None
    if behind and not before and len(lengths) > 1 and max(lengths) in WHOLE_DIGITS:
        return max(lengths)
    shorter = next(path for path in paths if len(_parts(path)[1]) == min(lengths))
    raise UsageError(
        f"{shorter}: nobody can tell whether the {min(lengths)} to {max(lengths)} digits after the seconds in"
        " this folder's names are decimals or nanoseconds: write all with nine, leading zeros too"
    )


def _fraction_ns(fraction: str, whole_digits: int | None) -> int:
    padded = fraction.ljust(9, "0") if whole_digits is None else fraction.zfill(whole_digits).ljust(9, "0")
    return int(padded)
