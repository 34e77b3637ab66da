"""When what of one vehicle was saved: its state as a checkpoint, its estimates as history."""

from dataclasses import dataclass

__all__ = ["Saving"]


@dataclass(slots=True)
class Saving:
    """Of one vehicle.

    Attributes:
        checkpoint_s: when its state was handed over to be saved, wall clock.
        unsaved: whether it has changed since; urgent: whether that is to be saved at once.
        history_s: sample time of the last estimate kept for history.
    """

    checkpoint_s: float = float("-inf")
    unsaved: bool = False
    urgent: bool = False
    history_s: float = float("-inf")

    def note_change(self, urgent: bool = False) -> None:
        """Its state has changed."""
        self.unsaved = True
        self.urgent |= urgent

    def hurry(self) -> None:
        """Its state is to be saved at once, changed or not."""
        self.urgent = True

    def note_saved(self, now_s: float) -> None:
        """Its state is handed over."""
        self.checkpoint_s, self.unsaved, self.urgent = now_s, False, False

    def begin_anew(self) -> None:
        """Of a watch that has ended nothing is saved."""
        self.unsaved = self.urgent = False

    def history_is_due(self, time_s: float, interval_s: float) -> bool:
        """Whether the estimate at this sample time is kept; after a step back of the clock it is."""
        if 0.0 <= time_s - self.history_s < interval_s - 1e-6:
            return False
        self.history_s = time_s
        return True
