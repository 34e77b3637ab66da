"""What may have failed, and what it makes of the relations' parameters: one entry a cause and part."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.monitor.detection.redundancy.layout import (
    AILERON,
    AIRSPEED,
    ALPHA,
    AXIAL,
    BETA,
    COLUMNS,
    EAST,
    ELEVATOR,
    HEADING,
    LIFT,
    NORTH,
    PARAMETERS,
    PARAMETERS_OF_ROW,
    PITCH,
    PITCHING,
    PRIORS,
    RELATIONS,
    ROLL,
    ROLLING,
    RUDDER,
    SIDE,
    YAWING,
    parameter_index,
)

__all__ = ["HYPOTHESES", "USED_BY", "Effect", "Hypothesis", "Parts", "recovery_from", "with_effects"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Effect:
    """What a hypothesis does to one relation.

    Attributes:
        direction: (COLUMNS,), by size 1.
        free: (COLUMNS,), standard deviation of what it changes besides.
        proves: whether it may be claimed by this relation alone; else that counts no more than those that prove it.
        by_size: (COLUMNS,), the same for each unit of the size: a direction is known to a fraction of itself.
    """

    direction: Array
    free: Array = field(default_factory=lambda: np.zeros(COLUMNS))
    by_size: Array = field(default_factory=lambda: np.zeros(COLUMNS))
    proves: bool = True

    def varying(self, size: float) -> Array:
        """Standard deviation of what it may change besides where it has that size, (COLUMNS,)."""
        return np.hypot(self.free, size * self.by_size)


class Parts(NamedTuple):
    """Effects of a hypothesis as kernels take them: ``relations`` and how many ``parameters`` each has (p,), what
    ``Effect`` says of each (p, COLUMNS), and whether it ``proves`` (p,)."""

    relations: NDArray[np.int64]
    parameters: NDArray[np.int64]
    directions: Array
    free: Array
    by_size: Array
    proves: NDArray[np.bool_]


@dataclass(frozen=True)
class Hypothesis:
    """One cause that befalls one part.

    Attributes:
        cause: of the shared vocabulary; channel: the part, by its column of the flight table.
        kind: of its alert.
        size_std: standard deviation of its size beforehand; 0 where the size is 1 and nothing else.
        signed: whether the size may be negative.
        unit: of the size; ``levels``: sizes from which an alert is a warning, and critical.
        words, advice: what the operator reads; ``{size}`` stands in the words.
        effects: by relation.
        part: of the airframe, where the channel does not say it: ``tail``, ``left``.
        late: named only after some seconds, and by 99 %: ice follows no table, and looks like lost thrust at first.
        repeated: relation whose own reading repeats, where that is the fault.
    """

    cause: str
    channel: str
    kind: str
    size_std: float
    signed: bool
    unit: str
    levels: tuple[float, float]
    words: str
    advice: str
    effects: Mapping[int, Effect] = field(default_factory=dict)
    repeated: int | None = None
    late: bool = False
    part: str = ""

    @property
    def key(self) -> tuple[str, str, str]:
        """Cause, channel and part: one fault at a time has them."""
        return self.cause, self.channel, self.part

    @property
    def is_of_airframe(self) -> bool:
        """Whether it befalls the airframe, and no channel shows it alone."""
        return not self.channel

    def without(self, relations: frozenset[int]) -> "Hypothesis | None":
        """It as other relations show it; None where they do not."""
        if self.repeated in relations:
            return None
        if not relations & frozenset(self.effects):
            return self
        left = {i: e for i, e in self.effects.items() if i not in relations}
        said = any(e.direction.any() for e in left.values())
        return replace(self, effects=left) if said or self.repeated is not None else None

    @cached_property
    def parts(self) -> Parts:
        """Its effects by relation."""
        relations, effects = np.array(list(self.effects), dtype=np.int64), list(self.effects.values())
        tables = (np.array([getattr(e, name) for e in effects]) for name in ("direction", "free", "by_size"))
        directions, free, by_size = (table.reshape(-1, COLUMNS) for table in tables)
        proves = np.array([e.proves for e in effects], dtype=np.bool_)
        return Parts(relations, PARAMETERS_OF_ROW[relations], directions, free, by_size, proves)

    @cached_property
    def relations(self) -> frozenset[int]:
        """Those that it shows in."""
        return frozenset(self.effects) | ({self.repeated} if self.repeated is not None else set())

    def level(self, size: float) -> str:
        """``watch``, ``warning`` or ``critical``; ``size`` in the unit of the hypothesis."""
        return (
            "critical"
            if abs(size) >= self.levels[1]
            else "warning"
            if abs(size) >= self.levels[0]
            else "watch"
        )


def with_effects(hypothesis: Hypothesis, more: Mapping[int, Effect]) -> Hypothesis:
    """It shows in more relations, too."""
    return replace(hypothesis, effects={**hypothesis.effects, **more})


def _effect(relation: int, direction: Mapping[str, float], free: Mapping[str, float] | None = None) -> Effect:
    a, f = np.zeros(COLUMNS), np.zeros(COLUMNS)
    for name, value in direction.items():
        a[parameter_index(relation, name)] = value
    for name, value in (free or {}).items():
        f[parameter_index(relation, name)] = value
    return Effect(a, f)


def _everywhere(parameter: str) -> dict[int, Effect]:
    """A fault in every relation that has it as a parameter."""
    return {i: _effect(i, {parameter: 1.0}) for i, names in enumerate(PARAMETERS) if parameter in names}


_SENSOR_ADVICE = "Do not trust this reading, nor derivatives estimated with it."


def _surface(relation: int, name: str) -> list[Hypothesis]:
    channel, word = f"{name}_rad", name.capitalize()
    return [
        Hypothesis(
            "surface_stuck", channel, "damage", 0.0, False, "", (0.0, 0.0),
            f"{word} does not follow its command: stuck, or its position sensor is", "Land as soon as possible.",
            {relation: _effect(relation, {"not following": 1.0}, {"offset": 0.3})},
        ),
        Hypothesis(
            "surface_offset", channel, "damage", 0.05, True, "rad", (0.05, 0.15),
            f"{word} stands {{size}} beside its command", "Check the linkage; land as soon as practical.",
            {relation: _effect(relation, {"offset": 1.0})},
        ),
        Hypothesis(
            "actuator_lag", channel, "damage", 0.1, False, "s", (0.1, 0.3),
            f"{word} follows its command {{size}} later than it did", "Avoid quick manoeuvres.",
            {relation: _effect(relation, {"lag": 1.0})},
        ),
    ]  # fmt: skip


def _bias(channel: str, std: float, unit: str, levels: tuple[float, float], word: str) -> Hypothesis:
    return Hypothesis(
        "sensor_bias", channel, "sensor", std, True, unit, levels, f"{word} reads {{size}} too much",
        _SENSOR_ADVICE, _everywhere(f"{channel} bias"),
    )  # fmt: skip


def _gyro(rate: str, word: str) -> list[Hypothesis]:
    bias = _bias(rate, 0.02, "rad/s", (0.01, 0.05), word)
    return [
        bias,
        Hypothesis(
            "sensor_scale", rate, "sensor", 0.2, True, "", (0.1, 0.3), f"{word} reads {{size}} too much",
            _SENSOR_ADVICE, _everywhere(f"{rate} scale"),
        ),
        Hypothesis(
            "sensor_delay", rate, "sensor", 0.1, False, "s", (0.05, 0.15), f"{word} is {{size}} late",
            _SENSOR_ADVICE, _everywhere(f"{rate} delay"),
        ),
    ]  # fmt: skip


def _vane(channel: str, word: str) -> list[Hypothesis]:
    return [_bias(channel, 0.05, "rad", (0.02, 0.06), word)]


def _frozen(relation: int, word: str, advice: str = _SENSOR_ADVICE) -> Hypothesis:
    channel = RELATIONS[relation].channels[0] if relation < NORTH else RELATIONS[relation].channels[1]
    levels = (0.0, 0.0) if relation in (ROLL, PITCH, AIRSPEED) else (0.0, np.inf)
    return Hypothesis(
        "sensor_freeze", channel, "sensor", 0.0, False, "", levels, f"{word} is frozen", advice, {}, relation,
    )  # fmt: skip


def _airspeed() -> list[Hypothesis]:
    scale, follow = "airspeed_true_m_s scale", "airspeed_true_m_s not following"
    shown = _everywhere(scale)
    squares = _effect(
        AXIAL, {"drag": 0.6, "thrust loss": 0.6}
    ).direction  # a third of its own part at a size of 0.2
    shown[AXIAL] = replace(shown[AXIAL], by_size=squares)
    return [
        Hypothesis(
            "airspeed_error", "airspeed_true_m_s", "sensor", 0.15, True, "", (0.05, 0.15),
            "Airspeed reads {size} too much", "Fly by attitude and throttle; " + _SENSOR_ADVICE.lower(), shown,
        ),
        Hypothesis(
            "sensor_freeze", "airspeed_true_m_s", "sensor", 0.0, False, "", (0.0, 0.0),
            "Airspeed is frozen: the pitot tube may be blocked",
            "Fly by attitude and throttle; " + _SENSOR_ADVICE.lower(),
            {AIRSPEED: _effect(AIRSPEED, {follow: 1.0})},
        ),
        _frozen(
            AIRSPEED, "Airspeed", "The pitot tube may be blocked. Fly by attitude and throttle; do not trust it."
        ),
    ]  # fmt: skip


def _thrust() -> list[Hypothesis]:
    return [
        Hypothesis(
            "thrust_loss", "throttle", "damage", 0.4, False, "", (0.15, 0.5), "{size} of the thrust is lost",
            "Find a place to land within gliding range; check propeller, engine and battery.",
            {AXIAL: _effect(AXIAL, {"thrust loss": 1.0})}, late=True,
        ),
        Hypothesis(
            "drag", "specific_force_x_m_s2", "unexplained", 1.0, False, "", (0.2, 0.5),
            "Drag has grown by {size} of its zero-lift part", "Ice or damage is possible; inspect.",
            {AXIAL: replace(_effect(AXIAL, {"drag": 1.0}), by_size=_effect(AXIAL, {"induced drag": 0.5}).direction)},
            late=True,
        ),
    ]  # fmt: skip


def recovery_from(hypothesis: Hypothesis, size: float) -> Hypothesis:
    """The fault of that size is gone."""
    effects = {i: Effect(-size * e.direction, e.varying(size)) for i, e in hypothesis.effects.items()}
    return replace(hypothesis, cause="recovered", size_std=0.0, effects=effects)


def _unknown(relation: int) -> Hypothesis:
    free = np.where(PRIORS[relation] > 1e-8, 2.0 * PRIORS[relation], 0.0)
    return Hypothesis(
        "unknown", RELATIONS[relation].channels[0], "unexplained", 0.0, False, "", (np.inf, np.inf),
        f"A contradiction of {RELATIONS[relation].name}", "Compare with the evidence and inspect.",
        {relation: Effect(np.zeros(COLUMNS), free)},
    )  # fmt: skip


_AIRFRAME = (LIFT, SIDE, ROLLING, PITCHING, YAWING)
USED_BY: Mapping[str, frozenset[int]] = {
    "airspeed_true_m_s": frozenset((AIRSPEED, ALPHA, BETA, AXIAL, NORTH, EAST, *_AIRFRAME)),
    "angle_of_attack_rad": frozenset((AIRSPEED, ALPHA, NORTH, EAST, LIFT, PITCHING)),
    "sideslip_rad": frozenset((AIRSPEED, BETA, NORTH, EAST, SIDE, ROLLING, YAWING)),
    "roll_rate_rad_s": frozenset((ROLL, BETA, SIDE, ROLLING, YAWING)),
    "pitch_rate_rad_s": frozenset((PITCH, HEADING, ALPHA, LIFT, PITCHING)),
    "yaw_rate_rad_s": frozenset((PITCH, HEADING, BETA, SIDE, ROLLING, YAWING)),
    "elevator_rad": frozenset((ELEVATOR, LIFT, PITCHING)),
    "aileron_rad": frozenset((AILERON, SIDE, ROLLING, YAWING)),
    "rudder_rad": frozenset((RUDDER, SIDE, ROLLING, YAWING)),
    "roll_rad": frozenset((ROLL, PITCH, HEADING, AIRSPEED, ALPHA, BETA, NORTH, EAST)),
    "pitch_rad": frozenset((ROLL, PITCH, HEADING, AIRSPEED, ALPHA, BETA, NORTH, EAST)),
    "heading_rad": frozenset((HEADING, NORTH, EAST)),
    "specific_force_x_m_s2": frozenset((AIRSPEED, ALPHA, AXIAL)),
    "specific_force_y_m_s2": frozenset((AIRSPEED, BETA, SIDE)),
    "specific_force_z_m_s2": frozenset((AIRSPEED, ALPHA, AXIAL, LIFT)),
    "velocity_north_m_s": frozenset((NORTH, EAST)),
}
"""Relations that a channel takes part in: while it is at fault they show nothing else."""

HYPOTHESES: tuple[Hypothesis, ...] = (
    *_surface(ELEVATOR, "elevator"),
    *_surface(AILERON, "aileron"),
    *_surface(RUDDER, "rudder"),
    *_gyro("roll_rate_rad_s", "Roll rate"),
    *_gyro("pitch_rate_rad_s", "Pitch rate"),
    *_gyro("yaw_rate_rad_s", "Yaw rate"),
    _bias("roll_rad", 0.05, "rad", (0.03, 0.1), "Bank angle"),
    _bias("pitch_rad", 0.05, "rad", (0.03, 0.1), "Pitch attitude"),
    _bias("heading_rad", 0.1, "rad", (0.05, 0.2), "Heading"),
    *_airspeed(),
    _bias("specific_force_x_m_s2", 0.3, "m/s2", (0.3, 1.0), "The forward accelerometer"),
    _bias("specific_force_y_m_s2", 0.3, "m/s2", (0.3, 1.0), "The lateral accelerometer"),
    _bias("specific_force_z_m_s2", 0.3, "m/s2", (0.3, 1.0), "The normal accelerometer"),
    *_vane("angle_of_attack_rad", "Angle of attack"),
    *_vane("sideslip_rad", "Sideslip"),
    *_thrust(),
    _frozen(ROLL, "Bank angle"),
    _frozen(PITCH, "Pitch attitude"),
    _frozen(HEADING, "Heading"),
    _frozen(ALPHA, "Angle of attack"),
    _frozen(BETA, "Sideslip"),
    _frozen(NORTH, "Velocity over the ground"),
    *(_unknown(i) for i in (ELEVATOR, AILERON, RUDDER)),
)
"""Everything that competes; what no active relation shows is left out.

What no hypothesis describes is one of surfaces alone: gusts are no random walk, an attitude is a filter's estimate, and
of the axial force drag is what is not thrust."""
