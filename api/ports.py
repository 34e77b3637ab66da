"""What the REST door needs from others beside the monitor: the estimate history."""

from collections.abc import Sequence
from typing import Protocol

__all__ = ["EstimateRow", "HistoryPort"]


class EstimateRow(Protocol):
    """One stored estimate of one mode at one instant.

    ``value`` and ``standard_error`` follow the order of the structure's ``derivatives``; NaN where
    nothing was known.
    """

    @property
    def time_s(self) -> float:
        """Stamp of the last sample that the estimate used."""
        ...

    @property
    def estimator(self) -> str:
        """``fourier`` or ``ekf``."""
        ...

    @property
    def structure(self) -> str:
        """Name of the model structure, such as ``short_period``."""
        ...

    @property
    def value(self) -> Sequence[float]:
        """Concise derivatives."""
        ...

    @property
    def standard_error(self) -> Sequence[float]:
        """Their standard errors."""
        ...

    @property
    def outcome(self) -> str:
        """Standing of the mode's estimate."""
        ...


class HistoryPort(Protocol):
    """Where stored estimates are read from. Called from worker threads."""

    def estimate_history(
        self, fleet: str, vehicle: str, from_s: float | None = None, to_s: float | None = None
    ) -> Sequence[EstimateRow]:
        """Estimates of one vehicle, ``from_s <= time_s <= to_s``, in any order; None leaves an end open."""
        ...
