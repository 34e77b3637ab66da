"""Whether the Fourier estimator's equation holds: its mean score at the true derivatives, in air that moves.

Blocks of ten seconds from the situations of ``situations.py``, the plants' derivatives and the variances of sensors and
air given as they are. The score then is chance alone, with a mean of nothing. What its mean is, is divided by the
information of all blocks: a bias of the derivatives, beside the standard error that so many blocks have.

    .venv/bin/python benchmarks/score_at_truth.py [--plants short_period dutch_roll] [--flights 24]
        [--cases NAME ...] [--rates 20 50 100] [--without-noise] [--json]

Per plant, case and rate: bias of each derivative, and in brackets its standard error, percent of the derivative.
``--without-noise``: flown without noise of the sensors, weighed as with it, so that what the air does alone is left.
Air that is not Dryden's has no such variance of the gust, and a loop around the motion is none of the equation's.
"""

import argparse
import json
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray
from reference_plant import PLANTS, Plant
from saving import run_benchmark
from situation_cases import SITUATIONS
from situation_plants import AIRSPEED_M_S, Situation, aerodynamic, fly_situation, reference_noise
from situations import BAND_HZ, at_centre, fourier_config

from wingwatch.estimators import FourierEstimator
from wingwatch.estimators.fourier.noise import between_samples_variance
from wingwatch.estimators.fourier.state import BETWEEN, GUST, ROLLING, SOLUTIONS, Memory

Array = NDArray[np.float64]

CASES = ("still, open, each 5 s", "moderate, open, each 5 s")
BLOCK_S = 10.0
NOTHING = 1e-12
SURE = 1e20
"""Information of what is known, beside which a block's is rounding."""


@dataclass(frozen=True, slots=True)
class Figures:
    """Bias and its standard error of each derivative, percent of it, (6,) each."""

    plant: str
    case: str
    rate_hz: float
    blocks: int
    bias: tuple[float, ...]
    standard_error: tuple[float, ...]


def variances(plant: Plant, case: Situation) -> Array:
    """All noise variances of a block, as they are: states, accelerometer, equations, input, air."""
    out = np.full(9, NOTHING)
    out[:3], out[3] = reference_noise(plant, case.signal_to_noise) ** 2, 0.0
    if case.air is not None:
        # Dryden's transverse gust: white rate of 3 sigma^2 V / L above its corner
        out[GUST] = 3.0 * case.air.intensity_m_s**2 * AIRSPEED_M_S / case.air.length_m * case.rate_hz
    out[ROLLING], out[BETWEEN] = NOTHING, between_samples_variance(out[GUST], 1.0 / case.rate_hz)
    return out


def read(plant: Plant, name: str, case: Situation, flights: int, noisy: bool) -> Figures:
    """Scores of all blocks of some flights at the truth."""
    truth, noise, scores, information = aerodynamic(plant), variances(plant, case), [], np.zeros((6, 6))
    flown = case if noisy else replace(case, signal_to_noise=float("inf"))
    for seed in range(flights):
        flight = at_centre(fly_situation(plant, flown, seed, 60.0))
        estimator = FourierEstimator(fourier_config(flight.known))
        length = round(BLOCK_S * case.rate_hz)
        for start in range(0, len(flight.rows) - length + 1, length):
            gained = said_at(estimator, flight.rows[start : start + length], truth, noise)
            scores.append(gained.vector - gained.sensitivity @ truth)
            information += gained.sensitivity
    apart = np.array(scores)
    inverse = np.linalg.pinv(information)
    spread = (apart - apart.mean(axis=0)) @ inverse
    size = np.abs(np.array(plant.truth))
    return Figures(
        plant.structure.name,
        name,
        case.rate_hz,
        len(apart),
        tuple(100.0 * (inverse @ apart.sum(axis=0)) / size),
        tuple(100.0 * np.sqrt((spread**2).sum(axis=0)) / size),
    )


def said_at(estimator: FourierEstimator, rows: Array, truth: Array, noise: Array) -> Memory:
    """What a block says of the derivatives, linearised at ``truth`` with the noise variances ``noise``.

    Solved by the estimator itself, which a memory of the truth without any doubt keeps from moving: its first step is
    its last, and what it says is from there.
    """
    state = estimator.init(1)
    estimator.update(state, rows[None])
    state.theta[0], state.covariance[0], state.noise[0] = truth, 0.0, noise
    state.counts[0, SOLUTIONS] = 1  # so that it does not begin with noise of its own
    sure = SURE * np.eye(truth.size)
    state.sensitivity[0], state.information[0], state.vector[0] = sure, sure, sure @ truth
    estimator.solve(state)
    return estimator._workspace.found.gained


def main() -> int:
    plants = {plant.structure.name: plant for plant in PLANTS}
    parser = argparse.ArgumentParser(description="The Fourier estimator's mean score at the truth.")
    parser.add_argument("--plants", nargs="+", choices=list(plants), default=list(plants))
    parser.add_argument("--flights", type=int, default=24, help="of a minute each, at least 1")
    parser.add_argument("--cases", nargs="+", default=list(CASES), help="of situations.py")
    parser.add_argument("--rates", nargs="+", type=float, default=[50.0], help="samples a second")
    parser.add_argument("--without-noise", action="store_true", help="fly without noise of the sensors")
    parser.add_argument("--json", action="store_true", help="one JSON object a line instead of the table")
    chosen = parser.parse_args()
    unknown = [name for name in chosen.cases if name not in SITUATIONS]
    if unknown:
        parser.error(f"--cases {unknown[0]!r}: give names that situations.py prints")
    if chosen.flights < 1:
        parser.error(f"--flights is {chosen.flights}; give at least 1")
    if not chosen.json:
        print(
            f"{chosen.flights} flights of 60 s, blocks of {BLOCK_S:g} s, {BAND_HZ[0]:g} to {BAND_HZ[1]:g} Hz"
        )
    for name in chosen.plants:
        for case in chosen.cases:
            for rate in chosen.rates:
                situation = replace(SITUATIONS[case], rate_hz=rate)
                found = read(plants[name], case, situation, chosen.flights, not chosen.without_noise)
                print(json.dumps(asdict(found)) if chosen.json else line(found))
    return 0


def line(found: Figures) -> str:
    """One row of the table."""
    cells = "  ".join(
        f"{bias:6.2f} ({error:.2f})" for bias, error in zip(found.bias, found.standard_error, strict=True)
    )
    return f"{found.plant:13}{found.case:36}{found.rate_hz:4.0f} Hz {found.blocks:4} blocks  {cells}"


if __name__ == "__main__":
    run_benchmark(main)
