"""What the online filter is given, and what follows from that before any sample: set-up, columns and priors."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.structures import ModeStructure
from wingwatch.estimators.filter_error.intake import Columns
from wingwatch.estimators.filter_error.lanes import Setup
from wingwatch.estimators.filter_error.model import Layout
from wingwatch.estimators.filter_error.recursion import Priors
from wingwatch.estimators.signals import SignalLayout

__all__ = ["FilterConfig", "Fixed", "fixed_for"]

Array = NDArray[np.float64]

_GRADIENT = {"w": -1.0, "v": 1.0}

_GUST_AT = {"w": "q", "v": "r"}

_SHORTEST_VANE_M = 0.01
"""A vane that is less ahead than this is at the aircraft."""

_TRIM_STD = (10.0, 1.0, 30.0)
"""Of the constants of velocity, rates and accelerometer, m/s, rad/s, m/s2: unknown."""

_TRIM_WALK = (0.05, 0.005, 0.1)
"""Their random walk, in the root of a second: a trim may move by half a degree within ten seconds."""

_NOISE_WALK = math.sqrt(0.5 / 30.0)
"""Random walk of the ln of variances and intensities: a factor of two in half a minute."""

_SHAPE_WALK = 0.02
"""Of what shapes gusts and their path."""


@dataclass(frozen=True, slots=True)
class FilterConfig:
    """How the filter works on one structure.

    Attributes:
        structure: short period, Dutch roll or lateral.
        prior_value: referred aerodynamic derivatives as expected beforehand, (k,).
        natural: natural size of each, (k,).
        reference: (airspeed_true_m_s, air_density_kg_m3) to which derivatives are referred.
        prior_ratio: standard deviation of the prior, in natural sizes.
        walk: random walk of the derivatives, natural sizes in the root of a second: the only forgetting. 0.005 is 4 %
            in a minute and 30 % in an hour: payload, fuel, flaps within their speed.
        held: for each input, whether it is held between samples; else it moves on a line.
        use_accelerometer: whether the accelerometer is read.
        measures_velocity: whether a vane measures the velocity; the filter does not work without.
        imu_position_m: (x, y, z) of the accelerometer from the c.g.
        input_noise_std: of the measured inputs, as the aircraft file states it, rad.
        span_m: of the wing; makes the time constants of gusts' gradients (MIL-F-8785C).
        vane_ahead_m: how far the vane is ahead of the centre of gravity.
    """

    structure: ModeStructure
    prior_value: Array
    natural: Array
    reference: tuple[float, float]
    prior_ratio: float = 3.0
    walk: float = 0.005
    held: tuple[bool, ...] = ()
    use_accelerometer: bool = True
    measures_velocity: bool = True
    imu_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    input_noise_std: tuple[float, ...] = ()
    span_m: float = 2.9
    vane_ahead_m: float = 0.0

    def __post_init__(self) -> None:
        s = self.structure
        if s.states not in (("w", "q"), ("v", "r"), ("v", "p", "r")):
            raise ValueError(
                f"the filter estimates short_period, dutch_roll and lateral; {s.name} has other states"
            )
        if not self.measures_velocity:
            raise ValueError(
                "the filter needs a vane: with a reconstructed velocity it has nothing that tells gusts from motion; "
                "use the Fourier estimator"
            )
        for name in ("held", "input_noise_std"):
            given = getattr(self, name)
            if given and len(given) != len(s.inputs):
                raise ValueError(f"{name} has {len(given)} entries; {s.name} has {len(s.inputs)} inputs")


class Fixed(NamedTuple):
    """What does not change in flight: ``lanes.Setup``, ``recursion.Priors``, ``intake.Columns``, the priors' means as
    far as they do not depend on the flight (size,), and span over pi times the gradients' factor, m."""

    setup: Setup
    priors: Priors
    columns: Columns
    mean: Array
    span_m: Array


def fixed_for(config: FilterConfig, at: Layout, signals: SignalLayout) -> Fixed:
    """What a config comes to."""
    s = config.structure
    ns, nu, ch = signals.states, signals.inputs, at.channels
    velocity = s.states[0]
    natural = np.maximum(np.abs(np.asarray(config.natural, dtype=np.float64)), 1e-6).reshape(ns, ns + nu)
    x, y, z = config.imu_position_m
    arms = {"w": {"p": -y, "q": x}, "v": {"p": z, "r": -x}}[velocity]
    roll = s.states.index("p") if at.rolling_air else 0
    ahead = config.vane_ahead_m if config.vane_ahead_m > _SHORTEST_VANE_M else 0.0
    held = np.array(config.held or (False,) * nu)
    setup = Setup(
        ns, nu, ch, at.moments, int(at.rolling_air), s.states.index(_GUST_AT[velocity]), roll,
        0 if config.use_accelerometer else -1, _GRADIENT[velocity], ahead, 4.0 * config.span_m / math.pi,
        natural, np.array([arms.get(state, 0.0) for state in s.states]), _steps(at), held,
    )  # fmt: skip
    forward = np.array([{"q": 1.0, "r": -1.0}.get(state, 0.0) for state in s.states])
    down = np.array([{"p": 1.0}.get(state, 0.0) for state in s.states])
    columns = Columns(
        ns, nu, ch, signals.accelerometer, signals.first_input, signals.kinematic, signals.known_moments,
        np.array(config.reference), forward, down, held,
        np.square(np.array(config.input_noise_std or (0.0,) * nu)),
    )  # fmt: skip
    return Fixed(setup, _priors(config, at), columns, _mean(config, at, natural), _spans(config, velocity))


def _spans(config: FilterConfig, velocity: str) -> Array:
    """Lengths over which gusts' gradients are smoothed: in pitch or yaw, and in roll, m; then the span, m."""
    return np.array([4.0 if velocity == "w" else 3.0, 4.0, math.pi]) * config.span_m / math.pi


def _steps(at: Layout) -> Array:
    step = np.full(at.size, 1e-3)
    step[at.theta] = step[at.copy] = step[at.gust_rate_gain] = 1e-4
    return step


def _priors(config: FilterConfig, at: Layout) -> Priors:
    size, ns = at.size + at.channels, len(at.structure.states)
    std, walk, reach = np.ones(size), np.full(size, _SHAPE_WALK), np.full(size, 4.0)
    std[at.theta], walk[at.theta], reach[at.theta] = config.prior_ratio, config.walk, 4.0 * config.prior_ratio
    std[at.copy], walk[at.copy] = 1.0, config.walk
    std[at.log_noise], walk[at.log_noise], reach[at.log_noise] = 3.0, _NOISE_WALK, 30.0
    for place in (slice(at.gust, at.gust + 1), at.disturbance):
        std[place], walk[place], reach[place] = 3.0, _NOISE_WALK, 7.0
    std[at.log_span_time], reach[at.log_span_time] = 0.7, 2.0
    reach[at.log_gust_time] = reach[at.log_moment_time] = 3.0
    trims = [0] + [1] * (ns - 1) + [2] * (at.channels - ns)
    std[at.size :], walk[at.size :] = np.take(_TRIM_STD, trims), np.take(_TRIM_WALK, trims)
    reach[at.size :] = np.inf
    return Priors(std, walk**2, reach)


def _mean(config: FilterConfig, at: Layout, natural: Array) -> Array:
    """Means of the priors that the flight does not change; the others 0."""
    ns = len(at.structure.states)
    mean = np.zeros(at.size + at.channels)
    mean[at.theta] = np.asarray(config.prior_value, dtype=np.float64) / natural.ravel()
    mean[at.copy] = mean[at.theta].reshape(ns, -1)[:, :ns].ravel()
    mean[at.gust_rate_gain] = 1.0
    mean[at.log_moment_time] = math.log(0.5)
    surfaces = natural[1:, ns:].max(axis=1) * math.radians(0.2)
    mean[at.disturbance][: at.moments] = np.log(surfaces)
    return mean
