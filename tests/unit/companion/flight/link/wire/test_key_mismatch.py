"""Keys of MAVLink signing that do not match: each case has a short text and a remedy."""

import pytest

from companion.flight.link.wire.key_mismatch import KeyMismatch
from companion.flight.link.wire.signing import Verdict


@pytest.mark.parametrize("mismatch", KeyMismatch)
def test_each_fits_one_text_of_the_pilot_and_has_a_remedy(mismatch: KeyMismatch) -> None:
    assert len(f"SLZ: {mismatch.value}: mapping only") <= 50
    assert len(mismatch.remedy) > 30


@pytest.mark.parametrize(
    ("verdict", "mismatch"),
    [
        (None, None),
        ("good", None),
        ("allowed", None),
        ("unsigned", KeyMismatch.NOT_SIGNED),
        ("forged", KeyMismatch.OTHER_KEY),
        ("replayed", KeyMismatch.OLD_TIMES),
    ],
)
def test_a_refused_frame_of_the_autopilot_shows_how_the_keys_differ(
    verdict: Verdict | None, mismatch: KeyMismatch | None
) -> None:
    assert KeyMismatch.of(verdict) is mismatch
