"""One simulated flight and the monitor that watches it.

Nothing that the simulation knows reaches the monitor but the channels of the flight.
"""

import itertools
import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.monitor import (
    Chain,
    MonitorStart,
    Report,
    VehicleMemory,
    VehicleMonitor,
    surface_kinds,
)
from wingwatch.monitor.detection.blocks import FOURIER, BlockView, ModeBlock
from wingwatch.monitor.detection.comparison import change_since
from wingwatch.simulation import (
    EFFECTS,
    Effect,
    Scenario,
    TurbulenceOnset,
    patrol,
)
from wingwatch.simulation.sensor_errors import SIMULATED
from wingwatch.studies.alert_history import AlertHistory, keep_alert
from wingwatch.studies.drawn_icing import drawn_icing
from wingwatch.studies.expectation import Expectations
from wingwatch.studies.grid import UNSENT
from wingwatch.studies.plan import FlightPlan, manoeuvres
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock, complete, derivations

__all__ = ["UNSENSED", "Observed", "ScoredBlock", "WatchedFlight", "effects_of", "scenario_of"]

Array = NDArray[np.float64]

UNSENSED = "pitch_demand_rad"
"""Follows from the motion, and no sensor may lose it."""
_RANK = 1e-9


def scenario_of(plan: FlightPlan, aircraft: Aircraft) -> Scenario:
    """The flight to be simulated.

    Raises:
        AircraftDataError, TrimError, ValueError: a flight that cannot be flown, in one sentence.
    """
    condition = plan.condition
    changes = (TurbulenceOnset(g.rms_m_s, g.onset_s, g.ramp_s) for g in plan.gusts)
    return Scenario(
        _noisier(aircraft, plan.noise_scale),
        plan.airspeed_true_m_s,
        plan.altitude_m,
        manoeuvres=manoeuvres(
            plan.excitation, aircraft, condition, plan.excitation_period_s, plan.excitation_start_s
        ),
        effects=(*effects_of(plan), *changes),
        turbulence=plan.air,  # type: ignore[arg-type]  # the grid takes the levels' words only
        turbulence_model=plan.turbulence_model,  # type: ignore[arg-type]
        seed=plan.seed,
        route=patrol(aircraft, condition) if plan.route == "patrol" else None,
    )


def _noisier(aircraft: Aircraft, scale: float) -> Aircraft:
    if scale == 1.0:
        return aircraft
    noise = {column: scale * std for column, std in aircraft.sensors.noise_std.items()}
    return aircraft.model_copy(update={"sensors": aircraft.sensors.model_copy(update={"noise_std": noise})})


def effects_of(plan: FlightPlan) -> tuple[Effect, ...]:
    """What befalls the aircraft; nothing in a healthy flight."""
    if plan.severity is None or plan.onset_s is None or plan.ramp_s is None:
        return ()
    if plan.effect == "icing":
        return (drawn_icing(plan.severity, plan.onset_s, plan.ramp_s, plan.target, plan.icing_factors),)
    return (EFFECTS[plan.effect](plan.severity, plan.onset_s, plan.ramp_s, plan.target),)


def _left_out(plan: FlightPlan) -> tuple[str, ...]:
    """Channels that the aircraft's sensors do not give."""
    return (*UNSENT.get(plan.sensors, ()), *UNSENT.get(plan.surfaces, ()))


class ScoredBlock(NamedTuple):
    """How far a block of a structure lies from its expectation: chi-square, and degrees of freedom."""

    structure: str
    end_s: float
    chi_square: float
    freedom: float


@dataclass(slots=True)
class Observed:
    """What a flight led to so far."""

    alerts: dict[str, AlertHistory] = field(default_factory=dict)
    """By id, in the order in which they were raised."""
    evidence: list[tuple[float, float]] = field(default_factory=list)
    """Time and log statistic of every verdict."""
    blocks: list[ScoredBlock] = field(default_factory=list)
    information: list[tuple[float, str, Array]] = field(default_factory=list)
    """End of a block, structure, and the information that it brought."""


class WatchedFlight:
    """One flight's monitor, and what it said."""

    def __init__(
        self,
        plan: FlightPlan,
        aircraft: Aircraft,
        expectations: Expectations,
        chains: dict[tuple[str, tuple[str, ...]], Chain],
    ) -> None:
        self.plan, self.aircraft = plan, aircraft
        self._given = tuple(c for c in SIMULATED if c not in _left_out(plan))
        self._lacking = [CHANNEL_INDEX[c] for c in _left_out(plan)]
        drawn = plan.expectation == "drawn"
        self.truth, self._drawn = expectations.exact(), drawn
        numbers = itertools.count(1)
        kind = plan.aircraft, self._given
        expected = expectations.drawn(plan.expectation_errors) if drawn else self.truth
        start = MonitorStart(
            memory=VehicleMemory(envelopes=expected), chain=None if drawn else chains.get(kind)
        )
        self.monitor = VehicleMonitor(
            aircraft, "study", str(plan.seed), [*self._given, *derivations(self._given)], surface_kinds(self._given),
            new_id=lambda: str(next(numbers)), start=start,
        )  # fmt: skip
        if not drawn:
            chains.setdefault(kind, self.monitor.chain.of_another())
        self.observed = Observed()
        self.samples = 0
        self.lost = False
        self.wall_s = self.processor_s = 0.0
        self._block: BlockView | None = None

    def sensed(self, values: Array) -> SampleBlock:
        """The next samples, as the flight's sensors report them; a flight that goes beyond all numbers ends there."""
        beyond = np.flatnonzero(~np.isfinite(values[:, CHANNEL_INDEX[UNSENSED]]))
        if beyond.size:
            self.lost = True
            values = values[: beyond[0]]
        self.samples += len(values)
        values = values.copy()
        values[:, self._lacking] = np.nan
        return complete(SampleBlock(values), self._given)

    def hear(self, report: Report) -> None:
        """What the monitor made of them."""
        observed, monitor = self.observed, self.monitor
        now_s = self.samples / self.plan.rate_hz
        for alert in (*report.alerts, *monitor.active_alerts):  # sizes move without a word, too
            keep_alert(observed.alerts, alert, now_s)
        block = monitor.last_block
        if block is None or block is self._block:
            return
        self._block = block
        if monitor.last_verdict is not None:
            observed.evidence.append((block.end_s, monitor.last_verdict.log_statistic))
        for name, mode in block.modes.items():
            score = ScoredBlock(name, block.end_s, *self._score(mode))
            if math.isfinite(score.chi_square):
                observed.blocks.append(score)
        for solution in report.solutions:
            for name, mode_solution in solution.modes.items():
                found = mode_solution.block
                if name in block.modes and found is not None:
                    at = monitor.judge.coordinates[name].at(block.condition)
                    information, _ = at.of_evidence(found.information, found.vector)
                    if mode_solution.reconstructed:  # the monitor goes by the filter alone
                        information = block.modes[name].evidence.information[FOURIER]
                    observed.information.append((block.end_s, name, information))

    def _score(self, mode: ModeBlock) -> tuple[float, float]:
        """Chi-square of expectation minus block value over the covariance stated of both, and degrees of freedom.

        An exact expectation has no error; a drawn one that which the file states. The bias that gusts are expected to
        have caused counts as error, as it does for the monitor.
        """
        information, vector, bias = (part[FOURIER] for part in mode.evidence)
        covariance = mode.expected_covariance if self._drawn else np.zeros_like(information)
        bias = np.linalg.pinv(information, rcond=_RANK, hermitian=True) @ bias
        natural = np.ones(mode.expected.size)
        change = change_since(mode.expected, covariance, information, vector, np.outer(bias, bias), natural)
        scale = np.sqrt(
            np.maximum(np.diagonal(change.precision), 0.0)
        )  # what is next to nothing may be rounded below it
        seen = scale > 0.0
        if not seen.any():
            return 0.0, 0.0
        precision = change.precision[np.ix_(seen, seen)] / np.outer(scale[seen], scale[seen])
        vector = change.score[seen] / scale[seen]
        freedom = float(np.linalg.matrix_rank(precision, tol=_RANK * precision.shape[0], hermitian=True))
        return float(vector @ np.linalg.pinv(precision, rcond=_RANK, hermitian=True) @ vector), freedom
