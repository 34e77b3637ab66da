"""The relations of one vehicle: samples on their way to the test, what it remembers, and its alerts."""

from collections.abc import Callable, Sequence
from copy import deepcopy

import numpy as np

from wingwatch.monitor.detection.redundancy.book import RedundancyBook, RedundancyBookState
from wingwatch.monitor.detection.redundancy.hypotheses import Hypothesis
from wingwatch.monitor.detection.redundancy.watch import RedundancyState, RedundancyWatch
from wingwatch.monitor.views import AlertState, AlertView
from wingwatch.telemetry import SampleBlock

__all__ = ["VehicleRelations"]


class VehicleRelations:
    """One vehicle's relations and the alerts in force by them.

    Samples wait until the solution that they lead to is looked at: which blocks of derivatives are compared must not
    depend on how samples were cut into messages.

    Args:
        watch: of its type.
        new_id: makes ids of alerts.

    Attributes:
        book: alerts in force.
    """

    def __init__(self, watch: RedundancyWatch, fleet: str, vehicle: str, new_id: Callable[[], str]) -> None:
        self._watch = watch
        self.book = RedundancyBook(fleet, vehicle, new_id, watch)
        self._state = watch.init()
        self._waiting = SampleBlock.concatenate(())
        self._raised: list[AlertView] = []

    def wait(self, block: SampleBlock) -> None:
        """Samples that come next, clean and of attached flight."""
        self._waiting = block

    def up_to(self, time_s: float, airframe_alarmed: bool) -> None:
        """Take in samples up to the first with this stamp.

        Args:
            airframe_alarmed: an alert about the airframe is in force.
        """
        found = np.flatnonzero(self._waiting.time_s == time_s)
        self._take(int(found[0]) + 1 if found.size else 0, airframe_alarmed)

    def rest(self, airframe_alarmed: bool) -> list[AlertView]:
        """Take in all that wait; alerts that were raised, changed or cleared since this was last asked."""
        self._take(len(self._waiting), airframe_alarmed)
        raised, self._raised = self._raised, []
        return raised

    def explain(self, by: AlertView, now_s: float) -> None:
        """An alert about the airframe, raised or changed, explains a changed drag."""
        if by.state is AlertState.ACTIVE:
            self._raised += self.book.explained(self._state, by, now_s)

    def confirm(self, by: AlertView, now_s: float) -> AlertView | None:
        """Derivatives have changed, too: the alert about the airframe in force with their evidence, where it is new."""
        return self.book.confirm(self._state, by, now_s)

    def onset_s(self, alert_id: str) -> float | None:
        """Stamp at which the fault of an alert in force began; None for another alert."""
        faults = zip(self.book.state.active, self._state.faults, strict=True)
        return next((fault.onset_s for alert, fault in faults if alert.id == alert_id), None)

    def reinstate(self, alert: AlertView) -> None:
        """An alert of an earlier run is in force again."""
        self.book.reinstate(self._state, alert)

    def take_over(self, alert: AlertView, now_s: float) -> None:
        """What was done to an alert in force counts; one that was cleared is followed no longer."""
        if alert.state is AlertState.CLEARED:
            self.book.dismiss(self._state, alert.id, now_s)
        else:
            self.book.take_over(alert)

    def could_see(self) -> Sequence[tuple[Hypothesis, float | None]]:
        """By hypothesis the smallest size that the remembered half minute would have shown."""
        return self._watch.could_see(self._state)

    def saved(self) -> tuple[RedundancyState, RedundancyBookState]:
        """A copy of all that is remembered between calls; its arrays are changed in place."""
        return deepcopy(self._state), deepcopy(self.book.state)

    def restore(self, state: RedundancyState, book: RedundancyBookState) -> None:
        """Go on from what ``saved`` gave."""
        self._state = state
        self.book.restore(book)

    def _take(self, rows: int, airframe_alarmed: bool) -> None:
        block, self._waiting = self._waiting.values[:rows], SampleBlock(self._waiting.values[rows:])
        for second in self._watch.feed(self._state, SampleBlock(block)):
            self._raised += self.book.follow(self._state, second, airframe_alarmed)
