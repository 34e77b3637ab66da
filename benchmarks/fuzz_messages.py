"""Messages of a fuzzer that knows the contract: valid ones of simulated flights, and what it makes of them.

Each message begins as the next one of a vehicle's flight and is then changed in its values, clock, numbers, columns,
types or bytes, in JSON and protobuf. Everything follows from one seed.
"""

import math
import random
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import orjson

from wingwatch.telemetry import CHANNEL_INDEX, CHANNELS, JSON, PROTOBUF, SampleBlock, vehicle_key
from wingwatch.telemetry.protocol import vehicle_pb2

__all__ = ["Fuzzer", "Sent", "Victim"]

MAX_SAMPLES, MAX_BYTES = 1000, 65_536
LARGEST = sys.float_info.max
EXTREMES = (
    0.0, -0.0, 5e-324, -5e-324, sys.float_info.min, 1e-300, 1e-9, 1.0, -1.0, 1e9, -1e9, 2.0**31, 2.0**32, -(2.0**32),
    2.0**53, 1e15, 1e154, 1e155, 1e300, LARGEST, -LARGEST, math.inf, -math.inf, math.nan,
)  # fmt: skip
AIRSPEEDS = (-10.0, -0.2, 0.0, 5e-324, 0.999, 1.0, 1.001, 5.0, 60.0, 399.9, 400.0, 400.1, 1e308, math.nan)
STEPS_S = (
    0.0, 5e-324, 1e-12, 1e-6, 0.001, 0.02, 0.1, 0.49, 0.5, 1.0, 10.0, 3599.0, 3601.0, 1e6, -0.02, -0.5, -2.0,
    -1e6,
)  # fmt: skip
STARTS_S = (
    0.0, -0.0, 5e-324, 1e-300, -1.0, -86_400.0, 1.7e9, 2.0**32, 2.0**32 - 1.0, -(2.0**32), 9e15, 1e300,
    math.nan,
)  # fmt: skip
SEQUENCES = (0, 1, 2, 2**31, 2**32 - 1, 2**32, 2**53 - 1, 2**53, 2**63 - 1, 2**63, 2**64 - 2, 2**64 - 1)
MASSES_KG = (
    0.0, -0.0, 5e-324, -1.0, 1e-9, 3.0, 10.0, 11.0, 11.1, 12.0, 25.0, 1e5, 1e6, 1e308, math.nan, math.inf,
)  # fmt: skip
SHIFTS_M = (0.0, -0.0, 5e-324, 0.001, 0.01, -0.01, 0.05, 1.0, -100.0, 100.1, math.nan, -math.inf)
NAMES = (
    "", " ", "\x00", "\x1b[2J", "\r\nINFO all is well", "é", "Ω" * 40, "\u202egnirts", "\ufeff", "𝕏" * 20, "a" * 300,
    "../../etc/passwd", "<script>alert(1)</script>", "time_s ", "TIME_S", "%s%n", "__class__", "null", "-",
    "a" * 60_000,
)  # fmt: skip
ENCODINGS = (
    "", "zenoh/bytes", "zenoh/string", "text/plain", "text/json", "application/json;charset=latin-1",
    "APPLICATION/JSON ",
    "application/octet-stream", "application/x-protobuf", "image/png", "\x00", "é" * 500, "a/" * 5000, ";;;",
)  # fmt: skip
LITERALS = (
    b"NaN", b"Infinity", b"-Infinity", b"1e400", b"-1e999", b"1e-400", b"0." + b"0" * 400 + b"1", b"9" * 400,
    b"-" + b"9" * 30,
    b"18446744073709551616", b"0x10", b"01", b"+1", b"1.", b".5", b"--1", b"true", b"null", b'"1"', b'"NaN"',
    b'"-Infinity"',
    b"[]", b"{}", b'{"a":[1]}', b'"\\ud800"', b'"\\u0000"', b"'1'", b"1,", b"/*1*/1", b"",
)  # fmt: skip
OTHERS: tuple[Any, ...] = (
    None, True, False, "", "1", "NaN", "Infinity", "17", "\uff11\uff17", -1, 1.5, 2**63, -(2**63), [], {}, [[]], [None],
    {"a": 1},
    [1, [2]], "é" * 100,
)  # fmt: skip
AIRCRAFT = (
    "aerosonde", "aerosonde-a", "twinotter", "ultrastick25e", "jetstream31", "lagging", "aerosonde ", "AEROSONDE",
    "none",
    "../aerosonde", "aerosonde.toml", "/etc/passwd", "a" * 128, "a" * 129,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Sent:
    """A message as it goes out.

    Attributes:
        key: a key expression, not always one of the contract's.
        change: the name of the first change that was made; ``valid`` without any.
    """

    key: str
    payload: bytes
    encoding: str
    change: str


@dataclass(slots=True)
class Victim:
    """A vehicle in whose name messages are made up.

    Attributes:
        flight: what it flies, over and over, on a clock that goes on.
        columns: the same as lists; row: the next sample; clock_s: added to its stamps; sequence: of the next message.
    """

    name: str
    aircraft: str
    flight: SampleBlock
    row: int = 0
    clock_s: float = 0.0
    sequence: int = 0
    stream: int | None = None
    columns: dict[str, list[float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.columns = {name: self.flight.column(name).tolist() for name in self.flight.present}


@dataclass(slots=True)
class Draft:
    """A sensors message while it is being changed."""

    sequence: Any
    stream: Any
    columns: dict[str, Any]
    encoding: str = JSON
    victim: Victim | None = None
    more: dict[str, Any] = field(default_factory=dict)

    @property
    def rows(self) -> int:
        """Samples, by its stamps."""
        stamps = self.columns.get("time_s")
        return len(stamps) if isinstance(stamps, list) else 0


class Fuzzer:
    """Makes messages, one after another.

    Args:
        rng: all chance comes from it.
        victims: vehicles with a flight, in whose name most messages go out.
        dear: how many in a thousand messages have as many samples as may be, and how many another loading.
    """

    def __init__(self, rng: random.Random, victims: Sequence[Victim], dear: float = 0.3) -> None:
        self._rng, self._victims, self._dear = rng, victims, dear
        self._kept: list[tuple[str, bytes, str]] = []
        self._strangers = 0
        self._changes: tuple[tuple[Callable[[Draft], None], float], ...] = (
            (self._extreme_values, 4.0), (self._other_clock, 4.0), (self._airspeeds, 2.0), (self._numbers, 1.0),
            (self._other_stream, 0.3), (self._other_columns, 3.0), (self._lengths, 1.0), (self._field_names, 1.0),
            (self._other_types, 2.0),
        )  # fmt: skip

    def message(self) -> Sent:
        """The next message."""
        kind = self._rng.random()
        if kind < 0.06:
            return self._announcement()
        if kind < 0.10:
            return self._repeated()
        victim = self._rng.choice(self._victims)
        draft = self._next_of(victim, self._rows())
        change = "valid"
        if kind > 0.14:
            numbers = range(len(self._changes))
            weights = [weight for _, weight in self._changes]
            for number in sorted(self._rng.choices(numbers, weights, k=self._rng.choice((0, 1, 1, 2, 3)))):
                one = self._changes[number][0]  # types and names last
                change = one.__name__.strip("_") if change == "valid" else change
                one(draft)
        payload = self._encoded(draft)
        if kind > 0.8:
            payload, name = self._damaged(payload, draft)
            change = name if change == "valid" else change
        self._kept = [*self._kept[-200:], (victim.name, payload, draft.encoding)]
        return Sent(self._key(victim.name, "sensors"), payload, self._label(draft.encoding), change)

    def _rows(self) -> int:
        if self._rng.random() * 1000.0 < self._dear:
            return MAX_SAMPLES
        return self._rng.choice((0, 1, 1, 1, 2, 3, 5, 10))

    def _next_of(self, victim: Victim, rows: int) -> Draft:
        """The vehicle's next samples, as it would send them."""
        if victim.row + rows > len(victim.flight):
            victim.clock_s += float(victim.flight.time_s[-1] - victim.flight.time_s[0]) + 0.02
            victim.row = 0
        columns = {name: column[victim.row : victim.row + rows] for name, column in victim.columns.items()}
        columns["time_s"] = [t + victim.clock_s for t in columns["time_s"]]
        victim.row += rows
        if rows > 200:  # as many samples as the payload takes
            columns = {
                name: [float(f"{v:.2g}") for v in c] for name, c in columns.items() if name != "time_s"
            }
            columns["time_s"] = [victim.clock_s + 0.02 * i for i in range(rows)]
        if self._rng.random() < 0.005:  # it is started again
            victim.sequence, victim.stream = 0, self._rng.choice((None, self._rng.randrange(2**64)))
        victim.sequence += 1
        return Draft(victim.sequence - 1, victim.stream, columns, self._rng.choice((JSON, PROTOBUF)), victim)

    def _key(self, name: str, leaf: str) -> str:
        chance = self._rng.random()
        if chance > 0.04:
            return vehicle_key("default", name, leaf)
        if chance > 0.015:
            self._strangers += 1
            return vehicle_key(self._rng.choice(("default", "other")), f"x{self._strangers}", leaf)
        strange = self._rng.choice(NAMES)
        return self._rng.choice(
            (f"wingwatch/v1/default/{strange}/{leaf}", f"wingwatch/v1/{strange}", strange)
        )

    def _label(self, encoding: str) -> str:
        chance = self._rng.random()
        if chance > 0.06:
            return encoding
        return self._rng.choice(ENCODINGS) if chance > 0.02 else self._rng.choice((JSON, PROTOBUF))

    def _repeated(self) -> Sent:
        """One that has been sent before, in the same name or another's."""
        if not self._kept:
            return self._announcement()
        name, payload, encoding = self._rng.choice(self._kept)
        if self._rng.random() < 0.3:
            name = self._rng.choice(self._victims).name
        return Sent(self._key(name, "sensors"), payload, encoding, "repeated")

    # -- values --------------------------------------------------------------------------------

    def _some(self, draft: Draft) -> list[str]:
        names = [name for name, column in draft.columns.items() if isinstance(column, list) and column]
        names = [name for name in names if name in CHANNEL_INDEX]
        return self._rng.sample(names, min(len(names), self._rng.choice((1, 1, 2, 3, len(names)))))

    def _extreme_values(self, draft: Draft) -> None:
        for name in self._some(draft):
            column = draft.columns[name]
            low, high = next(((c.low, c.high) for c in CHANNELS if c.name == name), (0.0, 1.0))
            ends = (low, high, math.nextafter(low, -math.inf), math.nextafter(high, math.inf))
            value = self._rng.choice(
                (self._rng.choice(EXTREMES), self._rng.choice(ends), self._rng.choice(ends))
            )
            whole = self._rng.random() < 0.5
            for k in range(len(column)) if whole else (self._rng.randrange(len(column)),):
                column[k] = value

    def _other_clock(self, draft: Draft) -> None:
        rows, rng = draft.rows, self._rng
        if not rows:
            return
        stamps = draft.columns["time_s"]
        start = stamps[0] if rng.random() < 0.6 else rng.choice(STARTS_S)
        if rng.random() < 0.2:
            draft.columns["time_s"] = [start + rng.choice(STEPS_S) * rng.random() for _ in range(rows)]
        else:
            step = rng.choice(STEPS_S)
            draft.columns["time_s"] = [start + step * k for k in range(rows)]

    def _airspeeds(self, draft: Draft) -> None:
        name = self._rng.choice(("airspeed_true_m_s", "airspeed_true_m_s", "airspeed_indicated_m_s"))
        draft.columns[name] = [self._rng.choice(AIRSPEEDS)] * draft.rows

    def _numbers(self, draft: Draft) -> None:
        rng = self._rng
        near = (int(draft.sequence) if type(draft.sequence) is int else 0) + rng.choice(
            (-3, -1, 1, 7, 10**6, 10**6 + 1)
        )
        draft.sequence = rng.choice((rng.choice(SEQUENCES), *(min(max(near, 0), 2**64 - 1),) * 2))

    def _other_stream(self, draft: Draft) -> None:
        rng = self._rng
        draft.stream = rng.choice((None, 0, 1, 4711, 2**53, 2**63, 2**64 - 1, rng.randrange(2**64)))
        if draft.victim is not None and rng.random() < 0.3:  # it goes on so
            draft.victim.stream, draft.victim.sequence = draft.stream, rng.choice((0, draft.victim.sequence))

    def _other_columns(self, draft: Draft) -> None:
        rng = self._rng
        for _ in range(rng.choice((1, 2, 5))):
            name = rng.choice(CHANNELS).name
            if name in draft.columns:
                del draft.columns[name]
            else:
                draft.columns[name] = [rng.choice(EXTREMES) for _ in range(draft.rows)]
        if rng.random() < 0.05:
            draft.columns = {name: draft.columns[name] for name in ("time_s",) if name in draft.columns}

    def _lengths(self, draft: Draft) -> None:
        for name in self._some(draft):
            column = draft.columns[name]
            draft.columns[name] = self._rng.choice((column[:-1], column * 2, [], [*column, 0.0]))
        if self._rng.random() < 0.02:
            draft.columns = {name: [0.0] * (MAX_SAMPLES + 1) for name in list(draft.columns)[:8]}

    # -- types and names: JSON only ---------------------------------------------------------------

    def _other_types(self, draft: Draft) -> None:
        draft.encoding = JSON
        where = self._rng.random()
        other = self._rng.choice(OTHERS)
        if where < 0.2:
            draft.sequence = other
        elif where < 0.4:
            draft.stream = other
        elif where < 0.6:
            draft.columns[self._rng.choice(CHANNELS).name] = other
        else:
            for name in self._some(draft):
                column = list(draft.columns[name])
                column[self._rng.randrange(len(column))] = other
                draft.columns[name] = column

    def _field_names(self, draft: Draft) -> None:
        draft.encoding = JSON
        target = draft.columns if self._rng.random() < 0.6 else draft.more
        target[self._rng.choice(NAMES)] = self._rng.choice((draft.columns.get("time_s"), *OTHERS))

    # -- bytes ----------------------------------------------------------------------------------

    def _encoded(self, draft: Draft) -> bytes:
        if draft.encoding == PROTOBUF:
            try:
                message = vehicle_pb2.Sensors(sequence=draft.sequence, stream=draft.stream)
                for name, column in draft.columns.items():
                    getattr(message.columns, name).extend(column)
                return message.SerializeToString()
            except (TypeError, ValueError, AttributeError):
                draft.encoding = JSON  # protobuf cannot say it
        named = {} if draft.stream is None else {"stream": draft.stream}
        return orjson.dumps({"sequence": draft.sequence, **named, "columns": draft.columns, **draft.more})

    def _damaged(self, payload: bytes, draft: Draft) -> tuple[bytes, str]:
        rng = self._rng
        at = rng.randrange(len(payload) + 1)
        kind = rng.randrange(9)
        if kind == 0:
            return payload[:at], "truncated"
        if kind == 1 and payload:
            flipped = bytearray(payload)
            for _ in range(rng.choice((1, 1, 2, 8, 64))):
                flipped[rng.randrange(len(flipped))] ^= 1 << rng.randrange(8)
            return bytes(flipped), "bits_flipped"
        if kind == 2:
            return payload[:at] + rng.randbytes(rng.choice((1, 2, 8, 100))) + payload[at:], "bytes_inserted"
        if kind == 3:
            return payload * rng.choice((2, 2, 3)), "doubled"
        if kind == 4:
            return payload + self._unknown_field(), "unknown_field"
        if kind == 5:
            return rng.choice((b" ", b"\n", b"\xef\xbb\xbf", b"\x00", b"{")) * rng.choice(
                (1, 1, 10, 1000)
            ) + payload, "prefixed"
        if kind == 6 and draft.encoding == JSON:
            return payload.replace(
                rng.choice((b"0.0", b"null", b"1", b"2", b",")), rng.choice(LITERALS), 1
            ), "literal"
        if kind == 7 and rng.random() < 0.05:
            return self._large(), "large"
        if kind == 8 and rng.random() < 0.3:
            return self._nested(), "nested"
        return payload[:at] + payload[at + rng.choice((1, 2, 8)) :], "bytes_removed"

    def _unknown_field(self) -> bytes:
        """A field that the schema does not have, or one that it has in another wire type."""
        rng = self._rng
        tag = rng.choice((1, 2, 3, 4, 15, 31, 1000)) << 3 | rng.choice((0, 1, 2, 3, 4, 5, 7))
        varint = bytes((tag,)) if tag < 128 else bytes((tag & 127 | 128, tag >> 7))
        rest = rng.choice(
            (b"", b"\x00", b"\xff" * 9 + b"\x01", b"\x08\x96\x01", rng.randbytes(8), b"\xff" * 12)
        )
        return (varint + rest) * rng.choice((1, 1, 1, 100))

    def _large(self) -> bytes:
        rng = self._rng
        size = rng.choice((MAX_BYTES - 1, MAX_BYTES, MAX_BYTES + 1))
        filler = rng.choice((b"\x00", b"[", b" ", b"{", b"\x0b", b"\x80", b"\xa2\x06\x00", b'"'))
        return (rng.choice((b"", b'{"columns":')) + filler * size)[:size]

    def _nested(self) -> bytes:
        depth = self._rng.choice((10, 500, 990, 1000, 1023, 1024, 5000, 30_000))
        inner, begin, end = self._rng.choice(((b"1", b"[", b"]"), (b"1", b'{"a":', b"}")))
        deep = begin * depth + inner + end * depth
        return self._rng.choice((
            deep, b'{"columns":' + deep + b"}", b'{"sequence":' + deep + b',"columns":{}}',
            b'{"columns":{"time_s":[' + deep + b"]}}", b'{"columns":{"time_s":' + deep + b"}}",
            b'{"aircraft":' + deep + b"}",
        ))  # fmt: skip

    # -- aircraft messages ------------------------------------------------------------------------

    def _announcement(self) -> Sent:
        rng, victim = self._rng, self._rng.choice(self._victims)
        fields: dict[str, Any] = {"aircraft": victim.aircraft}
        if rng.random() < 0.5:  # its own, another's, or nonsense
            fields["stream"] = rng.choice(
                (victim.stream, victim.stream, rng.choice(SEQUENCES), rng.choice(OTHERS))
            )
        change, encoding = "announced", rng.choice((JSON, PROTOBUF))
        chance = rng.random()
        if chance > 0.5:
            change = "announced_otherwise"
            self._other_fields(fields)
        payload = self._encoded_aircraft(fields, encoding)
        if chance > 0.8:
            payload, change = self._damaged(payload, Draft(0, None, {}, encoding))
        return Sent(self._key(victim.name, "aircraft"), payload, self._label(encoding), change)

    def _other_fields(self, fields: dict[str, Any]) -> None:
        rng = self._rng
        which = rng.randrange(6)
        if which == 0 and rng.random() < 0.2:  # another type takes a new monitor
            fields["aircraft"] = rng.choice(AIRCRAFT)
        elif which == 1 and rng.random() < 0.1:
            fields["configuration"] = rng.choice(("clean", "flaps", "x" * 64, "x" * 65))
        elif which == 2:
            fields[rng.choice(("aircraft", "configuration", "mass_kg", *NAMES))] = rng.choice(OTHERS)
        elif which == 3:
            fields[rng.choice(("aircraft", "configuration"))] = rng.choice(NAMES)
        elif rng.random() * 20.0 < self._dear:
            fields["mass_kg"] = rng.choice(MASSES_KG)
            fields["cg_shift_m"] = rng.choice(SHIFTS_M)
        else:
            fields[rng.choice(("mass_kg", "cg_shift_m"))] = rng.choice(
                (-1.0, 1e308, math.nan, math.inf, -math.inf, 5e-324)
            )

    def _encoded_aircraft(self, fields: dict[str, Any], encoding: str) -> bytes:
        if encoding == PROTOBUF:
            try:
                return vehicle_pb2.Aircraft(**fields).SerializeToString()
            except (TypeError, ValueError):
                pass  # protobuf cannot say it
        return orjson.dumps(fields)
