"""One vehicle: cleaning, estimation, comparison and alerts in one recursion, the same live and offline."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import (
    DUTCH_ROLL,
    LATERAL,
    SHORT_PERIOD,
    Aircraft,
    FlightCondition,
    ModeStructure,
)
from wingwatch.baselines import Envelope, Expectation, OutOfEnvelope
from wingwatch.estimators import BlockEvidence
from wingwatch.monitor.detection.alerts import CLEAR_BLOCKS, AlertBook
from wingwatch.monitor.detection.blocks import BlockView, ModeBlock
from wingwatch.monitor.detection.cell_memory import CellBook
from wingwatch.monitor.detection.comparison import Coordinates, natural_size
from wingwatch.monitor.detection.judge import Judge
from wingwatch.monitor.detection.redundancy import RedundancyWatch, VehicleRelations
from wingwatch.monitor.detection.surfaces_seen import EFFECTIVENESS, SurfaceWatch
from wingwatch.monitor.detection.vehicle_alerts import VehicleAlerts
from wingwatch.monitor.estimation.chain import (
    NO_CONDITION,
    Chain,
    Solution,
    condition_of,
    nominal_condition,
)
from wingwatch.monitor.estimation.flight_regime import FlightRegime
from wingwatch.monitor.estimation.mode_solution import ModeSolution
from wingwatch.monitor.estimation.solution_times import SOLUTION_INTERVAL_S
from wingwatch.monitor.ports import VehicleMemory
from wingwatch.monitor.positions import position_of
from wingwatch.monitor.state_codec import detached
from wingwatch.monitor.vehicle.manoeuvre_watch import FlownManoeuvre, ManoeuvreWatch
from wingwatch.monitor.vehicle.readings import VehicleReadings, note_worst, suspected
from wingwatch.monitor.vehicle.start import Judged, MonitorStart, Report, surface_kinds
from wingwatch.monitor.vehicle.state import MonitorState, SavedSolution, WatchMemory
from wingwatch.monitor.views import (
    AlertState,
    AlertView,
    CouldSeeView,
    VehicleState,
    WorstDerivative,
)
from wingwatch.telemetry import Aligner, Cleaner, SampleBlock, aligned_delays

__all__ = ["Judged", "MonitorStart", "Report", "VehicleMonitor", "note_worst", "surface_kinds", "suspected"]


Array = NDArray[np.float64]

_SET_BACK_S = 1.0  # what the cleaner takes for another clock, too


class VehicleMonitor(VehicleReadings):
    """Watches one vehicle.

    Args:
        aircraft: its file.
        present: channels that its samples carry after completion.
        kinds: of the surfaces (see ``surface_kinds``).
        new_id: makes alert ids.
        start: what it starts from; the aircraft file alone if not given.
    """

    def __init__(
        self,
        aircraft: Aircraft,
        fleet: str,
        vehicle: str,
        present: Sequence[str],
        kinds: Mapping[str, str],
        *,
        new_id: Callable[[], str],
        start: MonitorStart | None = None,
    ) -> None:
        start = start or MonitorStart()
        memory, configuration = start.memory, start.configuration
        self.fleet, self.vehicle, self.configuration = fleet, vehicle, configuration
        self.cleaner = Cleaner()
        self._regime = FlightRegime(aircraft)
        delays = aligned_delays(aircraft.sensors.delay_s, kinds)
        self._aligner = Aligner(delays, [name for name, kind in kinds.items() if kind == "command"])
        self.chain = (
            start.chain.of_another()
            if start.chain
            else Chain(
                aircraft, present, kinds, configuration, memory.envelopes, start.engine, start.memory_s
            )
        )
        self.aircraft = aircraft = self.chain.aircraft  # equal, and one object for all vehicles of its type
        self.chain_state = self.chain.init()
        self._compared = _compared(self.chain.structures)
        nominal = nominal_condition(aircraft)
        self._stated = self._stated_provenance(nominal)
        reference = (nominal.airspeed_true_m_s, nominal.air_density_kg_m3) if nominal else (1.0, 1.0)
        self.judge = Judge({s.name: Coordinates(s, aircraft, reference) for s in self._compared}, start.judge)
        self.cells = CellBook(self.judge.coordinates, memory.cells)
        self._judge_state = self.judge.init(memory.references, self._founded_by_file)
        self.book = AlertBook(fleet, vehicle, new_id)
        self.relations = start.relations or RedundancyWatch(aircraft, present, kinds)
        self._relations = VehicleRelations(self.relations, fleet, vehicle, new_id)
        self._alerts = VehicleAlerts(self.book, self._relations)
        self._surfaces = SurfaceWatch(present, self._compared, self.relations.hypotheses)
        self._manoeuvres = ManoeuvreWatch(aircraft, present)
        self._could_see: tuple[float, Sequence[CouldSeeView]] | None = None
        self._memory = WatchMemory(surfaces=self._surfaces.init())
        self._worst: tuple[Solution, WorstDerivative | None] | None = None

    def adopt(self, memory: VehicleMemory) -> None:
        """Take in what is kept of the vehicle where it could not be read at the start; estimates go on as they are."""
        self.chain.envelopes.update({k: e for k, e in memory.envelopes.items() if k in self.chain.envelopes})
        self._stated = self._stated_provenance(nominal_condition(self.aircraft))
        self.judge.adopt(self._judge_state, memory.references, self._founded_by_file)
        self.cells.adopt(memory.cells)
        self._worst = None

    def renew(self, memory: VehicleMemory, stated: Mapping[str, Envelope]) -> None:
        """What is kept of the vehicle was changed by a person, and counts from now on; estimates go on as they are.

        Args:
            stated: the aircraft file's expectations, of structures that the memory has none of.
        """
        for name in self.chain.envelopes:
            found = memory.envelopes.get(name, stated.get(name))
            if found is not None:
                self.chain.envelopes[name] = found
        self._stated = self._stated_provenance(nominal_condition(self.aircraft))
        self.judge.renew(self._judge_state, memory.references, self._founded_by_file)
        self.cells.renew(memory.cells)
        self._worst = None

    def saved(self) -> MonitorState:
        """A copy of all that this monitor remembers; what it is made of is not in it."""
        latest, (redundancy, redundancy_book) = self._memory.latest, self._relations.saved()
        return MonitorState(
            cleaner=self.cleaner.state,
            cleaned=self.cleaner.report,
            aligner=self._aligner.state,
            chain=self.chain.saved(self.chain_state),
            judge=detached(self._judge_state),
            book=self.book.state,
            redundancy=redundancy,
            redundancy_book=redundancy_book,
            alerts=detached(self._alerts.memory),
            cells=detached(self.cells.state),
            memory=detached(self._memory),
            latest=None if latest is None else SavedSolution.of(latest),
        )

    def restore(self, saved: MonitorState) -> None:
        """Go on from what ``saved`` gave, as if there had been no interruption; this monitor has seen no sample.

        Raises:
            ValueError: it was saved by a monitor of other estimators or other expectations.
        """
        expected = {name: r.vector.shape for name, r in self._judge_state.references.items()}
        if {name: r.vector.shape for name, r in saved.judge.references.items()} != expected:
            raise ValueError("the references belong to other structures than the vehicle's")
        self.chain.restore(self.chain_state, saved.chain)
        self.cleaner = Cleaner(state=saved.cleaner, report=saved.cleaned)
        self._aligner.resume(saved.aligner)
        self._judge_state = saved.judge
        self.book.restore(saved.book)
        self._relations.restore(saved.redundancy, saved.redundancy_book)
        self._alerts.restore(saved.alerts)
        self.cells.restore(saved.cells)
        self._memory = saved.memory
        self._memory.latest = None if saved.latest is None else saved.latest.solution(self.chain)

    def reinstate(self, alert: AlertView) -> None:
        """An alert that was in force before a restart is so again, and was raised after this state was saved.

        A monitor that has seen blocks is on the same clock. For one that has not, all blocks may be part of the change:
        none of them is learned from.
        """
        known = self._memory.block is not None
        blocks_s = self.judge.config.patience_blocks * self.judge.config.block_s
        onset_s = alert.raised_s - blocks_s if known else float("-inf")
        self._alerts.reinstate(alert, onset_s)
        self._memory.state = VehicleState.DEGRADED

    def take_over(self, alert: AlertView) -> None:
        """What was done to an alert in force counts; one that was cleared is followed no longer.

        The surface that it was about has to show itself anew then: by what comes after it, for the test remembers.
        """
        now_s = self.last_sample_time_s or 0.0
        mine = next((one for one in self.active_alerts if one.id == alert.id), None)
        self._alerts.take_over(alert, now_s)
        if mine is not None and alert.state is AlertState.CLEARED:
            until_s = now_s + self.judge.config.remembered_blocks * self.judge.config.block_s
            for column, cause in EFFECTIVENESS.items():
                if mine.channel == column or mine.cause == cause:
                    self._surfaces.forget(self._memory.surfaces, column, until_s)

    def dismiss(self, by_person: bool) -> None:
        """The airframe's alert in force was cleared after this state was saved.

        Args:
            by_person: what was changed may be so still; else the change was over, and its blocks are forgotten.
        """
        onset_s = self.book.onset_s
        if not by_person and onset_s is not None:
            self.judge.forget_since(self._judge_state, onset_s)
        self._alerts.dismiss_airframe()
        self._memory.state = VehicleState.NOT_OBSERVABLE

    def feed(self, block: SampleBlock) -> Report:
        """Take in samples as they came (completed, not cleaned)."""
        report = Report()
        for solution in self.chain.advance(self.chain_state, self.prepared(block)):
            judged = self.judge_solution(solution)
            self.enter_cells(judged)
            report.add(solution, judged)
        report.add_alerts(self.after_samples())
        return report

    def end_manoeuvre(self) -> FlownManoeuvre | None:
        """The flight is over: what was being flown at its last solution, if anything was."""
        latest = self._memory.latest
        return None if latest is None else self._manoeuvres.end(latest)

    def judge_solution(self, solution: Solution) -> Judged:
        """What the next solution of the chain leads to; its estimators go on by ``enter_cells`` alone."""
        self._relations.up_to(solution.time_s, self.book.active is not None)
        changed, resumed = self._compare(solution)
        if changed is not None and self._relations.book.airframe_alarmed:
            self.book.dismiss()
            changed = self._relations.confirm(changed, solution.time_s)
        elif changed is not None:
            self._relations.explain(changed, solution.time_s)
        if changed is not None:
            changed = self._alerts.announced([changed])[0]
        before, self._memory.latest = self._memory.latest, solution
        flown = self._manoeuvres.look(before, solution)
        if self._memory.surfaces.begun_s is None:
            self._memory.surfaces.begun_s = solution.time_s
        self._note_state(solution, before)
        return Judged(changed, flown, resumed)

    def enter_cells(self, judged: Judged) -> None:
        """In another cell of the envelope the estimators go on from what is remembered of it."""
        for name, memory in judged.resumed.items():
            self.chain.resume(self.chain_state, name, *memory)

    def after_samples(self) -> list[AlertView]:
        """After some samples: alerts by redundancy that were raised, changed or cleared in them.

        Who is on the ground or stalled is not observable. On the ground a flight is over, and with it what surfaces
        have shown.
        """
        raised = self._alerts.announced(self._relations.rest(self.book.active is not None))
        for alert in raised:
            if alert.state is AlertState.CLEARED and alert.channel is None:
                onset_s = alert.raised_s - self.judge.config.block_s
                self.judge.forget_change(self._judge_state, onset_s, CLEAR_BLOCKS)
        if self._memory.regime.waits and self._memory.regime.landed:
            self._memory.surfaces = self._surfaces.init()
        if raised and self.alarmed and self.state is not VehicleState.DEGRADED:
            self._memory.state, self._memory.state_since_s = VehicleState.DEGRADED, raised[0].raised_s
        if self._memory.regime.waits and self.state in (VehicleState.HEALTHY, VehicleState.UNKNOWN):
            self._memory.state, self._memory.state_since_s = (
                VehicleState.NOT_OBSERVABLE,
                self.last_sample_time_s,
            )
        return raised

    def prepared(self, block: SampleBlock) -> SampleBlock:
        """Samples as the chain takes them: cleaned, without the delays that the aircraft file states, and of attached
        flight.

        They come late by the largest delay: what belongs to an instant has to have been seen.
        """
        aligned = self._aligner.feed(self.cleaner.clean(block).block)
        used = self._regime.select(self._memory.regime, aligned)
        self._relations.wait(used)
        self._manoeuvres.add(used)
        self._memory.position = position_of(aligned) or self._memory.position
        return used

    @property
    def _founded_by_file(self) -> bool:
        """Whether every compared structure's expectation rests on flights of the type, not on numbers alone."""
        return bool(self._stated) and all(basis != "a-priori" for basis in self._stated.values())

    def _stated_provenance(self, nominal: FlightCondition | None) -> dict[str, str]:
        """What each compared structure's expectation rests on at the nominal condition, own flights apart."""
        found = {
            s.name: self.chain.envelopes[s.name].lookup(nominal) if nominal else None for s in self._compared
        }
        return {
            name: str(e.provenance) if isinstance(e, Expectation) else "a-priori" for name, e in found.items()
        }

    def _compare(self, solution: Solution) -> tuple[AlertView | None, dict[str, tuple[Array, Array]]]:
        """If blocks were closed, compare them: what that leads to, and the memories of cells that are resumed."""
        closed = [
            (m, m.block)
            for s in self._compared
            if (m := solution.modes[s.name]).block is not None
            and m.comparable
            and not self._relations.book.doubts(s.states)
        ]  # what a wrong reading makes of derivatives is neither a change nor to be learned
        modes: dict[str, ModeBlock] = {}
        resumed: dict[str, tuple[Array, Array]] = {}
        condition = None
        for mode, evidence in closed:
            found = condition_of(evidence.condition, self.configuration)
            if found is None:
                self._memory.outside = NO_CONDITION
                continue
            condition = found
            expectation = self.chain.envelopes[mode.structure.name].lookup(condition)
            if isinstance(expectation, OutOfEnvelope):
                self._memory.outside = expectation.reason
                continue
            self._memory.outside = ""
            modes[mode.structure.name] = self.judge.mode_block(mode, evidence, expectation, condition)
            if not mode.reconstructed:
                memory = self._remembered(mode, evidence, modes[mode.structure.name], condition)
                resumed |= {} if memory is None else {mode.structure.name: memory}
        if condition is None or not modes:
            return None, resumed
        block = BlockView(closed[0][1].end_s, condition, modes)
        before = self._memory.block
        if before is not None and block.end_s < before.end_s - _SET_BACK_S:
            self.book.note_set_back()
        onset_s = self.book.onset_s
        verdict = self.judge.consider(self._judge_state, block, onset_s)
        self._memory.block, self._memory.verdict = block, verdict
        changed = self.book.follow(
            self.judge, self._judge_state, verdict, condition, solution.time_s, self.basis or "a-priori"
        )
        if changed is not None and changed.state is AlertState.CLEARED and onset_s is not None:
            self.judge.forget_change(self._judge_state, onset_s, CLEAR_BLOCKS)
        return changed, resumed

    def _remembered(
        self, mode: ModeSolution, evidence: BlockEvidence, seen: ModeBlock, condition: FlightCondition
    ) -> tuple[Array, Array] | None:
        """The block joins the memory of its cell; in another cell than before, that is to be resumed."""
        return self.cells.block(
            mode.structure.name, evidence, condition, natural_size(seen.expected, seen.expected_covariance),
            alarmed=self.book.active is not None, rough=mode.rough,
        )  # fmt: skip

    def _note_state(self, solution: Solution, before: Solution | None) -> None:
        m = self._memory
        seen = self.says_something
        if seen:
            slow = before is not None and solution.time_s - before.time_s > 1.5 * SOLUTION_INTERVAL_S
            m.observable_s += 2.0 * SOLUTION_INTERVAL_S if slow else SOLUTION_INTERVAL_S
            self._look_at_surfaces(solution.time_s)
        shown = seen and not m.outside and not m.surfaces.unseen
        state = VehicleState.HEALTHY if shown else VehicleState.NOT_OBSERVABLE
        if self.alarmed:
            state = VehicleState.DEGRADED
        if state is not m.state:
            m.state, m.state_since_s = state, solution.time_s

    def _look_at_surfaces(self, now_s: float) -> None:
        """Whether a fault of those that have not shown themselves would have been noticed by now."""
        block_s = None if self._memory.block is None else self._memory.block.end_s
        if self._surfaces.due(self._memory.surfaces, now_s, block_s):
            airframe = self.judge.smallest_seen(self._judge_state) if self._compared else {}
            self._surfaces.look(self._memory.surfaces, now_s, airframe, self._relations.could_see())


def _compared(structures: Sequence[ModeStructure]) -> tuple[ModeStructure, ...]:
    """Structures the monitor compares: short period, and the fullest lateral one there is."""
    lateral = LATERAL if LATERAL in structures else DUTCH_ROLL
    return tuple(s for s in (SHORT_PERIOD, lateral) if s in structures)
