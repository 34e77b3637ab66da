"""One vehicle of a MAVLink link: its messages in, its samples out."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf, isfinite, nan
from typing import Any

import numpy as np

from wingwatch.telemetry.logs.link_facts import AUTOPILOTS, boot_s, next_wrap_s, parameter_value, vehicle_word
from wingwatch.telemetry.logs.log import AutopilotLog, LogError, topic_key
from wingwatch.telemetry.maps import MapError
from wingwatch.telemetry.mavlink.boot_clock import BootClock, Stamp
from wingwatch.telemetry.mavlink.dialect import HEARTBEAT, PARAM_VALUE, Layout
from wingwatch.telemetry.mavlink.live_table import HISTORY_S, SILENT_S, LivePlan, LiveTable, live_plan
from wingwatch.telemetry.mavlink.packets import Packet
from wingwatch.telemetry.mavlink.topic_buffer import TopicBuffer
from wingwatch.telemetry.sample import SURFACE_CHANNELS, SampleBlock

__all__ = ["LinkVehicle", "Piece"]

_FIRST_PLAN_S = 2.0
_PARAMETERS_S = 10.0
_PLAN_S = 15.0
_AGAIN_S = 1.0
_AWAITED_S = 2.0
_MOST_PARAMETERS = 4096
_SURFACE_PARAMETERS = ("SERVO", "RC", "CA_SV_CS", "PWM_", "ELEVON", "VTAIL", "FLAPERON")
_NO_CHANNELS = frozenset(("SYSTEM_TIME",))


@dataclass(frozen=True, slots=True)
class Piece:
    """Samples of a vehicle.

    Attributes:
        block: in their order.
        columns: channels that the vehicle has.
        stream: number of the stream; a vehicle that was started anew begins another.
    """

    block: SampleBlock
    columns: tuple[str, ...]
    stream: int


@dataclass(slots=True)
class _Heartbeat:
    """What a vehicle says it is."""

    autopilot: str = ""
    kind: int = -1
    first_s: float = nan


@dataclass(slots=True)
class _Counts:
    """Readings dropped, of all streams; and samples made."""

    repeated: int = 0
    late: int = 0
    overflow: int = 0
    unplaced: int = 0
    samples: int = 0
    unbridged: dict[str, int] = field(default_factory=dict)


class LinkVehicle:
    """Messages of one vehicle's autopilot become samples on its clock.

    Args:
        name: of the vehicle.
        travel_rad: deflections at full travel by channel.
        patient: whether surfaces' parameters are waited for before the first sample is made.

    Attributes:
        clock: of the vehicle.
        parameters: as received last.
        heartbeat: what it says it is.
        counts: of readings and samples.
        streams: how many there were.
    """

    def __init__(self, name: str, travel_rad: Mapping[str, float], patient: bool = True) -> None:
        self.name = name
        self.clock = BootClock()
        self.parameters: dict[str, float] = {}
        self.heartbeat = _Heartbeat()
        self.counts = _Counts()
        self.streams = 1
        self._surface_parameters: dict[str, float] = {}
        self._raw_parameters: dict[str, tuple[float, int]] = {}
        self._travel_rad = travel_rad
        self._patient = patient
        self._buffers: dict[str, TopicBuffer] = {}
        self._doubtful: list[tuple[Layout, bytes, float]] = []
        self._table: LiveTable | None = None
        self._plan_due_s, self._planned_s, self._signature = -inf, -inf, frozenset[str]()
        self._ready: list[Piece] = []

    @property
    def is_multicopter(self) -> bool:
        """Whether nothing is to be published of it."""
        return self.heartbeat.kind >= 0 and vehicle_word(self.heartbeat.kind) == "multicopter"

    @property
    def plan(self) -> LivePlan | None:
        """How its topics become samples; None before that is known."""
        return None if self._table is None else self._table.plan

    def accept(self, packet: Packet, received_s: float) -> None:
        """One packet of the vehicle's autopilot.

        Args:
            packet: of a message that is wanted.
            received_s: when its bytes came, on the receiver's clock.
        """
        layout = packet.layout
        if layout is None:
            return
        if layout.is_topic:
            self._take(layout, packet.payload, received_s)
        elif layout.name == HEARTBEAT:
            self._beat(_record(layout, packet.payload), received_s)
        elif layout.name == PARAM_VALUE:
            self._set_parameter(_record(layout, packet.payload))

    def step(self, now_s: float, final: bool = False) -> list[Piece]:
        """Samples that are due.

        Args:
            now_s: on the receiver's clock.
            final: nothing more comes.
        """
        if self.heartbeat.kind >= 0 and not self.is_multicopter:
            self._plan(now_s)
            self._make(now_s, final)
        ready, self._ready = self._ready, []
        return ready

    def rates_hz(self) -> dict[str, float]:
        """Rate of new readings by channel, as planned."""
        return {} if self.plan is None else {n: one.rate_hz for n, one in self.plan.channels.items()}

    def dropped(self) -> dict[str, int]:
        """Readings dropped, by the reason."""
        buffers = self._buffers.values()
        return {
            "readings_repeated": self.counts.repeated + sum(one.repeated for one in buffers),
            "readings_late": self.counts.late + sum(one.late for one in buffers),
            "readings_off_clock": self.clock.off,
            "readings_unplaced": self.counts.unplaced,
            "readings_overflow": self.counts.overflow + sum(one.overflow for one in buffers),
        }

    # -- messages ------------------------------------------------------------------------------

    def _take(self, layout: Layout, payload: bytes, received_s: float) -> None:
        stamp_s = self._stamp_s(layout, payload)
        if not isfinite(stamp_s):
            if self.clock.offset_s == inf:
                self.counts.unplaced += 1
            else:
                self._add(layout, payload, self.clock.placed(received_s))
            return
        verdict = self.clock.stamped(stamp_s, received_s)
        if verdict is Stamp.GOOD:
            self._doubtful.clear()
            self._add(layout, payload, stamp_s)
            return
        self._doubtful.append((layout, payload, stamp_s))
        if verdict is Stamp.DOUBTFUL:
            del self._doubtful[:-3]
            return
        if verdict is Stamp.RESTART:
            self._restart(received_s)
        for one in self._doubtful:
            self._add(*one)
        self._doubtful.clear()

    def _stamp_s(self, layout: Layout, payload: bytes) -> float:
        if layout.stamp is None:
            return nan
        start, size, unit = layout.stamp
        value = int.from_bytes(payload[start : start + size], "little")
        stamp_s = boot_s(value, None) if unit == 1e-3 else boot_s(None, value)
        return next_wrap_s(stamp_s, self.clock.newest_s) if layout.wraps else stamp_s

    def _add(self, layout: Layout, payload: bytes, stamp_s: float) -> None:
        if layout.name in _NO_CHANNELS:
            return
        instance = 0 if layout.instance is None else payload[layout.instance]
        key = topic_key(layout.name, instance)
        buffer = self._buffers.get(key)
        if buffer is None:
            if instance > 1:
                return
            buffer = self._buffers[key] = TopicBuffer(layout, instance)
        buffer.add(stamp_s, payload)

    def _beat(self, record: Any, received_s: float) -> None:
        if not isfinite(self.heartbeat.first_s):
            self.heartbeat.first_s = received_s
        autopilot = AUTOPILOTS.get(int(record["autopilot"]), "")
        self.heartbeat.kind = int(record["type"])
        if autopilot != self.heartbeat.autopilot:  # it says how the parameters before it are to be read
            self.heartbeat.autopilot = autopilot
            for name in self._raw_parameters:
                self._keep_parameter(name)

    def _set_parameter(self, record: Any) -> None:
        name = bytes(record["param_id"]).split(b"\0")[0].decode("ascii", "replace")
        if len(self._raw_parameters) < _MOST_PARAMETERS or name in self._raw_parameters:
            self._raw_parameters[name] = float(record["param_value"]), int(record["param_type"])
            self._keep_parameter(name)

    def _keep_parameter(self, name: str) -> None:
        value = parameter_value(*self._raw_parameters[name], self.heartbeat.autopilot)
        self.parameters[name] = value
        if name.startswith(_SURFACE_PARAMETERS) and self._surface_parameters.get(name) != value:
            self._surface_parameters[name] = value
            self._plan_due_s = -inf

    def _restart(self, received_s: float) -> None:
        """What is of the clock before goes out; then another stream begins."""
        if self._table is not None:
            self._make(received_s, final=True)
        for buffer in self._buffers.values():
            self.counts.repeated += buffer.repeated
            self.counts.late += buffer.late
            self.counts.overflow += buffer.overflow
        self._buffers.clear()
        self._table, self._plan_due_s, self._planned_s = None, -inf, -inf
        self.heartbeat.first_s = received_s
        self.streams += 1

    # -- samples -------------------------------------------------------------------------------

    def _log(self, topics: bool) -> AutopilotLog:
        """The last seconds as a log."""
        newest_s = self.clock.newest_s
        found = {key: one.topic(newest_s - HISTORY_S) for key, one in self._alive().items()} if topics else {}
        name = self.heartbeat.autopilot
        kind = vehicle_word(self.heartbeat.kind)
        return AutopilotLog(self.name, "tlog", name, kind, name, found, self._surface_parameters)

    def _alive(self) -> dict[str, TopicBuffer]:
        oldest_s = self.clock.newest_s - SILENT_S
        return {key: one for key, one in self._buffers.items() if one.newest_s > oldest_s}

    def _plan(self, now_s: float) -> None:
        """Chooses sources and clock: at first, where topics come or go, and now and then."""
        waited_s = now_s - self.heartbeat.first_s
        if (
            not isfinite(self.clock.newest_s)
            or waited_s < _FIRST_PLAN_S
            or now_s - self._planned_s < _AGAIN_S
        ):
            return
        signature = frozenset(self._alive())
        if now_s < self._plan_due_s and signature == self._signature:
            return
        self._plan_due_s, self._planned_s, self._signature = now_s + _PLAN_S, now_s, signature
        try:
            plan = live_plan(self._log(topics=True), self._travel_rad)
        except (LogError, MapError):
            self._plan_due_s = -inf  # nothing that could be the clock has come yet
            return
        if self._table is None:
            surfaces = any(name in plan.channels for name in SURFACE_CHANNELS)
            if self._patient and not surfaces and waited_s < _PARAMETERS_S:
                self._plan_due_s = -inf
                return
            self._table = LiveTable(self._buffers, plan)
            self._wait_for(plan)
            return
        former = self._table.plan
        plan = plan.with_kept(former, signature)
        self._wait_for(plan)
        if not former.agrees(plan):
            self._make(now_s, final=False)
            self._table.plan = plan

    def _wait_for(self, plan: LivePlan) -> None:
        """A channel that may come to life is looked for sooner."""
        if plan.awaits:
            self._plan_due_s = min(self._plan_due_s, self._planned_s + _AWAITED_S)

    def _make(self, now_s: float, final: bool) -> None:
        table = self._table
        if table is None:
            return
        newest_s = max(self.clock.newest_s, self.clock.placed(now_s)) if not final else self.clock.newest_s
        block = table.rows(self._log(topics=False), newest_s, final)
        if block is None:
            return
        self.counts.samples += len(block)
        self.counts.unbridged = table.unbridged
        self._ready.append(Piece(block, table.plan.wire_columns, self.streams))


def _record(layout: Layout, payload: bytes) -> Any:
    return np.frombuffer(payload, dtype=layout.dtype)[0]
