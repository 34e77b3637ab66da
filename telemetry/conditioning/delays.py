"""Delays of channels: taken out where they are stated, and found from a flight where they are not (thesis 6.7).

A delay is found against motion itself. Attitudes are integrals of the gyros; velocities from vanes and airspeed
are integrals of the accelerometers (``kinematics``). Advanced by the right times, all channels of an identity fit
together. So delays are relative to the gyros, which are taken to be in time with one another: a delay common to all
channels no kinematics can tell. A surface's position is compared with its command through a first-order servo.

The fit is by instruments: bin by bin the residual e of the identity, weighted by its own smoothed power, is made
orthogonal to what a delay would change, each channel's rate times the share of its power that is signal. A channel's
noise stands at a right angle to its own rate, so it biases nothing, and the curvature is that of the signal alone.
Errors are those of the estimating equations (J^-1 K J^-T).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from wingwatch.aircraft.vocabulary import SURFACES
from wingwatch.telemetry.conditioning.gust_spectrum import fit_gust
from wingwatch.telemetry.conditioning.kinematics import IDENTITIES, Columns
from wingwatch.telemetry.conditioning.parameter import Parameter
from wingwatch.telemetry.conditioning.positions import at_centre
from wingwatch.telemetry.conditioning.sensor_noise import detrended
from wingwatch.telemetry.conditioning.spectra import Bins, make_bins, smoothed_power, wiener_gain
from wingwatch.telemetry.conditioning.windows import even_window
from wingwatch.telemetry.maps import undelayed
from wingwatch.telemetry.sample import CHANNEL_INDEX, MAX_GAP_S, SampleBlock

__all__ = ["DelayConfig", "align", "estimate_delays", "estimate_servo_delay"]

Array = NDArray[np.float64]
Spectrum = NDArray[np.complex128]
Residual = Callable[[Array], Spectrum]

_LEAPING = ("roll_rad", "heading_rad")
_MOTION = (
    "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s", "roll_rad", "pitch_rad", "airspeed_true_m_s",
    "specific_force_x_m_s2", "specific_force_y_m_s2", "specific_force_z_m_s2", "altitude_m",
)  # fmt: skip
_WITH_VANES = ("angle_of_attack_rad", "sideslip_rad")

_PLAN: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("roll", ("roll_rad",)),
    ("pitch", ("pitch_rad",)),
    ("heading", ("heading_rad",)),
    ("down", ("angle_of_attack_rad", "specific_force_z_m_s2")),
    ("across", ("sideslip_rad", "specific_force_y_m_s2")),
    ("ahead", ("airspeed_true_m_s", "specific_force_x_m_s2")),
    ("altitude", ("altitude_m",)),
)
"""Identity, and the channels whose delays it tells."""

_OF_AIR = ("down", "across", "ahead")
"""Identities that a gust disturbs."""

_GUST_LENGTH_M = 533.4
"""Of MIL-F-8785C; in the band that is used, any length of this order gives the same power."""

_AIR_SHARE = 0.5
"""Where the air's part of what a delay is found from may be this large, a bound on its error is none."""


@dataclass(frozen=True, slots=True)
class DelayConfig:
    """How delays are sought.

    Attributes:
        largest_s: delays are sought within this, to either side.
        band_hz: frequencies that are used.
        vane_position_m: (x, y, z) of the vane from the centre of gravity, body axes.
        imu_position_m: of the accelerometers.
        iterations: at most so many steps.
    """

    largest_s: float = 0.3
    band_hz: tuple[float, float] = (0.1, 12.0)
    vane_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    imu_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    iterations: int = 12

    def __post_init__(self) -> None:
        if not (math.isfinite(self.largest_s) and self.largest_s > 0.0):
            raise ValueError(f"largest_s is {self.largest_s}; give a positive number of seconds")
        if not 0.0 < self.band_hz[0] < self.band_hz[1]:
            raise ValueError(f"band_hz is {self.band_hz}; give two rising positive frequencies")

    @property
    def ignorance_s(self) -> float:
        """Standard deviation of a delay of which only the range is known."""
        return self.largest_s / math.sqrt(3.0)


def align(block: SampleBlock, delays_s: Mapping[str, float], max_gap_s: float = MAX_GAP_S) -> SampleBlock:
    """A table whose channels are all of the stamp's instant: each takes the value it shows ``delay`` later.

    States are interpolated (roll and heading the shorter way round), commands held; NaN where a value would lie beyond
    a gap or the table's end. ``Aircraft.sensors.delay_s`` is such a mapping.

    Raises:
        ValueError: a name that is no channel, or the time, or a delay that is not finite.
    """
    values = block.values.copy()
    for name, delay_s in delays_s.items():
        if name not in CHANNEL_INDEX or name == "time_s":
            raise ValueError(f"{name!r} cannot be aligned: give a flight-table channel other than time_s")
        if not math.isfinite(delay_s):
            raise ValueError(f"the delay of {name} is {delay_s}; give a finite number of seconds")
        if delay_s == 0.0:
            continue
        column = values[:, CHANNEL_INDEX[name]]
        present = np.isfinite(column)
        if name in _LEAPING:
            column[present] = np.unwrap(column[present])
        held = name.endswith("_command_rad")
        moved = np.full(column.shape, np.nan)
        moved[present] = undelayed(block.time_s[present], column[present], delay_s, max_gap_s, held)
        if name in _LEAPING:
            moved = np.arctan2(np.sin(moved), np.cos(moved))
        values[:, CHANNEL_INDEX[name]] = moved
    return SampleBlock(values)


def estimate_delays(block: SampleBlock, config: DelayConfig | None = None) -> tuple[Parameter, ...]:
    """Delay of every attitude, vane, accelerometer, airspeed and altitude channel behind the gyros.

    The flight must be of still air for vanes, accelerometers and airspeed: a gust moves the aircraft as well as
    the vane, and how it does is aerodynamics (``turbulence_intensity`` says how still the air was).

    Args:
        block: samples; positions of vane and accelerometers come from the configuration.
        config: what is supposed.

    Returns:
        One parameter a channel, in s, positive where it comes late; not observable where its standard error is
        not below that of a number known only to lie in the range.

    Raises:
        ValueError: channels are missing or no window is long enough.
    """
    c = DelayConfig() if config is None else config
    present = set(block.present)
    names = [n for n in (*_MOTION, "heading_rad", *_WITH_VANES) if n in present or n in _MOTION]
    time_s, columns = even_window(block, names)
    window = _Window(time_s, columns, c)
    found: list[Parameter] = []
    for identity, delayed in _PLAN:
        if set(delayed) <= present:
            found += window.fit(identity, delayed)
    return tuple(found)


class _Window:
    """A window of flight with the delays that are known so far."""

    def __init__(self, time_s: Array, columns: Columns, config: DelayConfig) -> None:
        self._config = config
        self._time_s = time_s
        self._columns = columns
        self._splines = {
            name: scipy.interpolate.CubicSpline(time_s, column) for name, column in columns.items()
        }
        self._known: dict[str, float] = {}
        self._rough = False
        self._bins = make_bins(len(time_s), float(time_s[1] - time_s[0]), config.band_hz)

    def _advanced(self, delays_s: Mapping[str, float]) -> dict[str, Array]:
        """Channels as they were at the stamps, at the centre of gravity."""
        first, last = self._time_s[0], self._time_s[-1]
        columns = dict(self._columns)
        for name, delay_s in delays_s.items():
            columns[name] = np.asarray(self._splines[name](np.clip(self._time_s + delay_s, first, last)))
        c = self._config
        if not (any(c.vane_position_m) or any(c.imu_position_m)):
            return columns
        moved = at_centre(
            SampleBlock.from_columns({"time_s": self._time_s, **columns}), c.vane_position_m, c.imu_position_m
        )
        return {name: moved.column(name) for name in columns}

    def _sides(self, identity: str, columns: Columns) -> tuple[Spectrum, Spectrum]:
        """Transforms of the measured quantity's rate and of what the other channels say it is."""
        measured, rate = IDENTITIES[identity](columns)
        return self._bins.of_rate(detrended(measured)), self._bins.of(rate - np.mean(rate))

    def fit(self, identity: str, delayed: Sequence[str]) -> list[Parameter]:
        """Delays of the named channels; what is found is known from here on."""
        c, bins = self._config, self._bins
        gains = np.array([wiener_gain(bins, detrended(self._columns[n])) for n in delayed])

        def residual(x: Array) -> Spectrum:
            delays = self._known | dict(zip(delayed, x.tolist(), strict=True))
            measured, rate = self._sides(identity, self._advanced(delays))
            return measured - rate

        start = _scan(residual, len(delayed), c.largest_s, bins)
        fit = _solve(residual, start, gains, bins, c.iterations)
        columns = self._advanced(self._known | dict(zip(delayed, fit.value.tolist(), strict=True)))
        air = np.zeros(len(delayed))
        if identity in _OF_AIR:
            air = _air_error(fit, self._sides(identity, columns), identity, columns, bins)
        self._rough |= bool(air.any())
        if identity == "altitude" and self._rough:
            air[:] = np.inf  # the velocities are through air that moves
        found = [
            _delay(name, value, chance, off, c)
            for name, value, chance, off in zip(
                delayed, fit.value.tolist(), fit.standard_error.tolist(), air.tolist(), strict=True
            )
        ]
        self._known |= {
            name: parameter.value
            for name, parameter in zip(delayed, found, strict=True)
            if parameter.observable
        }
        return found


def _delay(name: str, value: float, chance: float, air: float, c: DelayConfig) -> Parameter:
    label = f"delay of {name}"
    error = math.hypot(chance, air)
    reason = ""
    if not (math.isfinite(error) and error < c.ignorance_s):
        why = "rough air moves it too much" if chance < c.ignorance_s else "the flight moves it too little"
        reason = f"its error is not below {c.ignorance_s:.2g} s: {why}"
    elif abs(value) >= c.largest_s:
        reason = f"it lies at the end of the range of {c.largest_s:g} s: allow for more"
    if reason:
        return Parameter(label, math.nan, math.inf, "s", False, reason)
    return Parameter(label, float(value), float(error), "s")


@dataclass(frozen=True, slots=True)
class _Fit:
    """Solution of the estimating equations, its chance errors, and what they rest on at the solution."""

    value: Array
    standard_error: Array
    instruments: Spectrum
    inverse: Array


def _scan(residual: Residual, delays: int, largest_s: float, bins: Bins) -> Array:
    """Delays, one after the other, twice, at which the integrated residual is least: where the fit starts."""
    x = np.zeros(delays)
    grid = np.linspace(-largest_s, largest_s, 25)

    def cost(i: int, delay_s: float) -> float:
        at = x.copy()
        at[i] = delay_s
        return float(np.sum(np.abs(residual(at) / bins.omega_rad_s) ** 2))

    for _ in range(2):
        for i in range(delays):
            x[i] = grid[int(np.argmin([cost(i, d) for d in grid.tolist()]))]
    return x


def _solve(residual: Residual, start: Array, gains: Array, bins: Bins, iterations: int) -> _Fit:
    """Estimating equations sum Re(Z' e) / P = 0 by Newton's steps, and the errors of their solution.

    Z are the residual's derivatives times ``gains`` (parameters, bins), P the residual's smoothed power.
    """
    x = start.copy()
    step = bins.step_s
    nothing = np.full(x.size, np.inf)
    for _ in range(iterations):
        e = residual(x)
        slope = np.array([(residual(x + d) - residual(x - d)) / (2.0 * step) for d in np.eye(x.size) * step])
        weight = 1.0 / np.maximum(smoothed_power(np.abs(e) ** 2), 1e-300)
        z = np.conj(gains * slope) * weight
        curvature = np.real(z @ slope.T)
        if np.linalg.cond(curvature) > 1e10:
            return _Fit(x, nothing, z, np.zeros_like(curvature))
        inverse = np.linalg.inv(curvature)
        move = -inverse @ np.real(z @ e)
        x = x + np.clip(move, -2.0 * step, 2.0 * step)
        spread = 0.5 * np.real((z / weight) @ np.conj(z).T) * bins.overlap
        error = np.sqrt(np.maximum(np.diagonal(inverse @ spread @ inverse.T), 0.0))
        if np.all(np.abs(move) < 1e-3 * error + 1e-9):
            break
    return _Fit(x, error, z, inverse)


def _air_error(
    fit: _Fit, sides: tuple[Spectrum, Spectrum], identity: str, columns: Columns, bins: Bins
) -> Array:
    """How far off rough air may have put each delay.

    Power X of the residual is a gust's, as its spectrum shows (``gust_spectrum``). The aircraft answers it, by no more
    than it all: of a column of power M it may be sqrt(X / M), all of it where X is more, in the worst phase. Where half
    of what a delay is found from may be the air's own, nothing is known.
    """
    gust_time = _GUST_LENGTH_M / max(float(np.mean(columns["airspeed_true_m_s"])), 1.0)
    excess = fit_gust(np.abs(sides[0] - sides[1]) ** 2, identity, columns, bins, gust_time).power
    if not excess.any():
        return np.zeros(fit.value.size)
    share = np.minimum(np.sqrt(excess / np.maximum(smoothed_power(np.abs(sides[0]) ** 2), 1e-300)), 1.0)
    weight = np.abs(fit.instruments)
    mostly = weight @ share >= _AIR_SHARE * np.sum(weight, axis=1)
    off = np.abs(fit.inverse) @ (weight @ (share * np.sqrt(excess)))
    return np.where(mostly.any(), np.inf, off)


def estimate_servo_delay(
    block: SampleBlock, surface: str, time_constant_s: float | None = None, config: DelayConfig | None = None
) -> tuple[Parameter, ...]:
    """Delay and time constant between a surface's command and its measured position.

    The model is T x' + x = gain u(t - delay) + constant, the command held between samples, solved exactly at the
    samples; position noise is all there is, so this is output error. Errors allow for a coloured residual, as a
    rate limit or play leaves it; a rate limit makes large movements later than what is found in small ones.

    Args:
        block: samples with position and command.
        surface: ``elevator``, ``aileron`` or ``rudder``.
        time_constant_s: of the servo where it is known, 1 / (2 pi bandwidth); None to find it too.
        config: range of the delay.

    Returns:
        The delay in s and, where it was to be found, the time constant in s.

    Raises:
        ValueError: no such surface, position or command missing, or no window is long enough.
    """
    if surface not in SURFACES:
        raise ValueError(f"surface is {surface!r}; give elevator, aileron or rudder")
    c = DelayConfig() if config is None else config
    position_name, command_name = f"{surface}_rad", f"{surface}_command_rad"
    time_s, columns = even_window(block, (position_name, command_name))
    servo = _Servo(columns[position_name], columns[command_name], float(time_s[1] - time_s[0]))
    fit = servo.fit(c.largest_s, time_constant_s, c.iterations)
    label, follows = f"{position_name} behind {command_name}", servo.follows(fit[0])
    reason = "the position does not follow the command"
    found = [Parameter(f"delay of {label}", math.nan, math.inf, "s", False, reason)]
    if follows:
        found = [_delay(label, fit[0][0], fit[1][0], 0.0, c)]
    if time_constant_s is None:
        error = float(fit[1][1])
        observable = follows and error < c.ignorance_s
        reason = "" if observable else "the flight moves it too little"
        found.append(
            Parameter(f"time constant of {surface}", float(fit[0][1]), error, "s", observable, reason)
        )
    return tuple(found)


class _Servo:
    """Output error of a delayed first-order servo."""

    def __init__(self, position: Array, command: Array, step_s: float) -> None:
        self._position = position
        self._command = command - np.mean(command)
        self._step = step_s

    def _moved(self, delay_s: float, constant_s: float) -> Array:
        """Position at the samples for a gain of 1: within a step the command changes once, the delay's rest into it."""
        whole = math.floor(delay_s / self._step)
        rest = delay_s / self._step - whole
        n = self._command.size

        def late(samples: int) -> Array:
            return self._command[np.clip(np.arange(n) - samples, 0, n - 1)]

        stays = math.exp(-self._step / max(constant_s, 1e-3 * self._step))
        after = math.exp(-(1.0 - rest) * self._step / max(constant_s, 1e-3 * self._step))
        drive = (after - stays) * late(whole + 2) + (1.0 - after) * late(whole + 1)
        start = np.array([stays * drive[0] / max(1.0 - stays, 1e-12)])
        return np.asarray(scipy.signal.lfilter([1.0], [1.0, -stays], drive, zi=start)[0])

    def _residual(self, x: Array) -> tuple[Array, Array]:
        """Residual, and the model's columns of gain and constant, which are solved for at every step."""
        columns = np.stack([self._moved(x[0], x[1]), np.ones(self._command.size)], axis=1)
        linear = np.linalg.lstsq(columns, self._position, rcond=None)[0]
        return self._position - columns @ linear, columns

    def follows(self, x: Array) -> bool:
        """Whether the model leaves less than chance would: twice the log-likelihood ratio over 25, five standard
        errors, for of many delays the best was taken."""
        left = float(np.sum(self._residual(x)[0] ** 2))
        whole = float(np.sum((self._position - np.mean(self._position)) ** 2))
        return whole > 0.0 and self._position.size * math.log(whole / max(left, 1e-300)) > 25.0

    def fit(self, largest_s: float, constant_s: float | None, iterations: int) -> tuple[Array, Array]:
        """(delay, time constant) and their standard errors, a known time constant with the error 0."""
        grid = np.linspace(-largest_s, largest_s, 61)
        fixed = self._step if constant_s is None else constant_s
        costs = [float(np.sum(self._residual(np.array([d, fixed]))[0] ** 2)) for d in grid]
        x = np.array([grid[int(np.argmin(costs))], fixed])
        free = 2 if constant_s is None else 1
        nudge = 0.05 * self._step
        error = np.zeros(2)
        for _ in range(iterations):
            residual, columns = self._residual(x)
            moves = np.eye(2)[:free] * nudge
            ahead = [(self._residual(x + d)[0] - residual) / nudge for d in moves]
            behind = [(residual - self._residual(x - d)[0]) / nudge for d in moves]
            both = [0.5 * (one + other) for one, other in zip(ahead, behind, strict=True)]
            step, error[:free] = self._step_and_error(residual, np.column_stack([*both, columns]), free)
            # at a whole number of samples the model has a kink: the flatter side says how sure one can be
            for side in (ahead, behind):
                error[:free] = np.maximum(
                    error[:free], self._step_and_error(residual, np.column_stack([*side, columns]), free)[1]
                )
            x[:free] += np.clip(step, -2.0 * self._step, 2.0 * self._step)
            x[1] = max(x[1], 0.0)
            if not np.isfinite(error).all() or np.all(np.abs(step) < 1e-3 * error[:free] + 1e-9):
                break
        return x, np.where(error[:2] > 0.0, error, np.inf if free == 2 else 0.0)

    def _step_and_error(self, residual: Array, design: Array, free: int) -> tuple[Array, Array]:
        inverse = np.linalg.pinv(design.T @ design)
        spread = coloured_spread(design * residual[:, None], round(1.0 / self._step))
        error = np.sqrt(np.maximum(np.diagonal(inverse @ spread @ inverse), 0.0))
        return -(inverse @ (design.T @ residual))[:free], error[:free]


def coloured_spread(scores: Array, lags: int) -> Array:
    """Covariance of a sum of scores (n, k) that go together over up to ``lags`` samples (Newey and West 1987)."""
    total = scores.T @ scores
    for lag in range(1, min(lags, len(scores) - 1) + 1):
        together = scores[lag:].T @ scores[:-lag]
        total += (1.0 - lag / (lags + 1.0)) * (together + together.T)
    return np.asarray(total)
