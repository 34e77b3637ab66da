"""Cases flown by JSBSim: its bundled aircraft, with effects by its own means.

The aircraft are those of ``jsbsim_aircraft`` that a linear model describes (a constant force for the engine, no flight
control system, no drag by sideslip, which would pitch an aircraft whose centre of gravity is off the plane of its
forces). Servos are ours, and a loop that holds pitch and bank. The file has geometry, mass, servos, and one of two:
JSBSim's own linearised derivatives at the trim, or, of some aircraft, JSBSim's coefficients (``jsbsim_file``).

Effects on the aircraft change JSBSim's configuration before it is loaded: aerodynamic functions scaled, mass and
inertias, the place of the centre of gravity. The size of ``pitch_damping`` and ``derivative`` is the ratio of what the
file states (JSBSim's linearised derivative, or the coefficient about the centre of gravity) after to before, minus 1: a
scaled term is not all of it. Sensor effects are put on the recorded columns (``diagnosis_readings``).
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from diagnosis_air import Servo, gusts
from diagnosis_draw import drawn, flyable
from diagnosis_hidden import CATALOGUE, SURFACES, Array, Case, Hidden
from diagnosis_inputs import KINDS, commands
from diagnosis_jsbsim_flight import STEP_HZ, Holds, jsbsim_motion
from diagnosis_readings import SENSOR_EFFECTS, Motion, Recorder
from jsbsim_aircraft import AIRCRAFT, Subject, misfit
from jsbsim_file import peer_aircraft
from jsbsim_peer import FT, Peer

from wingwatch.aircraft import (
    LATERAL,
    SHORT_PERIOD,
    SURFACE_OF_INPUT,
    Actuator,
    Actuators,
    Aircraft,
    ConditionEntry,
    DerivativeEntry,
    FlightCondition,
    Geometry,
    Mass,
    Mode,
    Sensors,
    load_aircraft,
)
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock

__all__ = ["JsbsimPlan", "as_stated", "draw_jsbsim", "subject_with"]

NAMES: dict[str, tuple[float, float]] = {
    "c172r": (0.9, 1.4), "c310": (0.9, 1.4), "pa28": (0.95, 1.4), "L17": (0.9, 1.0), "F80C": (0.9, 1.4),
    "B17": (0.9, 1.4),
}  # fmt: skip
"""Aircraft whose accelerations the linear model describes to 5 % of their size after two degrees of doublets, and the
airspeeds where that is so, over those of ``jsbsim_aircraft``."""
WITH_COEFFICIENTS = ("pa28", "L17", "B17")
"""Those whose aerodynamics the aircraft file has words for, so that its linearisation is JSBSim's."""
WITHOUT = ("aero/coefficient/CDbeta",)
EFFECTS = (
    *(f"{surface}_effectiveness" for surface in SURFACES), "surface_offset", "cg_shift", "mass_inertia",
    "pitch_damping", "actuator_lag", "actuator_rate_limit", "actuator_backlash", "derivative", *SENSOR_EFFECTS,
)  # fmt: skip
ROWS = tuple(row for row in CATALOGUE if row.name in EFFECTS)
_SERVOS = ("actuator_", "surface_")
STATED_ERROR = 0.1
"""Standard error of a stated derivative, of its natural size."""
HOW_OFTEN = {"none": 0.5, "light": 0.4, "moderate": 0.1}
NOISE = load_aircraft("twinotter").sensors.noise_std
HOLDS = Holds()

_PROPERTIES = {
    "beta": ("aero/beta-rad",),
    "p": ("velocities/p-aero-rad_sec", "velocities/p-rad_sec"),
    "q": ("velocities/q-aero-rad_sec", "velocities/q-rad_sec"),
    "r": ("velocities/r-aero-rad_sec", "velocities/r-rad_sec"),
    "elevator": ("fcs/elevator-pos-rad", "fcs/mag-elevator-pos-rad"),
    "aileron": ("fcs/left-aileron-pos-rad", "fcs/right-aileron-pos-rad"),
    "rudder": ("fcs/rudder-pos-rad",),
    "alphadot": ("aero/alphadot-rad_sec",),
}
_AXIS = {"z": "LIFT", "y": "SIDE", "l": "ROLL", "m": "PITCH", "n": "YAW"}
_INDEX = {"w": "alpha", "v": "beta", "p": "p", "q": "q", "r": "r", **SURFACE_OF_INPUT}


def _regressor(function: ET.Element) -> str:
    """What an aerodynamic term goes with: a rate, an angle or a surface; ``alpha`` where only that is in it."""
    named = {(element.text or "").strip() for element in function.iter("property")}
    for regressor, properties in _PROPERTIES.items():
        if named & set(properties):
            return regressor
    tables = {(element.text or "").strip() for element in function.iter("independentVar")}
    return "alpha" if "aero/alpha-rad" in named | tables else ""


def _scale(tree: ET.Element, axis: str, regressor: str, factor: float) -> None:
    """Every term of an axis (of all, where it is empty) that goes with a regressor times a factor."""
    for element in tree.findall("aerodynamics/axis"):
        if axis and element.get("name") != axis:
            continue
        for function in element.findall("function"):
            product = function.find("product")
            if product is not None and _regressor(function) == regressor:
                ET.SubElement(product, "value").text = repr(factor)


def _shift_centre(tree: ET.Element, shift_m: float) -> None:
    """The centre of gravity further aft, and with it the thrust that goes through it."""
    for place in (
        tree.find("mass_balance/location[@name='CG']"),
        tree.find("external_reactions/force/location"),
    ):
        assert place is not None
        along = place.find("x")
        assert along is not None
        unit = {"IN": FT / 12.0, "FT": FT, "M": 1.0}[place.get("unit", "IN")]
        along.text = repr(float(along.text or "") + shift_m / unit)


def _change(effects: Sequence[Hidden]) -> Callable[[ET.Element], None]:
    """What effects do to a description."""

    def change(tree: ET.Element) -> None:
        for effect in effects:
            if effect.name.endswith("_effectiveness"):
                _scale(tree, "", effect.name.removesuffix("_effectiveness"), 1.0 - effect.size)
            elif effect.name == "pitch_damping":
                _scale(tree, "PITCH", "q", 1.0 + effect.size)
            elif effect.name == "derivative":
                row, index = effect.target.split("_")
                _scale(tree, _AXIS[row], _INDEX[index], 1.0 + effect.size)
            elif effect.name == "cg_shift":
                _shift_centre(tree, effect.size)

    return change


def _peer(name: str, effects: Sequence[Hidden], mass: Mass | None) -> Peer:
    return Peer(name, rate_hz=STEP_HZ, without=WITHOUT, mass=mass, change=_change(effects), second_order=True)


def subject_with(name: str, condition: FlightCondition, effects: Sequence[Hidden] = ()) -> Subject:
    """A bundled aircraft with effects, trimmed.

    Raises:
        ValueError: no level flight there.
    """
    heavier = next((effect.size for effect in effects if effect.name == "mass_inertia"), None)
    mass = None
    if heavier is not None:
        before = Subject(name, condition, _peer(name, (), None)).peer.mass
        mass = Mass(**{key: value * (1.0 + heavier) for key, value in before.model_dump().items()})
    return Subject(name, condition, _peer(name, effects, mass))


def as_stated(effect: Hidden, before: Subject, after: Subject, coefficients: bool = False) -> Hidden:
    """The effect with the size that the aircraft's file would show, where its size is that of a derivative."""
    if effect.name not in ("pitch_damping", "derivative"):
        return effect
    symbol = effect.target or "m_q"
    old, new = (_stated(subject, symbol, coefficients) for subject in (before, after))
    return replace(effect, size=new / old - 1.0)


def _stated(subject: Subject, symbol: str, coefficients: bool) -> float:
    """A derivative as a file states it: concise, or the coefficient behind it."""
    if not coefficients:
        return subject.truth_at(subject.condition.airspeed_true_m_s)[0][symbol]
    row, index = symbol.split("_")
    table = peer_aircraft(subject.peer, subject.trim).need_coefficients("the size of an effect")
    group = getattr(table, {"z": "CL", "y": "CY", "l": "Cl", "m": "Cm", "n": "Cn"}[row])
    return float(getattr(group, _INDEX[index]))


@dataclass(frozen=True)
class JsbsimPlan:
    """How a case is flown, all but its effects.

    Attributes:
        seed: of noise and gusts.
        name: of the bundled aircraft.
        condition: where it flies.
        inputs: commands added to the trim's, rad, (samples, 3), of the flight and of the held-out one.
        servo_hz: bandwidth of the servos, as the file has it.
        holds: gains of the loop.
        louder: noise over that of the Twin Otter's file.
        turbulence: of both flights.
        coefficients: whether the file states coefficients instead of derivatives.
        fixed: name of a fixed case.
    """

    seed: int
    name: str
    condition: FlightCondition
    inputs: tuple[Array, Array]
    servo_hz: float = 8.0
    holds: Holds = HOLDS
    louder: float = 1.0
    turbulence: str = "none"
    coefficients: bool = False
    fixed: str = ""

    @cached_property
    def aircraft(self) -> Aircraft:
        """The file of the aircraft without effects."""
        noise = {column: self.louder * std for column, std in NOISE.items()}
        make = file_of_coefficients if self.coefficients else file_of_derivatives
        return make(self._subject(()), self.servo_hz, noise)

    @cached_property
    def _recorder(self) -> Recorder:
        return Recorder(self._motion, self.seed, self.aircraft.sensors.noise_std, self.turbulence == "none")

    @cached_property
    def _subjects(self) -> dict[tuple[Hidden, ...], Subject]:
        """Loaded aircraft of this plan alone: what JSBSim did before shows in the last digits of what it does next."""
        return {}

    def _subject(self, effects: Sequence[Hidden]) -> Subject:
        key = tuple(e for e in effects if e.name not in SENSOR_EFFECTS and not e.name.startswith(_SERVOS))
        if key not in self._subjects:
            self._subjects[key] = subject_with(self.name, self.condition, key)
        return self._subjects[key]

    def ideal(self, effects: Sequence[Hidden]) -> Array | None:
        """The flight in still air without noise; None where it cannot be flown."""
        return self._recorder.table(effects, 0, ideal=True)

    def case(self, effects: Sequence[Hidden], signal: float) -> Case | None:
        """The case; None where it cannot be flown."""
        flights = [self._recorder.table(effects, which) for which in (0, 1)]
        if flights[0] is None or flights[1] is None:
            return None
        before = self._subject(())
        try:
            stated = tuple(as_stated(e, before, self._subject((e,)), self.coefficients) for e in effects)
        except ValueError:  # coefficients that no aircraft file can state
            return None
        return Case(
            "jsbsim", self.seed, self.aircraft, SampleBlock(flights[0]), SampleBlock(flights[1]),
            {f"{surface}_rad": "position" for surface in SURFACES}, stated, self.turbulence, signal, self.fixed,
            self._misfit(effects),
        )  # fmt: skip

    def _misfit(self, effects: Sequence[Hidden]) -> float:
        """What the true linear model leaves of the held-out flight, the worse of the two structures."""
        motion = self._recorder.motion(effects, 1)
        assert motion is not None
        subject = self._subject(effects)
        return max(misfit(subject, s, motion.table, motion.spin) for s in (SHORT_PERIOD, LATERAL))

    def _motion(self, effects: tuple[Hidden, ...], which: int, still: bool) -> Motion | None:
        try:
            subject = self._subject(effects)
        except ValueError:  # no level flight
            return None
        servos = [Servo(self.servo_hz).under(effects, surface) for surface in SURFACES]
        air = None
        if not still:
            chance = np.random.default_rng([self.seed, 5, which])
            speed = self.condition.airspeed_true_m_s
            air = gusts(chance, self.turbulence, speed, len(self.inputs[which]))
        motion = jsbsim_motion(subject, self.inputs[which], servos, self.holds, air)
        # Half throttle is the thrust of the trim without effects, as the file of coefficients has it.
        throttle = 0.5 * subject.trim.thrust_n / self._subject(()).trim.thrust_n
        motion.table[:, CHANNEL_INDEX["throttle"]] = throttle
        shift = sum(effect.size for effect in effects if effect.name == "cg_shift")
        return replace(motion, sensors_ahead_m=shift) if flyable(motion.table) else None


def file_of_derivatives(subject: Subject, servo_hz: float, noise_std: dict[str, float]) -> Aircraft:
    """The aircraft's file: JSBSim's linearised derivatives, its dimensions and mass, our servos."""
    peer, at = subject.peer, subject.condition
    table, alpha = subject.truth_at(at.airspeed_true_m_s)
    entries = {
        d: DerivativeEntry(value=table[d], standard_error=STATED_ERROR * float(size))
        for structure in (SHORT_PERIOD, LATERAL)
        for d, size in zip(structure.derivatives, subject.natural(structure), strict=True)
    }
    here = ConditionEntry(
        airspeed_true_m_s=at.airspeed_true_m_s, altitude_m=at.altitude_m, angle_of_attack_rad=alpha,
        provenance="a-priori", derivatives=entries,
    )  # fmt: skip
    geometry = Geometry(
        wing_area_m2=peer["metrics/Sw-sqft"] * FT**2,
        span_m=peer["metrics/bw-ft"] * FT,
        mean_chord_m=peer["metrics/cbarw-ft"] * FT,
    )
    bare = Aircraft(
        format=1, name=subject.name.lower(), geometry=geometry, mass=peer.mass, conditions=(here,)
    )
    return _equipped(bare, subject, servo_hz, noise_std)


def file_of_coefficients(subject: Subject, servo_hz: float, noise_std: dict[str, float]) -> Aircraft:
    """The aircraft's file: JSBSim's coefficients about the centre of gravity, tables by their tangent at the trim."""
    return _equipped(peer_aircraft(subject.peer, subject.trim), subject, servo_hz, noise_std)


def _has_coefficients(subject: Subject) -> bool:
    """Whether the aircraft file has words for a bundled aircraft at its trim: no polar where drag falls with lift."""
    if subject.name not in WITH_COEFFICIENTS:
        return False
    try:
        peer_aircraft(subject.peer, subject.trim)
    except ValueError:
        return False
    return True


def _equipped(bare: Aircraft, subject: Subject, servo_hz: float, noise_std: dict[str, float]) -> Aircraft:
    """With sensors, servos and analysis bands."""
    servo = Actuator(bandwidth_hz=servo_hz)
    return bare.model_copy(
        update={
            "sensors": Sensors(noise_std=noise_std),
            "actuators": Actuators(elevator=servo, aileron=servo, rudder=servo),
            "modes": {s.name: Mode(band_hz=subject.band_hz(s)) for s in (SHORT_PERIOD, LATERAL)},
        }
    )


def draw_jsbsim(seed: int, count: int) -> Case:
    """A case with ``count`` effects; what is flown goes by the seed alone.

    Raises:
        RuntimeError: none of many draws could be flown and seen.
    """
    rng = np.random.default_rng([seed, 3])
    name = list(NAMES)[rng.integers(len(NAMES))]
    usual, (low, high) = AIRCRAFT[name], NAMES[name]
    condition = FlightCondition(round(usual.airspeed_true_m_s * rng.uniform(low, high), 1), usual.altitude_m)
    subject = subject_with(name, condition)
    frequencies = (subject.frequency_rad_s(SHORT_PERIOD), subject.frequency_rad_s(LATERAL))
    seconds, amplitude = float(rng.integers(60, 121)), math.radians(rng.uniform(1.0, 3.0))
    inputs = [
        commands(rng, KINDS[rng.integers(len(KINDS))], seconds, frequencies, amplitude) for _ in range(2)
    ]
    plan = JsbsimPlan(
        seed, name, condition, (inputs[0], inputs[1]),
        servo_hz=round(float(rng.uniform(4.0, 10.0)), 1),
        holds=Holds(0.15 * rng.uniform(0.6, 1.5), 0.2 * rng.uniform(0.6, 1.5)),
        louder=float(np.exp(rng.uniform(math.log(0.5), math.log(2.0)))),
        turbulence=str(rng.choice(list(HOW_OFTEN), p=list(HOW_OFTEN.values()))),
        coefficients=bool(rng.random() < 0.5) and _has_coefficients(subject),
    )  # fmt: skip
    return drawn(plan, ROWS, np.random.default_rng([seed, 4]), count)
