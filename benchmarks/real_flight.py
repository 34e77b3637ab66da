"""What the chain makes of the real flight: table, halves compared, and the README's picture.

    .venv/bin/python benchmarks/real_flight.py FLIGHT.mat [--map docs/maps/thor75.toml] [--aircraft ultrastick25e]
        [--picture docs/pictures/thor75.png]

There is no randomness in it. The flight is not part of this repository; without it the command says so.
"""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.baselines import OutOfEnvelope
from wingwatch.monitor import Solution, VehicleMonitor
from wingwatch.telemetry import SampleBlock, load_flight

Array = NDArray[np.float64]

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


def halves(flight: Path, channel_map: Path, aircraft: str) -> list[tuple[str, float, float, float, float]]:
    """The Fourier form on each half of the flight alone: symbol, value and error of both."""
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
        for k, symbol in enumerate(first.structure.derivatives):
            if first.outcomes[k] == second.outcomes[k] == "converged":
                rows.append(
                    (symbol, float(first.value[k]), float(first.standard_error[k]), float(second.value[k]),
                     float(second.standard_error[k]))
                )  # fmt: skip
    return rows


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
    for structure, symbols in PANELS:
        for symbol in symbols:
            t = trace(monitor, solutions, structure, symbol)
            pairs = ((t.fourier, t.fourier_error), (t.ekf, t.ekf_error), (t.apriori, t.apriori_error))
            print(f"{symbol:8}" + "".join(f"{f'{v[-1]:.3g} ± {e[-1]:.2g}':>20}" for v, e in pairs))
    both = halves(chosen.flight, chosen.channel_map, chosen.aircraft)
    agree = [abs(a - b) < 1.96 * np.hypot(ea, eb) for _, a, ea, b, eb in both]
    print(f"halves of the flight: {sum(agree)} of {len(agree)} converged Fourier derivatives agree at 95 %")
    print("   differ: " + ", ".join(r[0] for r, ok in zip(both, agree, strict=True) if not ok))
    if chosen.picture:
        draw(monitor, solutions, chosen.picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
