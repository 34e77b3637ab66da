"""Signals of linear plants whose truth is known, and one way to run every estimator over them."""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from wingwatch.aircraft import DUTCH_ROLL, GRAVITY_M_S2, SHORT_PERIOD, FlightCondition, ModeStructure
from wingwatch.estimators import (
    EkfConfig,
    EkfEstimator,
    EkfState,
    Estimate,
    FourierConfig,
    FourierEstimator,
    FourierState,
    SignalLayout,
)
from wingwatch.estimators.ekf.state import arrays_of
from wingwatch.simulation import linear_response, specific_force, state_rates

Array: TypeAlias = NDArray[np.float64]
State: TypeAlias = FourierState | EkfState

RATE_HZ = 50.0
LEVEL = FlightCondition(25.0, 1000.0)
REFERENCE = (LEVEL.airspeed_true_m_s, LEVEL.air_density_kg_m3)
SIGNAL_TO_NOISE = 5.0
SOLVE_EVERY = 25
"""Samples between solutions: 2 Hz, as the thesis has it."""


@dataclass(frozen=True)
class Plant:
    """A mode, the thesis's linearised Aerosonde derivatives of it, and the pulse of the thesis's doublet."""

    structure: ModeStructure
    truth: Array
    pulse_s: float

    @property
    def derivatives(self) -> dict[str, float]:
        return dict(zip(self.structure.derivatives, map(float, self.truth), strict=True))

    @property
    def forward(self) -> Array:
        """The forward speed's share of each derivative."""
        kinematic = {"z_q": 1.0, "y_r": -1.0}
        return LEVEL.airspeed_true_m_s * np.array([kinematic.get(d, 0.0) for d in self.structure.derivatives])

    @property
    def aerodynamic(self) -> Array:
        return self.truth - self.forward


# tables 7.2 and 7.7 of the thesis
PITCH = Plant(SHORT_PERIOD, np.array([-4.139, 24.33, -2.361, -4.289, -6.035, -32.54]), 0.2018)
YAW = Plant(DUTCH_ROLL, np.array([-0.643, -25.02, 3.517, 0.684, -1.043, -22.10]), 0.3846)
PLANTS = {"short_period": PITCH, "dutch_roll": YAW}


def doublets(plant: Plant, seconds: float, every_s: float = 5.0, amplitude_deg: float = 2.0) -> Array:
    """The thesis's doublet, first after a second, then every ``every_s``; radians, shape (samples,)."""
    time = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    since = np.mod(time - 1.0, every_s)
    up = (time >= 1.0) & (since < plant.pulse_s)
    down = (time >= 1.0) & (since >= plant.pulse_s) & (since < 2.0 * plant.pulse_s)
    return np.asarray(np.radians(amplitude_deg) * (up.astype(float) - down.astype(float)))


def make_signals(plant: Plant, inputs: Array, offsets: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
    """Signal rows of one vehicle in level trimmed flight at ``LEVEL``, shape (samples, columns).

    ``offsets`` are the trim values of both states and of the input: a constant of the aerodynamics holds them.
    """
    structure = plant.structure
    states = linear_response(structure, plant.derivatives, inputs, 1.0 / RATE_HZ)
    rates = state_rates(structure, plant.derivatives, states, inputs)
    full = states + np.array(offsets[:2])
    force = specific_force(structure, rates, full[:, 1], LEVEL, 0.0)
    layout = SignalLayout(2, 1)
    out = np.zeros((len(inputs), layout.columns))
    out[:, 0] = np.arange(len(inputs)) / RATE_HZ
    out[:, 1:3] = full
    out[:, layout.accelerometer] = force
    out[:, layout.first_input] = inputs + offsets[2]
    longitudinal = structure is SHORT_PERIOD
    turn = LEVEL.airspeed_true_m_s * full[:, 1] * (1.0 if longitudinal else -1.0)
    out[:, layout.kinematic] = turn + (GRAVITY_M_S2 if longitudinal else 0.0)
    out[:, layout.kinematic + 1] = 1.0
    out[:, layout.kinematic + 2] = LEVEL.airspeed_true_m_s
    out[:, layout.kinematic + 3] = LEVEL.air_density_kg_m3
    out[:, layout.kinematic + 4] = LEVEL.altitude_m
    out[:, layout.kinematic + 6] = 1.0
    return out


def add_noise(plant: Plant, clean: Array, std: Array, rng: np.random.Generator) -> Array:
    """White noise on both states and the accelerometer, std of shape (3,); the kinematic term reads the noisy rate."""
    noisy = clean.copy()
    noisy[:, 1:4] += std * rng.standard_normal((len(clean), 3))
    forward = LEVEL.airspeed_true_m_s * (1.0 if plant.structure is SHORT_PERIOD else -1.0)
    noisy[:, SignalLayout(2, 1).kinematic] += forward * (noisy[:, 2] - clean[:, 2])
    return noisy


def noisy_batch(plant: Plant, seconds: float, seeds: int, first_seed: int = 0) -> Array:
    """Vehicles that fly the same doublets at signal-to-noise 5, shape (seeds, samples, columns)."""
    clean = make_signals(plant, doublets(plant, seconds))
    std = clean[:, 1:4].std(axis=0) / SIGNAL_TO_NOISE
    return np.stack(
        [add_noise(plant, clean, std, np.random.default_rng(first_seed + i)) for i in range(seeds)]
    )


def quiet_batch(plant: Plant, seconds: float, vehicles: int = 1, seed: int = 0) -> Array:
    """Trimmed flight without any input: sensor noise only, as strong as in ``noisy_batch``."""
    std = make_signals(plant, doublets(plant, 20.0))[:, 1:4].std(axis=0) / SIGNAL_TO_NOISE
    still = make_signals(plant, np.zeros(round(seconds * RATE_HZ)))
    return np.stack([add_noise(plant, still, std, np.random.default_rng(seed + i)) for i in range(vehicles)])


def curved_signals(inputs: Array, bent: float, lift: float = 0.0, lost_s: float = math.inf) -> Array:
    """Signal rows, without noise, of a short period whose pitching moment has so much of |w| w, per m/s, beside m_w w,
    and whose normal force so much (``lift``) of w w beside z_w w.

    Its elevator loses 40 % of its moment at ``lost_s``.
    """
    z, m = PITCH.truth.reshape(2, 3)

    def rates(time: float, x: Array) -> list[float]:
        w, q = x
        eta = inputs[min(int(time * RATE_HZ + 1e-9), inputs.size - 1)]
        moment = m[0] * (w + bent * abs(w) * w) + m[1] * q + m[2] * eta * (1.0 if time < lost_s else 0.6)
        return [z[0] * (w + lift * w * w) + z[1] * q + z[2] * eta, moment]

    time = np.arange(inputs.size) / RATE_HZ
    moved = solve_ivp(rates, (0.0, time[-1]), [0.0, 0.0], t_eval=time, max_step=0.5 / RATE_HZ, rtol=1e-8).y.T
    rows = make_signals(PITCH, inputs)
    rows[:, 1:3] = moved
    w, q = moved.T
    rows[:, 3] = (
        z[0] * (w + lift * w * w) + (z[1] - LEVEL.airspeed_true_m_s) * q + z[2] * inputs - GRAVITY_M_S2
    )
    rows[:, 5] = LEVEL.airspeed_true_m_s * moved[:, 1] + GRAVITY_M_S2
    return rows


class Runner:
    """An estimator under test with the two calls that differ between estimators hidden."""

    def __init__(self, estimator: FourierEstimator | EkfEstimator) -> None:
        self.estimator = estimator

    def init(self, vehicles: int) -> State:
        return self.estimator.init(vehicles)

    def update(self, state: State, signals: Array) -> None:
        if isinstance(self.estimator, FourierEstimator):
            assert isinstance(state, FourierState)
            self.estimator.update(state, signals)
        else:
            assert isinstance(state, EkfState)
            self.estimator.update(state, signals)

    def solve(self, state: State) -> None:
        if isinstance(self.estimator, FourierEstimator):
            assert isinstance(state, FourierState)
            self.estimator.solve(state)
        else:
            assert isinstance(state, EkfState)
            self.estimator.solve(state)

    def estimate(self, state: State, vehicle: int = 0) -> Estimate:
        if isinstance(self.estimator, FourierEstimator):
            assert isinstance(state, FourierState)
            return self.estimator.estimate(state, vehicle)
        assert isinstance(state, EkfState)
        return self.estimator.estimate(state, vehicle)

    def reset(self, state: State, vehicle: int) -> None:
        """Forget what is known of one vehicle's derivatives: every one of them has changed."""
        k = len(self.estimator.config.structure.derivatives)
        if isinstance(self.estimator, FourierEstimator):
            assert isinstance(state, FourierState)
            self.estimator.resume(state, np.zeros((k, k)), np.zeros(k), vehicle)
        else:
            assert isinstance(state, EkfState)
            self.estimator.release(state, np.ones(k), vehicle)

    def run(
        self, signals: Array, state: State | None = None, chunks: tuple[int, ...] = (SOLVE_EVERY,)
    ) -> State:
        """Samples (vehicles, samples, columns) in pieces of the given lengths in turn; solved every half second."""
        state = self.init(signals.shape[0]) if state is None else state
        for start in range(0, signals.shape[1], SOLVE_EVERY):
            part = signals[:, start : start + SOLVE_EVERY]
            at = turn = 0
            while at < part.shape[1]:
                length = chunks[turn % len(chunks)]
                self.update(state, part[:, at : at + length])
                at, turn = at + length, turn + 1
            self.solve(state)
        return state


def arrays(state: State) -> dict[str, Array]:
    """Every array of a state by its name."""
    if isinstance(state, EkfState):
        return dict(arrays_of(state))
    return {f.name: getattr(state, f.name) for f in fields(state)}


Maker: TypeAlias = Callable[[Plant], Runner]


def natural(plant: Plant) -> Array:
    """Natural size of each derivative, as the service takes it from an expectation; none is nought."""
    return np.maximum(np.abs(plant.aerodynamic), 0.1)


def fourier(plant: Plant, **changes: object) -> Runner:
    config = FourierConfig(
        plant.structure, (0.1, 4.0), 0.7 * plant.aerodynamic, 3.0 * natural(plant), REFERENCE, held=(True,)
    )
    return Runner(FourierEstimator(replace(config, **changes)))  # type: ignore[arg-type]


def ekf(plant: Plant, engine: Literal["compiled", "filterpy"] = "compiled", **changes: object) -> Runner:
    config = EkfConfig(
        plant.structure, 0.7 * plant.aerodynamic, natural(plant), REFERENCE, engine=engine, held=(True,)
    )
    return Runner(EkfEstimator(replace(config, **changes)))  # type: ignore[arg-type]


def ekf_filterpy(plant: Plant) -> Runner:
    return ekf(plant, "filterpy")


ESTIMATORS: dict[str, Maker] = {"fourier": fourier, "ekf": ekf, "ekf_filterpy": ekf_filterpy}
