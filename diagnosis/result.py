"""What a diagnosis says: misfit, causes, gain, and the extended model."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.diagnosis.evidence import MATTERS

__all__ = [
    "Cause",
    "Diagnosis",
    "Gain",
    "Interval",
    "Misfit",
    "MissingTerm",
    "NotSeparable",
    "ParameterEstimate",
    "Traces",
]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Misfit:
    """How far a simulated channel is from the measured one, over all windows.

    Attributes:
        r_squared: 1 - sum of squared residuals over sum of squared deviations from each window's mean.
        tic: Theil's inequality coefficient, rms residual / (rms measured + rms simulated), of the same deviations.
        bias, variance, covariance: Theil's proportions of the mean square residual; they sum to 1.
        noise_fraction: part of the residual's mean square that sensor noise explains.
        whiteness: Ljung-Box probability of so correlated a residual, were it white.
        coherence: largest mean squared coherence of the residual with an input or state over the band, by its name.
    """

    r_squared: float
    tic: float
    bias: float
    variance: float
    covariance: float
    noise_fraction: float = math.nan
    whiteness: float = math.nan
    coherence: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ParameterEstimate:
    """A cause's parameter, its standard error and unit."""

    value: float
    standard_error: float
    unit: str


@dataclass(frozen=True, slots=True)
class Cause:
    """A cause that was found.

    Attributes:
        name: of the vocabulary of causes.
        target: what of it: a channel, a surface, a derivative; empty where the name says all.
        parameters: by name.
        channels: those whose misfit it lowers, most first.
        probability: of this cause against those that compete with it, and against none.
        set_probability: that it is this cause or one that this flight does not distinguish it from.
        gain: of the log-likelihood, by it alone.
        held_out_gain: part of the squared, weighted misfit that it takes away on windows left out.
        indistinguishable_from: labels (``label``) of causes that this flight does not distinguish it from.
        separating_manoeuvre: which manoeuvre would; empty where none is needed or none does.
        text: what an operator reads.
    """

    name: str
    target: str
    parameters: Mapping[str, ParameterEstimate]
    channels: tuple[str, ...]
    probability: float
    gain: float
    held_out_gain: float
    indistinguishable_from: tuple[str, ...] = ()
    separating_manoeuvre: str = ""
    text: str = ""
    set_probability: float = math.nan

    @property
    def label(self) -> str:
        """Name, with the target in brackets, as ``wingwatch simulate --effect`` writes it."""
        return f"{self.name}[{self.target}]" if self.target else self.name


@dataclass(frozen=True, slots=True)
class NotSeparable:
    """Causes that no flight can tell apart, and why."""

    causes: tuple[str, ...]
    reason: str


@dataclass(frozen=True, slots=True)
class MissingTerm:
    """A term that the simulation lacks and what is left follows.

    Attributes:
        coefficient: ``CL``, ``CY``, ``Cl``, ``Cm`` or ``Cn``.
        signal: what of the motion: angles in rad about their means, rates times span or chord over twice the speed.
        value, standard_error: of the coefficient for one of the signal.
        gain: of log-likelihood.
    """

    coefficient: str
    signal: str
    value: float
    standard_error: float
    gain: float


@dataclass(frozen=True, slots=True)
class Interval:
    """A figure with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Gain:
    """Misfit on data left out, with the model as stated and as extended.

    Attributes:
        source: which data: windows of the same flight, or another flight.
        before, after: by channel.
        change: of the rms residual, after over before minus 1, with bootstrap intervals over windows, by channel.
        intervals: of ``r_squared``, ``tic``, ``bias``, ``variance`` and ``covariance`` before and after, likewise.
    """

    source: str
    before: Mapping[str, Misfit]
    after: Mapping[str, Misfit]
    change: Mapping[str, Interval]
    intervals: Mapping[str, Mapping[str, tuple[Interval, Interval]]] = field(default_factory=dict)

    @property
    def pays(self) -> bool:
        """Whether some channel is surely better, and none surely worse by what matters."""
        changes = self.change.values()
        return any(c.high < 0.0 for c in changes) and not any(c.low > MATTERS for c in changes)


@dataclass(frozen=True, slots=True)
class Traces:
    """Measured, simulated and mended signals for pictures.

    Attributes:
        time_s: (samples,), NaN between windows.
        measured, simulated, mended: by channel, (samples,).
        residual_hz: frequencies of the spectra.
        spectra: by channel: power of the residual before and after and of the noise that no model explains, (3, bins).
    """

    time_s: Array
    measured: Mapping[str, Array]
    simulated: Mapping[str, Array]
    mended: Mapping[str, Array]
    residual_hz: Array
    spectra: Mapping[str, Array]


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Answer to: what does the simulation get wrong, why, and how much better is it once mended?

    Attributes:
        source: the flight, in words.
        aircraft: the simulated aircraft as its file has it.
        misfit: of the simulation as stated, by channel.
        causes: those found, most important first; empty where the simulation agrees or no cause is beyond doubt.
        ranking: of all causes that were tried: label, log-likelihood gained alone, probability; best first.
        unexplained_fraction: part of the misfit beyond noise that the causes leave.
        unexplained: in words: what is left and which term would follow it; empty where nothing is.
        gain: on data left out; None where nothing was found or the extension does not pay there.
        not_separable: sets that no flight can tell apart.
        notes: what could not be answered, and why.
        model: the extended aircraft; None where nothing is offered.
        derivatives: concise derivatives before and after, by symbol.
        traces: for pictures.
        seconds: of flight that were used; windows: how many.
        missing_terms: that what is left follows beyond doubt, best first.
        not_judged: derivatives of which an error of a third would not show in this flight.
        another_aircraft: why the file may be of another aircraft than this flight; empty where nothing says so.
    """

    source: str
    aircraft: Aircraft
    misfit: Mapping[str, Misfit]
    causes: tuple[Cause, ...]
    ranking: tuple[tuple[str, float, float], ...]
    unexplained_fraction: float
    unexplained: str
    gain: Gain | None
    not_separable: tuple[NotSeparable, ...]
    notes: tuple[str, ...]
    model: Aircraft | None
    derivatives: Mapping[str, tuple[float, float]]
    traces: Traces
    seconds: float
    windows: int
    missing_terms: tuple[MissingTerm, ...] = ()
    not_judged: tuple[str, ...] = ()
    another_aircraft: str = ""
