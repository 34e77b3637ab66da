"""What a flight could have shown: by cause the smallest size that would have been noticed, and what would show more."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from wingwatch.monitor.detection.redundancy import Hypothesis
from wingwatch.monitor.views import CouldSeeView

__all__ = ["beside_lacking", "could_see"]

_AIRFRAME_INPUT: Mapping[str, str] = {
    "icing": "a doublet of the elevator",
    "elevator_effectiveness": "a doublet of the elevator",
    "aileron_effectiveness": "a doublet of the aileron",
    "rudder_effectiveness": "a doublet of the rudder",
    "pitch_damping": "a doublet of the elevator",
    "cg_shift": "a doublet of the elevator",
    "wing_damage": "a doublet of the aileron",
}
_CHANNEL_INPUT: Mapping[str, str] = {
    "elevator_rad": "a command of the elevator",
    "aileron_rad": "a command of the aileron",
    "rudder_rad": "a command of the rudder",
    "roll_rate_rad_s": "a doublet of the aileron",
    "pitch_rate_rad_s": "a doublet of the elevator",
    "yaw_rate_rad_s": "a doublet of the rudder",
    "angle_of_attack_rad": "a doublet of the elevator",
    "sideslip_rad": "a doublet of the rudder",
    "throttle": "a change of throttle",
    "airspeed_true_m_s": "a change of airspeed",
}
ENOUGH = 0.1
"""Fraction of a surface's effectiveness, of thrust, of a scale, or severity of ice: who would see so little needs no
input."""


def could_see(
    airframe: Mapping[str, float | None], relations: Sequence[tuple[Hypothesis, float | None]]
) -> tuple[CouldSeeView, ...]:
    """Both in one table.

    Args:
        airframe: by cause, from blocks of derivatives.
        relations: by hypothesis, from analytical redundancy; one of fixed size is seen wholly or not at all.
    """
    found: dict[tuple[str, str | None], CouldSeeView] = {}
    for cause, size in airframe.items():
        wanted = _AIRFRAME_INPUT.get(cause, "") if size is None or size > ENOUGH else ""
        found[cause, None] = CouldSeeView(cause, None, size, "", wanted)
    for hypothesis, smallest in relations:
        size = smallest
        if hypothesis.size_std == 0.0:
            size = 1.0 if smallest is not None and smallest <= 1.0 else None
        elif smallest is not None and smallest > _MOST.get(hypothesis.unit, float("inf")):
            size = None
        help_needed = size is None or (hypothesis.unit == "" and hypothesis.size_std > 0.0 and size > ENOUGH)
        key = hypothesis.cause, hypothesis.channel or None
        inputs = _CHANNEL_INPUT.get(hypothesis.channel) or _AIRFRAME_INPUT.get(hypothesis.cause, "")
        before = found[key].smallest_size if key in found else None
        if key not in found or (size is not None and (before is None or size < before)):
            unit = hypothesis.unit.replace("1", "")
            found[key] = CouldSeeView(*key, size, unit, inputs if help_needed else "")
    return tuple(found.values())


def beside_lacking(rows: Sequence[CouldSeeView], lacking: Collection[str]) -> tuple[CouldSeeView, ...]:
    """The table of a flight that has not these surfaces, by column: nothing is said of them or wanted from them."""
    names = [channel.removesuffix("_rad") for channel in lacking]
    kept = [row for row in rows if row.cause not in {f"{name}_effectiveness" for name in names}]
    return tuple(
        replace(row, input="") if any(row.input.endswith(f"of the {name}") for name in names) else row
        for row in kept
    )


_MOST: Mapping[str, float] = {"": 1.0, "s": 1.0, "rad": 1.0, "rad/s": 1.0, "m/s2": 20.0}
"""By unit, a size beyond which nothing is said."""
