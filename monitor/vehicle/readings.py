"""What a vehicle's monitor says of its vehicle, from what it remembers; ``VehicleMonitor`` does the remembering."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft, FlightCondition, ModeStructure, mode_quantities
from wingwatch.baselines import Expectation, OutOfEnvelope, Reference
from wingwatch.estimators import Estimate
from wingwatch.monitor.detection.alerts import AlertBook
from wingwatch.monitor.detection.blocks import BlockView
from wingwatch.monitor.detection.cell_memory import CellBook
from wingwatch.monitor.detection.could_see import beside_lacking, could_see
from wingwatch.monitor.detection.furthest import PendingWorst, furthest
from wingwatch.monitor.detection.judge import Judge
from wingwatch.monitor.detection.judge_state import JudgeConfig, JudgeState, Verdict
from wingwatch.monitor.detection.redundancy import VehicleRelations
from wingwatch.monitor.detection.surfaces_seen import SurfaceWatch
from wingwatch.monitor.detection.vehicle_alerts import VehicleAlerts
from wingwatch.monitor.estimation.air_watch import PendingAir
from wingwatch.monitor.estimation.chain import Chain, ChainState, Solution, condition_of
from wingwatch.monitor.estimation.lacking_surfaces import derivatives_by
from wingwatch.monitor.estimation.mode_solution import COMPARED_SO, NO_VANE
from wingwatch.monitor.positions import Position
from wingwatch.monitor.record_views import BlockRecord
from wingwatch.monitor.vehicle.flight_record import block_record
from wingwatch.monitor.vehicle.mode_object import mode_object
from wingwatch.monitor.vehicle.state import WatchMemory
from wingwatch.monitor.views import AlertView, CouldSeeView, VehicleState, VehicleView, WorstDerivative
from wingwatch.telemetry import Aligner, Cleaner
from wingwatch.telemetry.conditioning import AirQuality

__all__ = ["VehicleReadings", "note_worst", "suspected"]

Array = NDArray[np.float64]

_COULD_SEE_S = 30.0


class VehicleReadings:
    """Answers about one vehicle; none of them changes what its monitor will say next.

    Attributes:
        fleet, vehicle: its name; configuration: of the aircraft.
        cleaner: of its samples.
        chain, chain_state: estimators, and where they are.
        judge: of its blocks; cells: memory by cell of the envelope; book: the airframe's alert.
    """

    fleet: str
    vehicle: str
    aircraft: Aircraft
    configuration: str
    cleaner: Cleaner
    chain: Chain
    chain_state: ChainState
    judge: Judge
    cells: CellBook
    book: AlertBook
    _aligner: Aligner
    _judge_state: JudgeState
    _compared: tuple[ModeStructure, ...]
    _memory: WatchMemory
    _alerts: VehicleAlerts
    _relations: VehicleRelations
    _stated: Mapping[str, str]
    _surfaces: SurfaceWatch
    _could_see: tuple[float, Sequence[CouldSeeView]] | None
    _worst: tuple[Solution, WorstDerivative | None] | None

    @property
    def active_alerts(self) -> list[AlertView]:
        """All alerts in force, worst first."""
        return self._alerts.active

    def onset_s(self, alert_id: str) -> float | None:
        """Stamp at which the fault of an alert in force began, as far as it is known."""
        return self._alerts.onset_s(alert_id)

    @property
    def changed_s(self) -> float | None:
        """When the change began that an alert about the airframe in force is about; None without."""
        return None if self.book.active is None else self.book.onset_s

    @property
    def alarmed(self) -> bool:
        """Whether an alert is in force."""
        return self._alerts.alarmed

    @property
    def counts(self) -> dict[str, int]:
        """Samples accepted and rejected, by reason; ``too_slow``, ``stalled`` and ``unaligned`` are accepted ones that
        nothing was estimated from: on the ground, stalled, and without a reading that a stated delay makes late."""
        regime = self._memory.regime
        unused = {"too_slow": regime.too_slow, "stalled": regime.stalled, "unaligned": self._aligner.dropped}
        return {**self.cleaner.report.counts, **{name: times for name, times in unused.items() if times}}

    @property
    def rejected_by_channel(self) -> dict[str, int]:
        """Readings that were refused as not finite, out of range or of a stuck sensor, by channel."""
        found = dict(self.cleaner.report.by_channel)
        for name, rows in self.chain.supervisor.stuck_rows(self.chain_state.lane).items():
            found[name] = found.get(name, 0) + rows
        return found

    @property
    def observable_s(self) -> float:
        """Seconds of flight in which something could be said."""
        return self._memory.observable_s

    @property
    def references(self) -> Mapping[str, Reference]:
        """What this vehicle's flights have taught so far, by structure."""
        return self._judge_state.references

    @property
    def learned_blocks(self) -> int:
        """Blocks that its references rest on; one more means there is something new to keep."""
        return sum(r.blocks for r in self.references.values())

    @property
    def air(self) -> AirQuality | None:
        """Gusts of the last half minute as of the last solution; None where they are not known."""
        return self.chain.air(self.chain_state)

    @property
    def pending_air(self) -> PendingAir | None:
        """What ``air`` would work out; None where it is known already."""
        return self.chain.pending_air(self.chain_state)

    @property
    def last_block(self) -> BlockView | None:
        """The latest block that was compared."""
        return self._memory.block

    @property
    def last_verdict(self) -> Verdict | None:
        """What the test said after it; None while there is nothing to compare with."""
        return self._memory.verdict

    @property
    def suspects(self) -> bool:
        """Whether the test is half-way to an alert, or further."""
        return suspected(self._memory, self.judge.config)

    @property
    def last_sample_time_s(self) -> float | None:
        """Stamp of the last sample used."""
        t = self.chain_state.last_s
        return t if np.isfinite(t) else None

    @property
    def position(self) -> Position | None:
        """Where it was last, by the samples that say so."""
        return self._memory.position

    @property
    def flown_s(self) -> float:
        """Time since the flight's first solution."""
        begun_s, now_s = self._memory.surfaces.begun_s, self.last_sample_time_s
        return 0.0 if begun_s is None or now_s is None else now_s - begun_s

    @property
    def waits(self) -> str:
        """Why estimation waits, on the ground or stalled; empty where it does not."""
        return self._memory.regime.waits

    @property
    def in_rough_air(self) -> bool:
        """Whether the air of the last half minute hides what an input would show, as far as that is known."""
        latest, air = self._memory.latest, self.air
        rough = latest is not None and any(mode.rough for mode in latest.modes.values())
        return bool(rough or (air is not None and not air.fit_for_estimating))

    @property
    def says_something(self) -> bool:
        """Whether a compared structure was observable, and its air fit for it, at the latest solution."""
        latest = self._memory.latest
        return latest is not None and any(latest.modes[s.name].is_compared for s in self._compared)

    @property
    def condition(self) -> FlightCondition | None:
        """As of the latest solution; None before it, and where it was not steady enough to state one."""
        latest = self._memory.latest
        if latest is None or not latest.modes:
            return None
        return condition_of(next(iter(latest.modes.values())).condition, self.configuration)

    @property
    def unseen_surfaces(self) -> Sequence[str]:
        """Columns of surfaces that have not moved enough in this flight for a stuck one to be noticed."""
        return self._memory.surfaces.unseen

    def expectation(
        self, structure: ModeStructure, condition: FlightCondition
    ) -> Expectation | OutOfEnvelope:
        """What is expected at a condition, this vehicle's own flights included."""
        found = self.chain.envelopes[structure.name].lookup(condition)
        if isinstance(found, OutOfEnvelope) or structure.name not in self.judge.coordinates:
            return found
        at = self.judge.coordinates[structure.name].at_each([condition])
        prior = at.from_concise(found.value[None], found.covariance[None])
        value, covariance = at.to_concise(*self.judge.expected([self._judge_state], structure.name, *prior))
        return Expectation(structure, value[0], covariance[0], found.provenance, condition, found.source)

    def expectations(
        self, structure: ModeStructure, conditions: Sequence[FlightCondition]
    ) -> tuple[Array, Array]:
        """What is expected at m conditions, this vehicle's own flights included: values and standard errors, (m, k)
        each, NaN where nothing is; as ``expectation``, for all at once."""
        value, covariance = self.chain.envelopes[structure.name].values_at(conditions)
        inside = np.flatnonzero(np.all(np.isfinite(value), axis=1))
        if inside.size and structure.name in self.judge.coordinates:
            at = self.judge.coordinates[structure.name].at_each([conditions[m] for m in inside.tolist()])
            prior = at.from_concise(value[inside], covariance[inside])
            states = [self._judge_state] * inside.size
            value[inside], covariance[inside] = at.to_concise(
                *self.judge.expected(states, structure.name, *prior)
            )
        return value, np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))

    def block_record(self, solution: Solution) -> BlockRecord | None:
        """What the block that this solution, the latest, has closed said; None where it has closed none."""
        compared = self.last_block, self.last_verdict, self.judge, self._judge_state
        return block_record(solution, *compared, self.changed_s)

    def derivatives(self, solution: Solution | None = None) -> dict[str, Any]:
        """The contract's ``estimate`` object as of a solution, or else of the last sample, with expectations."""
        at = self.chain.current(self.chain_state) if solution is None else solution
        estimators: dict[str, dict[str, Any]] = {"fourier": {}, "ekf": {}}
        for name, mode in at.modes.items():
            for estimate in mode.estimates:
                estimators[estimate.estimator][name] = self.mode_object(estimate)
        return {
            "time_s": at.time_s if np.isfinite(at.time_s) else None,
            "basis": self.basis,
            "estimators": estimators,
            "not_estimated": dict(self.chain.absent),
        }

    def _expected_now(self, estimate: Estimate) -> Expectation | None:
        condition = condition_of(estimate.condition, self.configuration)
        if condition is None:
            return None
        found = self.expectation(estimate.structure, condition)
        return None if isinstance(found, OutOfEnvelope) else found

    def mode_object(self, estimate: Estimate) -> dict[str, Any]:
        """The contract's object of one mode by one estimator, beside what is expected at its condition."""
        values = dict(zip(estimate.structure.derivatives, estimate.value.tolist(), strict=True))
        quantities = mode_quantities(estimate.structure, values, estimate.covariance)
        made = mode_object(estimate, self._expected_now(estimate), quantities)
        lacking = self.chain.supervisor.pairs[estimate.structure.name].lacking
        for symbol in derivatives_by(estimate.structure, lacking):
            row = made["derivatives"][symbol]  # what the estimators started from is no estimate
            made["derivatives"][symbol] = {**row, "value": np.nan, "standard_error": np.nan}
        return made

    @property
    def solved(self) -> bool:
        """Whether there has been a solution."""
        return self._memory.latest is not None

    @property
    def pending_worst(self) -> PendingWorst | None:
        """The latest solution beside what is expected, where nobody has asked yet which derivative is furthest."""
        solution = self._memory.latest
        if solution is None or (self._worst is not None and self._worst[0] is solution):
            return None
        return PendingWorst(
            solution, self._compared, self.configuration, self.chain.envelopes, self.judge, self._judge_state
        )

    def keep_worst(self, one: PendingWorst, found: WorstDerivative | None) -> None:
        """What was found of ``pending_worst``."""
        self._worst = one.solution, found

    @property
    def state(self) -> VehicleState:
        """Health as of the last solution."""
        return self._memory.state

    @property
    def basis(self) -> str | None:
        """What the comparison rests on: ``a-priori``, ``empirical`` or ``identified``."""
        if not self._compared:
            return None
        weakest = "identified"
        for s in self._compared:
            stated = self._stated[s.name]
            own = self._judge_state.references[s.name].blocks >= self.judge.config.founded_blocks
            mine = "empirical" if stated == "a-priori" and own else stated
            weakest = min(weakest, mine, key=("a-priori", "empirical", "identified").index)
        return weakest

    @property
    def basis_text(self) -> str:
        """The basis as a sentence, with what contradicts it."""
        if self.basis is None:
            return "Nothing to compare with: " + "; ".join(f"{k}: {v}" for k, v in self.chain.absent.items())
        seconds = max(r.seconds for r in self._judge_state.references.values())
        words = {
            "a-priori": "Compared with a-priori numbers and with this flight's own earlier blocks",
            "empirical": f"Compared with {seconds:.0f} s of this aircraft's own flights",
            "identified": "Compared with derivatives identified in flight",
        }[self.basis]
        for name, symbols in self._judge_state.contradictions.items():
            words += f"; the a-priori {name} does not fit this aircraft ({', '.join(symbols) or 'jointly'})"
        if self.cells.text:
            words += f"; {self.cells.text}"
        if blind := [s.name for s in self._compared if not self.chain.supervisor.pairs[s.name].vane]:
            words += f"; {' and '.join(blind)} ({NO_VANE}): {COMPARED_SO}"
        return words + "."

    def worst(self) -> WorstDerivative | None:
        """The derivative furthest from its expectation, among those that are observable (``note_worst``)."""
        note_worst([self])
        return None if self._worst is None else self._worst[1]

    @property
    def reason(self) -> str:
        """Why the state is what it is, in one clause."""
        if active := self.active_alerts:
            return " ".join(alert.text for alert in active)
        if not self._compared:
            return self.basis_text
        if self.waits:
            return self.waits
        if self._memory.outside:
            return self._memory.outside
        if stuck := self.chain.supervisor.stuck(self.chain_state.lane):
            return f"{', '.join(stuck)} stays as it is while the aircraft moves: a stuck sensor is left out"
        if (latest := self._memory.latest) is None:
            return "no solution yet"
        if self.unseen_surfaces and self.says_something:
            return self._surfaces.text(self._memory.surfaces)
        if self.state is VehicleState.NOT_OBSERVABLE:
            reasons = (latest.modes[s.name].why_not_compared for s in self._compared)
            return "; ".join(dict.fromkeys(reasons))  # one that is of all modes is said once
        return "no change against what is expected"

    def could_see(self) -> Sequence[CouldSeeView]:
        """By cause, the smallest size that the remembered minutes would have shown; worked out anew every
        ``_COULD_SEE_S``."""
        now_s = self.last_sample_time_s
        if now_s is None:
            return ()
        if self._could_see is None or not 0.0 <= now_s - self._could_see[0] < _COULD_SEE_S:
            airframe = self.judge.smallest_seen(self._judge_state) if self._compared else {}
            rows = could_see(airframe, self._relations.could_see())
            lacking = {c for pair in self.chain.supervisor.pairs.values() for c in pair.lacking}
            self._could_see = now_s, beside_lacking(rows, lacking)
        return self._could_see[1]

    def view(self) -> VehicleView:
        """The vehicle as an operator sees it, without what ``could_see`` works out."""
        solution = self._memory.latest
        condition: dict[str, float] = {}
        if solution is not None and solution.modes:
            airspeed, altitude, density, _ = next(iter(solution.modes.values())).condition
            condition = {
                "airspeed_true_m_s": airspeed,
                "altitude_m": altitude,
                "air_density_kg_m3": density,
            }
        return VehicleView(
            fleet=self.fleet, vehicle=self.vehicle, aircraft=self.aircraft.name, configuration=self.configuration,
            state=self.state, state_since_s=self._memory.state_since_s, reason=self.reason,
            last_sample_time_s=self.last_sample_time_s, basis=self.basis, basis_text=self.basis_text,
            worst=self.worst(), counts=self.counts,
            active_alerts=tuple(alert.id for alert in self.active_alerts), condition=condition,
            air=self.air, rejected_by_channel=self.rejected_by_channel, unseen_surfaces=self.unseen_surfaces,
            position=self._memory.position,
        )  # fmt: skip


def note_worst(monitors: Sequence[VehicleReadings]) -> None:
    """Find out of several vehicles together which derivative is furthest from its expectation (``furthest``).

    It is worked out once a solution, whoever asks, with a lock or without: a solution and what flights taught are
    replaced, never changed.
    """
    due = [(monitor, one) for monitor in monitors if (one := monitor.pending_worst) is not None]
    if not due:
        return
    for (monitor, one), found in zip(due, furthest([one for _, one in due]), strict=True):
        monitor.keep_worst(one, found)


def suspected(memory: WatchMemory, config: JudgeConfig) -> bool:
    """Whether what a monitor remembers is half-way to an alert, or further."""
    verdict = memory.verdict
    return verdict is not None and verdict.log_statistic > 0.5 * config.log_threshold
