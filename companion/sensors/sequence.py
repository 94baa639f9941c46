"""Gaps in the numbering of packets."""

from __future__ import annotations

WRAP = 1 << 16
# A packet at most this far behind was overtaken on the way; farther behind, the count began anew.
OVERTAKEN = 8
# A gap larger than this is a sensor that restarted, not packets lost.
LARGEST_GAP = 2000


class PacketSequence:
    """Counts lost packets by `udp_cnt`, which restarts with every frame or runs freely, as firmware does.

    Attributes
    ----------
    lost
        Packets missing between those received; an overtaken packet is taken off again.
    """

    def __init__(self) -> None:
        self._expected: int | None = None
        self._frame = 0
        self._stamp = -1
        self.lost = 0

    def is_new(self, count: int, frame: int, stamp: int) -> bool:
        """Note a packet; return False for one received twice."""
        expected, self._expected = self._expected, (count + 1) % WRAP
        same_frame, self._frame = frame == self._frame, frame
        last_stamp, self._stamp = self._stamp, stamp
        if expected is None:
            return True
        ahead, behind = (count - expected) % WRAP, (expected - count) % WRAP
        if behind == 1 and stamp == last_stamp:
            return False
        if same_frame and 0 < behind <= OVERTAKEN and count != 0:
            self.lost = max(0, self.lost - 1)
            self._expected, self._stamp = expected, last_stamp
        elif ahead <= LARGEST_GAP and (same_frame or ahead == 0):
            self.lost += ahead
        elif count <= LARGEST_GAP:  # a new frame that begins at zero
            self.lost += count
        return True
