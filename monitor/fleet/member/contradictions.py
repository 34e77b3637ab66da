"""Whether the channels that a vehicle sends contradict each other: what refuses a recorded flight, looked at live.

A look takes the latest two minutes and some fifteen milliseconds, so it is taken seldom: soon after the first samples,
and every five minutes later on.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from wingwatch.aircraft import Aircraft
from wingwatch.monitor.fleet.member.sample_ring import SampleRing
from wingwatch.telemetry import Cleaner, SampleBlock
from wingwatch.telemetry.plausibility import Verdict, check_flight

__all__ = ["Contradictions"]

_FIRST_S, _SOON_S, _LATER_S = 30.0, 60.0, 300.0
_SOON = 4
"""Looks until they become rare."""

_NOT_LIVE = ("held",)
"""A command that is held may be the autopilot's own rate, and a vehicle has no way to say so."""


@dataclass(slots=True)
class Contradictions:
    """What the looks at one vehicle's channels have found.

    Attributes:
        by_channel: the clause of each channel that contradicts others.
        looks: how many there have been; since_s: stamp of the first sample or of the latest look.
    """

    by_channel: dict[str, str] = field(default_factory=dict)
    looks: int = 0
    since_s: float | None = None

    @property
    def text(self) -> str:
        """One clause for the operator; empty where nothing contradicts."""
        return "; ".join(self.by_channel.values())

    def due(self, now_s: float) -> bool:
        """Whether it is time for a look, by the vehicle's own clock."""
        if self.since_s is None or now_s < self.since_s:
            self.since_s = now_s
        wait_s = _FIRST_S if self.looks == 0 else _SOON_S if self.looks < _SOON else _LATER_S
        return now_s - self.since_s >= wait_s

    def look(self, ring: SampleRing, aircraft: Aircraft, kinds: Mapping[str, str]) -> None:
        """Check the latest minutes; what was found stands until the same channel is found right.

        Args:
            ring: the latest samples.
            aircraft: as it is loaded.
            kinds: ``position`` or ``command`` of the surfaces.
        """
        time_s, values = ring.latest()
        columns = {name: values[:, i] for i, name in enumerate(ring.names)}
        block = SampleBlock.from_columns({"time_s": time_s, **columns})
        findings = check_flight(Cleaner().clean(block).block, kinds, aircraft)
        for one in findings:
            if one.standing is Verdict.RIGHT:
                self.by_channel.pop(one.channel, None)
        for one in findings:
            if one.standing is Verdict.REFUSAL and one.check not in _NOT_LIVE:
                self.by_channel[one.channel] = one.text
        self.looks += 1
        self.since_s = float(time_s[-1]) if time_s.size else self.since_s
