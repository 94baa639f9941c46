"""Frames that a network, or a router with two ways to the autopilot, delivers once more."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

# Copies come up to some seconds late. After this, equal bytes are another frame with the same number.
KEPT_NS = 10_000_000_000
MOST_KEPT = 20_000  # frames: bounds memory at any rate
# A copy this late is old: what it says was replaced meanwhile.
OLD_NS = 1_000_000_000


class RepeatedFrames:
    """Recogniser of copies: the bytes, hence sender and number, of a frame of a few seconds ago.

    Numbers have eight bits, and a frame without a stamp may come with the number and bytes of an earlier one
    by chance: one that is the next in number is no copy, nor is one of a sender that does not count.

    Attributes
    ----------
    copies, old_copies
        Number of copies, and of those at least a second late.
    """

    def __init__(self) -> None:
        self._heard: OrderedDict[bytes, int] = OrderedDict()
        self._newest: dict[tuple[int, int], int] = {}  # number of each sender's newest frame
        self._counting: set[tuple[int, int]] = set()  # senders of different numbers
        self.copies = self.old_copies = 0

    def is_copy(self, message: Any, now_ns: int) -> bool:
        """Return whether a message is a copy, and count it; else remember it."""
        frame, sender = bytes(message.get_msgbuf()), (message.get_srcSystem(), message.get_srcComponent())
        number, newest = message.get_seq(), self._newest.get(sender)
        if newest is not None and number != newest:
            self._counting.add(sender)
        heard_ns = self._heard.get(frame)
        if (
            heard_ns is not None
            and now_ns - heard_ns <= KEPT_NS
            and sender in self._counting
            and number != (-1 if newest is None else newest + 1) % 256
        ):
            self.copies += 1
            self.old_copies += now_ns - heard_ns >= OLD_NS
            return True
        self._newest[sender] = number
        self._heard[frame] = now_ns
        self._heard.move_to_end(frame)
        while self._heard and (
            len(self._heard) > MOST_KEPT or now_ns - next(iter(self._heard.values())) > KEPT_NS
        ):
            self._heard.popitem(last=False)
        return False
