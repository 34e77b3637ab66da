"""The Kalman filter's model and state: named arrays, which compiled code takes as they are.

Axes: n vehicles, the first axis of everything in ``EkfState``; ns states and nu inputs of the mode; ng gust states, or
0; nx = ns + ng; k = ns (ns + nu) derivatives, equation by equation, states before inputs; nz = nx + k + ns elements
of the augmented state: states, gust states, referred derivatives, one trim constant an equation. A signal row has the
columns of ``SignalLayout``.

Units: the first state is a velocity, m/s, the others rates (and the roll angle's), rad/s; an equation has its state's
unit over a second, a derivative that of its equation over that of its state or input, a variance the square. The gust
states are angular accelerations, rad/s2, a rate, rad/s, and numbers.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.kernels.apart import room_around
from wingwatch.estimators.kernels.intersample import Servos

__all__ = [
    "ACCELERATION",
    "AIRSPEED",
    "ALPHA",
    "ALTITUDE",
    "CONDITION_ALPHA",
    "DENSITY",
    "EARLIER",
    "ESTIMATED",
    "EXPECTED",
    "FIRST_READING",
    "KEPT",
    "gust_states",
    "NEWEST",
    "PATH",
    "PRESSURE_RATIO",
    "READINGS",
    "SQUARES",
    "SUM",
    "TIME",
    "TURN",
    "VANE",
    "WITH_ROLL",
    "Accepted",
    "Checkpoints",
    "Coherence",
    "EkfState",
    "InputErrors",
    "Memory",
    "Model",
    "Noise",
    "Running",
    "running",
    "Scatter",
    "Sizes",
    "Solved",
    "Window",
    "arrays_of",
    "one_vehicle",
    "put_vehicle",
    "sizes_of",
]

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
Flags = NDArray[np.bool_]
Named = TypeVar("Named", bound=tuple[Any, ...])

TIME = 0
"""Column of the time in a signal row."""

PRESSURE_RATIO, AIRSPEED, DENSITY, ALTITUDE, ALPHA, VANE = 1, 2, 3, 4, 5, 6
"""Columns of a signal row after its kinematic column: dynamic pressure ratio, airspeed, density, altitude, angle of
attack, and whether a vane measured the first state."""

ACCELERATION, TURN, PATH = 0, 1, 2
"""Gust states, after the states of the mode: angular acceleration of the first rate that nothing measures, above all by
air that no vane sees; rate of the air that the slope of a gust makes; from PATH on, one for each equation, what that
rate does beside what the derivative says, in natural sizes of this; then, where roll is a state, the unmeasured
acceleration of each other equation."""

WITH_ROLL = 3
"""States of a mode with roll."""

NEWEST, EARLIER = 0, 1
"""The last signal row and the one before, in ``EkfState.rows``."""

CONDITION_ALPHA = 4
"""The angle of attack in ``EkfState.condition``."""

EXPECTED, ESTIMATED, KEPT = 0, 1, 2
"""Ratios of the derivatives by roll rate: expected beforehand, while the damping is not known; of the estimates as they
are; of those before the last change."""

READINGS, SUM, SQUARES, FIRST_READING = 0, 1, 2, 3
"""Of ``EkfState.moments``."""


class Sizes(NamedTuple):
    """Numbers of states, inputs and gust states, and what follows from them."""

    states: int
    inputs: int
    gusts: int
    dynamic: int
    """nx: states and gust states; the derivatives begin here."""
    augmented: int
    """nz: the whole augmented state."""
    kinematic: int
    """Column of the kinematic term in a signal row."""


def gust_states(states: int) -> int:
    """How many there are beside so many states of a mode."""
    return PATH + states + (states - 1 if states == WITH_ROLL else 0)


def sizes_of(states: int, inputs: int, gusts: int) -> Sizes:
    """All sizes from the three that matter."""
    dynamic = states + gusts
    augmented = dynamic + states * (states + inputs) + states
    return Sizes(states, inputs, gusts, dynamic, augmented, 2 + states + inputs)


class Model(NamedTuple):
    """What does not change."""

    sizes: Sizes
    longitudinal: bool
    """Whether the first equation is that of the vertical velocity; else that of the lateral one."""
    roll: bool
    """Whether the roll rate is the second state."""
    use_accelerometer: bool
    adapt_s: float
    """Time constant of the noise variances."""
    trim_corner_rad_s: float
    memory_s: float
    stale_s: float
    reference_airspeed_m_s: float
    reference_density_kg_m3: float
    stated_variance: Array
    """(ns + 1,): of the measured states and of the accelerometer as the aircraft file states it, 0 where it says
    nothing."""
    input_variance: Array
    """(nu,): of the inputs' readings as it is stated, rad2; 0 of exact ones."""
    servos: Servos
    lever_m: Array
    """(ns,): the accelerometer reads less this times each angular acceleration."""
    gust_length_m: Array
    """(ng,): over which the span smooths roll or pitch, and yaw, of the air, and unmeasured accelerations last; nothing
    for the path."""
    gust_direction: Array
    """(ns,): how each equation answers to the gusts' angular acceleration, over how the first rate's does; as expected
    beforehand."""
    prior_value: Array
    """(k + ns,): derivatives and trim constants."""
    prior_std: Array
    """(k + ns,)."""


class Noise(NamedTuple):
    """Noise variances, learned from the record."""

    reading: Array
    """(n, ns + 1): of the measured states and of the accelerometer, m2/s4."""
    gust: Array
    """(n,): process variance a step that gusts give the first state, m2/s2."""
    unmeasured: Array
    """(n, ns): process variance a step of the unmeasured acceleration of each equation that has one, m2/s4 and
    rad2/s4."""
    gain: Array
    """(n,): square of the relative error of the predicted specific force."""
    fisher: Array
    """(n, 2): running Fisher information of the accelerometer's variance and of ``gain``."""
    corrections: Array
    """(n,): discounted sum of the corrections of the first state."""
    inputs: Array
    """(n, nu): variance of the inputs' readings, rad2; 0 of exact ones."""
    largest: Array
    """(n, ns + nu): of the readings of states and inputs at most."""


class MomentLevel(NamedTuple):
    """What the filter would be at another variance of the unmeasured acceleration of an equation, axis e
    (``moment_level``)."""

    mean: Array
    """(n, e, ns + 1): derivative of the mean of states and acceleration by the logarithm of the variance."""
    covariance: Array
    """(n, e, ns + 1, ns + 1): of their covariance."""
    information: Array
    """(n, e): running mean of what a sample tells of that logarithm."""
    samples: Array
    """(n, e): number of samples that it comes of."""


class Coherence(NamedTuple):
    """What innovations and earlier motion have in common, by equation (``coherence``)."""

    level: Array
    """(n, ns): slow mean of the explained acceleration."""
    passed: Array
    """(n, ns, STAGES): explained acceleration less that mean, behind so many low-pass filters."""
    sums: Array
    """(n, ns, STAGES): discounted sums of innovation times what has passed."""
    products: Array
    """(n, ns, STAGES, STAGES): lower triangle of their covariance if innovations are white."""


class Memory(NamedTuple):
    """What the noise variances are learned from when a sample is seen for the first time."""

    differences: Array
    """(n, ns, 5): of successive readings of each state, see ``noise``."""
    levels: Array
    """(n, 4, LEVELS): smoothers of the velocity that the vane measures, see ``kernels.levels``."""
    roughness: Array
    """(n,): sum of squared second differences of the accelerometer during the warm-up, m2/s4."""
    readings: Array
    """(n, ns + nu, READING_MEMORY): of the readings of states and inputs, see ``kernels.reading_noise``."""


class InputErrors(NamedTuple):
    """How one reading error of each input acts on the filter, if the input acted in equation r alone (``inputs``)."""

    response: Array
    """(n, nu, nx, r): effect of a unit error on states and gust states, followed from step to step."""
    energy: Array
    """(n, nu, ns, r): of its effect on the normalised innovations, summed so far."""
    information: Array
    """(n, nu, ns, r): that sum for the last error that was followed to its end."""
    age: Counts
    """(n,): steps that the error has been followed for."""


class Levels(NamedTuple):
    """Levels of noise that misfit of the derivatives raises, at each checkpoint."""

    accelerometer: Array
    """(n, c): variance of its reading, the last of ``Noise.reading``."""
    gain: Array
    """(n, c): of ``Noise``."""
    fisher: Array
    """(n, c, 2): of ``Noise``."""
    unmeasured: Array
    """(n, c, ns): of ``Noise``."""
    information: Array
    """(n, c, ns): of ``MomentLevel``."""


class Checkpoints(NamedTuple):
    """The filter at the beginning of the window and within it: axis c, two of them."""

    z: Array
    """(n, c, nz)."""
    cov: Array
    """(n, c, nz, nz)."""
    rows: Array
    """(n, c, 2, columns): last signal row before it, and the one before."""
    log_variance: Array
    """(n, c, ns + 1): logarithms of the innovations' variances that the rows after it were weighted by."""
    value: Array
    """(n, c, k): derivatives that the rows after it were linearised about."""
    covariance: Array
    """(n, c, k, k): of these."""
    information: Array
    """(n, c, k, k): of the derivatives at the checkpoint."""
    levels: Levels


class Window(NamedTuple):
    """The last signal rows, kept to be linearised again about better values."""

    rows: NDArray[np.float32]
    """(n, WINDOW_ROWS, columns kept): signal rows as ``window.remember`` keeps them."""
    filled: Counts
    """(n,): rows in it, or more if they did not fit."""
    middle: Counts
    """(n,): rows before the second checkpoint, 0 where there is none."""
    solutions: Counts
    """(n,): solutions in it."""
    skipped: Counts
    """(n,): rows in it that have set levels of noise alone and are still to be filtered."""
    rerun: Counts
    """(n,): rows that the filter has run again so far."""
    ends: Counts
    """(n, SOLUTIONS): rows before each solution."""
    keep: Array
    """(n, SOLUTIONS): fraction of the information that each solution kept."""
    resting: Flags
    """(n, SOLUTIONS, ns + nu): whether each state and input rested before it."""
    checkpoints: Checkpoints


class Accepted(NamedTuple):
    """The posterior of the derivatives when data last carried signal, and the information gained and what had gone with
    the motion by then."""

    value: Array
    """(n, k)."""
    covariance: Array
    """(n, k, k)."""
    gained_matrix: Array
    """(n, k, k)."""
    gained_vector: Array
    """(n, k)."""
    sums: Array
    """As in ``Coherence``."""
    products: Array
    """As there."""


class Scatter(NamedTuple):
    """The running block of solutions, and how much blocks scatter about what was known before each."""

    solutions: Counts
    """(n,): in the running block."""
    start_s: Array
    """(n,): when it began."""
    start_matrix: Array
    """(n, k, k): information about the derivatives at its beginning."""
    start_vector: Array
    """(n, k): its vector."""
    matrix: Array
    """(n, k, k): information gained from data in it."""
    vector: Array
    """(n, k): its vector."""
    equations: Array
    """(n, ns, 3): of each equation discounted chi-square of closed blocks, its degrees of freedom, and the dispersion
    that they gave before the last of them."""
    coherent: Array
    """(n, ns): dispersion by what goes with the motion, when the running block began."""


class EkfState(NamedTuple):
    """Everything the filter remembers."""

    z: Array
    """(n, nz): mean of the augmented state."""
    cov: Array
    """(n, nz, nz): its covariance."""
    noise: Noise
    memory: Memory
    input_errors: InputErrors
    moment_level: MomentLevel
    coherence: Coherence
    moments: Array
    """(n, ns + nu, 4): of each state and input since the last solution: number of readings, their sum and sum of
    squares from the first of them, that first one."""
    halves: Array
    """(n, ns + nu, 4, 3): of each state and input in the last four half seconds: number of readings, their mean and sum
    of squares from it."""
    half_s: Array
    """(n,): when the last of them began."""
    rows: Array
    """(n, 2, columns): last signal row and the one before."""
    condition: Array
    """(n, 5): of the last sample, dynamic pressure ratio, airspeed, density, altitude (m) and angle of attack."""
    samples: Counts
    """(n,): taken so far."""
    settling: Flags
    """(n,): whether the last sample set levels of noise alone."""
    ratios: Counts
    """(n,): where the ratios come from in which equations answer to rolling air, EXPECTED, ESTIMATED or KEPT."""
    direction: Array
    """(n, ns): these ratios where they are not ESTIMATED."""
    solutions: Counts
    """(n,): so far."""
    solved_s: Array
    """(n,): time of the last solution."""
    informed_s: Array
    """(n, k): last time each derivative's variance shrank through data."""
    moved_s: Array
    """(n, ns + nu): last time each state and input moved beyond its noise."""
    variance: Array
    """(n, k): of the derivatives after the last solution."""
    information: Array
    """(n, k, k): information matrix of the derivatives after the last solution."""
    vector: Array
    """(n, k): their information vector."""
    gained_matrix: Array
    """(n, k, k): information gained from data since ``take_gained`` was called."""
    gained_vector: Array
    """(n, k): its vector."""
    scatter: Scatter
    window: Window
    accepted: Accepted


class Running(NamedTuple):
    """What samples advance of an ``EkfState``, by its names: numba unpacks all that it is given at every call."""

    z: Array
    cov: Array
    noise: Noise
    memory: Memory
    input_errors: InputErrors
    moment_level: MomentLevel
    coherence: Coherence
    moments: Array
    rows: Array
    condition: Array
    samples: Counts
    settling: Flags
    ratios: Counts
    direction: Array


def running(state: EkfState) -> Running:
    """The same arrays."""
    return Running(
        state.z, state.cov, state.noise, state.memory, state.input_errors, state.moment_level, state.coherence,
        state.moments, state.rows, state.condition, state.samples, state.settling, state.ratios, state.direction,
    )  # fmt: skip


class Solved(NamedTuple):
    """What a solution did, vehicle by vehicle."""

    keep: Array
    """(n,): fraction of its information that the vehicle keeps, NaN where nothing was solved."""
    gained: Array
    """(n,): fraction of all that is known (mean over directions) that the data since the last solution gave."""
    resting: Flags
    """(n, ns + nu): states and inputs whose derivatives' information was taken back."""


def _each(change: Callable[[Any], Any], state: Named) -> Named:
    """The same named arrays, every one changed."""
    kind: Any = type(state)
    return kind(*(_each(change, v) if isinstance(v, tuple) else change(v) for v in state))  # type: ignore[no-any-return]


def arrays_of(state: tuple[Any, ...], prefix: str = "") -> Iterator[tuple[str, NDArray[Any]]]:
    """Every array of a state with its dotted name."""
    for name, value in state._asdict().items():  # type: ignore[attr-defined]
        if isinstance(value, tuple):
            yield from arrays_of(value, f"{prefix}{name}.")
        else:
            yield prefix + name, value


def one_vehicle(state: Named, i: int) -> Named:
    """A copy of one vehicle's state, a batch of one."""
    return _each(lambda array: room_around(array[i : i + 1]), state)


def put_vehicle(state: EkfState, which: Any, other: EkfState) -> None:
    """The state of some vehicles becomes that of all of another batch, in place."""
    for (_, kept), (_, new) in zip(arrays_of(state), arrays_of(other), strict=True):
        kept[which] = new
