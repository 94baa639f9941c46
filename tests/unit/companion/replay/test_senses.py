"""What a recording holds that no decoder takes costs itself only."""

import numpy as np
import pytest

from companion.recorder import journal
from companion.recorder.journal import BadRecordError
from companion.replay.reading import Header, Raw
from companion.replay.replay import Replay
from companion.replay.senses import Senses
from params import Parameters

HEADER = Header("livox", Parameters().model_dump(mode="json"), 0)
BROKEN = [
    Raw(journal.MAVLINK_IN, 1, b""),
    Raw(journal.MAVLINK_IN, 1, b"\xfd\x01"),
    Raw(journal.MAVLINK_IN, 1, np.random.default_rng(1).bytes(60)),
    Raw(journal.LIDAR, 1, b"\0" * 5),
    Raw(journal.EVENT, 1, b"[]"),
    Raw(journal.EVENT, 1, b"\xff"),
]


@pytest.mark.parametrize("message", BROKEN)
def test_a_message_that_cannot_be_read_says_so(message: Raw) -> None:
    with pytest.raises(BadRecordError):
        Senses(HEADER, Parameters(), lambda _returns: None).take(message)


@pytest.mark.parametrize(
    "message", [*BROKEN, Raw(journal.GAP, 1, b"null"), Raw(journal.GAP, 1, b'{"lost": "x"}')]
)
def test_a_replay_counts_it_and_goes_on(message: Raw) -> None:
    replay = Replay(HEADER, Parameters())
    assert replay.take(message) is None
    assert replay.outcome.bad == 1
