"""A diagnosis made by hand, as one of a flight with a weak elevator and a late vane would read."""

import dataclasses
import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import load_aircraft
from wingwatch.diagnosis import (
    Cause,
    Diagnosis,
    Gain,
    Interval,
    Misfit,
    NotSeparable,
    ParameterEstimate,
    Traces,
)

__all__ = ["AGREES", "FOUND", "NOTHING_FOUND", "example"]

Array = NDArray[np.float64]

ELEVATOR = Cause(
    name="elevator_effectiveness",
    target="",
    parameters={"fraction_lost": ParameterEstimate(0.3012, 0.0124, "")},
    channels=("pitch_rate_rad_s", "specific_force_z_m_s2", "angle_of_attack_rad"),
    probability=0.97,
    gain=1834.2,
    held_out_gain=0.71,
    indistinguishable_from=("derivative[m_eta]",),
    separating_manoeuvre="elevator doublets at two airspeeds: an effectiveness scales both forces, a derivative one",
    text="The elevator has 30 ± 1 % less effect than the aircraft file says.",
)
DELAY = Cause(
    name="sensor_delay",
    target="angle_of_attack_rad",
    parameters={"delay_s": ParameterEstimate(0.0603, 0.0019, "s")},
    channels=("angle_of_attack_rad",),
    probability=0.9999,
    gain=412.9,
    held_out_gain=0.12,
    text="The angle of attack is measured 0.060 s late.",
)
RANKING = (
    ("elevator_effectiveness", 1834.2, 0.97),
    ("derivative[m_eta]", 1790.1, 0.03),
    ("icing", 980.4, 1e-8),
    ("sensor_delay[angle_of_attack_rad]", 412.9, 0.9999),
    ("cg_shift", 350.0, 1e-9),
    ("actuator_lag[elevator]", 210.5, 1e-12),
    ("sensor_scale[pitch_rate_rad_s]", 80.25, math.nan),
    ("downwash_lag", 12.0, 1e-30),
    ("thrust_loss", 1.5, 1e-30),
    ("sensor_bias[pitch_rad]", 0.8, 1e-30),
    ("airspeed_error", 0.1, 1e-30),
)
BEFORE: Mapping[str, Misfit] = {
    "roll_rate_rad_s": Misfit(0.991, 0.048, 0.0, 0.02, 0.98, 0.93, 0.21, {"aileron_rad": 0.08}),
    "pitch_rate_rad_s": Misfit(
        0.62, 0.34, 0.01, 0.61, 0.38, 0.04, 1e-12, {"elevator_rad": 0.83, "pitch_rate_rad_s": 0.4}
    ),
    "yaw_rate_rad_s": Misfit(0.984, 0.063, 0.01, 0.01, 0.98, 0.95, 0.43),
    "angle_of_attack_rad": Misfit(0.55, 0.37, 0.02, 0.45, 0.53, 0.06, 1e-9, {"elevator_rad": 0.71}),
    "specific_force_z_m_s2": Misfit(0.71, 0.29, 0.02, 0.52, 0.46, 0.11, 1e-7, {"pitch_rate_rad_s": 0.66}),
    "altitude_m": Misfit(-3.4, 0.61, math.nan, math.nan, math.nan),
}
AFTER: Mapping[str, Misfit] = {
    "roll_rate_rad_s": BEFORE["roll_rate_rad_s"],
    "pitch_rate_rad_s": Misfit(0.97, 0.085, 0.0, 0.05, 0.95, 0.71, 0.03, {"elevator_rad": 0.11}),
    "yaw_rate_rad_s": BEFORE["yaw_rate_rad_s"],
    "angle_of_attack_rad": Misfit(0.95, 0.11, 0.01, 0.08, 0.91, 0.64, 0.02),
    "specific_force_z_m_s2": Misfit(0.96, 0.10, 0.0, 0.07, 0.93, 0.83, 0.09),
}
CHANGE = {
    "roll_rate_rad_s": Interval(0.002, -0.01, 0.013),
    "pitch_rate_rad_s": Interval(-0.74, -0.79, -0.66),
    "yaw_rate_rad_s": Interval(-0.001, -0.02, 0.02),
    "angle_of_attack_rad": Interval(-0.69, -0.75, -0.58),
    "specific_force_z_m_s2": Interval(-0.63, -0.7, -0.55),
}
SIZES = {"roll_rate_rad_s": 0.3, "pitch_rate_rad_s": 0.2, "yaw_rate_rad_s": 0.1, "angle_of_attack_rad": 0.05,
         "specific_force_z_m_s2": 4.0, "altitude_m": 2.0}  # fmt: skip


def _response(t: Array, gain: float, late_s: float) -> Array:
    """A doublet every ten seconds, answered by a damped oscillation."""
    since = np.mod(t - late_s, 10.0)
    answer = np.where(since < 5.0, np.sin(5.5 * since) * np.exp(-1.6 * since), 0.0)
    return np.asarray(gain * (answer - 0.7 * np.where(since > 0.6, np.roll(answer, 30), 0.0)))


def _traces() -> Traces:
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 120.0, 0.02)
    stamps = np.where((t % 40.0) < 36.0, t, np.nan)
    parts: dict[str, dict[str, Array]] = {"measured": {}, "simulated": {}, "mended": {}}
    for channel, size in SIZES.items():
        late = 0.06 if channel == "angle_of_attack_rad" else 0.0
        wrong = 0.95 if BEFORE[channel].tic < 0.1 else 1.4
        parts["measured"][channel] = size * (_response(t, 1.0, late) + rng.normal(0.0, 0.02, t.size))
        parts["simulated"][channel] = size * _response(t, wrong, 0.0)
        parts["mended"][channel] = size * _response(t, 1.01, late)
    hz = np.geomspace(0.1, 10.0, 60)
    shape = 1.0 / (1.0 + ((hz - 0.9) / 0.5) ** 2)
    spectra = {
        channel: size**2 * np.stack([0.05 * shape + 4e-5, 0.003 * shape + 4e-5, np.full(hz.size, 4e-5)])
        for channel, size in SIZES.items()
    }
    return Traces(stamps, **parts, residual_hz=hz, spectra=spectra)


def example() -> Diagnosis:
    """Two causes found, an extended model that pays."""
    aircraft = load_aircraft("aerosonde")
    coefficients = aircraft.need_coefficients("the example")
    pitch = coefficients.Cm.model_copy(update={"elevator": 0.7 * coefficients.Cm.elevator})
    mended = aircraft.model_copy(
        update={
            "coefficients": coefficients.model_copy(update={"Cm": pitch}),
            "sensors": aircraft.sensors.model_copy(update={"delay_s": {"angle_of_attack_rad": 0.0603}}),
        }
    )
    return Diagnosis(
        source="flight <7>.csv",
        aircraft=aircraft,
        misfit=BEFORE,
        causes=(ELEVATOR, DELAY),
        ranking=RANKING,
        unexplained_fraction=0.17,
        unexplained="What is left in pitch rate goes with the throttle: a thrust line not stated would do that.",
        gain=Gain("windows left out", {c: BEFORE[c] for c in AFTER}, AFTER, CHANGE),
        not_separable=(
            NotSeparable(("mass_inertia", "derivative[m_q]"), "a scaled inertia scales every pitch derivative alike"),
        ),
        notes=("altitude_m: no noise is stated, so its noise part is not known",),
        model=mended,
        derivatives={"m_eta": (-131.5, -92.05), "z_eta": (-14.2, -9.94), "m_q": (-6.035, -6.035), "x_w": (0.0, 0.1)},
        traces=_traces(),
        seconds=108.0,
        windows=3,
    )  # fmt: skip


FOUND = example()
NOTHING_FOUND = dataclasses.replace(
    FOUND, causes=(), gain=None, model=None, derivatives={}, unexplained_fraction=1.0, not_separable=(), notes=()
)  # fmt: skip
AGREES = dataclasses.replace(
    NOTHING_FOUND,
    misfit={c: m for c, m in BEFORE.items() if m.noise_fraction > 0.9},
    ranking=(),
    unexplained="",
    unexplained_fraction=0.0,
)
