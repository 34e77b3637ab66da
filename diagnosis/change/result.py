"""What a diagnosis of a change says."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from wingwatch.diagnosis.result import ParameterEstimate

__all__ = ["ChangeDiagnosis", "Explanation", "Outcome"]


class Outcome(StrEnum):
    """What became of the question which cause explains the change.

    ``decided``: one named cause. ``not_separable``: several. ``nothing``: no change that is beyond doubt.
    ``no_known_cause``: a change that no cause of the vocabulary explains.
    """

    DECIDED = "decided"
    NOT_SEPARABLE = "not_separable"
    NOTHING = "nothing"
    NO_KNOWN_CAUSE = "no_known_cause"


@dataclass(frozen=True, slots=True)
class Explanation:
    """One cause fitted to the time since the onset.

    Attributes:
        cause: of the shared vocabulary; target: the part that it befalls, or what of it, empty where the name says all.
        parameters: by name, each with its standard error and unit.
        size, size_standard_error, unit: the cause's size, as an alert states it.
        evidence: log of its odds against no change.
        probability: among all that competed.
        text: a sentence.
    """

    cause: str
    target: str
    parameters: Mapping[str, ParameterEstimate]
    size: float
    size_standard_error: float
    unit: str
    evidence: float
    probability: float
    text: str


@dataclass(frozen=True, slots=True)
class ChangeDiagnosis:
    """A change and what explains it.

    Attributes:
        outcome: what became of the question.
        onset_s: time stamp from which on the causes are there; asked_s: the one that was asked for.
        explanations: that were fitted, most probable first.
        unexplained_probability: of a change that is none of them; nothing_probability: of none.
        separating_manoeuvre: what would tell the first two apart, in words; empty where there is nothing to tell.
        before_s, after_s: seconds of flight that it rests on.
        inflation: variance of scores before the onset over what independent innovations would have.
        notes: what else is to be known.
    """

    outcome: Outcome
    onset_s: float
    asked_s: float
    explanations: tuple[Explanation, ...]
    unexplained_probability: float
    nothing_probability: float
    separating_manoeuvre: str = ""
    before_s: float = 0.0
    after_s: float = 0.0
    inflation: float = 1.0
    notes: tuple[str, ...] = field(default=())

    @property
    def possible(self) -> tuple[Explanation, ...]:
        """Those that have 95 % of the probability of the named ones together, most probable first."""
        total = sum(e.probability for e in self.explanations)
        found, so_far = [], 0.0
        for one in self.explanations:
            found.append(one)
            so_far += one.probability
            if so_far >= 0.95 * total:
                break
        return tuple(found)
