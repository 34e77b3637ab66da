"""What a case of the diagnosis benchmark hides: the effects that are drawn, how large they may be, and the case itself.

Names and targets are those of the vocabulary of causes, sizes as the contract has them: effectiveness, thrust and wing
the fraction lost; a ratio minus 1 for derivatives, mass, scales and airspeed; s, m, rad, rad/s for the others.
Nothing here knows how a finder works. A case goes to it as a flight table and an aircraft file.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock

__all__ = [
    "CATALOGUE",
    "LEAST_SIGNAL",
    "Case",
    "Hidden",
    "Range",
    "bigger",
    "draw_hidden",
    "signal_to_noise",
]

Array = NDArray[np.float64]
Surface = Literal["elevator", "aileron", "rudder"]

LEAST_SIGNAL = 5.0
"""Rms change of the most affected channel over its noise, in its best ``BEST_S``, that a hidden effect must make."""
BEST_S = 2.0
_LOUDER = 1.6
"""A size that makes too little signal is multiplied by this."""

SURFACES: tuple[Surface, ...] = ("elevator", "aileron", "rudder")
RATES = ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s")
FORCES = ("specific_force_x_m_s2", "specific_force_y_m_s2", "specific_force_z_m_s2")
ATTITUDES = ("roll_rad", "pitch_rad")
VANES = ("angle_of_attack_rad", "sideslip_rad")


@dataclass(frozen=True, slots=True)
class Hidden:
    """One effect that the aircraft file does not have.

    Attributes:
        name: of the vocabulary of causes.
        target: surface, column, sensor's axis or derivative; empty where the name says all.
        parameter: what its size is.
        size: in SI, as the module says.
    """

    name: str
    target: str
    parameter: str
    size: float

    @property
    def label(self) -> str:
        """Name, with the target in brackets."""
        return f"{self.name}[{self.target}]" if self.target else self.name


@dataclass(frozen=True, slots=True)
class Case:
    """One flight to be diagnosed, with what is hidden in it.

    Attributes:
        source: ``jsbsim``, ``simulation`` or ``plant``.
        seed: it was drawn with.
        aircraft: the file that the finder gets, of the aircraft without the effects.
        flight: measured.
        held_out: measured, another flight of the same aircraft with the effects: other inputs, air and noise.
        kinds: ``position`` or ``command`` by surface column.
        effects: what is hidden; empty for a healthy case.
        turbulence: ``none``, ``light`` or ``moderate``.
        signal_to_noise: of the least of the effects (``signal_to_noise``); 0 for a healthy case.
        name: of a fixed case; empty for one that was drawn.
        true_model_misfit: what the linear model with the true derivatives leaves of the held-out flight's true
            accelerations, of their standard deviation; NaN where it is not known. None of a plant.
    """

    source: str
    seed: int
    aircraft: Aircraft
    flight: SampleBlock
    held_out: SampleBlock
    kinds: Mapping[str, str]
    effects: tuple[Hidden, ...]
    turbulence: str
    signal_to_noise: float
    name: str = ""
    true_model_misfit: float = math.nan

    @property
    def label(self) -> str:
        """Labels of what is hidden."""
        return " and ".join(effect.label for effect in self.effects) or "healthy"


@dataclass(frozen=True, slots=True)
class Range:
    """Sizes that an effect may have: drawn evenly in the logarithm from ``low`` to ``high``, raised up to ``largest``.

    Attributes:
        name, targets, parameter: as ``Hidden``; one of the targets is drawn.
        low, high, largest: without sign; ``largest`` below ``low`` for an effect that grows as its size falls.
        signs: one is drawn.
        scale: what the sizes are multiples of: nothing (empty) or the mean ``chord``.
    """

    name: str
    targets: tuple[str, ...]
    parameter: str
    low: float
    high: float
    largest: float
    signs: tuple[float, ...] = (1.0,)
    scale: str = ""

    def unit(self, aircraft: Aircraft) -> float:
        """What a size of 1 is."""
        return aircraft.need_geometry("the size of an effect").mean_chord_m if self.scale == "chord" else 1.0


BOTH = (1.0, -1.0)
_DERIVATIVES = ("z_w", "m_w", "m_eta", "y_v", "l_v", "l_p", "l_r", "l_xi", "n_v", "n_r", "n_zeta")

CATALOGUE: tuple[Range, ...] = (
    *(Range(f"{s}_effectiveness", ("",), "fraction", 0.08, 0.4, 0.7) for s in SURFACES),
    Range("surface_offset", SURFACES, "offset_rad", 0.01, 0.05, 0.09, BOTH),
    Range("cg_shift", ("",), "shift_m", 0.03, 0.12, 0.15, BOTH, "chord"),
    Range("mass_inertia", ("",), "ratio", 0.1, 0.3, 0.4, BOTH),
    Range("pitch_damping", ("",), "ratio", 0.2, 0.6, 0.9, BOTH),
    Range("incidence_nonlinearity", ("", "lift", "pitch"), "slope_change_per_rad", 2.0, 8.0, 20.0, BOTH),
    Range("downwash_lag", ("",), "downwash_slope", 0.2, 0.5, 0.8),
    Range("roll_yaw_coupling", ("",), "ratio", 0.4, 1.5, 3.0, BOTH),
    Range("actuator_lag", SURFACES, "time_constant_s", 0.03, 0.12, 0.25),
    Range("actuator_rate_limit", SURFACES, "rate_limit_rad_s", 0.15, 0.6, 0.05),
    Range("actuator_backlash", SURFACES, "width_rad", 0.01, 0.04, 0.09),
    Range("thrust_effect", ("",), "distance_m", 0.1, 0.6, 1.0, BOTH, "chord"),
    Range("thrust_loss", ("",), "fraction", 0.1, 0.3, 0.5),
    Range("icing", ("",), "severity", 0.05, 0.25, 0.4),
    Range("wing_damage", ("left", "right"), "fraction", 0.05, 0.25, 0.35),
    Range("sensor_delay", (*RATES, *FORCES[1:], *VANES, *ATTITUDES), "delay_s", 0.03, 0.12, 0.25),
    Range("sensor_bias", RATES, "bias", 0.01, 0.05, 0.2, BOTH),
    Range("sensor_bias", FORCES, "bias", 0.15, 0.6, 2.0, BOTH),
    Range("sensor_bias", (*VANES, *ATTITUDES), "bias", 0.01, 0.04, 0.08, BOTH),
    Range("sensor_scale", (*RATES, *FORCES[1:]), "scale", 0.1, 0.4, 0.7, BOTH),
    Range("sensor_position", ("imu_x",), "distance_m", 0.3, 1.5, 3.0, BOTH, "chord"),
    Range("sensor_position", ("imu_z",), "distance_m", 0.2, 1.0, 1.5, BOTH, "chord"),
    Range("sensor_position", ("vane_x",), "distance_m", 0.8, 3.0, 4.0, scale="chord"),
    Range("sensor_position", ("vane_y",), "distance_m", 1.0, 3.0, 5.0, BOTH, "chord"),
    Range("airspeed_error", ("",), "scale", 0.03, 0.12, 0.2, BOTH),
    Range("vane_upwash", ("angle_of_attack", "sideslip"), "scale", 0.08, 0.3, 0.5),
    Range("vane_upwash", ("angle_of_attack", "sideslip"), "scale", 0.08, 0.15, 0.3, (-1.0,)),
    Range("derivative", _DERIVATIVES, "ratio", 0.2, 0.5, 0.8, BOTH),
)  # fmt: skip
"""Every effect with its plausible sizes; a name may have several rows."""


def draw_hidden(
    rng: np.random.Generator, rows: Sequence[Range], aircraft: Aircraft, without: Sequence[str] = ()
) -> Hidden:
    """One effect: each name is as likely as another, then each of its rows, targets and signs.

    Args:
        rng: consumed.
        rows: to draw from.
        aircraft: gives the sizes' scale.
        without: names not to draw.
    """
    names = [name for name in dict.fromkeys(row.name for row in rows) if name not in without]
    name = names[rng.integers(len(names))]
    mine = [row for row in rows if row.name == name]
    row = mine[rng.integers(len(mine))]
    target = row.targets[rng.integers(len(row.targets))]
    size = math.exp(rng.uniform(math.log(row.low), math.log(row.high)))
    sign = row.signs[rng.integers(len(row.signs))]
    return Hidden(name, target, row.parameter, _rounded(sign * size * row.unit(aircraft)))


def bigger(hidden: Hidden, rows: Sequence[Range], aircraft: Aircraft) -> Hidden | None:
    """The same effect with a size that shows more, None where that would be beyond what is plausible."""
    sign = math.copysign(1.0, hidden.size)
    row = next(r for r in rows if r.name == hidden.name and hidden.target in r.targets and sign in r.signs)
    unit = row.unit(aircraft)
    if row.largest < row.low:
        size = abs(hidden.size) / _LOUDER
        return replace(hidden, size=_rounded(sign * size)) if size >= row.largest * unit else None
    size = abs(hidden.size) * _LOUDER
    return replace(hidden, size=_rounded(sign * size)) if size <= row.largest * unit else None


def _rounded(size: float) -> float:
    """Three digits: what is printed is what is hidden."""
    return float(f"{size:.3g}")


_LEAST_NOISE: Mapping[str, float] = {
    "airspeed_true_m_s": 0.1,
    **dict.fromkeys(RATES, 0.0005),
    **dict.fromkeys(FORCES, 0.01),
    **dict.fromkeys(ATTITUDES, 0.001),
    **dict.fromkeys(VANES, 0.001),
    **{f"{surface}_rad": 0.0009 for surface in SURFACES},
}
"""Channels that count as a signal, and the least noise they are taken to have, in their units."""
_SHOWN_BY_TRIM: Mapping[str, float] = {
    "throttle": 0.01,
    **{f"{surface}_command_rad": 0.0009 for surface in SURFACES},
}
_OFFSETS = ("sensor_bias", "surface_offset", "thrust_effect", "thrust_loss")
"""Effects that a constant difference shows; of the others only what moves with the manoeuvres counts."""


def signal_to_noise(aircraft: Aircraft, hidden: Hidden, with_effect: Array, without: Array) -> float:
    """Rms change of the most affected channel over its noise, in the ``BEST_S`` of the flight where it is largest.

    Args:
        aircraft: its file states the noise.
        hidden: the effect.
        with_effect, without: the same flight in still air without noise, flight tables (samples, channels).

    Of effects that a constant difference does not show, only what differs from the mean change counts.
    """
    offset = hidden.name in _OFFSETS
    time_s = without[:, CHANNEL_INDEX["time_s"]]
    best, window = 0.0, round(BEST_S / float(time_s[1] - time_s[0]))
    for name, least in {**_LEAST_NOISE, **(_SHOWN_BY_TRIM if offset else {})}.items():
        change = with_effect[:, CHANNEL_INDEX[name]] - without[:, CHANNEL_INDEX[name]]
        if not np.isfinite(change).all():
            continue
        moved = change if offset else change - change.mean()
        best = max(best, _best_rms(moved, window) / max(aircraft.noise_std(name) or 0.0, least))
    return best


def _best_rms(values: Array, window: int) -> float:
    """Largest root mean square of so many consecutive values."""
    total = np.concatenate([[0.0], np.cumsum(values**2)])
    return math.sqrt(max(0.0, float((total[window:] - total[:-window]).max()) / window))
