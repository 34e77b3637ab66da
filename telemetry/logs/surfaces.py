"""Surfaces out of servo outputs: what each autopilot's own parameters say of its outputs, undone.

The result is one more topic, ``surfaces``, whose fields ``elevator``, ``aileron`` and ``rudder`` are fractions of full
travel, -1 to 1, in the autopilots' sense: positive raises the nose, rolls to the right, yaws to the right. Mixed
surfaces are taken apart into the angles that they share (elevons: half of the sum and of the difference).
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.logs.log import AutopilotLog, Topic

__all__ = ["SURFACES_TOPIC", "with_surfaces"]

SURFACES_TOPIC = "surfaces"

Array = NDArray[np.float64]

_FULL_ANGLE = 4500.0
_MOST_SURFACES = 16
_THROTTLE = 70
_FIRST_SERVO = 201  # PX4's output functions: servo 1
_BEYOND = 1.5  # of full travel: a signal that holds a disarmed servo off
_OLD_MIXING = ("ELEVON_OUTPUT", "ELEVON_MIXING", "VTAIL_OUTPUT", "FLAPERON_OUTPUT")
_FUNCTIONS: Mapping[int, Mapping[str, float]] = {
    4: {"aileron": 1.0}, 19: {"elevator": 1.0}, 21: {"rudder": 1.0},
    77: {"elevator": 1.0, "aileron": -1.0}, 78: {"elevator": 1.0, "aileron": 1.0},
    79: {"elevator": 1.0, "rudder": 1.0}, 80: {"elevator": 1.0, "rudder": -1.0},
    24: {"aileron": 1.0}, 25: {"aileron": 1.0},
}  # fmt: skip
"""ArduPilot's output functions: which surfaces an output is a part of, and its sign in each. Elevons left and right,
V-tail left and right, flaperons left and right (whose flap is no part of the half difference)."""

_AXES: Mapping[str, str] = {"elevator": "P", "aileron": "R", "rudder": "Y"}
_TYPES: Mapping[int, tuple[str, ...]] = {
    1: ("aileron",), 2: ("aileron",), 15: ("aileron",), 3: ("elevator",), 4: ("rudder",),
    5: ("elevator", "aileron"), 6: ("elevator", "aileron"),
    7: ("elevator", "rudder"), 8: ("elevator", "rudder"), 13: ("elevator", "rudder"), 14: ("elevator", "rudder"),
}  # fmt: skip
"""PX4's types of control surfaces (CA_SV_CSn_TYPE): ailerons, elevator, rudder, elevons, V-tails, A-tails."""


@dataclass(frozen=True, slots=True)
class _Output:
    """One servo of an ArduPilot log."""

    number: int
    function: int
    low: float
    trim: float
    high: float
    reversed: bool

    def fraction(self, pwm: Array) -> Array:
        """Of full travel, -1 to 1; each side of the trim has a travel of its own. A signal of 0 is none."""
        side = np.where(pwm >= self.trim, self.high - self.trim, self.trim - self.low)
        with np.errstate(all="ignore"):
            value = (pwm - self.trim) / np.where(side > 0.0, side, np.nan)
        return np.where(pwm > 0.0, -value if self.reversed else value, np.nan)

    def range(self, pwm: Array) -> Array:
        """From 0 to 1, as a throttle has it."""
        value = (pwm - self.low) / max(self.high - self.low, 1.0)
        return np.where(pwm > 0.0, np.clip(1.0 - value if self.reversed else value, 0.0, 1.0), np.nan)


def with_surfaces(log: AutopilotLog) -> AutopilotLog:
    """The log with its surfaces as a topic of their own, and a note on where each comes from.

    A log without outputs, or whose outputs nothing explains, comes back with a note that says so.
    """
    if log.autopilot == "px4":
        made, notes = _px4(log)
    else:
        made, notes = _ardupilot(log)
    topics = dict(log.topics)
    if made is not None:
        topics[made.key] = made
    return replace(log, topics=topics, notes=(*log.notes, *notes))


def _topic(time_s: Array, fields: Mapping[str, Array]) -> Topic:
    return Topic(SURFACES_TOPIC, 0, time_s, dict(fields))


def _ardupilot(log: AutopilotLog) -> tuple[Topic | None, list[str]]:
    sent, prefix, suffix = log.get("RCOU"), "C", ""
    if sent is None:
        sent, prefix, suffix = log.get("SERVO_OUTPUT_RAW"), "servo", "_raw"
    if sent is not None:
        for key in _OLD_MIXING:
            if log.parameters.get(key, 0.0):
                return None, [f"surfaces are mixed by {key}, which is not undone: name them in a channel map"]
        channels = {name: f"{sent.name}.{name}" for name in sent.fields}
        outputs = [o for o in _outputs(log) if f"{prefix}{o.number}{suffix}" in channels]
        if outputs:
            return _from_outputs(sent, outputs, prefix, suffix)
    demands = log.get("AETR")
    if demands is not None:
        names = {"aileron": "Ail", "elevator": "Elev", "rudder": "Rudd"}
        fields = {s: demands.fields[n] / _FULL_ANGLE for s, n in names.items() if n in demands.fields}
        return _topic(demands.time_s, fields), ["surfaces are the demands of AETR, before trims and mixing"]
    return None, ["no servo output can be ascribed to a surface: name them in a channel map"]


def _from_outputs(sent: Topic, outputs: list[_Output], prefix: str, suffix: str) -> tuple[Topic, list[str]]:
    """Each surface the mean of the outputs that it is a part of."""
    parts: dict[str, list[Array]] = {}
    words: dict[str, list[str]] = {}
    for output in outputs:
        pwm = sent.fields[f"{prefix}{output.number}{suffix}"]
        name = f"{prefix}{output.number}{suffix}"
        if output.function == _THROTTLE:
            parts.setdefault("throttle", []).append(output.range(pwm))
            continue
        for surface, sign in _FUNCTIONS[output.function].items():
            parts.setdefault(surface, []).append(sign * output.fraction(pwm))
            turned = ", reversed" if output.reversed else ""
            words.setdefault(surface, []).append(
                f"{sent.name}.{name} ({output.low:g}, {output.trim:g}, {output.high:g} us{turned})"
            )
    fields = {surface: np.mean(np.stack(values), axis=0) for surface, values in parts.items()}
    return _topic(sent.time_s, fields), [f"{s} is commanded by {' and '.join(w)}" for s, w in words.items()]


def _outputs(log: AutopilotLog) -> list[_Output]:
    """Outputs with a function that is known; of logs before 2017 by RCn_ and RCMAP_ parameters."""
    found, parameters = [], log.parameters
    if any(re.fullmatch(r"SERVO\d+_FUNCTION", name) for name in parameters):
        for number in range(1, 33):
            function = log.number(f"SERVO{number}_FUNCTION")
            found.append(_output(parameters, f"SERVO{number}", number, function, "REVERSED", 1.0))
    else:
        main = {"ROLL": 4, "PITCH": 19, "THROTTLE": _THROTTLE, "YAW": 21}
        defaults = {"ROLL": 1, "PITCH": 2, "THROTTLE": 3, "YAW": 4}
        functions = {log.number(f"RCMAP_{n}", defaults[n]): f for n, f in main.items()}
        for number in range(1, 17):
            function = log.number(f"RC{number}_FUNCTION") or functions.get(number, 0)
            found.append(_output(parameters, f"RC{number}", number, function, "REV", -1.0))
    return [output for output in found if output is not None]


def _output(
    parameters: Mapping[str, float], name: str, number: int, function: int, turned: str, when: float
) -> _Output | None:
    if function not in _FUNCTIONS and function != _THROTTLE:
        return None
    keys = (f"{name}_MIN", f"{name}_TRIM", f"{name}_MAX")
    if not all(key in parameters for key in keys):
        return None
    low, trim, high = (parameters[key] for key in keys)
    return _Output(number, function, low, trim, high, parameters.get(f"{name}_{turned}", 0.0) == when)


def _px4(log: AutopilotLog) -> tuple[Topic | None, list[str]]:
    servos = log.get("actuator_servos")
    if servos is not None:
        made = _allocated(log, servos)
        if made is not None:
            return made
    group = 1 if log.vehicle == "vtol" and log.get("actuator_controls_1") is not None else 0
    controls = log.get(f"actuator_controls_{group}")
    if controls is not None and "control[2]" in controls.fields:
        fields = {
            s: controls.fields[f"control[{i}]"] for i, s in enumerate(("aileron", "elevator", "rudder"))
        }
        return _topic(controls.time_s, fields), [f"surfaces are commanded by {controls.name}, before mixing"]
    torque = log.get("vehicle_torque_setpoint")
    if torque is not None and "xyz[2]" in torque.fields:
        fields = {s: torque.fields[f"xyz[{i}]"] for i, s in enumerate(("aileron", "elevator", "rudder"))}
        return _topic(torque.time_s, fields), [
            "surfaces are vehicle_torque_setpoint, before allocation and trims"
        ]
    servos = _px4_link(log)
    made = None if servos is None else _allocated(log, servos)
    if made is None:
        return None, ["no servo output can be ascribed to a surface: name them in a channel map"]
    return made[0], [*made[1], "the servo signals of port 0 are taken for PX4's main outputs (PWM_MAIN)"]


def _px4_link(log: AutopilotLog) -> Topic | None:
    """The allocation's outputs out of the signals that PX4 sends over its link; None where nothing says what they are.

    PX4 puts an output from -1 to 1 linearly between the minimum and the maximum of its signal.
    """
    name, first = "servo{}_raw", 1
    sent = log.get("SERVO_OUTPUT_RAW")
    if sent is None:
        name, first = "actuator[{}]", 0
        sent = log.get("ACTUATOR_OUTPUT_STATUS")
    fields: dict[str, Array] = {}
    for number in range(1, _MOST_SURFACES + 1):
        servo = log.number(f"PWM_MAIN_FUNC{number}") - _FIRST_SERVO
        low, high = (log.parameters.get(f"PWM_MAIN_{end}{number}", 0.0) for end in ("MIN", "MAX"))
        signal = None if sent is None else sent.fields.get(name.format(number - 1 + first))
        if not 0 <= servo < _MOST_SURFACES or signal is None or not high > low:
            continue
        value = (2.0 * signal - low - high) / (high - low)
        turned = log.number("PWM_MAIN_REV") >> (number - 1) & 1
        value = np.where((signal > 0.0) & (np.abs(value) <= _BEYOND), -value if turned else value, np.nan)
        fields[f"control[{servo}]"] = value
    return Topic("actuator_servos", 0, sent.time_s, fields) if sent is not None and fields else None


def _allocated(log: AutopilotLog, servos: Topic) -> tuple[Topic, list[str]] | None:
    """By the types and torques of PX4's control allocation; None where it has no surfaces."""
    parts: dict[str, list[Array]] = {}
    words: dict[str, list[str]] = {}
    for number in range(min(log.number("CA_SV_CS_COUNT"), _MOST_SURFACES)):
        kind = log.number(f"CA_SV_CS{number}_TYPE")
        control = servos.fields.get(f"control[{number}]")
        for surface in _TYPES.get(kind, ()) if control is not None else ():
            torque = log.parameters.get(f"CA_SV_CS{number}_TRQ_{_AXES[surface]}", 0.0)
            if control is None or not torque:
                continue
            parts.setdefault(surface, []).append(np.sign(torque) * control)
            words.setdefault(surface, []).append(f"actuator_servos.control[{number}]")
    if not parts:
        return None
    fields = {surface: np.mean(np.stack(values), axis=0) for surface, values in parts.items()}
    notes = [f"{s} is commanded by {' and '.join(w)}" for s, w in words.items()]
    return _topic(servos.time_s, fields), notes
