"""MAVLink packets out of a stream of bytes: versions 1 and 2, signed or not, whatever lies between them."""

import re
from binascii import crc_hqx
from collections.abc import Mapping
from typing import NamedTuple

from wingwatch.telemetry.mavlink.dialect import Layout

__all__ = ["Packet", "PacketReader"]

_V1, _V2 = 0xFE, 0xFD
_HEAD = {_V1: 6, _V2: 10}
_CHECKSUM, _SIGNATURE = 2, 13
_SIGNED = 1
_MAGIC = re.compile(rb"[\xfd\xfe]")
_REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
_START = 0xFFFF


class Packet(NamedTuple):
    """One packet whose checksum is right.

    Attributes:
        layout: of its message; None for one that the dialect does not know, whose checksum nobody can check.
        system: number of the sender's system.
        component: of its component.
        sequence: the component's count of its packets, modulo 256.
        payload: of full length, zeros restored.
        checksum: as sent.
    """

    layout: Layout | None
    system: int
    component: int
    sequence: int
    payload: bytes
    checksum: int


class PacketReader:
    """Reads one stream; what a packet lacks may come with the next bytes.

    Args:
        layouts: messages by number.

    Attributes:
        counts: ``packets``, and of those ``packets_unknown`` (no message of the dialect), ``packets_signed`` (the
            signature is not verified) and ``packets_version_1``; ``packets_damaged`` (begun, but the checksum is
            wrong) and ``bytes_between`` (of no packet).
    """

    def __init__(self, layouts: Mapping[int, Layout]) -> None:
        self._layouts = layouts
        self._rest = b""
        self._in_step = True  # whether a packet begins where the last one ended
        kinds = ("", "_unknown", "_signed", "_version_1", "_damaged")
        self.counts = dict.fromkeys((*(f"packets{kind}" for kind in kinds), "bytes_between"), 0)

    def feed(self, data: bytes) -> list[Packet]:
        """The packets that these bytes complete, in their order; never an exception, whatever the bytes."""
        data = self._rest + data if self._rest else data
        found: list[Packet] = []
        counts, at, end = self.counts, 0, len(data)
        while at < end:
            magic = data[at]
            if magic != _V2 and magic != _V1:
                begin = _MAGIC.search(data, at)
                after = end if begin is None else begin.start()
                counts["bytes_between"] += after - at
                at, self._in_step = after, False
                continue
            length = _length(data, at)
            if end - at < length:
                break
            packet = self._packet(data, at, self._in_step)
            if packet is None:
                counts["packets_damaged"] += 1
                counts["bytes_between"] += 1
                at, self._in_step = at + 1, False
                continue
            found.append(packet)
            at, self._in_step = at + length, True
        self._rest = data[at:]
        counts["packets"] += len(found)
        return found

    def _packet(self, data: bytes, at: int, may_be_unknown: bool) -> Packet | None:
        """The packet that begins here and is here as a whole; None where its checksum is wrong."""
        size = data[at + 1]
        if data[at] == _V2:
            flags, begin = data[at + 2], at + 10
            sequence, system, component = data[at + 4], data[at + 5], data[at + 6]
            number = data[at + 7] | data[at + 8] << 8 | data[at + 9] << 16
        else:
            flags, begin = 0, at + 6
            sequence, system, component, number = data[at + 2], data[at + 3], data[at + 4], data[at + 5]
        close = begin + size
        checksum = data[close] | data[close + 1] << 8
        layout = self._layouts.get(number)
        if layout is None or flags & ~_SIGNED:  # flags that nobody knows may change what the bytes mean
            if not may_be_unknown or not self._is_framed(data, at):
                return None
            self.counts["packets_unknown"] += 1
            return Packet(None, system, component, sequence, b"", checksum)
        crc = crc_hqx(data[at + 1 : close].translate(_REVERSED), _START)
        crc = crc_hqx(_REVERSED[layout.checksum_extra : layout.checksum_extra + 1], crc)
        if _REVERSED[crc >> 8] != data[close] or _REVERSED[crc & 0xFF] != data[close + 1]:
            return None
        self.counts["packets_signed"] += flags
        self.counts["packets_version_1"] += data[at] == _V1
        payload = (
            data[begin : begin + min(size, layout.size)] if layout.wanted else b""
        )  # newer ones are longer
        return Packet(layout, system, component, sequence, payload.ljust(layout.size, b"\0"), checksum)

    def _is_framed(self, data: bytes, at: int) -> bool:
        """Whether what nobody can check is a packet after all: another begins behind it, and none that can be checked
        lies within it."""
        after = at + _length(data, at)
        if after < len(data) and data[after] not in (_V1, _V2):
            return False
        begins = (one.start() for one in _MAGIC.finditer(data, at + 1, after))
        return not any(
            one + _length(data, one) <= len(data) and self._packet(data, one, False) is not None
            for one in begins
        )


def _length(data: bytes, at: int) -> int:
    """Bytes of the packet that begins here; those of the head where not even that is here."""
    magic = data[at]
    head = _HEAD[magic]
    if len(data) - at < head:
        return head
    signed = magic == _V2 and data[at + 2] & _SIGNED
    return head + data[at + 1] + _CHECKSUM + (_SIGNATURE if signed else 0)
