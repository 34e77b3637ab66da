"""Directional forgetting of the Fourier estimator beside a time constant: one surface at a time, long quiet, a change.

    .venv/bin/python benchmarks/memory.py [--seeds 20] [--quiet 600]

The linearised lateral motion of the Aerosonde at 25 m/s, 1000 m (no accelerometer, white noise on v, p and r, the
surfaces known), flown as a script: both surfaces by turns, the ailerons alone, quiet, both by turns again with a rudder
that has lost 30 % of its effect. The peer fades all that is known with the same 40 s, but for quiet of more than 30 s:
the rule that both estimators had before. Seeds are fixed.
"""

import argparse
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from saving import run_benchmark
from scipy.linalg import expm

from wingwatch.aircraft import LATERAL, FlightCondition, linearised_derivatives, load_aircraft, trimmed
from wingwatch.estimators import FourierConfig, FourierEstimator, FourierState, SignalLayout, offsets

Array = NDArray[np.float64]

RATE_HZ = 50.0
SOLVE_EVERY = 25
CONDITION = FlightCondition(25.0, 1000.0)
REFERENCE = (CONDITION.airspeed_true_m_s, CONDITION.air_density_kg_m3)
NOISE_STD = (0.05, 0.004, 0.004)
"""Of v in m/s, p and r in rad/s."""
AMPLITUDE_RAD = np.deg2rad(2.0)
HALF_S = {"xi": 0.2, "zeta": 0.38}
EVERY_S = 10.0
GROUPS = {"by rudder": ("y_zeta", "l_zeta", "n_zeta"), "by ailerons": ("y_xi", "l_xi", "n_xi"),
          "roll rate": ("y_p", "l_p", "n_p"), "yaw rate": ("y_r", "l_r", "n_r"),
          "sideslip": ("y_v", "l_v", "n_v")}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Leg:
    """A part of the flight: its name, its length and which surfaces take turns, a doublet each ``EVERY_S``."""

    name: str
    seconds: float
    surfaces: tuple[str, ...]


def script(quiet_s: float) -> tuple[Leg, ...]:
    """The flight; the rudder is as it should be in all legs but the last two."""
    return (
        Leg("both surfaces", 80.0, ("xi", "zeta")),
        Leg("ailerons alone", 300.0, ("xi",)),
        Leg("quiet", quiet_s, ()),
        Leg("rudder -30 %, 40 s", 40.0, ("zeta", "xi")),
        Leg("rudder -30 %, 120 s", 80.0, ("zeta", "xi")),
    )


def truth() -> Array:
    """Concise derivatives of the healthy aircraft, (15,)."""
    aircraft = load_aircraft("aerosonde")
    table = linearised_derivatives(aircraft, trimmed(aircraft, CONDITION), LATERAL)
    return np.array([table[d] for d in LATERAL.derivatives])


def damaged(healthy: Array) -> Array:
    """The same with 30 % less rudder."""
    by_rudder = np.array([d in GROUPS["by rudder"] for d in LATERAL.derivatives])
    return np.where(by_rudder, 0.7 * healthy, healthy)


def inputs(leg: Leg) -> Array:
    """Ailerons and rudder over a leg, rad, (samples, 2); held between samples."""
    u = np.zeros((round(leg.seconds * RATE_HZ), 2))
    for turn in range(int(leg.seconds / EVERY_S) if leg.surfaces else 0):
        surface = leg.surfaces[turn % len(leg.surfaces)]
        column, half = LATERAL.inputs.index(surface), round(HALF_S[surface] * RATE_HZ)
        start = round((turn * EVERY_S + 1.0) * RATE_HZ)
        u[start : start + half, column] = AMPLITUDE_RAD
        u[start + half : start + 2 * half, column] = -AMPLITUDE_RAD
    return u


def respond(derivatives: Array, u: Array) -> Array:
    """States from trim at the samples, exact, (samples, 3)."""
    table = derivatives.reshape(3, 5)
    both = np.zeros((5, 5))
    both[:3] = table / RATE_HZ
    grown = expm(both)
    x = np.zeros((len(u), 3))
    for k in range(1, len(u)):
        x[k] = grown[:3, :3] @ x[k - 1] + grown[:3, 3:] @ u[k - 1]
    return x


def rows_of(x: Array, u: Array, start_s: float, columns: int) -> Array:
    """Signal rows of ``wingwatch.estimators.Signals`` from measured states (vehicles, samples, 3)."""
    rows = np.zeros((*x.shape[:2], columns))
    rows[..., 0] = start_s + np.arange(x.shape[1]) / RATE_HZ
    rows[..., 1:4] = x
    rows[..., 5:7] = u
    forward = offsets(LATERAL, CONDITION.airspeed_true_m_s, 0.0)
    rows[..., 7] = forward[2] * x[..., 2]
    rows[..., 8:12] = 1.0, *REFERENCE, CONDITION.altitude_m
    rows[..., 13] = 1.0
    return rows


def make(healthy: Array) -> FourierEstimator:
    """The estimator, started 30 % off."""
    aerodynamic = healthy - offsets(LATERAL, CONDITION.airspeed_true_m_s, 0.0)
    size = np.maximum(np.abs(aerodynamic), 0.1)
    return FourierEstimator(
        FourierConfig(LATERAL, (0.1, 4.0), 0.7 * aerodynamic, 3.0 * size, REFERENCE, held=(True, True),
                      force_from_accelerometer=False)
    )  # fmt: skip


def forget_discounted(state: FourierState) -> None:
    """The peer's rule: what is discounted is forgotten."""
    for name in ("sensitivity", "information", "vector", "bias"):
        discounted = getattr(state, f"discounted_{name}")
        getattr(state, name)[...] -= discounted
        discounted[...] = 0.0


def advance(estimator: FourierEstimator, state: FourierState, rows: Array, directional: bool) -> None:
    """Run one leg, half a second at a time."""
    for k in range(0, rows.shape[1], SOLVE_EVERY):
        estimator.update(state, rows[:, k : k + SOLVE_EVERY])
        if not directional:
            forget_discounted(state)
        estimator.solve(state)


def main() -> int:
    parser = argparse.ArgumentParser(description="Directional forgetting beside a time constant alone.")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--quiet", type=float, default=600.0, help="seconds of quiet flight")
    chosen = parser.parse_args()
    healthy = truth()
    estimator = make(healthy)
    states = {name: estimator.init(chosen.seeds) for name in ("directional", "time constant")}
    generators = [np.random.default_rng(s) for s in range(chosen.seeds)]
    print(
        f"{chosen.seeds} seeds; of each group of derivatives the rms error and the rms stated error in percent of\n"
        "natural size, and how much of the truth lies in the stated 95 % interval"
    )
    start_s = 0.0
    for leg in script(chosen.quiet):
        real = damaged(healthy) if leg.name.startswith("rudder") else healthy
        u = inputs(leg)
        x = respond(real, u)
        noise = np.stack([g.standard_normal(x.shape) for g in generators]) * np.array(NOISE_STD)
        rows = rows_of(x + noise, u, start_s, SignalLayout(3, 2).columns)
        start_s += leg.seconds
        print(f"\nafter {leg.seconds:g} s of: {leg.name}")
        print(" " * 24 + "".join(f"{g:>22}" for g in GROUPS))
        for name, state in states.items():
            advance(estimator, state, rows, name == "directional")
            found = [estimator.estimate(state, i) for i in range(chosen.seeds)]
            value, error = (
                np.array([getattr(e, part) for e in found]) for part in ("value", "standard_error")
            )
            _print(name, value, error, real)
    return 0


def _print(name: str, value: Array, stated: Array, real: Array) -> None:
    size = np.maximum(np.abs(real - offsets(LATERAL, CONDITION.airspeed_true_m_s, 0.0)), 0.1)
    miss = value - real
    cells = ""
    for group in GROUPS.values():
        at = [LATERAL.derivatives.index(d) for d in group]
        error = 100.0 * np.sqrt(np.mean((miss[:, at] / size[at]) ** 2))
        claimed = 100.0 * np.sqrt(np.mean((stated[:, at] / size[at]) ** 2))
        inside = 100.0 * np.mean(np.abs(miss[:, at]) <= 1.959964 * stated[:, at])
        cells += f"{error:8.1f}{claimed:7.1f}{inside:5.0f} %"
    print(f"  {name:<22}{cells}")


if __name__ == "__main__":
    run_benchmark(main)
