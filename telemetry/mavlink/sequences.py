"""How many packets of a component were lost, came twice or came late: by the count that MAVLink packets carry."""

__all__ = ["PacketSequence"]

_AHEAD = 128
_RECENT = 32


class PacketSequence:
    """Follows the packets of one component; the count begins anew after 255.

    A leap of 128 and more cannot be distinguished from a step back, so a pause that swallows more than that is counted
    modulo 256.

    Attributes:
        lost: numbers that did not come.
        repeated: packets that had been here, to the bit.
        late: packets that came after newer ones; no longer lost.
    """

    def __init__(self) -> None:
        self.lost, self.repeated, self.late = 0, 0, 0
        self._next = -1
        self._seen: list[int] = [-1] * 256  # checksum by number, of the last 256
        self._leap, self._since_leap = 0, 0

    def arrived(self, sequence: int, checksum: int) -> bool:
        """Whether the packet is new; False for one that had been here."""
        if self._next < 0:
            self._next = sequence
        ahead = (sequence - self._next) & 0xFF
        self._since_leap += 1
        if ahead >= _AHEAD:
            if self._seen[sequence] == checksum:
                self.repeated += 1
                return False
            if self._seen[sequence] < 0:
                self._seen[sequence] = checksum
                self.late += 1
                self.lost = max(0, self.lost - 1)
                return True
            self._seen = [-1] * 256  # another count has begun
        elif ahead:
            for k in range(ahead):
                self._seen[(self._next + k) & 0xFF] = -1
            self.lost += ahead
            self._leap, self._since_leap = ahead, 0
        self._seen[sequence] = checksum
        self._next = (sequence + 1) & 0xFF
        return True

    def restarted(self) -> None:
        """The vehicle was started anew: the leap of its count was no loss."""
        if self._since_leap <= _RECENT:
            self.lost = max(0, self.lost - self._leap)
        self._leap = 0
