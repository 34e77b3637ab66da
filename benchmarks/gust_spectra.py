"""Simulated turbulence beside the specification: root mean squares and spectra of all six motions of the air.

    .venv/bin/python benchmarks/gust_spectra.py [--height 1000] [--level light] [--minutes 180] [--plot PICTURE]

The seed is fixed. Each row is a band of frequencies: the specification's spectrum at its middle, and in brackets the
measured over the specified mean of the band, with chance's standard error. Specified are the values with what sampling
folds onto them, in full; the filter of von Karman's form ends at 10^4 / T, so its highest bands lack some of that. The
Aerosonde's span, 25 m/s, steps of 0.01 s.
"""

import argparse
import itertools
import math
import time
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray
from saving import run_benchmark

from wingwatch.simulation import Turbulence, TurbulenceModel, gust_scales, gust_spectra
from wingwatch.simulation.random_numbers import fill_normals, random_streams
from wingwatch.simulation.turbulence import NORMALS, STATES, gust_step, turbulence_filter

AIRSPEED_M_S, SPAN_M, RATE_HZ = 25.0, 2.9, 100.0
MODELS: tuple[TurbulenceModel, ...] = ("dryden", "von-karman")
AXES = ("u", "v", "w", "p", "q", "r")
SEGMENT = 32768
FOLDS = 50
"""Aliases counted on each side of the band."""
SEED = 3
HEIGHTS_M, BAND = (30.0, 100.0, 300.0, 1000.0), (5.0, 15.0)

Array = NDArray[np.float64]


@njit(error_model="numpy")
def flown(row, state, stream, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` (samples, 6) with the air's motion."""
    normals, middle = np.empty(NORMALS), np.empty(6)
    for k in range(out.shape[0]):
        fill_normals(stream, normals)
        gust_step(row, state, normals, out[k], middle)


def simulated(
    level: Turbulence, height_m: float, model: TurbulenceModel, samples: int
) -> tuple[Array, float]:
    """A record (6, samples) and what a step of it took in microseconds."""
    f = turbulence_filter(level, height_m, AIRSPEED_M_S, SPAN_M, 1.0 / RATE_HZ, model)
    rng = np.random.default_rng(SEED)
    state = f.stationary @ rng.standard_normal(STATES)
    stream = random_streams([rng])[0]
    out = np.empty((samples, 6))
    flown(f.row, state.copy(), stream.copy(), out[:1])
    start = time.perf_counter()
    flown(f.row, state, stream, out)
    return out.T, (time.perf_counter() - start) / samples * 1e6


def periodogram(record: Array) -> tuple[Array, Array]:
    """Angular frequencies and the one-sided spectrum (6, frequencies), mean over segments under Hann's taper."""
    taper = np.hanning(SEGMENT + 1)[:SEGMENT]
    segments = record[:, : record.shape[1] // SEGMENT * SEGMENT].reshape(6, -1, SEGMENT)
    power = (np.abs(np.fft.rfft(segments * taper, axis=2)) ** 2).mean(axis=1)
    omega = 2.0 * math.pi * RATE_HZ * np.arange(power.shape[1]) / SEGMENT
    return np.asarray(omega), np.asarray(power / (math.pi * RATE_HZ * (taper**2).sum()))


def specified(
    model: TurbulenceModel, level: Turbulence, height_m: float, omega: Array
) -> tuple[Array, Array]:
    """The specification's spectra, and with what sampling folds onto them."""
    scales, turn = gust_scales(level, height_m, model), 2.0 * math.pi * RATE_HZ
    folds = range(-FOLDS, FOLDS + 1)
    spectra = [gust_spectra(model, scales, AIRSPEED_M_S, SPAN_M, np.abs(omega + turn * k)) for k in folds]
    return spectra[FOLDS], np.sum(spectra, axis=0)


def report(
    model: TurbulenceModel, level: Turbulence, height_m: float, minutes: float
) -> tuple[Array, Array, Array]:
    """Print a model's table; frequencies, measured and specified spectra."""
    record, microseconds = simulated(level, height_m, model, round(60.0 * minutes * RATE_HZ))
    scales = gust_scales(level, height_m, model)
    print(
        f"{model}, {level}, {height_m:g} m: sigma {scales.sigma_u_m_s:.3g} and {scales.sigma_w_m_s:.3g} m/s, "
        f"L {scales.length_u_m:.3g} and {scales.length_w_m:.3g} m; "
        f"{microseconds:.3f} microseconds a step with its normals"
    )
    omega, measured = periodogram(record)
    plain, wanted = specified(model, level, height_m, omega)
    wide = np.geomspace(1e-6, 1e6, 40001)
    spectra = gust_spectra(model, scales, AIRSPEED_M_S, SPAN_M, wide)
    rms = np.sqrt(np.trapezoid(spectra * wide, np.log(wide), axis=1))
    print(f"{'rad/s':>8}" + "".join(f"{axis:>22}" for axis in AXES))
    print(
        f"{'rms':>8}"
        + "".join(f"{t:9.4f} ({m / t:6.3f}      )" for t, m in zip(rms, record.std(axis=1), strict=True))
    )
    segments = record.shape[1] // SEGMENT
    edges = np.unique(np.geomspace(3, omega.size - 1, 14).astype(int))
    for low, high in itertools.pairwise(edges):
        bins = np.arange(low, high, 3)
        ratio = (measured[:, bins] / wanted[:, bins]).mean(axis=1)
        chance = 1.0 / math.sqrt(segments * bins.size)
        middle = int(bins[bins.size // 2])
        cells = [f"{p:10.2e} ({r:5.3f}±{chance:5.3f})" for p, r in zip(plain[:, middle], ratio, strict=True)]
        print(f"{omega[middle]:8.3f}" + "".join(f"{cell:>22}" for cell in cells))
    print()
    return omega, measured, plain


def by_height(level: Turbulence) -> None:
    """Print what the specification says by height: strength, length, and what is left in the band of the modes."""
    print(
        f"{level}: sigma u, w (m/s); L u, w (m); root mean square of w between {BAND[0]:g} and {BAND[1]:g} rad/s (m/s)"
    )
    band = np.linspace(*BAND, 2001)
    for height_m in HEIGHTS_M:
        cells = []
        for model in MODELS:
            g = gust_scales(level, height_m, model)
            inside = np.trapezoid(gust_spectra(model, g, AIRSPEED_M_S, SPAN_M, band)[2], band)
            strength = f"{g.sigma_u_m_s:5.2f} {g.sigma_w_m_s:5.2f}"
            cells.append(f"{model} {strength}  {g.length_u_m:4.0f} {g.length_w_m:4.0f}  {inside**0.5:5.2f}")
        print(f"{height_m:6g} m  " + "    ".join(cells))


def draw(path: Path, results: dict[TurbulenceModel, tuple[Array, Array, Array]], title: str) -> None:
    """Measured spectra in colour, the specification's as black lines."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, panels = plt.subplots(2, 3, figsize=(13.0, 7.0), sharex=True, layout="constrained")
    for axis, panel in enumerate(panels.flat):
        for colour, (model, (omega, measured, plain)) in zip(
            ("tab:blue", "tab:orange"), results.items(), strict=True
        ):
            panel.loglog(
                omega[3:], measured[axis, 3:], color=colour, linewidth=0.5, label=f"{model}, simulated"
            )
            style = "-" if model == "dryden" else "--"
            panel.loglog(
                omega[3:],
                plain[axis, 3:],
                color="black",
                linewidth=1.2,
                linestyle=style,
                label=f"{model}, specified",
            )
        unit = "(m/s)²/(rad/s)" if axis < 3 else "(rad/s)²/(rad/s)"
        panel.set(title=f"{AXES[axis]}, {unit}", xlabel="rad/s" if axis > 2 else "")
        panel.grid(alpha=0.3)
    panels[0, 0].legend(fontsize=8)
    figure.suptitle(title)
    figure.savefig(path, dpi=110)


def main() -> int:
    parser = argparse.ArgumentParser(description="Simulated turbulence beside the specification.")
    parser.add_argument("--height", type=float, default=1000.0, help="above the ground, m")
    parser.add_argument("--level", choices=("light", "moderate", "severe"), default="light")
    parser.add_argument("--minutes", type=float, default=180.0, help="of flight")
    parser.add_argument("--plot", type=Path, help="picture to write")
    chosen = parser.parse_args()
    if chosen.minutes * 60.0 * RATE_HZ < SEGMENT:
        parser.error(
            f"--minutes is {chosen.minutes:g}; give at least {SEGMENT / RATE_HZ / 60.0:.1f}, one segment"
        )
    results = {model: report(model, chosen.level, chosen.height, chosen.minutes) for model in MODELS}
    by_height(chosen.level)
    if chosen.plot is not None:
        draw(
            chosen.plot,
            results,
            f"Turbulence, {chosen.level}, {chosen.height:g} m above the ground, {AIRSPEED_M_S:g} m/s",
        )
    return 0


if __name__ == "__main__":
    run_benchmark(main)
