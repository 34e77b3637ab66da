"""What a check of a flight's channels found: one channel, what was measured, and the line that mends it."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

__all__ = ["Finding", "Verdict"]


class Verdict(StrEnum):
    """How a channel stands to the others."""

    RIGHT = "right"
    WARNING = "warning"
    REFUSAL = "refusal"


@dataclass(frozen=True, slots=True)
class Finding:
    """One channel under one check.

    Attributes:
        standing: right; doubtful; or so far off that nothing estimated from it means anything.
        channel: of the flight table.
        check: what was looked at, such as ``slope`` or ``gravity``.
        measured: what was measured, in ``unit``.
        standard_error: of that, in ``unit``.
        unit: SI unit, empty for a ratio.
        text: one clause for a person.
        line: what to write into the channel map, empty where no line would help; several are parted by line ends.
    """

    standing: Verdict
    channel: str
    check: str
    measured: float
    standard_error: float
    unit: str
    text: str
    line: str = ""

    @property
    def sentence(self) -> str:
        """The clause with the line to write."""
        lines = " and ".join(self.line.splitlines())
        return f"{self.text}: write {lines} into the channel map" if lines else self.text

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "standing": str(self.standing), "channel": self.channel, "check": self.check, "measured": self.measured,
            "standard_error": self.standard_error, "unit": self.unit, "text": self.text, "line": self.line,
        }  # fmt: skip
