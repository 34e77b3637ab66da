"""The picture of a fit: measured and predicted motion of manoeuvres, and what is left beside the sensor's noise."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wingwatch.diagnosis.predicted_motion import MotionChannel, PredictedManoeuvre

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_fit"]

_MOST = 3
"""Manoeuvres of a structure that are drawn: those in which a surface moved most."""

_LABELS = {
    "w": ("w, m/s", 1.0), "v": ("v, m/s", 1.0), "p": ("p, deg/s", 180.0 / np.pi), "q": ("q, deg/s", 180.0 / np.pi),
    "r": ("r, deg/s", 180.0 / np.pi), "a_z": ("a_z, m/s²", 1.0), "a_y": ("a_y, m/s²", 1.0),
}  # fmt: skip


def draw_fit(path: Path, title: str, manoeuvres: Sequence[PredictedManoeuvre]) -> None:
    """Draw into a file, whose suffix says the format: a block for each structure, a column for each manoeuvre."""
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(one.structure for one in manoeuvres))
    blocks = [_largest([one for one in manoeuvres if one.structure == name]) for name in names]
    rows = [len(block[0].channels) for block in blocks]
    figure = Figure(figsize=(13.0, 1.9 * sum(rows) + 1.0), dpi=110, layout="constrained")
    figure.suptitle(title, fontsize=13)
    parts: Any = figure.subfigures(len(blocks), 1, height_ratios=rows, squeeze=False)
    for part, block, name in zip(parts[:, 0], blocks, names, strict=True):
        part.suptitle(name.replace("_", " "), fontsize=11)
        _draw_block(part, block)
    figure.savefig(path)


def _largest(manoeuvres: Sequence[PredictedManoeuvre]) -> list[PredictedManoeuvre]:
    largest = sorted(manoeuvres, key=lambda one: -one.moved_rad)[:_MOST]
    return sorted(largest, key=lambda one: float(one.time_s[0]))


def _draw_block(part: Any, block: Sequence[PredictedManoeuvre]) -> None:
    """Two rows for each channel: the motion, and what is left of it."""
    channels = len(block[0].channels)
    heights = [2.0, 1.0] * channels
    axes = part.subplots(2 * channels, len(block), sharex="col", squeeze=False, height_ratios=heights)
    for column, one in enumerate(block):
        for k, channel in enumerate(one.channels):
            _motion(axes[2 * k, column], one, channel, named=column == 0)
            _left(axes[2 * k + 1, column], one, channel, named=column == 0)
        axes[-1, column].set_xlabel("time, s")
    axes[0, 0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, fontsize=7, frameon=False)


def _motion(axis: "Axes", one: PredictedManoeuvre, channel: MotionChannel, named: bool) -> None:
    label, factor = _LABELS.get(channel.name, (channel.name, 1.0))
    axis.plot(one.time_s, factor * channel.measured, color="#444444", linewidth=1.0, label="measured")
    axis.plot(one.time_s, factor * channel.expected, color="#aaaaaa", linewidth=1.0, label="as expected")
    axis.plot(
        one.time_s, factor * channel.estimated, color="#c05a00", linewidth=1.2, label="by the estimates"
    )
    axis.set_title(f"R2 {100.0 * channel.r_squared:.1f} %", fontsize=8, loc="right")
    if named:
        axis.set_ylabel(label, fontsize=8)
    axis.grid(alpha=0.3)


def _left(axis: "Axes", one: PredictedManoeuvre, channel: MotionChannel, named: bool) -> None:
    _, factor = _LABELS.get(channel.name, (channel.name, 1.0))
    left = factor * (channel.measured - channel.estimated)
    axis.plot(one.time_s, left, color="#1f5fa8", linewidth=0.8)
    if np.isfinite(channel.over_noise) and channel.over_noise > 0.0:
        band = 1.96 * float(np.std(left)) / channel.over_noise
        axis.axhspan(-band, band, color="#888888", alpha=0.2)
    if named:
        axis.set_ylabel("left", fontsize=8)
    axis.grid(alpha=0.3)
