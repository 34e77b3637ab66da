"""What a diagnosis has found about an alert, and the alert with it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from wingwatch.monitor.views import AlertView, CandidateView

__all__ = ["AlertFinding", "Correction", "with_finding"]


@dataclass(frozen=True, slots=True)
class Correction:
    """How an alert reads after a diagnosis that is decided; the fields are those of ``AlertView``."""

    kind: str
    cause: str
    level: str
    size: float
    size_standard_error: float
    probability: float
    text: str
    channel: str | None
    candidates: Sequence[CandidateView] = ()


@dataclass(frozen=True, slots=True)
class AlertFinding:
    """What a diagnosis says about an alert.

    Attributes:
        begun_with: the alert, as its monitor had it, when the diagnosis was begun.
        note: in plain words.
        correction: None where nothing is decided.
        diagnosis_id: under which its report is found; None without.
    """

    begun_with: AlertView
    note: str
    correction: Correction | None = None
    diagnosis_id: str | None = None

    def applies(self, alert: AlertView) -> bool:
        """Whether a version by the monitor says no more than the one that the diagnosis was begun with.

        A cause that the monitor has changed since counts more than the diagnosis, and so does a size of the same cause.
        """
        begun, decided = self.begun_with, self.correction
        if decided is None or (alert.cause, alert.channel) != (begun.cause, begun.channel):
            return False
        same = (decided.cause, decided.channel) == (alert.cause, alert.channel)
        return not same or (alert.size, alert.size_standard_error) == (begun.size, begun.size_standard_error)


def with_finding(shown: AlertView, own: AlertView, finding: AlertFinding) -> AlertView:
    """An alert as it is shown.

    Args:
        shown: with what people did to it.
        own: the same version as the monitor has it.
        finding: of a diagnosis that was begun before or at this version.
    """
    alert = replace(shown, diagnosis_id=finding.diagnosis_id)
    if not finding.applies(own) or finding.correction is None:
        return alert
    c = finding.correction
    return replace(
        alert, kind=c.kind, cause=c.cause, level=c.level, size=c.size, size_standard_error=c.size_standard_error,
        probability=c.probability, text=c.text, channel=c.channel, candidates=tuple(c.candidates),
    )  # fmt: skip
