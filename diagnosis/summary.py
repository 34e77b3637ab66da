"""What a diagnosis says in words: the answer in two sentences, and how channels, causes and figures are written.

The terminal and the report share these, so that both say the same.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from wingwatch.diagnosis.evidence import MATTERS
from wingwatch.diagnosis.result import Cause, Diagnosis, Interval, Misfit, ParameterEstimate
from wingwatch.pages.texts import listed, percent, probability_text, with_error

__all__ = [
    "Display",
    "beyond_noise",
    "by_misfit",
    "cause_title",
    "chances",
    "change_text",
    "display",
    "headline",
    "label_title",
    "parameter_text",
    "parameter_title",
    "unexplained_text",
]

_ONLY_NOISE = 0.8
"""A channel agrees where sensor noise explains at least this part of its residual's mean square."""

_MOST_SILENT = 6
"""Of the twelve main derivatives: where a flight judges fewer than half of them, it does not judge the simulation."""

_UNITS: Mapping[str, tuple[str, float]] = {
    "_rad_s2": ("deg/s²", math.degrees(1.0)),
    "_rad_s": ("deg/s", math.degrees(1.0)),
    "_rad": ("deg", math.degrees(1.0)),
    "_deg": ("deg", 1.0),
    "_m_s2": ("m/s²", 1.0),
    "_m_s": ("m/s", 1.0),
    "_m": ("m", 1.0),
    "_kg_m3": ("kg/m³", 1.0),
    "_s": ("s", 1.0),
    "_k": ("K", 1.0),
}
_NAMES: Mapping[str, str] = {
    "airspeed_true": "true airspeed",
    "airspeed_indicated": "indicated airspeed",
    "specific_force_x": "forward specific force",
    "specific_force_y": "lateral specific force",
    "specific_force_z": "normal specific force",
    "roll": "bank angle",
    "pitch": "pitch attitude",
}
_GROUPS: Mapping[str, str] = {
    "inertial": "the inertial sensors",
    "imu": "gyros and accelerometers",
    "vanes": "the vanes",
}
_CAUSES: Mapping[str, str] = {
    "cg_shift": "shift of the centre of gravity",
    "mass_inertia": "mass or inertia",
    "incidence_nonlinearity": "nonlinearity with angle of attack",
    "roll_yaw_coupling": "coupling of roll and yaw",
    "unknown": "unknown cause",
}


@dataclass(frozen=True, slots=True)
class Display:
    """How a channel is shown to a person.

    Attributes:
        name: in words.
        unit: shown unit; empty for a ratio.
        factor: from the channel's SI unit to the shown one.
    """

    name: str
    unit: str
    factor: float

    @property
    def axis(self) -> str:
        """Name with the unit, as an axis is titled."""
        return f"{self.name}, {self.unit}" if self.unit else self.name


def display(channel: str) -> Display:
    """How a channel of the flight table is shown; degrees in place of radians."""
    for suffix, (unit, factor) in _UNITS.items():
        if channel.endswith(suffix):
            stem = channel.removesuffix(suffix)
            return Display(_NAMES.get(stem, stem.replace("_", " ")), unit, factor)
    return Display(channel.replace("_", " "), "", 1.0)


def parameter_title(name: str) -> str:
    """A parameter's name in words, without the unit that stands behind its value."""
    shown = display(name.removesuffix("_kg"))
    return shown.name


def label_title(label: str) -> str:
    """A cause's label in words: ``sensor_delay[pitch_rad]`` is "sensor delay of pitch attitude"."""
    name, bracket, target = label.partition("[")
    first, space, rest = name.partition(
        " "
    )  # of a set that no flight can tell apart: "sensor_delay of all channels"
    words = _CAUSES.get(first, first.replace("_", " ")) + space + rest
    if not bracket:
        return words
    target = target.removesuffix("]")
    if name == "derivative":
        return f"derivative {target}"
    if name == "surface_stuck":
        return f"{target} stuck"
    shown = display(target)
    return f"{words} of {shown.name if shown.unit else _GROUPS.get(target, target.replace('_', ' '))}"


def cause_title(cause: Cause) -> str:
    """A cause's name and target in words."""
    return label_title(cause.label)


def chances(cause: Cause) -> str:
    """Its probability, and that of the set that it cannot be distinguished from."""
    alone = f"probability {probability_text(cause.probability)}"
    if not cause.indistinguishable_from or not math.isfinite(cause.set_probability):
        return alone
    return f"{alone}, {probability_text(cause.set_probability)} with those that this flight does not separate it from"


def parameter_text(name: str, parameter: ParameterEstimate) -> str:
    """A parameter with its standard error and unit."""
    unit = f" {parameter.unit}" if parameter.unit else ""
    return f"{parameter_title(name)} {with_error(parameter.value, parameter.standard_error)}{unit}"


def change_text(change: Interval) -> str:
    """A relative change with its 95 % interval: "43 % smaller (38 to 47)", or "+1 % (-2 to 4)" if it may be none."""
    if not math.isfinite(change.value):
        return "-"
    sign = -100.0 if change.high < 0.0 else 100.0
    ends = sorted((sign * change.low, sign * change.high))
    interval = f" ({ends[0]:.0f} to {ends[1]:.0f})" if all(map(math.isfinite, ends)) else ""
    if change.high < 0.0 or change.low > 0.0:
        return f"{sign * change.value:.0f} % {'smaller' if sign < 0.0 else 'larger'}{interval}"
    return f"{round(100.0 * change.value, 0) + 0.0:+.0f} %{interval}"


def beyond_noise(misfit: Misfit) -> float:
    """Theil's coefficient of the residual beyond sensor noise: what a better model could still take away."""
    noise = misfit.noise_fraction if math.isfinite(misfit.noise_fraction) else 0.0
    return misfit.tic * math.sqrt(min(max(1.0 - noise, 0.0), 1.0)) if math.isfinite(misfit.tic) else 0.0


def by_misfit(misfits: Mapping[str, Misfit]) -> tuple[str, ...]:
    """Channels, those that a better model could improve most first, and those whose noise is not known last."""

    def order(channel: str) -> tuple[bool, float]:
        misfit = misfits[channel]
        return not math.isfinite(misfit.noise_fraction), -beyond_noise(misfit)

    return tuple(sorted(misfits, key=order))


def headline(diagnosis: Diagnosis) -> tuple[str, str]:
    """The answer in two sentences: what is wrong and why; what the extension gains, empty where there is no cause."""
    doubt = diagnosis.another_aircraft
    question = (
        f"Is the file of {diagnosis.aircraft.name} the one of this aircraft? {doubt[:1].upper()}{doubt[1:]}. "
    )
    return f"{question if doubt else ''}{_what_and_why(diagnosis)}", _gained(diagnosis)


def _what_and_why(d: Diagnosis) -> str:
    wrong = [c for c in by_misfit(d.misfit) if not _agrees(d.misfit[c])]
    most = listed(display(channel).name for channel in wrong[:2])
    if d.causes:
        causes = listed(_brief(c) for c in d.causes[:3])
        more = f" and {len(d.causes) - 3} more" if len(d.causes) > 3 else ""
        where = f" departs from this flight most in {most}" if most else " departs from this flight"
        plural = "causes" if len(d.causes) > 1 else "cause"
        return f"The simulation of {d.aircraft.name}{where}; {plural} found: {causes}{more}."
    if len(d.not_judged) > _MOST_SILENT and not wrong:
        return (
            f"This flight moves the aircraft too little to judge the simulation of {d.aircraft.name}: an error of a "
            f"third in any of {listed(d.not_judged)} would not show. Its motion agrees."
        )
    if not wrong and d.unexplained_fraction == 0.0:
        return f"The simulation of {d.aircraft.name} agrees with this flight: what is left is sensor noise."
    if not wrong:
        return (
            f"The simulation of {d.aircraft.name} departs from this flight by more than its sensors' noise, but by no "
            "more than gusts and unmodelled moments of the size that was found; no cause is beyond doubt."
        )
    return (
        f"The simulation of {d.aircraft.name} departs from this flight most in {most}, "
        "but no cause is beyond doubt."
    )


def _agrees(misfit: Misfit) -> bool:
    return misfit.noise_fraction >= _ONLY_NOISE


def _brief(cause: Cause) -> str:
    """A cause with its first parameter."""
    for parameter in cause.parameters.values():
        unit = f" {parameter.unit}" if parameter.unit else ""
        return f"{cause_title(cause)} ({with_error(parameter.value, parameter.standard_error)}{unit})"
    return cause_title(cause)


def _gained(d: Diagnosis) -> str:
    if not d.causes:
        return ""
    if d.gain is None:
        return "No extended model is offered, because it does not pay on data left out."
    certain = [(c, i) for c, i in d.gain.change.items() if i.high < 0.0]
    if not certain:
        return f"On {d.gain.source} the extended model is not better beyond doubt in any channel."
    certain.sort(key=lambda item: item[1].value)
    largest = [item for item in certain[:2] if item[1].value <= -MATTERS] or certain[:1]
    worse = sorted(
        ((c, i) for c, i in d.gain.change.items() if i.low > MATTERS), key=lambda item: -item[1].value
    )
    but = f", but {_changes(worse[:1])}: no extended file is offered" if worse else ""
    return f"With the model extended, the residual on {d.gain.source} is {_changes(largest)}{but}."


def _changes(best: Sequence[tuple[str, Interval]]) -> str:
    return listed(f"{change_text(change)} in {display(channel).name}" for channel, change in best)


def unexplained_text(diagnosis: Diagnosis) -> str:
    """What the causes leave, in a sentence or two."""
    fraction = diagnosis.unexplained_fraction
    if not math.isfinite(fraction):
        return diagnosis.unexplained or "How much is left unexplained is not known."
    left = f"The causes found leave {percent(fraction)} of the misfit beyond noise unexplained."
    if not diagnosis.causes:
        left = "No cause was found, so all of the misfit beyond noise is unexplained."
        if fraction <= 0.0:
            left = "There is no misfit beyond noise."
    rest = diagnosis.unexplained
    if rest and fraction <= 0.0:
        left = "Almost no misfit remains beyond noise."
    stop = "" if not rest or rest.endswith(".") else "."
    return f"{left} {rest[:1].upper()}{rest[1:]}{stop}".strip()
