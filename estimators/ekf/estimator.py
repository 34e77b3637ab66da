"""Extended Kalman filter with the derivatives as states, for a batch of vehicles; engines "compiled" and "filterpy".

Both engines run the same model (``model``), noise adaptation and forgetting; the engine "filterpy" leaves
prediction and correction to ``filterpy.kalman.ExtendedKalmanFilter`` and serves as the reference.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from wingwatch.aircraft.structures import ModeStructure
from wingwatch.estimators.ekf.accepted import NOISE, UNDECIDED, accept, go_back, prior_accepted
from wingwatch.estimators.ekf.coherence import forget_coherence, no_coherence
from wingwatch.estimators.ekf.gust_variance import gust_variance
from wingwatch.estimators.ekf.noise import LEAST
from wingwatch.estimators.ekf.recursion import WARM_UP, Runner
from wingwatch.estimators.ekf.release import gained_in_window, keep_ratios, release_since
from wingwatch.estimators.ekf.relinearise import relinearise_all
from wingwatch.estimators.ekf.rerun import Rerun
from wingwatch.estimators.ekf.scatter import (
    dispersed,
    dispersion_before,
    forget_block,
    no_scatter,
    stated_dispersions,
    wider_covariances,
)
from wingwatch.estimators.ekf.solve import solve_all
from wingwatch.estimators.ekf.state import (
    ACCELERATION,
    EXPECTED,
    NEWEST,
    PATH,
    PRESSURE_RATIO,
    TIME,
    TURN,
    WITH_ROLL,
    Checkpoints,
    EkfState,
    InputErrors,
    Levels,
    Memory,
    Model,
    MomentLevel,
    Noise,
    Solved,
    Window,
    gust_states,
    put_vehicle,
    sizes_of,
)
from wingwatch.estimators.ekf.window import NOT_KEPT, SOLUTIONS, WINDOW_ROWS, begin_window, remember
from wingwatch.estimators.estimate import Estimate
from wingwatch.estimators.evidence.dispersion import dispersion_workspace
from wingwatch.estimators.kernels.apart import apart
from wingwatch.estimators.kernels.intersample import servos_of
from wingwatch.estimators.kernels.levels import LEVELS
from wingwatch.estimators.kernels.reading_noise import READING_MEMORY
from wingwatch.estimators.lanes import Lanes, all_lanes
from wingwatch.estimators.reference import offsets, referred_scale
from wingwatch.estimators.signals import SignalLayout
from wingwatch.estimators.standing import ConcisePosterior, Validities, assess
from wingwatch.kernels.by_address import ByAddress

__all__ = ["EkfConfig", "EkfEstimator", "EkfState"]

Array = NDArray[np.float64]

_KNOWN = 2.0
"""The prior's standard deviation over that to which a derivative has to be known before an account of it counts."""

_CONTRADICTION = 1e-4
"""Probability below which an account contradicts what is known: once in a day of blocks by chance."""


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
        servo_rate_rad_s: what each such servo moves by at most; 0 where that is not known.
        use_accelerometer: whether the accelerometer is a measurement.
        imu_position_m: (x, y, z) of the accelerometer from the c.g.
        noise_std: of the measured states as the aircraft file states it, 0 where it says nothing; believed as far as
            the record allows.
        input_noise_std: of the measured inputs, as the aircraft file states it.
        accelerometer_noise_std: of the accelerometer, as the aircraft file states it, m/s2; 0 where it says nothing.
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
    servo_rate_rad_s: tuple[float, ...] = ()
    use_accelerometer: bool = True
    imu_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    noise_std: tuple[float, ...] = ()
    input_noise_std: tuple[float, ...] = ()
    accelerometer_noise_std: float = 0.0
    span_m: float = 0.0

    def __post_init__(self) -> None:
        if not self.held:
            object.__setattr__(self, "held", (False,) * len(self.structure.inputs))


class EkfEstimator:
    """The filter: ``init``, ``update``, ``solve``, ``estimate``; a batch of vehicles at a time."""

    name = "ekf"

    def __init__(self, config: EkfConfig) -> None:
        self.config = config
        self.layout = SignalLayout(len(config.structure.states), len(config.structure.inputs))
        self.model = _model(config, self.layout.states, self.layout.inputs)
        self._dispersing = dispersion_workspace(config.prior_value.size)
        self._runner, self._rerun = Runner(self.model), Rerun(self.model)
        self._last: ByAddress | None = None

    def gust_variance(self, state: EkfState, places: NDArray[np.int64]) -> Array:
        """Variance of each state of some vehicles that gusts alone cause within ten seconds, shape (m, ns).

        Zeros for a filter that knows only calm air, NaN before there is a condition.
        """
        out = np.zeros((places.size, self.model.sizes.states))
        if self.model.sizes.gusts > 0:
            gust_variance(
                self.model, state.z, state.noise, state.condition, state.ratios, state.direction, places, out
            )
        return out

    def init(self, vehicles: int) -> EkfState:
        """State before the first sample."""
        n, c, sizes, columns = vehicles, self.config, self.model.sizes, self.layout.columns
        ns, nu, nx, k = sizes.states, sizes.inputs, sizes.dynamic, c.prior_value.size
        z = np.concatenate([np.zeros(nx), self.model.prior_value])
        cov = np.diag(np.concatenate([np.zeros(nx), self.model.prior_std**2]))
        known, information = cov[nx : nx + k, nx : nx + k], np.diag(c.prior_std**-2.0)
        none = np.zeros(n, dtype=np.int64)
        state = EkfState(
            z=np.tile(z, (n, 1)),
            cov=np.tile(cov, (n, 1, 1)),
            noise=_no_noise(self.model, n),
            memory=Memory(
                np.zeros((n, ns, 5)),
                np.zeros((n, 4, LEVELS)),
                np.zeros(n),
                np.zeros((n, ns + nu, READING_MEMORY)),
            ),
            input_errors=InputErrors(
                np.zeros((n, nu, nx, ns)), np.zeros((n, nu, ns, ns)), np.zeros((n, nu, ns, ns)), none.copy()
            ),
            moment_level=_no_slopes(n, ns),
            coherence=no_coherence(n, ns),
            moments=np.zeros((n, ns + nu, 4)),
            halves=np.zeros((n, ns + nu, 4, 3)),
            half_s=np.full(n, np.nan),
            rows=np.full((n, 2, columns), np.nan),
            condition=np.full((n, 5), np.nan),
            samples=none.copy(),
            ratios=np.full(n, EXPECTED),
            direction=np.tile(self.model.gust_direction, (n, 1)),
            settling=np.ones(n, dtype=np.bool_),
            solutions=none.copy(),
            solved_s=np.full(n, np.nan),
            informed_s=np.full((n, k), -np.inf),
            moved_s=np.full((n, ns + nu), -np.inf),
            variance=np.tile(c.prior_std**2, (n, 1)),
            information=np.tile(information, (n, 1, 1)),
            vector=np.tile(c.prior_value / c.prior_std**2, (n, 1)),
            gained_matrix=np.zeros((n, k, k)),
            gained_vector=np.zeros((n, k)),
            scatter=no_scatter(n, ns, k),
            window=Window(
                rows=np.zeros((n, WINDOW_ROWS, columns - NOT_KEPT), dtype=np.float32),
                filled=none.copy(),
                middle=none.copy(),
                solutions=none.copy(),
                skipped=none.copy(),
                rerun=none.copy(),
                ends=np.zeros((n, SOLUTIONS), dtype=np.int64),
                keep=np.zeros((n, SOLUTIONS)),
                resting=np.zeros((n, SOLUTIONS, ns + nu), dtype=np.bool_),
                checkpoints=Checkpoints(
                    z=np.tile(z, (n, 2, 1)),
                    cov=np.tile(cov, (n, 2, 1, 1)),
                    rows=np.full((n, 2, 2, columns), np.nan),
                    log_variance=np.full((n, 2, ns + 1), -np.inf),
                    value=np.tile(c.prior_value, (n, 2, 1)),
                    covariance=np.tile(known, (n, 2, 1, 1)),
                    information=np.tile(information, (n, 2, 1, 1)),
                    levels=_no_levels(n, ns),
                ),
            ),
            accepted=prior_accepted(c.prior_value, c.prior_std, no_coherence(n, ns)),
        )
        return apart(state)

    def update(self, state: EkfState, signals: Array, lanes: Lanes | None = None) -> None:
        """Take in samples: shape (vehicles, samples, columns) from ``Signals``; incomplete rows are passed over.

        Args:
            state: advanced in place.
            signals: of the vehicles in ``lanes``; of all where these are not given.

        Raises:
            ValueError: signals of another structure.
        """
        signals = self.layout.checked(signals)
        lanes = lanes or all_lanes(*signals.shape[:2])
        remember(signals, lanes, self.layout.kinematic, state.rows, state.window.rows, state.window.filled)
        if self.config.engine == "filterpy":
            from wingwatch.estimators.ekf import (
                filterpy_engine,  # it takes half a second that a service has no use for
            )

            filterpy_engine.update_all(self.model, state, signals, lanes)
        else:
            self._runner.update(state, signals, lanes)

    def solve(
        self, state: EkfState, seen: NDArray[np.int64] | None = None, places: NDArray[np.int64] | None = None
    ) -> dict[int, Exception]:
        """Note what was learned, then forget with ``memory_s``, unless all is quiet; where it matters, the last seconds
        are run again, linearised about what is known now. A filter whose numbers are no longer finite, or whose
        variances have become negative by rounding, starts anew.

        Args:
            state: in place.
            seen: of each vehicle, what the data since the last solution carried, as far as that is known:
                ``accepted``'s SIGNAL, NOISE or UNDECIDED, shape (vehicles,). All SIGNAL if not given.
            places: the vehicles, each once; all if not given.

        Returns:
            vehicles that the program failed on, and how; the others are solved.
        """
        places = np.arange(len(state.z)) if places is None else places
        n, first = places.size, self.model.sizes.dynamic
        self._start_lost(state, places)
        faults: dict[int, Exception] = {}
        quiet = [] if seen is None else places[seen == NOISE].tolist()
        for i in quiet:
            try:
                go_back(state, i, first)
            except Exception as error:  # the others are not to suffer by it
                faults[i] = error
        solved = Solved(
            np.empty(n), np.empty(n), np.empty((n, self.layout.states + self.layout.inputs), dtype=np.bool_)
        )
        packed, model = self._packed(state), self._rerun.by_address
        solve_all(model, packed, places, solved, self._dispersing)
        faults |= relinearise_all(self._rerun, state, packed, places, solved)
        self._start_lost(state, places)
        for i in quiet:
            begin_window(model, packed, i)
        if seen is not None:
            for decided in places[seen != UNDECIDED].tolist():
                accept(state, decided, first)
        return faults

    def _packed(self, state: EkfState) -> ByAddress:
        """The state by address; of the one that was asked for last it is at hand."""
        if self._last is None or self._last.named is not state:
            self._last = ByAddress(state)
        return self._last

    def _start_lost(self, state: EkfState, places: NDArray[np.int64]) -> None:
        """Start those filters anew that hold no probability distribution any more."""
        variances = np.diagonal(state.cov[places], axis1=1, axis2=2)
        sound = np.isfinite(state.z[places]).all(axis=1) & np.isfinite(state.cov[places]).all(axis=(1, 2))
        sound &= (variances >= 0.0).all(axis=1)
        if not sound.all():
            put_vehicle(state, places[~sound], self.init(int((~sound).sum())))

    def release(self, state: EkfState, spread: Array, vehicle: int = 0, since_s: float = np.inf) -> bool:
        """Inflate the covariance of derivatives that have changed: P becomes P + s^2 e e' for each.

        It is done as of ``since_s``, or of the beginning of the window of recent rows where that is later, and what
        came since is run again.
        The account of ``take_gained`` starts anew with what came since, as it is run again.

        Args:
            state: in place.
            spread: standard deviation s of what each has changed by, in natural sizes, shape (k,); 0 of one that has
                not.
            vehicle: row of the state.
            since_s: when they had not changed yet, on the rows' clock; infinite where that is not known.

        Returns:
            whether anything was run again.
        """
        if not spread.any():
            return False
        first, parameters = self.model.sizes.dynamic, self._parameters
        at_its_time = release_since(self._rerun, state, vehicle, spread, since_s)
        if not at_its_time:
            keep_ratios(self.model, state, vehicle)
            rows = np.arange(first, first + spread.size)
            state.cov[vehicle, rows, rows] += (spread * self.config.prior_std) ** 2
        covariance = state.cov[vehicle, parameters, parameters]
        state.information[vehicle] = np.linalg.inv(covariance)
        state.vector[vehicle] = state.information[vehicle] @ state.z[vehicle, parameters]
        state.variance[vehicle] = np.diagonal(covariance)
        state.gained_matrix[vehicle], state.gained_vector[vehicle] = 0.0, 0.0
        if at_its_time:
            gained = gained_in_window(self.model, state, vehicle)
            state.gained_matrix[vehicle], state.gained_vector[vehicle] = gained
        else:
            begin_window(self._rerun.by_address, self._packed(state), vehicle)
        forget_coherence(state, vehicle)
        accept(state, vehicle, first)
        forget_block(state, vehicle)
        return at_its_time

    @property
    def _parameters(self) -> slice:
        """Where the derivatives stand in the augmented state."""
        first = self.model.sizes.dynamic
        return slice(first, first + self.config.prior_value.size)

    def estimate(self, state: EkfState, vehicle: int = 0) -> Estimate:
        """Concise derivatives of one vehicle as of the last sample, at its present flight condition."""
        return self.validities(state, np.array([vehicle])).of(0).estimate(self.name, self.config.structure)

    def validities(self, state: EkfState, places: NDArray[np.int64]) -> Validities:
        """The same of some vehicles, (m,), in numbers."""
        c, parameters, z = self.config, self._parameters, state.z[places]
        _, airspeed, density, altitude, alpha = state.condition[places].T
        scale = referred_scale(c.structure, airspeed, density, c.reference)
        value = z[:, parameters] * scale + offsets(c.structure, airspeed, alpha)
        row = state.rows[places, NEWEST]
        if c.structure.states[0] == "w":
            value += self._by_airspeed(z, row, value, airspeed, alpha)
        dispersion = stated_dispersions(state, places)
        covariance = wider_covariances(state.cov[places, parameters, parameters], c.prior_std, dispersion)
        covariance *= scale[:, :, None] * scale[:, None, :]
        posterior = ConcisePosterior(value, covariance, 3.0 * c.prior_std * scale, prior_ratio=1.0)
        condition = np.stack([airspeed, altitude, density, alpha], axis=1)
        return assess(
            c.structure, row[:, TIME], posterior, state.informed_s[places], c.stale_s,
            state.samples[places] > WARM_UP, condition,
        )  # fmt: skip

    def _by_airspeed(self, z: Array, row: Array, value: Array, airspeed: Array, alpha: Array) -> Array:
        """What w changes through the airspeed, the forward speed being constant: dV/dw = sin(alpha); (m, k).

        The filter's forces go with rho V (states) and rho V^2 (inputs and constants), V measured; a concise derivative
        by w holds their slope by V too, for z_w -2 g sin(alpha) / V and a little more.
        """
        ns, nu = self.layout.states, self.layout.inputs
        table, first = value.reshape(-1, ns, ns + nu), self.layout.first_input
        known = np.isfinite(alpha) & (airspeed > 1.0)
        slope, speed = np.where(known, np.sin(alpha), 0.0)[:, None], np.where(known, airspeed, 1.0)[:, None]
        forces = z[:, -ns:] * row[:, self.layout.kinematic + PRESSURE_RATIO, None]
        forces += (table[:, :, ns:] * row[:, None, first : first + nu]).sum(axis=2)
        by_w = np.zeros(table.shape)
        by_w[:, :, 0] = slope * (2.0 * forces / speed + table[:, :, 0] * slope)
        by_w[~known] = 0.0
        return by_w.reshape(value.shape)

    def take_gained(
        self, state: EkfState, vehicle: int = 0, *, again: bool = False, within: float = 0.0
    ) -> tuple[Array, Array]:
        """Information (k, k) and vector (k,) gained from data since the last call, with the dispersion of the blocks
        before; the account starts anew.

        Each half second is linearised at what was known before it. So zeros are given where that was next to nothing of
        some derivative that the account has much of, and where the account contradicts what is known now, after rows
        were run again. ``again``: ``release`` has begun the account with rows run again about what they say themselves;
        ``within``: as for ``contradicted``.
        """
        matrix, vector = state.gained_matrix[vehicle].copy(), state.gained_vector[vehicle].copy()
        first = not again and _is_first(matrix, state.information[vehicle], self.config.prior_std)
        contradicts = self.contradicted(state, vehicle, within)
        for account in (state, state.accepted):
            account.gained_matrix[vehicle], account.gained_vector[vehicle] = 0.0, 0.0
        if first or contradicts:
            return np.zeros_like(matrix), np.zeros_like(vector)
        return dispersed(matrix, vector, dispersion_before(state.scatter, vehicle))

    def contradicted(self, state: EkfState, vehicle: int = 0, within: float = 0.0) -> bool:
        """Whether what a vehicle's data gave since the last ``take_gained`` cannot be of what is known by now.

        Args:
            within: by how much derivatives may differ all the same, in natural sizes.
        """
        matrix, vector = state.gained_matrix[vehicle], state.gained_vector[vehicle]
        off = vector - matrix @ state.z[vehicle, self._parameters]
        inner = np.eye(off.size) + matrix * (within * self.config.prior_std) ** 2
        return _contradicts(
            np.linalg.solve(inner, matrix), np.linalg.solve(inner, off), self.config.prior_std
        )


def _is_first(matrix: Array, known: Array, prior_std: Array) -> bool:
    """Whether an account (k, k), part of what is ``known``, tells a derivative that is next to unknown without it."""
    scale, prior = prior_std[:, None] * prior_std, np.eye(prior_std.size)
    within, without = (
        np.diagonal(np.linalg.pinv(part, hermitian=True)) * _KNOWN**2
        for part in (matrix * scale + prior, (known - matrix) * scale)
    )
    return bool(((within < 1.0) & ~((without > 0.0) & (without < 1.0))).any())


def _contradicts(matrix: Array, off: Array, prior_std: Array) -> bool:
    """Whether evidence (k, k) that is part of what is known cannot be of the derivatives' values: ``off``, its vector
    less what they make it, (k,)."""
    w, u = np.linalg.eigh(matrix * (prior_std[:, None] * prior_std))
    score = u.T @ (prior_std * off)
    seen = w > 1.0
    return bool(seen.any() and chdtrc(seen.sum(), (score[seen] ** 2 / w[seen]).sum()) < _CONTRADICTION)


def _no_noise(model: Model, n: int) -> Noise:
    """Before anything is known of it."""
    ns, inputs = model.sizes.states, model.input_variance
    return Noise(
        reading=np.full((n, ns + 1), LEAST),
        gust=np.full(n, LEAST),
        unmeasured=np.full((n, ns), LEAST),
        gain=np.full(n, LEAST),
        fisher=np.full((n, 2), LEAST),
        corrections=np.zeros(n),
        inputs=np.tile(inputs, (n, 1)),
        largest=np.tile(np.concatenate([np.full(ns, LEAST), inputs]), (n, 1)),
    )


def _no_slopes(n: int, ns: int) -> MomentLevel:
    """Before the first sample."""
    return MomentLevel(
        mean=np.zeros((n, ns, ns + 1)),
        covariance=np.zeros((n, ns, ns + 1, ns + 1)),
        information=np.zeros((n, ns)),
        samples=np.zeros((n, ns)),
    )


def _no_levels(n: int, ns: int) -> Levels:
    """Of checkpoints that are still to be set: none is lower than a vehicle's own."""
    return Levels(
        accelerometer=np.full((n, 2), np.inf),
        gain=np.zeros((n, 2)),
        fisher=np.zeros((n, 2, 2)),
        unmeasured=np.full((n, 2, ns), np.inf),
        information=np.zeros((n, 2, ns)),
    )


def _model(config: EkfConfig, ns: int, nu: int) -> Model:
    """What does not change in a filter so configured."""
    longitudinal, roll, lever = config.structure.equations[0] == "z", ns == WITH_ROLL, np.zeros(ns)
    x, _, z = config.imu_position_m
    if longitudinal:
        lever[1] = x
    else:
        lever[-1] = -x
        if roll:
            lever[1] = z
    # Roll and pitch of the air are smoothed over 4 b / pi, yaw over 3 b / pi (MIL-F-8785C 3.7.5).
    gust_length_m = np.zeros(gust_states(ns) if config.span_m > 0.0 else 0)
    if gust_length_m.size > 0:
        gust_length_m[ACCELERATION] = 4.0 * config.span_m / np.pi
        gust_length_m[PATH + ns :] = 4.0 * config.span_m / np.pi
        gust_length_m[TURN] = (4.0 if longitudinal else 3.0) * config.span_m / np.pi
    direction = np.zeros(ns)
    direction[1] = 1.0
    if roll:
        by_roll_rate = config.prior_value.reshape(ns, -1)[:, 1]
        if by_roll_rate[1] != 0.0:
            direction = by_roll_rate / by_roll_rate[1]
    constant = np.full(ns, 10.0)
    constant[0] = 30.0
    return Model(
        sizes=sizes_of(ns, nu, gust_length_m.size),
        longitudinal=longitudinal,
        roll=roll,
        use_accelerometer=config.use_accelerometer,
        adapt_s=float(config.adapt_s),
        trim_corner_rad_s=2.0 * np.pi * config.trim_corner_hz,
        memory_s=float(config.memory_s),
        stale_s=float(config.stale_s),
        reference_airspeed_m_s=float(config.reference[0]),
        reference_density_kg_m3=float(config.reference[1]),
        stated_variance=np.square([*(config.noise_std or (0.0,) * ns), config.accelerometer_noise_std]),
        input_variance=np.square(np.array(config.input_noise_std or (0.0,) * nu, dtype=np.float64)),
        servos=servos_of(config.servo_s, config.servo_rate_rad_s, config.held),
        lever_m=lever,
        gust_length_m=gust_length_m,
        gust_direction=np.ascontiguousarray(direction),
        prior_value=np.concatenate([config.prior_value, np.zeros(ns)]),
        prior_std=np.concatenate([config.prior_std, constant]),
    )
