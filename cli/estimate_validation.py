"""Derivatives of one flight judged on another: the linear model with them flies each manoeuvre open loop."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from wingwatch.aircraft import MODEL_STRUCTURES, Aircraft, ModeStructure
from wingwatch.diagnosis.predicted_motion import Derivatives, PredictedManoeuvre, predicted_motion
from wingwatch.estimators.offline.fit import ChannelFit, channel_fit
from wingwatch.telemetry import Cleaner, FlightTable

__all__ = ["Fitted", "Validation", "as_json", "fitted_of", "show_validation", "validated"]

_KNOWN = ("converged", "settling")


@dataclass(frozen=True, slots=True)
class Fitted:
    """One structure's derivatives as they came out of a flight.

    Attributes:
        estimator: of several the one that knows more of them.
        value, standard_error: (k,); what was not observable is as expected, NaN where nothing is expected either.
        expected: (k,); NaN where nothing is expected.
        observed: (k,), which of them the flight made observable.
        condition: airspeed_true_m_s, altitude_m, air_density_kg_m3, angle_of_attack_rad that all hold at.
    """

    structure: ModeStructure
    estimator: str
    value: np.ndarray[Any, np.dtype[np.float64]]
    standard_error: np.ndarray[Any, np.dtype[np.float64]]
    expected: np.ndarray[Any, np.dtype[np.float64]]
    observed: np.ndarray[Any, np.dtype[np.bool_]]
    condition: tuple[float, float, float, float]


def fitted_of(estimators: Mapping[str, Mapping[str, Any]]) -> dict[str, Fitted]:
    """Derivatives by structure out of the contract's objects (by estimator, then structure), in concise units."""
    best: dict[str, Fitted] = {}
    for estimator, modes in estimators.items():
        for name, mode in modes.items():
            made = _fitted(MODEL_STRUCTURES[name], estimator, mode)
            if made is None:
                continue
            if name not in best or made.observed.sum() > best[name].observed.sum():
                best[name] = made
    return best


def _fitted(structure: ModeStructure, estimator: str, mode: Mapping[str, Any]) -> Fitted | None:
    rows = [mode["derivatives"][symbol] for symbol in structure.derivatives]
    condition = tuple(_number(value) for value in mode["condition"].values())
    observed = np.array([row["outcome"] in _KNOWN for row in rows])
    if not observed.any() or not np.isfinite(condition[:3]).all():
        return None
    value, error, expected, doubt = (
        np.array([_number(row.get(key)) for row in rows])
        for key in ("value", "standard_error", "expected", "expected_standard_error")
    )
    observed &= np.isfinite(value) & np.isfinite(error)
    return Fitted(
        structure, estimator, np.where(observed, value, expected), np.where(observed, error, doubt), expected,
        observed, (condition[0], condition[1], condition[2], condition[3]),
    )  # fmt: skip


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


@dataclass(frozen=True, slots=True)
class Validation:
    """What came of judging.

    Attributes:
        manoeuvres: of the other flight, by structure in the order of time.
        fits: by structure and channel, over all manoeuvres: of the estimated derivatives, of the expected ones (None
            where they are not known), and the rms of what the first leave over the sensor's noise (median).
        notes: what could not be predicted, one clause each.
    """

    manoeuvres: Sequence[PredictedManoeuvre]
    fits: Mapping[str, Mapping[str, tuple[ChannelFit, ChannelFit | None, float]]]
    notes: Sequence[str]


def validated(fitted: Mapping[str, Fitted], flight: FlightTable, aircraft: Aircraft) -> Validation:
    """Derivatives judged on a flight; its derivatives are not estimated."""

    def known(structure: ModeStructure, at_s: float) -> Derivatives | None:
        one = fitted[structure.name]
        return Derivatives(one.value, one.expected, one.estimator, one.condition)

    clean = Cleaner().clean(flight.block).block
    found, notes = predicted_motion(
        flight, aircraft, clean, [one.structure for one in fitted.values()], known
    )
    fits: dict[str, dict[str, tuple[ChannelFit, ChannelFit | None, float]]] = {}
    for name in dict.fromkeys(one.structure for one in found):
        parts = [one for one in found if one.structure == name]
        for c, channel in enumerate(parts[0].channels):
            channels = [part.channels[c] for part in parts]
            measured = [one.measured for one in channels]
            expected = [one.expected for one in channels]
            whole = all(np.isfinite(one).all() for one in expected)
            fits.setdefault(name, {})[channel.name] = (
                channel_fit(channel.name, measured, [one.estimated for one in channels]),
                channel_fit(channel.name, measured, expected) if whole else None,
                float(np.median([one.over_noise for one in channels])),
            )
    return Validation(found, fits, notes)


def as_json(validation: Validation, source: Path) -> dict[str, Any]:
    """The object of ``estimate --validate --json``."""
    return {
        "flight": str(source),
        "structures": {
            name: {
                "manoeuvres": sum(one.structure == name for one in validation.manoeuvres),
                "channels": {
                    channel: {
                        "r_squared": fit.r_squared, "tic": fit.tic, "bias": fit.bias, "variance": fit.variance,
                        "covariance": fit.covariance, "over_noise": over,
                        "r_squared_expected": None if expected is None else expected.r_squared,
                    }
                    for channel, (fit, expected, over) in channels.items()
                },
            }
            for name, channels in validation.fits.items()
        },
        "notes": list(validation.notes),
    }  # fmt: skip


def show_validation(console: Console, validation: Validation, source: Path) -> None:
    """R2 and Theil's coefficient with its shares of bias, variance and covariance (5.39 to 5.43), by channel."""
    title = f"judged on {source}"
    table = Table(title=title, title_justify="left", title_style="bold")
    for column in (
        "structure",
        "manoeuvres",
        "channel",
        "R2",
        "as expected",
        "Theil",
        "bias, variance, covariance",
    ):
        table.add_column(column, justify="left" if column in ("structure", "channel") else "right")
    table.add_column("left over noise", justify="right")
    for name, channels in validation.fits.items():
        count = sum(one.structure == name for one in validation.manoeuvres)
        for k, (channel, (fit, expected, over)) in enumerate(channels.items()):
            shares = ", ".join(f"{100.0 * part:.0f}" for part in (fit.bias, fit.variance, fit.covariance))
            table.add_row(
                name if k == 0 else "", str(count) if k == 0 else "", channel, _percent(fit.r_squared),
                "-" if expected is None else _percent(expected.r_squared), f"{fit.tic:.3f}", f"{shares} %",
                f"{over:.2f}" if np.isfinite(over) else "-",
            )  # fmt: skip
    console.print(table)
    for note in validation.notes:
        console.print(f"{note[:1].upper()}{note[1:]}.", style="dim")


def _percent(part: float) -> str:
    if not np.isfinite(part):
        return "-"
    return "below 0" if part < 0.0 else f"{100.0 * part:.1f} %"
