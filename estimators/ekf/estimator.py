"""Extended Kalman filter with the derivatives as states, for a batch of vehicles; engines "compiled" and "filterpy".

Both engines run the same model (``model``), noise adaptation and forgetting; the engine "filterpy" leaves
prediction and correction to ``filterpy.kalman.ExtendedKalmanFilter`` and serves as the reference.
"""

from dataclasses import dataclass, fields
from typing import Literal

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray

from wingwatch.aircraft.structures import ModeStructure
from wingwatch.estimators.ekf.covariance import correct
from wingwatch.estimators.ekf.inputs import echo_after, echo_before, input_noise, track_inputs
from wingwatch.estimators.ekf.kernel import (
    SETTLE_S,
    WARM_UP,
    Fixed,
    air_decay,
    learn_after,
    learn_before,
    step_inputs,
    track_condition,
    update_all,
)
from wingwatch.estimators.ekf.model import measure, transition
from wingwatch.estimators.ekf.noise import NOISE_TAIL, process_noise, trim_drift
from wingwatch.estimators.ekf.quiet import NOISE, UNDECIDED, go_back, keep_sure, nothing_sure
from wingwatch.estimators.ekf.release import release_since
from wingwatch.estimators.ekf.relinearise import relinearise_all
from wingwatch.estimators.ekf.solve import solve_all
from wingwatch.estimators.ekf.stretch import SOLUTIONS, STRETCH_ROWS, mark, remember
from wingwatch.estimators.ekf.unrest import unrest_variance
from wingwatch.estimators.estimate import Estimate
from wingwatch.estimators.kernels.hot import sizes
from wingwatch.estimators.kernels.levels import LEVELS
from wingwatch.estimators.reference import Posterior, offsets, referred_scale, standing
from wingwatch.estimators.signals import MAX_GAP_S, SignalLayout

__all__ = ["EkfConfig", "EkfEstimator", "EkfState"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class EkfConfig:
    """How the filter works on one structure.

    Attributes:
        structure: which mode.
        prior_value: shape (k,), referred aerodynamic derivatives to start from and, in long quiet, to return to.
        prior_std: shape (k,), how far off they may be.
        reference: (airspeed_true_m_s, air_density_kg_m3) to which derivatives are referred.
        engine: ``compiled`` (batch) or ``filterpy`` (one vehicle at a time, the reference).
        memory_s: time constant of forgetting while something is excited.
        adapt_s: time constant of the noise variances.
        trim_corner_hz: slower changes than this belong to the trim, not to the derivatives.
        stale_s: without excitation for this long a derivative is not observable.
        held: for each input, whether it is held between samples.
        servo_s: for each input that is not, time constant of the servo that moves it, its command held between
            samples; 0 where that is not known, and it is taken to move evenly.
        use_accelerometer: whether the accelerometer is a measurement.
        imu_position_m: (x, y, z) of the accelerometer from the c.g.
        noise_std: of the measured states as the aircraft file states it, 0 where it says nothing; believed as far as
            the record allows.
        input_noise_std: of the measured inputs, as the aircraft file states it.
        span_m: of the wing, over which gusts are smoothed; 0 for a filter that knows only calm air.
    """

    structure: ModeStructure
    prior_value: Array
    prior_std: Array
    reference: tuple[float, float]
    engine: Literal["compiled", "filterpy"] = "compiled"
    memory_s: float = 40.0
    adapt_s: float = 10.0
    trim_corner_hz: float = 0.1
    stale_s: float = 30.0
    held: tuple[bool, ...] = ()
    servo_s: tuple[float, ...] = ()
    use_accelerometer: bool = True
    imu_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    noise_std: tuple[float, ...] = ()
    input_noise_std: tuple[float, ...] = ()
    span_m: float = 0.0

    def __post_init__(self) -> None:
        if not self.held:
            object.__setattr__(self, "held", (False,) * len(self.structure.inputs))


@dataclass(slots=True)
class EkfState:
    """Everything the filter remembers, one row a vehicle.

    Attributes:
        z: augmented state (states, the air's unrest, derivatives, constants); cov: its covariance.
        noise: variances, laid out in ``noise``; lags: last differences of each state, the mean root of their
            magnitudes, their covariance and what was foreseen of the state's last step; levels: smoothers of the
            vane's velocity; slow: sums of corrections.
        rows: (2, columns) last signal row and the one before.
        roughness: squared second differences during warm-up.
        condition: dynamic pressure ratio, airspeed, density, altitude, angle of attack of the last sample.
        clock: last solution's time.
        informed_s: last time each derivative's variance shrank through data, (k,); variance: its last value.
        information, vector: of the derivatives after the last solution, (k, k) and (k,).
        gained_matrix, gained_vector: information gained from data since they were last read.
        moments: of each input since the last solution: number of readings, their sum and sum of squares from the first
            of them, that first one, (nu, 4); moved_s: last time each moved beyond its noise, (nu,).
        echo: of a reading error of each input (``inputs.echo_before``), (nu, nx + 2 ns, ns).
        counts: samples, solutions, age of the echo.
        stretch: the last signal rows, which may be run again, first the time since the row before
            (``relinearise``), (STRETCH_ROWS, columns); tally: rows in it, rows before its second mark (0: none),
            solutions in it, rows that were run again so far.
        solved: of each of these solutions the rows before it, the share of information kept, whether each input
            rested, (SOLUTIONS, 2 + nu).
        marks_z, marks_cov, marks_rows: z, cov and rows at the beginning of the stretch and amid it, (2, ...).
        weighed: logarithms of the innovations' variances by which what follows each mark was weighed, (2, ns + 1).
        about: the derivatives that what follows each mark was linearised about and their covariance; and the
            information at the mark, (2, k, 1 + 2 k).
        sure: what was known when data last carried signal (``quiet``), (k, 2 k + 2).
    """

    z: Array
    cov: Array
    noise: Array
    lags: Array
    levels: Array
    slow: Array
    rows: Array
    roughness: Array
    condition: Array
    clock: Array
    informed_s: Array
    variance: Array
    information: Array
    vector: Array
    gained_matrix: Array
    gained_vector: Array
    moments: Array
    moved_s: Array
    echo: Array
    counts: NDArray[np.int64]
    stretch: NDArray[np.float32]
    tally: NDArray[np.int64]
    solved: Array
    marks_z: Array
    marks_cov: Array
    marks_rows: Array
    weighed: Array
    about: Array
    sure: Array


class EkfEstimator:
    """The filter: ``init``, ``update``, ``solve``, ``estimate``; a batch of vehicles at a time."""

    name = "ekf"

    def __init__(self, config: EkfConfig) -> None:
        self.config = config
        self.layout = SignalLayout(len(config.structure.states), len(config.structure.inputs))
        ns = self.layout.states
        self._longitudinal = config.structure.equations[0] == "z"
        self._roll = ns == 3
        self._lever = np.zeros(ns)
        x, _, z = config.imu_position_m
        if self._longitudinal:
            self._lever[1] = x
        else:
            self._lever[-1] = -x
            if self._roll:
                self._lever[1] = z
        self._exponents = np.array([1.0] * ns + [2.0] * self.layout.inputs)
        stated = config.noise_std or (0.0,) * ns
        self._settings = np.array([config.adapt_s, 2.0 * np.pi * config.trim_corner_hz, *np.square(stated)])
        # Roll and pitch of the air are smoothed over 4 b / pi, yaw over 3 b / pi (MIL-F-8785C 3.7.5).
        lengths = [4.0, 4.0 if self._longitudinal else 3.0]
        self._gust_m = (
            np.array(lengths if config.span_m > 0.0 else [], dtype=np.float64) * config.span_m / np.pi
        )
        self._direction = np.zeros(ns)
        self._direction[1] = 1.0
        if self._roll:
            by_roll_rate = config.prior_value.reshape(ns, -1)[:, 1]
            if by_roll_rate[1] != 0.0:
                self._direction = by_roll_rate / by_roll_rate[1]
        servo = np.array(config.servo_s or (0.0,) * self.layout.inputs)
        self._servo_s = np.where(config.held, 0.0, np.where(servo > 0.0, servo, np.inf))
        self._input_variance = np.square(config.input_noise_std or (0.0,) * self.layout.inputs)
        self._reference = np.array(config.reference)
        constant = np.full(ns, 10.0)
        constant[0] = 30.0
        self._prior_value = np.concatenate([config.prior_value, np.zeros(ns)])
        self._prior_std = np.concatenate([config.prior_std, constant])
        self._fixed = Fixed(
            self._servo_s, self._input_variance, self._lever, self._exponents, self._reference, self._longitudinal,
            self._roll, config.use_accelerometer, self._settings, self._gust_m, self._direction,
        )  # fmt: skip

    def unrest_of(self, state: EkfState, vehicle: int) -> Array:
        """Variance of each state that the air's unrest alone causes within ten seconds, shape (ns,).

        Zeros for a filter that knows only calm air, NaN before there is a condition.
        """
        _, airspeed, density, _, alpha = state.condition[vehicle]
        if not self._gust_m.size or not np.isfinite(airspeed):
            return np.full(self.layout.states, 0.0 if not self._gust_m.size else np.nan)
        c, ns = self.config, self.layout.states
        scale = referred_scale(c.structure, airspeed, density, c.reference)
        kinematic = offsets(c.structure, airspeed, alpha)[:ns]
        return np.asarray(
            unrest_variance(
                state.z[vehicle], state.noise[vehicle], scale, kinematic, self._gust_m, self._direction, airspeed,
                self._longitudinal, ns, self.layout.inputs,
            )
        )  # fmt: skip

    def init(self, vehicles: int) -> EkfState:
        """State before the first sample."""
        n, ns, k = vehicles, self.layout.states, self.config.prior_value.size
        nx = ns + self._gust_m.size
        z = np.concatenate([np.zeros(nx), self._prior_value])
        cov = np.zeros((z.size, z.size))
        cov[nx:, nx:] = np.diag(self._prior_std**2)
        known = cov[nx : nx + k, nx : nx + k]
        return EkfState(
            z=np.tile(z, (n, 1)),
            cov=np.tile(cov, (n, 1, 1)),
            noise=np.full((n, ns + 3 + NOISE_TAIL), 1e-8),
            lags=np.zeros((n, ns, 5)),
            levels=np.zeros((n, 4, LEVELS)),
            slow=np.zeros((n, 2)),
            rows=np.full((n, 2, self.layout.columns), np.nan),
            roughness=np.zeros((n, 1)),
            condition=np.full((n, 5), np.nan),
            clock=np.full(n, np.nan),
            informed_s=np.full((n, k), -np.inf),
            variance=np.tile(self.config.prior_std**2, (n, 1)),
            information=np.tile(np.diag(self.config.prior_std**-2.0), (n, 1, 1)),
            vector=np.tile(self.config.prior_value / self.config.prior_std**2, (n, 1)),
            gained_matrix=np.zeros((n, k, k)),
            gained_vector=np.zeros((n, k)),
            moments=np.zeros((n, self.layout.inputs, 4)),
            moved_s=np.full((n, self.layout.inputs), -np.inf),
            echo=np.zeros((n, self.layout.inputs, nx + 2 * ns, ns)),
            counts=np.zeros((n, 3), dtype=np.int64),
            stretch=np.zeros((n, STRETCH_ROWS, self.layout.columns), dtype=np.float32),
            tally=np.zeros((n, 4), dtype=np.int64),
            solved=np.zeros((n, SOLUTIONS, 2 + self.layout.inputs)),
            marks_z=np.tile(z, (n, 2, 1)),
            marks_cov=np.tile(cov, (n, 2, 1, 1)),
            marks_rows=np.full((n, 2, 2, self.layout.columns), np.nan),
            weighed=np.full((n, 2, ns + 1), -np.inf),
            about=np.tile(
                np.column_stack([self.config.prior_value, known, np.diag(self.config.prior_std**-2.0)]),
                (n, 2, 1, 1),
            ),
            sure=np.tile(nothing_sure(self.config.prior_value, self.config.prior_std), (n, 1, 1)),
        )

    def update(self, state: EkfState, signals: Array) -> None:
        """Take in samples: shape (vehicles, samples, columns) from ``Signals``; incomplete rows are passed over.

        Raises:
            ValueError: signals of another structure.
        """
        signals = self.layout.checked(signals)
        remember(signals, self.layout.kinematic + 5, state.rows, state.stretch, state.tally)
        if self.config.engine == "filterpy":
            for vehicle in range(signals.shape[0]):
                self._update_filterpy(state, vehicle, signals[vehicle])
            return
        update_all(
            signals, self._fixed, state.z, state.cov, state.noise, state.lags, state.levels,
            state.slow, state.rows, state.roughness, state.condition, state.moments, state.echo, state.counts,
        )  # fmt: skip

    def solve(self, state: EkfState, seen: NDArray[np.int64] | None = None) -> None:
        """Note what was learned, then forget with ``memory_s``, unless all is quiet; where it matters, the last seconds
        are run again, linearised about what is known now. A filter whose numbers are no longer finite starts anew.

        Args:
            state: in place.
            seen: of each vehicle, what the data since the last solution carried, as far as somebody can tell:
                ``quiet``'s SIGNAL, NOISE or UNDECIDED, shape (vehicles,). All SIGNAL if not given.
        """
        lost = ~(np.isfinite(state.z).all(axis=1) & np.isfinite(state.cov).all(axis=(1, 2)))
        if lost.any():
            fresh = self.init(int(lost.sum()))
            for name in (f.name for f in fields(state)):
                getattr(state, name)[lost] = getattr(fresh, name)
        quiet = [] if seen is None else [int(i) for i in np.flatnonzero(seen == NOISE)]
        for i in quiet:
            self._go_back(state, i)
        done = np.empty((len(state.z), 2 + self.layout.inputs))
        solve_all(
            self.config.memory_s, self.config.stale_s, self._prior_value, self._prior_std, self._input_variance,
            state.z, state.cov, state.rows, state.clock, state.informed_s, state.variance, state.information,
            state.vector, state.gained_matrix, state.gained_vector, state.moments, state.moved_s, state.echo,
            state.counts, done,
        )  # fmt: skip
        relinearise_all(
            sizes(self.layout.states, self.layout.inputs, self._gust_m.size), self._fixed, self._prior_value,
            self._prior_std, state.z, state.cov, state.noise, state.slow, state.rows, state.variance,
            state.information, state.vector, state.echo, state.counts, done, state.stretch, state.tally, state.solved,
            state.marks_z, state.marks_cov, state.marks_rows, state.weighed, state.about,
        )  # fmt: skip
        for i in quiet:
            self._begin_stretch(state, i)
        if seen is not None:
            for i in [int(i) for i in np.flatnonzero(seen != UNDECIDED)]:
                self._keep_sure(state, i)

    def _go_back(self, state: EkfState, i: int) -> None:
        known = (state.information[i], state.vector[i], state.variance[i])
        first = self.layout.states + self._gust_m.size
        go_back(
            state.sure[i],
            state.z[i],
            state.cov[i],
            known,
            (state.gained_matrix[i], state.gained_vector[i]),
            first,
        )
        state.moments[i] = 0.0
        state.echo[i] = 0.0
        state.tally[i, :3] = 0

    def _keep_sure(self, state: EkfState, i: int) -> None:
        first = self.layout.states + self._gust_m.size
        keep_sure(
            state.sure[i], state.z[i], state.cov[i], (state.gained_matrix[i], state.gained_vector[i]), first
        )

    def _begin_stretch(self, state: EkfState, i: int) -> None:
        """What follows may be run again, nothing before it."""
        state.tally[i, :3] = 0
        mark(
            0, state.z[i], state.cov[i], state.noise[i], state.rows[i], self.layout.states + self._gust_m.size,
            state.information[i], state.marks_z[i], state.marks_cov[i], state.marks_rows[i], state.weighed[i],
            state.about[i],
        )  # fmt: skip

    def release(
        self, state: EkfState, changed: NDArray[np.bool_], vehicle: int = 0, since_s: float = np.inf
    ) -> None:
        """Set free what is known of derivatives that have changed: P becomes P + s^2 e e', s the natural size.

        Where ``since_s`` lies within the rows that are kept, they are set free then and what came since is run again.
        What is lost so is no information gained: the account of ``take_gained`` does not see it.

        Args:
            state: in place.
            changed: which derivatives, shape (k,).
            vehicle: row of the state.
            since_s: when they had not changed yet, on the rows' clock; infinite where that is not known.
        """
        c, k = self.config, self.config.prior_value.size
        if not changed.any():
            return
        first = self.layout.states + self._gust_m.size
        at_its_time = release_since(
            sizes(self.layout.states, self.layout.inputs, self._gust_m.size), self._fixed, self._prior_value,
            self._prior_std, state, vehicle, changed, since_s,
        )  # fmt: skip
        if not at_its_time:
            rows = first + np.flatnonzero(changed)
            state.cov[vehicle, rows, rows] += c.prior_std[changed] ** 2
        parameters = state.cov[vehicle, first : first + k, first : first + k]
        state.information[vehicle] = np.linalg.inv(parameters)
        state.vector[vehicle] = state.information[vehicle] @ state.z[vehicle, first : first + k]
        state.variance[vehicle] = np.diagonal(parameters)
        if not at_its_time:
            self._begin_stretch(state, vehicle)
        self._keep_sure(state, vehicle)

    def estimate(self, state: EkfState, vehicle: int = 0) -> Estimate:
        """Concise derivatives of one vehicle as of the last sample, at its present flight condition."""
        c, k = self.config, self.config.prior_value.size
        first = self.layout.states + self._gust_m.size
        _, airspeed, density, altitude, alpha = state.condition[vehicle]
        scale = referred_scale(c.structure, airspeed, density, c.reference)
        value = state.z[vehicle, first : first + k] * scale + offsets(c.structure, airspeed, alpha)
        if c.structure.states[0] == "w":
            value += self._by_airspeed(state, vehicle, value)
        covariance = state.cov[vehicle, first : first + k, first : first + k] * np.outer(scale, scale)
        return standing(
            self.name, c.structure, float(state.rows[vehicle, 0, 0]),
            Posterior(value, covariance, 3.0 * c.prior_std * scale, prior_ratio=1.0), state.informed_s[vehicle],
            c.stale_s, bool(state.counts[vehicle, 0] > WARM_UP), np.array([airspeed, altitude, density, alpha]),
        )  # fmt: skip

    def _by_airspeed(self, state: EkfState, vehicle: int, value: Array) -> Array:
        """What w changes through the airspeed, the forward speed being constant: dV/dw = sin(alpha).

        The filter's forces go with rho V (states) and rho V^2 (inputs and constants), V measured; a concise derivative
        by w holds their slope by V too, for z_w -2 g sin(alpha) / V and a little more.
        """
        ns, nu = self.layout.states, self.layout.inputs
        _, airspeed, _, _, alpha = state.condition[vehicle]
        row, by_w = state.rows[vehicle, 0], np.zeros((ns, ns + nu))
        if np.isfinite(alpha) and airspeed > 1.0:
            table, kappa = value.reshape(ns, ns + nu), row[self.layout.kinematic + 1]
            still = state.z[vehicle, -ns:] * kappa + table[:, ns:] @ row[self.layout.first_input :][:nu]
            by_w[:, 0] = np.sin(alpha) * (2.0 * still / airspeed + table[:, 0] * np.sin(alpha))
        return by_w.ravel()

    def take_gained(self, state: EkfState, vehicle: int = 0) -> tuple[Array, Array]:
        """Information (k, k) and vector (k,) gained from data since the last call; the account starts anew."""
        matrix, vector = state.gained_matrix[vehicle].copy(), state.gained_vector[vehicle].copy()
        state.gained_matrix[vehicle] = 0.0
        state.gained_vector[vehicle] = 0.0
        state.sure[vehicle, :, 1 + matrix.shape[0] :] = 0.0
        return matrix, vector

    def _update_filterpy(self, state: EkfState, i: int, signals: Array) -> None:
        """The same recursion with filterpy's filter doing prediction and correction."""
        kinematic = self.layout.kinematic
        for new in signals:
            if not np.isfinite(new[: kinematic + 5]).all():
                continue
            old, older = state.rows[i, 0].copy(), state.rows[i, 1].copy()
            dt = new[0] - old[0]
            both_vanes = new[kinematic + 6] == 1.0 and old[kinematic + 6] == 1.0
            carried = bool(self.config.use_accelerometer and both_vanes)
            count = state.counts[i, 0] + 1
            filtering = count > WARM_UP and not (carried and count * dt < SETTLE_S) and np.isfinite(older[0])
            if not 0.0 < dt <= MAX_GAP_S or not filtering:
                self._compiled_one(state, i, new)
                continue
            state.counts[i, 0] = count
            self._filter_one(state, i, new, old, older, dt, carried)
            state.rows[i, 1] = old
            state.rows[i, 0] = new
            track_condition(state.condition[i], new, kinematic, dt)
            track_inputs(state.moments[i], new, 2 + self.layout.states, self.layout.inputs)

    def _filter_one(
        self, state: EkfState, i: int, new: Array, old: Array, older: Array, dt: float, carried: bool
    ) -> None:
        """``kernel._step`` by filterpy."""
        ns, nu, kinematic = self.layout.states, self.layout.inputs, self.layout.kinematic
        gusts, noise = self._gust_m.size, state.noise[i]
        over, bend, at_end, scale, forward, kappa, rest = step_inputs(
            new, old, older, self._servo_s, self._reference, self._exponents, self._longitudinal, self._roll, carried,
            ns, nu,
        )  # fmt: skip
        speed = max(new[kinematic + 2], 1.0)
        decay = air_decay(self._gust_m, speed, dt)
        after, top = transition(
            state.z[i], dt, scale, forward, over, bend[0], kappa, rest, decay, self._direction, carried, ns, nu, gusts
        )  # fmt: skip
        rate = learn_before(
            noise, state.lags[i], state.levels[i], self._settings[2:], new, old, older, state.z[i], after, dt,
            self._settings[0], state.counts[i, 0], kinematic, carried, ns,
        )  # fmt: skip
        process = np.zeros((after.size, after.size))
        nx = ns + gusts
        process[:nx, :nx] = process_noise(noise, top, dt, speed, decay, self._longitudinal, ns, gusts)
        expected, jacobian = measure(after, scale, at_end, kappa, self._lever, self._direction, ns, nu, gusts)
        heard = input_noise(top, jacobian[ns], after, self._input_variance, ns, nu, gusts, process[:nx, :nx])
        process[-ns:, -ns:] = np.diag(trim_drift(noise, dt, self._settings[1], carried, ns))
        measured = np.ones(ns + 1, dtype=bool)
        measured[0] = new[kinematic + 6] == 1.0
        measured[ns] = self.config.use_accelerometer
        kalman = _Filter(after, state.cov[i], top, process, int(measured.sum()))
        kalman.predict()
        reading = new[1 : 2 + ns].copy()
        reading[ns] += self._lever[1:] @ new[self.layout.known_moments :]
        spread = np.diagonal(kalman.P)[: ns + gusts].copy()
        swing = expected[ns] - after[-ns] * kappa
        variance = noise[: ns + 1].copy()
        variance[ns] += noise[-NOISE_TAIL] * swing**2 + heard
        self._follow_echo(state, i, top, bend[1], kalman.P, jacobian[ns], variance, measured)
        kalman.R = np.diag(variance[measured])
        kalman.update(reading[measured], lambda _: jacobian[measured], lambda _: expected[measured])
        state.z[i], state.cov[i] = kalman.x, 0.5 * (kalman.P + kalman.P.T)
        learn_after(
            noise, state.slow[i], state.z[i], state.cov[i], after, spread, jacobian[ns], reading[ns] - expected[ns],
            swing, heard, decay, rate, carried, self.config.use_accelerometer, ns, gusts,
        )  # fmt: skip

    def _follow_echo(
        self, state: EkfState, i: int, top: Array, mean: Array, predicted: Array, row: Array, variance: Array,
        measured: NDArray[np.bool_],
    ) -> None:  # fmt: skip
        """The echo needs the gains of measurements taken one by one; they come from copies of state and covariance."""
        ns, nu, gusts = self.layout.states, self.layout.inputs, self._gust_m.size
        work, noise = np.empty(ns + gusts), self._input_variance
        gains, few = np.zeros(((ns + 2) // 2 * 2, row.size)), np.zeros((2, (ns + 2) // 2 * 2))
        cov = 0.5 * (predicted + predicted.T)
        correct(
            np.zeros(row.size),
            cov,
            variance,
            np.zeros(ns + 1),
            row,
            measured,
            ns,
            row.size,
            gains,
            few[0],
            few[1],
        )
        echo_before(state.echo[i], state.counts[i, 2], top, mean, noise, ns, nu, gusts, work)
        state.counts[i, 2] = echo_after(
            state.echo[i], state.counts[i, 2], row, measured, gains, few[1], noise, ns, nu, gusts, work
        )

    def _compiled_one(self, state: EkfState, i: int, new: Array) -> None:
        """Start, restart and warm-up are no filtering and are shared with the compiled engine."""
        one = slice(i, i + 1)
        update_all(
            np.ascontiguousarray(new)[None, None], self._fixed, state.z[one], state.cov[one], state.noise[one],
            state.lags[one], state.levels[one], state.slow[one], state.rows[one], state.roughness[one],
            state.condition[one], state.moments[one], state.echo[one], state.counts[one],
        )  # fmt: skip


class _Filter(ExtendedKalmanFilter):  # type: ignore[misc]  # filterpy carries no types
    """filterpy's filter with the state's prediction handed in instead of F x."""

    def __init__(self, after: Array, covariance: Array, top: Array, process: Array, readings: int) -> None:
        super().__init__(dim_x=after.size, dim_z=readings)
        self.x, self.P, self.Q = after.copy(), covariance.copy(), process
        self.F = np.eye(after.size)
        self.F[: top.shape[0]] = top

    def predict_x(self, u: float = 0) -> None:
        """The state has been predicted by the model already."""
