"""The 8-bit sequence numbers of one sender, counted on: how late a packet is, by what came before.

A sender counts its packets upwards. One with a lower number than the last was overtaken on the way:
it had left before the packet that came first, however late it comes.
"""

from array import array
from math import inf

BEHIND = 0x80  # of 256 numbers; one that is farther behind looks as if it were ahead
#: s and packets, one after the other and all behind, after which the sender has begun anew
ANEW_AFTER, ANEW = 2.0, 3
#: s of silence after which one that counts from 0 has begun anew with its second packet
SILENT = 1.0
JUMP = 32  # numbers; 25 packets/s that come 7 s late are 80 ahead by their 8 bits
FIRST = 8  # numbers, of which the second packet has one: some may be lost


class NumberLine:
    """The numbers of one sender."""

    def __init__(self) -> None:
        self.last = -1  #: the highest number so far, counted on beyond 255; -1: none has come
        self._first = -1  # number that came
        self._passed = array("d", [0.0]) * 256  # s, when each number came, or a higher one
        self._came = array("q", [-1]) * 256  # which numbers came themselves, before any higher one
        self._ahead_by = array("h", [0]) * 256  # by how many these were ahead
        self._behind: list[tuple[int, float]] = []  # number and s, of those since the last ahead
        self.heard_at = 0.0  #: s, when the last packet came
        self._is_at_0 = False  # the last one was number 0, after a silence
        self.lives = 0  #: times that the sender has begun anew

    def __repr__(self) -> str:
        return f"NumberLine({self.last})"

    def place(self, seq: int, *, now: float) -> int:
        """Take a packet in; return its number, counted on. It is late if that is below ``last``."""
        silence, self.heard_at = now - self.heard_at, now
        was_at_0, self._is_at_0 = self._is_at_0, seq == 0 and silence >= SILENT
        by = (seq - self.last + BEHIND & 0xFF) - BEHIND
        if self.last < 0:
            self._first, self.last, by = seq, seq - 1, 1
        elif by <= 0:
            is_second = was_at_0 and 0 < seq <= FIRST
            if by == 0 or not (is_second or self._begins_anew(self.last + by, now)):
                return self.last + by
            self.lives += 1
            by &= 0xFF
        number = self.last = self.last + by
        self._passed[number & 0xFF] = now
        if by > 1:
            for each in range(number - min(by, 256) + 1, number):
                self._passed[each & 0xFF] = now
        self._came[number & 0xFF], self._ahead_by[number & 0xFF] = number, by
        self._behind.clear()
        return number

    def number_of(self, seq: int) -> int:
        """Return the number, counted on, of a packet that was taken in."""
        return self.last + (seq - self.last + BEHIND & 0xFF) - BEHIND

    def sent_after(self, number: int, *, now: float) -> float:
        """Return the earliest time in s at which the packet of this number can have left.

        That is when the number before it came. The last number again says nothing: some senders do
        not count. One from before the first that came may have left before this server began.
        """
        if number >= self.last:
            return now
        for each in range(number, max(self._first, self.last - 256) - 1, -1):
            if self._came[each & 0xFF] == each:
                return self._passed[each & 0xFF]
        return 0.0

    def has_all(self, seq: int, *, within: float) -> bool:
        """Whether each packet came that was sent in so many seconds before this one.

        This one may be late: the time counts from the packet before it.
        """
        number = self.number_of(seq)
        until = -inf
        for each in range(number - 1, max(self._first, self.last - 256), -1):
            if self._came[each & 0xFF] != each:
                return False
            passed = self._passed[each & 0xFF]
            if passed < until:
                return True
            until = max(until, passed - within)
        return False

    def jumped_to(self, number: int) -> bool:
        """Whether a packet seemed to be so far ahead that it may as well be far behind."""
        came = self._came[number & 0xFF] == number
        return came and self._ahead_by[number & 0xFF] > JUMP

    def _begins_anew(self, number: int, now: float) -> bool:
        """Whether nothing but rising lower numbers has come for a while: it counts from 0 again.

        What a net delivers late comes at once, or between newer packets.
        """
        behind = self._behind
        if behind and number <= behind[-1][0]:
            behind.clear()
        behind.append((number, now))
        del behind[1 : max(1, len(behind) - ANEW)]
        return len(behind) > ANEW - 1 and now - behind[0][1] >= ANEW_AFTER
