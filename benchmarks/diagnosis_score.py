"""Whether a diagnosis named what was hidden: one verdict a case, figures over many.

A cause is right when its label is the hidden one's, or one that names the very same change with the same size
(``SAME``). It counts as named when it comes first or stands in the set that the first cause cannot be distinguished
from.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from diagnosis_hidden import Case, Hidden

from wingwatch.aircraft import DERIVATIVES
from wingwatch.diagnosis import Cause, Diagnosis, ParameterEstimate

__all__ = ["Figures", "Verdict", "confusion", "figures", "judged", "refused", "same"]

Z_95 = 1.959964

SAME: Mapping[str, str] = {
    "derivative[m_q]": "pitch_damping",
    "sensor_scale[airspeed_true_m_s]": "airspeed_error",
    "sensor_scale[angle_of_attack_rad]": "vane_upwash[angle_of_attack]",
    "sensor_scale[sideslip_rad]": "vane_upwash[sideslip]",
}
"""Labels that name one and the same change, its size alike."""
_EVERYTHING = "[all]"


@dataclass(frozen=True, slots=True)
class Verdict:
    """What was said of one case.

    Attributes:
        case: name of a fixed case, else empty.
        source, seed, aircraft, turbulence, signal_to_noise, true_model_misfit: of the case.
        hidden: labels, with their sizes in ``sizes``.
        said: labels of the causes found, in their order.
        inseparable_from: labels that the first cause cannot be distinguished from.
        named: for each hidden effect, whether it was named.
        first: the right cause comes first.
        alone: and nothing else was said, nor is it called inseparable from anything.
        size: what was said of the hidden effect's size, its standard error and parameter; NaN where it was not named.
        size_error: value, standard error.
        inside: the size is in its stated 95 % interval; None where there is no size.
        gain: part of the squared misfit that the first cause takes away on windows left out; NaN without a cause.
        held_out: largest drop of a channel's rms residual on the second flight, percent; NaN where there is none.
        reached: part of the squared misfit beyond noise that is gone on the second flight, in the channel where most of
            it was; a true model reaches 1. NaN without an extension.
        seconds: that the diagnosis took.
        refusal: the sentence of a flight that was refused, else empty.
    """

    case: str
    source: str
    seed: int
    aircraft: str
    turbulence: str
    signal_to_noise: float
    true_model_misfit: float
    hidden: tuple[str, ...]
    sizes: tuple[float, ...]
    said: tuple[str, ...] = ()
    inseparable_from: tuple[str, ...] = ()
    named: tuple[bool, ...] = ()
    first: bool = False
    alone: bool = False
    size: float = math.nan
    size_error: float = math.nan
    inside: bool | None = None
    gain: float = math.nan
    held_out: float = math.nan
    reached: float = math.nan
    seconds: float = math.nan
    refusal: str = ""

    @property
    def missed(self) -> bool:
        """Whether something hidden was not named, or something was said of nothing."""
        if self.refusal:
            return False
        return bool(self.said) if not self.hidden else not all(self.named)


def same(one: str, other: str) -> bool:
    """Whether two labels name the same change."""
    return _plain(one) == _plain(other)


def _plain(label: str) -> str:
    bare = label.removesuffix(_EVERYTHING)
    return SAME.get(bare, bare)


def refused(case: Case, sentence: str, seconds: float) -> Verdict:
    """The verdict of a flight that was refused."""
    return _verdict(case, seconds=seconds, refusal=sentence)


def judged(case: Case, found: Diagnosis, seconds: float) -> Verdict:
    """The verdict of a diagnosis."""
    causes = found.causes
    said = tuple(cause.label for cause in causes)
    inseparable = causes[0].indistinguishable_from if causes else ()
    everything = (*said, *(label for cause in causes for label in cause.indistinguishable_from))
    if len(case.effects) == 1:  # then only the first and its set count
        everything = (*said[:1], *inseparable)
    named = tuple(any(same(hidden.label, label) for label in everything) for hidden in case.effects)
    first = bool(causes) and any(same(h.label, said[0]) for h in case.effects)
    value = _size(causes, case.effects)
    return _verdict(
        case,
        said=said,
        inseparable_from=tuple(inseparable),
        named=named,
        first=first,
        alone=first and len(causes) == len(case.effects) and not inseparable,
        size=math.nan if value is None else value[1].value,
        size_error=math.nan if value is None else value[1].standard_error,
        inside=None if value is None else _inside(*value),
        gain=causes[0].held_out_gain if causes else math.nan,
        held_out=_held_out(found),
        reached=_reached(found),
        seconds=seconds,
    )


def _verdict(case: Case, **said: object) -> Verdict:
    about = {
        "case": case.name, "source": case.source, "seed": case.seed, "aircraft": case.aircraft.name,
        "turbulence": case.turbulence, "signal_to_noise": case.signal_to_noise,
        "true_model_misfit": case.true_model_misfit,
        "hidden": tuple(h.label for h in case.effects), "sizes": tuple(h.size for h in case.effects),
    }  # fmt: skip
    return Verdict(**(about | said))  # type: ignore[arg-type]


def _size(causes: Sequence[Cause], hidden: Sequence[Hidden]) -> tuple[Hidden, ParameterEstimate] | None:
    """The first hidden effect that is said by its own label, and what is said of its size."""
    for effect in hidden:
        for cause in causes:
            estimate = _parameter(cause.parameters, effect)
            if same(effect.label, cause.label) and estimate is not None:
                return effect, estimate
    return None


def _parameter(parameters: Mapping[str, ParameterEstimate], hidden: Hidden) -> ParameterEstimate | None:
    """That of the hidden one's name, else the first; a derivative goes by its name alone."""
    if hidden.parameter in parameters or hidden.parameter in DERIVATIVES or not parameters:
        return parameters.get(hidden.parameter)
    return next(iter(parameters.values()))


def _inside(hidden: Hidden, estimate: ParameterEstimate) -> bool:
    return bool(abs(estimate.value - hidden.size) <= Z_95 * estimate.standard_error)


def _held_out(found: Diagnosis) -> float:
    """Largest drop of a channel's rms residual, percent."""
    if found.gain is None or not found.gain.change:
        return math.nan
    return -100.0 * min(interval.value for interval in found.gain.change.values())


def _reached(found: Diagnosis) -> float:
    """R2 says what is left, ``noise_fraction`` what of it no model takes away."""
    if found.gain is None:
        return math.nan
    reached, most = math.nan, 0.0
    for channel, before in found.gain.before.items():
        beyond, after = (
            (1.0 - before.r_squared) * (1.0 - before.noise_fraction),
            found.gain.after.get(channel),
        )
        weight = beyond / max(1.0 - before.r_squared, 1e-12) * before.tic
        if after is not None and weight > most:
            reached, most = min(1.0, (after.r_squared - before.r_squared) / beyond), weight
    return reached


@dataclass(frozen=True, slots=True)
class Figures:
    """Shares over cases in percent; None where there is no such case. Refused flights count in ``refused`` alone.

    Attributes:
        source: of the cases.
        one, two, healthy, refused: how many cases.
        named: of one effect: first, or in the set that the first cannot be distinguished from.
        first: the right cause first.
        alone: first, and nothing else said.
        inside: sizes in their stated 95 % interval, of those said.
        quiet: healthy cases without a claim.
        both: of two effects, both named.
        gain: median part of the squared misfit taken away on windows left out.
        held_out: median of the largest drop of a channel's rms residual on the second flight, percent.
        seconds: a case, median.
    """

    source: str
    one: int
    two: int
    healthy: int
    refused: int
    named: float | None
    first: float | None
    alone: float | None
    inside: float | None
    quiet: float | None
    both: float | None
    gain: float | None
    held_out: float | None
    seconds: float | None


def figures(source: str, verdicts: Sequence[Verdict]) -> Figures:
    """Figures of verdicts that belong together."""
    heard = [v for v in verdicts if not v.refusal]
    one = [v for v in heard if len(v.hidden) == 1]
    two = [v for v in heard if len(v.hidden) == 2]
    healthy = [v for v in heard if not v.hidden]
    return Figures(
        source, len(one), len(two), len(healthy), len(verdicts) - len(heard),
        named=_percent([all(v.named) for v in one]),
        first=_percent([v.first for v in one]),
        alone=_percent([v.alone for v in one]),
        inside=_percent([v.inside for v in heard if v.inside is not None]),
        quiet=_percent([not v.said for v in healthy]),
        both=_percent([all(v.named) for v in two]),
        gain=_median([v.gain for v in heard if v.hidden]),
        held_out=_median([v.held_out for v in heard if v.hidden]),
        seconds=_median([v.seconds for v in heard]),
    )  # fmt: skip


def confusion(verdicts: Sequence[Verdict]) -> dict[str, Counter[str]]:
    """Name of the first cause, or ``none``, counted by the hidden name; cases of one effect or none."""
    table: dict[str, Counter[str]] = {}
    for verdict in verdicts:
        if verdict.refusal or len(verdict.hidden) > 1:
            continue
        hidden = _name(verdict.hidden[0]) if verdict.hidden else "none"
        said = _name(verdict.said[0]) if verdict.said else "none"
        table.setdefault(hidden, Counter())[said] += 1
    return dict(sorted(table.items()))


def _name(label: str) -> str:
    return _plain(label).split("[")[0]


def _percent(answers: Sequence[bool]) -> float | None:
    return 100.0 * float(np.mean(answers)) if answers else None


def _median(values: Sequence[float]) -> float | None:
    finite = [value for value in values if math.isfinite(value)]
    return float(np.median(finite)) if finite else None
