"""What the chain makes of the real flight: table, halves compared, surfaces' delay, and the README's picture.

    .venv/bin/python benchmarks/real_flight.py FLIGHT.mat [--map docs/maps/thor75.toml] [--aircraft ultrastick25e]
        [--picture docs/pictures/thor75.png]

There is no randomness in it. The flight is not part of this repository; without it the command says so.
"""

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from saving import run_benchmark

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.baselines import OutOfEnvelope
from wingwatch.estimators import Estimate, offsets
from wingwatch.estimators.reference import referred_scale
from wingwatch.monitor import Solution, VehicleMonitor
from wingwatch.telemetry import SampleBlock, complete, load_flight

Array = NDArray[np.float64]

LIMITS_RAD_S = (1.5, 2.618, 4.0, 5.0, 7.0, float("inf"))
"""Of the servos; 2.618 rad/s is what the published simulation states."""
FINE_STEPS = 20
"""Of a servo in a sample."""
DELAYS_S = (-0.06, -0.04, -0.02, -0.01, 0.0, 0.01, 0.02, 0.04, 0.06)

PANELS = (("short_period", ("z_w", "m_w", "m_q", "m_eta")), ("lateral", ("l_p", "l_xi", "n_v", "n_r")))


@dataclass(frozen=True, slots=True)
class Trace:
    """One derivative over time: value, standard error, as both estimators have it, and what was expected."""

    time_s: Array
    fourier: Array
    fourier_error: Array
    ekf: Array
    ekf_error: Array
    apriori: Array
    apriori_error: Array


def watch(
    flight: Path, channel_map: Path, aircraft: str
) -> tuple[VehicleMonitor, list[Solution], SampleBlock, int]:
    """Run the chain over the flight."""
    table = load_flight(flight, channel_map)
    monitor = VehicleMonitor(
        load_aircraft(aircraft), "default", "uav", table.block.present, table.kinds, new_id=lambda: "alert"
    )
    report = monitor.feed(table.block)
    return monitor, list(report.solutions), table.block, len(report.alerts)


def trace(monitor: VehicleMonitor, solutions: list[Solution], structure: str, symbol: str) -> Trace:
    """One derivative's history."""
    rows = []
    for solution in solutions:
        mode = solution.modes[structure]
        k = mode.structure.derivatives.index(symbol)
        airspeed, altitude, density, alpha = mode.fourier.condition
        if not np.isfinite(airspeed):
            continue
        condition = FlightCondition(airspeed, altitude, density, angle_of_attack_rad=alpha)
        expected = monitor.chain.envelopes[structure].lookup(condition)
        known = (np.nan, np.nan)
        if not isinstance(expected, OutOfEnvelope):
            known = (float(expected.value[k]), float(expected.standard_error[k]))
        rows.append(
            (solution.time_s, mode.fourier.value[k], mode.fourier.standard_error[k], mode.ekf.value[k],
             mode.ekf.standard_error[k], *known)
        )  # fmt: skip
    return Trace(*np.array(rows).T)


def at_the_end(monitor: VehicleMonitor, structure: str, symbol: str) -> list[tuple[float, float]]:
    """Value and standard error of both estimators after the last sample, as ``wingwatch estimate`` prints them."""
    found = monitor.derivatives()["estimators"]
    of_symbol = [found[name][structure]["derivatives"][symbol] for name in ("fourier", "ekf")]
    return [(float(one["value"]), float(one["standard_error"])) for one in of_symbol]


def halves(flight: Path, channel_map: Path, aircraft: str) -> list[tuple[str, float, float, float, float]]:
    """The Fourier estimator on each half of the flight alone: symbol, value and error of both.

    A half's derivatives are those at its last blocks' airspeed and angle of attack. Both are taken to the mean of the
    two halves' conditions: what acts by rho V or rho V^2 (table B.3), U and W in z_q, y_r and y_p by these.
    """
    table = load_flight(flight, channel_map)
    half = len(table.block) // 2
    ends = []
    for part in (table.block.values[:half], table.block.values[half:]):
        block = SampleBlock(part)
        monitor = VehicleMonitor(
            load_aircraft(aircraft), "default", "uav", block.present, table.kinds, new_id=lambda: "alert"
        )
        ends.append(list(monitor.feed(block).solutions)[-1])
    rows = []
    for structure in ("short_period", "lateral"):
        first, second = (e.modes[structure].fourier for e in ends)
        common = 0.5 * (np.array(first.condition) + np.array(second.condition))
        (a, a_error), (b, b_error) = at_condition(first, common), at_condition(second, common)
        for k, symbol in enumerate(first.structure.derivatives):
            if first.outcomes[k] == second.outcomes[k] == "converged":
                rows.append((symbol, float(a[k]), float(a_error[k]), float(b[k]), float(b_error[k])))
    return rows


def at_condition(estimate: Estimate, condition: Array) -> tuple[Array, Array]:
    """Value and standard error at another airspeed, altitude, density and angle of attack."""
    structure, (airspeed, _, density, alpha) = estimate.structure, estimate.condition
    scale = referred_scale(structure, condition[0], condition[2], (airspeed, density))
    aerodynamic = estimate.value - offsets(structure, airspeed, alpha)
    return (
        scale * aerodynamic + offsets(structure, condition[0], condition[3]),
        scale * estimate.standard_error,
    )


def answers(flight: Path, channel_map: Path, aircraft: str) -> list[tuple[float, float, float]]:
    """How well roll and pitch acceleration follow from what was commanded a time before: delay in s, R2 of each.

    Equation error between 0.3 and 5 Hz, the servo that the aircraft file states apart. The delay that the map states
    is in the commands already: what is scanned comes on top.
    """
    known = load_aircraft(aircraft)
    block = complete(load_flight(flight, channel_map).block)
    half_step_s = 0.5 * float(np.median(np.diff(block.time_s)))

    def moved(surface: str, delay_s: float) -> NDArray[np.complex128]:
        servo = getattr(known.actuators, surface)
        lag_s = 1.0 / (2.0 * np.pi * servo.bandwidth_hz) if servo else 0.0
        frequency_hz, command = _spectrum(block, block.column(f"{surface}_rad"))
        # held to the next sample, so half a step later on average
        late = np.exp(-2j * np.pi * frequency_hz * (delay_s + half_step_s))
        return np.asarray(command * late / (1.0 + 2j * np.pi * frequency_hz * lag_s), dtype=np.complex128)

    return [(delay_s, *_explained(block, partial(moved, delay_s=delay_s))) for delay_s in DELAYS_S]


def limited(flight: Path, channel_map: Path, aircraft: str) -> list[tuple[float, float, float]]:
    """The same by what the servos move at most: limit in rad/s, R2 of each."""
    known = load_aircraft(aircraft)
    block = complete(load_flight(flight, channel_map).block)

    def moved(surface: str, limit_rad_s: float) -> NDArray[np.complex128]:
        servo = getattr(known.actuators, surface)
        if servo is None:
            return _spectrum(block, block.column(f"{surface}_rad"))[1]
        command, step_s = block.column(f"{surface}_rad"), np.diff(block.time_s) / FINE_STEPS
        at, toward = command[0], 1.0 - np.exp(-2.0 * np.pi * servo.bandwidth_hz * step_s)
        place = command.copy()
        for k in range(step_s.size):
            place[k] = at
            for _ in range(FINE_STEPS):
                most = limit_rad_s * step_s[k]
                at += min(max(toward[k] * (command[k] - at), -most), most)
        return _spectrum(block, place)[1]

    return [(limit, *_explained(block, partial(moved, limit_rad_s=limit))) for limit in LIMITS_RAD_S]


def _spectrum(block: SampleBlock, signal: Array) -> tuple[Array, NDArray[np.complex128]]:
    """Frequencies between 0.3 and 5 Hz, and the signal there."""
    frequency_hz = np.fft.rfftfreq(signal.size, float(np.median(np.diff(block.time_s))))
    band = (frequency_hz > 0.3) & (frequency_hz < 5.0)
    whole = np.fft.rfft((signal - signal.mean()) * np.hanning(signal.size))
    return np.asarray(frequency_hz[band], dtype=np.float64), np.asarray(whole[band], dtype=np.complex128)


def _explained(block: SampleBlock, moved: Callable[[str], NDArray[np.complex128]]) -> tuple[float, float]:
    """R2 of roll and pitch acceleration by states and surfaces, ``moved`` the spectrum of each surface."""
    airspeed = block.column("airspeed_true_m_s")
    p, q, r = (block.column(f"{axis}_rate_rad_s") for axis in ("roll", "pitch", "yaw"))
    w = airspeed * np.sin(block.column("angle_of_attack_rad"))
    v = airspeed * np.sin(block.column("sideslip_rad"))
    row = []
    for rate, states, surfaces in ((p, (v, p, r), ("aileron", "rudder")), (q, (w, q), ("elevator",))):
        columns = [_spectrum(block, x)[1] for x in states] + [moved(surface) for surface in surfaces]
        regressors = np.column_stack(columns)
        frequency_hz, turned = _spectrum(block, rate)
        response = 2j * np.pi * frequency_hz * turned
        left, right = np.vstack([regressors.real, regressors.imag]), np.r_[response.real, response.imag]
        misses = right - left @ np.linalg.lstsq(left, right, rcond=None)[0]
        row.append(1.0 - float(misses @ misses) / float(right @ right))
    return row[0], row[1]


def draw(monitor: VehicleMonitor, solutions: list[Solution], picture: Path) -> None:
    """Eight derivatives with their 95 % bands against the a-priori expectation."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 4, figsize=(15, 6.4), sharex=True, layout="constrained")
    for row, (structure, symbols) in enumerate(PANELS):
        for axis, symbol in zip(axes[row], symbols, strict=True):
            t = trace(monitor, solutions, structure, symbol)
            for value, error, colour, label in (
                (t.apriori, t.apriori_error, "0.55", "published simulation"),
                (t.ekf, t.ekf_error, "tab:orange", "Kalman filter"),
                (t.fourier, t.fourier_error, "tab:blue", "Fourier"),
            ):
                axis.fill_between(
                    t.time_s, value - 1.96 * error, value + 1.96 * error, color=colour, alpha=0.18, lw=0
                )
                axis.plot(t.time_s, value, color=colour, lw=1.4, label=label)
            late = t.time_s > t.time_s[0] + 20.0
            seen = np.concatenate([t.fourier[late], t.ekf[late], t.apriori[late], [0.0]])
            spread = seen.max() - seen.min()
            axis.set_ylim(seen.min() - 0.15 * spread, seen.max() + 0.15 * spread)
            axis.axhline(0.0, color="0.8", lw=0.6)
            axis.set_title(symbol)
    for axis in axes[-1]:
        axis.set_xlabel("time, s")
    axes[0, 0].legend(loc="upper right", fontsize=8)
    figure.suptitle("UltraStick 25e, flight 75: derivatives with 95 % bands")
    figure.savefig(picture, dpi=90)
    plt.close(figure)


def main() -> int:
    parser = argparse.ArgumentParser(description="What the chain makes of the real flight.")
    parser.add_argument("flight", type=Path)
    parser.add_argument("--map", type=Path, default=Path("docs/maps/thor75.toml"), dest="channel_map")
    parser.add_argument("--aircraft", default="ultrastick25e")
    parser.add_argument("--picture", type=Path)
    chosen = parser.parse_args()
    if not chosen.flight.exists():
        print(f"{chosen.flight} is absent: this benchmark needs the recorded flight", file=sys.stderr)
        return 2
    monitor, solutions, block, alerts = watch(chosen.flight, chosen.channel_map, chosen.aircraft)
    seconds = block.time_s[-1] - block.time_s[0]
    print(f"{len(block)} samples, {seconds:.0f} s; status {monitor.state}; basis {monitor.basis}")
    print(monitor.basis_text)
    print(f"alerts: {alerts}")
    print(f"{'':8}{'Fourier':>20}{'Kalman filter':>20}{'published':>20}")
    apart = {}
    for structure, symbols in PANELS:
        for symbol in symbols:
            (a, a_error), (b, b_error) = at_the_end(monitor, structure, symbol)
            t = trace(monitor, solutions, structure, symbol)
            pairs = ((a, a_error), (b, b_error), (t.apriori[-1], t.apriori_error[-1]))
            print(f"{symbol:8}" + "".join(f"{f'{value:.3g} ± {error:.2g}':>20}" for value, error in pairs))
            apart[symbol] = abs(a - b) / np.hypot(a_error, b_error)
    print("the estimators apart, joint errors: " + ", ".join(f"{name} {z:.2f}" for name, z in apart.items()))
    both = halves(chosen.flight, chosen.channel_map, chosen.aircraft)
    agree = [abs(a - b) < 1.96 * np.hypot(ea, eb) for _, a, ea, b, eb in both]
    print(f"halves of the flight: {sum(agree)} of {len(agree)} converged Fourier derivatives agree at 95 %")
    if not all(agree):
        print("   differ: " + ", ".join(r[0] for r, ok in zip(both, agree, strict=True) if not ok))
    print("roll and pitch acceleration explained, R2, the surfaces later than the map says by")
    for delay_s, roll, pitch in answers(chosen.flight, chosen.channel_map, chosen.aircraft):
        print(f"{delay_s:+8.2f} s{roll:10.3f}{pitch:10.3f}")
    print("the same, the servos moving at most by")
    for limit_rad_s, roll, pitch in limited(chosen.flight, chosen.channel_map, chosen.aircraft):
        print(f"{limit_rad_s:8.2f} rad/s{roll:6.3f}{pitch:10.3f}")
    if chosen.picture:
        draw(monitor, solutions, chosen.picture)
    return 0


if __name__ == "__main__":
    run_benchmark(main)
