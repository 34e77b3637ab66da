"""The solution of one mode: what both online estimators say of it, each beside the other.

The filter cannot distinguish a noisy regressor from a moving one, and no estimator sees gusts without a vane: what an
estimate is worth depends on the other's and on the channels (``docs/methods/supervision.md``).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import ModeStructure
from wingwatch.estimators import (
    BlockEvidence,
    EkfEstimator,
    Estimate,
    FourierEstimator,
    Outcome,
    Signals,
    Validity,
    confounding_text,
)
from wingwatch.monitor.estimation.lacking_surfaces import derivatives_by, known_beside, why_lacking

__all__ = ["COMPARED_SO", "NO_VANE", "ModeSolution", "Pair"]

Array = NDArray[np.float64]

NO_VANE = "reconstructed, no vane"

COMPARED_SO = "in calm air only, by the Kalman filter alone, while surfaces of the mode move it"
"""How structures without their vane are compared."""


@dataclass(frozen=True)
class Pair:
    """Both estimators of one structure, and the signals that both read.

    Attributes:
        vane: whether one measures the velocity; else it is reconstructed.
        force_noise_variance: of the accelerometer, m2/s4; 0 where it is not known.
        lacking: channels of surfaces that the flight has not; their columns are zeros.
        disturbed: derivatives of the equations in which these may have acted unseen.
    """

    structure: ModeStructure
    signals: Signals
    fourier: FourierEstimator
    ekf: EkfEstimator
    vane: bool
    force_noise_variance: float
    lacking: tuple[str, ...] = ()
    disturbed: tuple[str, ...] = ()

    @cached_property
    def known(self) -> Array | None:
        """1 for each derivative of which there is evidence, 0 where a surface lacks, (k,); None where none does."""
        if not self.lacking:
            return None
        return known_beside(self.structure, {*derivatives_by(self.structure, self.lacking), *self.disturbed})


@dataclass(slots=True)
class ModeSolution:
    """What both estimators say of one mode, and what the last closed block added.

    Estimates are made when somebody asks for them; they are of the solution's time all the same.
    """

    pair: Pair
    seen: tuple[Validity, Validity]
    """What the Fourier estimator and the filter say, each alone."""
    block: BlockEvidence | None
    """The Fourier estimator's evidence of the block that was closed, where one was; ``gained``: the filter's, since
    the block before."""
    gained: tuple[Array, Array] | None
    rough: bool = False
    """Whether the air makes a tenth or more of the rotation."""
    comparable: bool = True
    """Whether a block says of the aircraft what it says: without a vane only in air that was found calm."""
    _made: tuple[Estimate, Estimate] | None = None

    @property
    def structure(self) -> ModeStructure:
        """The mode's."""
        return self.pair.structure

    @property
    def reconstructed(self) -> bool:
        """Whether the velocity is reconstructed for want of a vane: no gust is seen, and the filter alone is
        valid."""
        return not self.pair.vane

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Of each online estimator, whose name it carries."""
        return self._both()

    @property
    def fourier(self) -> Estimate:
        """The Fourier estimator's estimate."""
        return self._both()[0]

    @property
    def ekf(self) -> Estimate:
        """The filter's."""
        return self._both()[1]

    @property
    def condition(self) -> tuple[float, float, float, float]:
        """Airspeed in m/s, altitude in m, air density in kg/m3 and angle of attack in rad of the last sample."""
        return self.ekf.condition

    @property
    def says_something(self) -> bool:
        """Whether the Fourier estimator's estimate is settling or converged; without a vane it is neither."""
        return self.pair.vane and self.seen[0].says_something

    @property
    def filter_says_something(self) -> bool:
        """Whether the filter's estimate is settling or converged, beside the Fourier estimator's; a vane or not."""
        fourier, ekf = self.seen
        if not ekf.says_something or (self.rough and not self.pair.vane):
            return False
        return bool(2 * np.count_nonzero(fourier.unseen) <= fourier.unseen.size)

    @property
    def is_compared(self) -> bool:
        """Whether what is estimated now can be compared with what is expected."""
        return self.comparable and (self.says_something if self.pair.vane else self.filter_says_something)

    @property
    def why_not_compared(self) -> str:
        """What keeps it from being compared, in one clause."""
        if self.pair.vane:
            return self.fourier.reason
        if self.comparable:
            return self.ekf.reason
        found = "gusts have been felt" if self.rough else "the air is not known to be calm"
        return f"{NO_VANE}: compared in calm air only, and {found}"

    def _both(self) -> tuple[Estimate, Estimate]:
        if self._made is None:
            self._made = _beside_each_other(self.pair, self.seen, self.rough)
        return self._made


def _beside_each_other(pair: Pair, seen: tuple[Validity, Validity], rough: bool) -> tuple[Estimate, Estimate]:
    """Both estimates with the outcomes that each has beside the other."""
    fourier = seen[0].estimate(pair.fourier.name, pair.structure)
    ekf = _beside_fourier(seen[1].estimate(pair.ekf.name, pair.structure), fourier, seen[0].unseen.tolist())
    if not pair.vane:
        fourier, ekf = _without_vane(fourier, rough), _without_vane(ekf, rough)
    if pair.lacking:
        fourier, ekf = _without_surfaces(pair, fourier), _without_surfaces(pair, ekf)
    return fourier, ekf


def _without_surfaces(pair: Pair, estimate: Estimate) -> Estimate:
    """An estimate that says which surfaces the flight has not, and rejects what they disturbed."""
    why = why_lacking(pair.lacking, pair.disturbed)
    outcomes = tuple(
        Outcome.REJECTED if symbol in pair.disturbed and outcome is not Outcome.NOT_OBSERVABLE else outcome
        for symbol, outcome in zip(pair.structure.derivatives, estimate.outcomes, strict=True)
    )
    reason = f"{why}; {estimate.reason}" if estimate.reason else why
    return replace(estimate, outcomes=outcomes, reason=reason)


def _without_vane(estimate: Estimate, rough: bool) -> Estimate:
    """An estimate from a reconstructed velocity, with the outcomes that are left to it.

    The reconstruction integrates accelerometer and gyro: its noise goes together with theirs and grows towards low
    frequencies. The filter models that, because the velocity is its state. The Fourier estimator takes a state's noise
    as white and its own, so its standard errors do not hold. Gusts are in neither.
    """
    if all(o is Outcome.NOT_OBSERVABLE for o in estimate.outcomes):
        return replace(estimate, reason=f"{NO_VANE}; {estimate.reason}")
    if not rough and estimate.estimator != "fourier":
        return replace(estimate, reason=f"{NO_VANE}; {estimate.reason}" if estimate.reason else NO_VANE)
    why = "without a vane rough air is not measured and counts as the aircraft's motion"
    if not rough:
        why = "its errors neglect that the velocity's noise goes with the rates'; the Kalman filter alone counts"
    outcomes = tuple(o if o is Outcome.NOT_OBSERVABLE else Outcome.REJECTED for o in estimate.outcomes)
    return replace(estimate, outcomes=outcomes, outcome=Outcome.REJECTED, reason=f"{NO_VANE}; {why}")


def _beside_fourier(ekf: Estimate, fourier: Estimate, hidden: Sequence[bool]) -> Estimate:
    """The filter's estimate with the outcomes that the excitation allows.

    The filter cannot distinguish a noisy regressor from a moving one; the Fourier estimator can (its signal-to-noise).
    A derivative that it calls not observable for want of signal is not observable for the filter either.

    Args:
        hidden: ``Validity.unseen`` of the Fourier estimator.
    """
    if not any(hidden):
        return ekf
    outcomes = tuple(
        Outcome.NOT_OBSERVABLE if h else own for h, own in zip(hidden, ekf.outcomes, strict=True)
    )
    confounded = tuple(dict.fromkeys((*ekf.confounded, *fourier.confounded)))
    if sum(hidden) > len(hidden) / 2 and ekf.outcome is not Outcome.REJECTED:
        return replace(
            ekf, outcomes=outcomes, outcome=Outcome.NOT_OBSERVABLE, reason=fourier.reason, confounded=confounded
        )  # fmt: skip
    if confounded != ekf.confounded:
        text = confounding_text(ekf.structure, confounded)
        reason = f"{text}; {ekf.reason}" if ekf.reason and not ekf.confounded else text
        return replace(ekf, outcomes=outcomes, reason=reason, confounded=confounded)
    return replace(ekf, outcomes=outcomes)
