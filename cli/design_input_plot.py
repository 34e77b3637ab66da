"""The picture of a designed input: what is flown, its spectrum beside the mode's band, and the predicted response."""

import importlib.util
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wingwatch.input_design import InputDesign, Promise
from wingwatch.operations.faults import CommandError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw", "need_matplotlib"]

_COLOURS = {"elevator": "#1f5fa8", "aileron": "#c05a00", "rudder": "#2b8040"}
_FAINTEST_DB = -40.0
_AXES = {
    "angle_of_attack_rad": "angle of\nattack, deg",
    "pitch_rate_rad_s": "pitch rate,\ndeg/s",
    "load_factor_z": "load factor\nz, g",
    "sideslip_rad": "sideslip,\ndeg",
    "roll_rate_rad_s": "roll rate,\ndeg/s",
    "yaw_rate_rad_s": "yaw rate,\ndeg/s",
    "roll_rad": "bank,\ndeg",
    "load_factor_y": "load factor\ny, g",
}


def need_matplotlib() -> None:
    """Raises CommandError where matplotlib is not installed."""
    if importlib.util.find_spec("matplotlib") is None:
        raise CommandError("--plot needs matplotlib, which is not installed; install wingwatch[plot]")


def draw(path: Path, title: str, design: InputDesign, promises: Sequence[Promise]) -> None:
    """Draw an input and the response of its modes into a file, whose suffix says the format."""
    from matplotlib.figure import Figure

    quantities = [item for one in promises for item in one.response.quantities.items()]
    figure = Figure(figsize=(13.0, max(6.0, 1.35 * len(quantities))), dpi=110, layout="constrained")
    figure.suptitle(title, fontsize=13)
    halves: Any = figure.subfigures(1, 2)
    left, right = halves
    panes = left.subplots(len(design.targets) + 1, 1, height_ratios=[*[1.0] * len(design.targets), 1.6])
    for i, axis in enumerate(panes[:-1]):
        _input(axis, design, i)
    panes[0].set_title("deflection from trim")
    panes[-2].set_xlabel("time, s")
    _spectrum(panes[-1], design)
    axes = right.subplots(len(quantities), 1, sharex=True, squeeze=False)[:, 0]
    axes[0].set_title("predicted response")
    for axis, (name, values) in zip(axes, quantities, strict=True):
        axis.plot(design.time_s, values if name.startswith("load") else np.degrees(values), color="#444444")
        axis.set_ylabel(_AXES[name])
        axis.grid(alpha=0.3)
    axes[-1].set_xlabel("time, s")
    figure.savefig(path)


def _plain(value: float, _position: float) -> str:
    return f"{value:g}"


def _input(axis: "Axes", design: InputDesign, i: int) -> None:
    name = design.surfaces[i]
    axis.step(design.time_s, np.degrees(design.inputs_rad[:, i]), where="post", color=_COLOURS[name])
    axis.set_ylabel(f"{name},\ndeg")
    axis.grid(alpha=0.3)


def _spectrum(axis: "Axes", design: InputDesign) -> None:
    """Densities over the strongest, in decibels, with bands shaded and natural frequencies dashed."""
    frequency, density = design.spectrum()
    top = density[1:].max()
    for i, target in enumerate(design.targets):
        colour = _COLOURS[target.surface]
        decibels = 10.0 * np.log10(np.maximum(density[1:, i] / top, 1e-30))
        if design.harmonics:
            lines = np.array(design.harmonics[i]) - 1
            axis.vlines(
                frequency[1:][lines], _FAINTEST_DB, decibels[lines], color=colour, label=target.surface
            )
            axis.plot(frequency[1:][lines], decibels[lines], "o", markersize=4, color=colour)
        else:
            axis.plot(frequency[1:], decibels, color=colour, label=target.surface)
        mode = target.natural_frequency_rad_s / (2.0 * math.pi)
        axis.axvline(mode, color=colour, linestyle="--", linewidth=1.0)
    for i, band in enumerate(dict.fromkeys(t.band_hz for t in design.targets)):
        axis.axvspan(*band, color="#888888", alpha=0.12, label="band" if i == 0 else None)
    axis.set_xscale("log")
    axis.set_ylim(_FAINTEST_DB, 5.0)
    axis.set_xlim(0.8 * frequency[1], frequency[-1])
    axis.xaxis.set_major_formatter(_plain)
    axis.set_title("power spectrum (dashed: natural frequency)")
    axis.set_xlabel("frequency, Hz")
    axis.set_ylabel("dB over the strongest")
    axis.grid(alpha=0.3, which="both")
    axis.legend(loc="lower left")
