"""A number found from data: never without its standard error and without saying whether the data show it."""

from dataclasses import dataclass

__all__ = ["Parameter"]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One estimated number.

    Attributes:
        name: what it is, with its channel where it belongs to one.
        value: estimate, in ``unit``.
        standard_error: of the estimate, in ``unit``; infinite where nothing is known.
        unit: SI unit, empty for a ratio.
        observable: whether the data, rather than what was supposed before, say it.
        reason: one clause where it is not observable, else empty.
    """

    name: str
    value: float
    standard_error: float
    unit: str
    observable: bool = True
    reason: str = ""

    @property
    def text(self) -> str:
        """One line for a person."""
        if not self.observable:
            return f"{self.name} not observable: {self.reason}"
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.name} {self.value:.5g} +- {self.standard_error:.2g}{unit}"
