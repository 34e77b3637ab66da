"""Estimators in situations nobody tuned them for: whether what they claim holds, and how much they claim.

Plants of two degrees of freedom (``situation_plants``) in the situations of ``situation_cases``: still and rough air of
several spectra, loop open and closed, doublets or none, moments nobody measured, a vane ahead, other rates, sensors and
inputs. Each online estimator is run alone, as the live chain configures it, solved twice a second and read at the end
of the flight; filter error is given the whole flight, as ``wingwatch estimate`` gives it. Each starts 30 % of each
derivative's natural size off. The situations are those of the trials that chose the filter's likelihood; the plants are
those of ``reference_plant``.

    .venv/bin/python benchmarks/situations.py [--seeds 8] [--seconds 60] [--cases "quiet;moderate, autopilot"]
        [--plants short_period,dutch_roll] [--estimators fourier,ekf,filter-error] [--conditions] [--json]

A claim is a derivative called ``converged``. Per situation and estimator: share of derivatives claimed; truth in the
stated 95 % interval of the claims and of all; median over all of the stated error over the natural size; rms and
largest error over stated error of the claims; and the rms error of the claims over the natural size.

A new estimator is a function from a ``Flight`` to an ``Estimate``, named in ``ESTIMATORS``.
"""

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from reference_plant import PLANTS, Plant
from saving import run_benchmark
from situation_cases import CONDITIONS, SITUATIONS
from situation_plants import Flight, Known, Situation, fly_situation

from wingwatch.estimators import (
    EkfConfig,
    EkfEstimator,
    Estimate,
    FilterErrorConfig,
    FourierConfig,
    FourierEstimator,
    Manoeuvre,
    ManoeuvreConfig,
    Outcome,
    SignalLayout,
    filter_error,
    manoeuvres,
    meets_at_centre,
)

Array = NDArray[np.float64]

BAND_HZ = (0.1, 4.0)
SOLUTION_INTERVAL_S = 0.5
WINDOW_S = 30.0
"""Longest manoeuvre of filter error, as ``wingwatch estimate`` cuts a flight."""
Z_95 = 1.959964


def at_centre(flight: Flight) -> Flight:
    """The flight with the velocity that the live chain gives its estimators where a vane is stated ahead."""
    layout = SignalLayout(2, 1)
    return replace(flight, rows=meets_at_centre(flight.rows[None], layout, flight.known.vane_ahead_m)[0])


def fourier_config(known: Known) -> FourierConfig:
    """The live chain's settings of the Fourier estimator."""
    return FourierConfig(
        known.plant.structure,
        BAND_HZ,
        known.start,
        3.0 * known.natural,
        known.reference,
        held=(known.held,),
        force_from_accelerometer=known.accelerometer,
        input_noise_std=(known.surface_noise_rad,),
        span_m=known.span_m,
        vane_ahead_m=known.vane_ahead_m,
    )


def fourier(flight: Flight) -> Estimate:
    """The Fourier estimator with the live chain's settings."""
    return _watched(FourierEstimator(fourier_config(flight.known)), at_centre(flight))


def ekf(flight: Flight) -> Estimate:
    """The filter with the live chain's settings, without the Fourier estimator's word on what the data carry."""
    k = flight.known
    config = EkfConfig(
        k.plant.structure,
        k.start,
        k.natural,
        k.reference,
        held=(k.held,),
        use_accelerometer=k.accelerometer,
        noise_std=(0.0, k.rate_noise_rad_s),
        input_noise_std=(k.surface_noise_rad,),
        span_m=k.span_m,
    )
    return _watched(EkfEstimator(config), at_centre(flight))


def whole_manoeuvres(flight: Flight) -> tuple[Manoeuvre, ...]:
    """A flight as estimators of whole flights are given it. A surface whose reading has noise is a position to them."""
    k = flight.known
    config = ManoeuvreConfig(
        k.plant.structure, k.reference, held=(k.held and k.surface_noise_rad == 0.0,), window_s=WINDOW_S,
        use_accelerometer=k.accelerometer,
    )  # fmt: skip
    return manoeuvres(config, flight.rows)


def whole_filter_error(flight: Flight) -> Estimate:
    """Filter error of the whole flight, whose prior is as wide as ``wingwatch estimate`` makes it."""
    k = flight.known
    config = FilterErrorConfig(k.span_m, k.vane_ahead_m, (k.surface_noise_rad,))
    return filter_error(whole_manoeuvres(flight), config, expected=k.start, natural=k.natural)[0]


ESTIMATORS: dict[str, Callable[[Flight], Estimate]] = {
    "fourier": fourier,
    "ekf": ekf,
    "filter-error": whole_filter_error,
}


def _watched(estimator: FourierEstimator | EkfEstimator, flight: Flight) -> Estimate:
    """What an online estimator says at the end of a flight."""
    state: Any = estimator.init(1)
    for piece in _pieces(flight):
        estimator.update(state, piece)
        estimator.solve(state)
    return estimator.estimate(state)


def _pieces(flight: Flight) -> list[Array]:
    """Rows (1, samples, columns) between solutions."""
    length = round(SOLUTION_INTERVAL_S * flight.known.rate_hz)
    return [flight.rows[None, at : at + length] for at in range(0, len(flight.rows), length)]


@dataclass(frozen=True, slots=True)
class Readings:
    """Final estimates of one estimator over the seeds, (seeds, 6) each: error, stated error, natural size, claims."""

    error: Array
    stated: Array
    natural: Array
    claimed: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Figures:
    """One estimator in one situation; percent, or None where nothing was claimed.

    Attributes:
        plant, situation, estimator: names.
        flights: number of seeds.
        claimed: share of derivatives called converged.
        covered_claims, covered_all: truth in the stated 95 % interval.
        stated: median over all of the stated error, of the natural size.
        rms_score, worst_score: error over stated error of the claims.
        worst_score_all: of all.
        rms_error: of the claims, of the natural size.
        covered_by_derivative: truth in the interval, (6,), of all.
        score_by_derivative: rms error over stated error, (6,), of all.
        stated_by_derivative: median stated error, of the natural size, (6,).
    """

    plant: str
    situation: str
    estimator: str
    flights: int
    claimed: float
    covered_claims: float | None
    covered_all: float
    stated: float
    rms_score: float | None
    worst_score: float | None
    worst_score_all: float
    rms_error: float | None
    covered_by_derivative: tuple[float, ...]
    score_by_derivative: tuple[float, ...]
    stated_by_derivative: tuple[float, ...]


def read(
    plant: Plant, situation: Situation, names: Sequence[str], seeds: int, seconds: float
) -> dict[str, Readings]:
    """Every estimator's final estimates of one situation, on the same flights."""
    found: dict[str, list[tuple[Array, Array, Array, NDArray[np.bool_]]]] = {name: [] for name in names}
    for seed in range(seeds):
        flight = fly_situation(plant, situation, seed, seconds)
        for name in names:
            estimate = ESTIMATORS[name](flight)
            claims = np.array([o is Outcome.CONVERGED for o in estimate.outcomes])
            error = estimate.value - np.array(plant.truth)
            found[name].append((error, estimate.standard_error, flight.known.natural, claims))
    return {
        name: Readings(*(np.array(part) for part in zip(*rows, strict=True))) for name, rows in found.items()
    }


def figures(names: tuple[str, str, str], readings: Readings) -> Figures:
    """Figures of plant, situation and estimator ``names``. What is not finite counts as outside its interval."""
    score = np.abs(readings.error) / readings.stated
    score = np.where(np.isfinite(score), score, np.inf)
    inside, relative = score <= Z_95, readings.stated / readings.natural
    claims = readings.claimed
    mine = score[claims]
    some = bool(claims.any())
    return Figures(
        *names,
        flights=len(score),
        claimed=100.0 * float(claims.mean()),
        covered_claims=100.0 * float(inside[claims].mean()) if some else None,
        covered_all=100.0 * float(inside.mean()),
        stated=100.0 * float(np.median(relative)),
        rms_score=_rms(mine) if some else None,
        worst_score=float(mine.max()) if some else None,
        worst_score_all=float(score.max()),
        rms_error=100.0 * _rms((readings.error / readings.natural)[claims]) if some else None,
        covered_by_derivative=tuple(100.0 * float(c) for c in inside.mean(axis=0)),
        score_by_derivative=tuple(_rms(score[:, j]) for j in range(score.shape[1])),
        stated_by_derivative=tuple(100.0 * float(m) for m in np.median(relative, axis=0)),
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


HEADER = (
    f"{'situation':58}{'estimator':14}{'claims':>7}{'in 95 %:':>10}{'':>8}{'stated/':>9}{'rms':>8}{'worst':>8}"
    f"{'worst':>8}{'error/':>9}\n{'':58}{'':14}{'%':>7}{'claims':>10}{'all':>8}{'size %':>9}{'z':>8}{'z':>8}"
    f"{'z, all':>8}{'size %':>9}"
)


def line(f: Figures) -> str:
    """One row of the table."""

    def cell(value: float | None, width: int, digits: int) -> str:
        if value is None:
            return f"{'-':>{width}}"
        return f"{value:{width}.{digits}f}" if value < 1e5 else f"{value:{width}.1g}"

    return (
        f"{f.situation:58}{f.estimator:14}{f.claimed:7.0f}{cell(f.covered_claims, 10, 0)}{f.covered_all:8.0f}"
        f"{cell(f.stated, 9, 1)}{cell(f.rms_score, 8, 2)}{cell(f.worst_score, 8, 1)}"
        f"{cell(f.worst_score_all, 8, 1)}{cell(f.rms_error, 9, 1)}"
    )


def summary(all_figures: Sequence[Figures]) -> list[str]:
    """Per plant and estimator: truth in the interval of all claims together, and where it is least."""
    lines = []
    for plant, name in dict.fromkeys((f.plant, f.estimator) for f in all_figures):
        mine = [f for f in all_figures if (f.plant, f.estimator) == (plant, name)]
        claiming = [f for f in mine if f.covered_claims is not None]
        claims = sum(f.claimed * f.flights for f in mine)
        held = sum(f.claimed * f.flights * (f.covered_claims or 0.0) for f in claiming)
        low = sum((f.covered_claims or 0.0) < 90.0 for f in claiming)
        worst = max((f.worst_score or 0.0 for f in claiming), default=0.0)
        share = claims / sum(f.flights for f in mine)
        lines.append(
            f"{plant}, {name}: claims {share:.0f} % of derivatives, of these "
            f"{held / claims if claims else float('nan'):.1f} % in the interval; below 90 % in {low} of the "
            f"{len(claiming)} situations with claims; largest error of a claim {worst:.1f} stated errors"
        )
    return lines


def _chosen_cases(text: str | None, conditions: bool) -> dict[str, Situation]:
    every = {**SITUATIONS, **CONDITIONS}
    if text is None:
        return CONDITIONS if conditions else SITUATIONS
    names = [name.strip() for name in text.split(";") if name.strip()]
    unknown = [name for name in names if name not in every]
    if unknown or not names:
        raise ValueError(f"there is no situation {unknown or text!r}; --list names them")
    return {name: every[name] for name in names}


def _chosen(text: str, known: Sequence[str], what: str) -> list[str]:
    names = [name.strip() for name in text.split(",") if name.strip()]
    unknown = [name for name in names if name not in known]
    if unknown or not names:
        raise ValueError(f"{what} {unknown or text!r}: give some of {', '.join(known)}")
    return names


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Estimators in situations nobody tuned them for.")
    parser.add_argument("--seeds", type=int, default=8, help="flights a situation, at least 1")
    parser.add_argument("--seconds", type=float, default=60.0, help="of a flight, at least 5")
    parser.add_argument("--cases", help="names, parted by semicolons; all situations if not given")
    parser.add_argument(
        "--conditions", action="store_true", help="the reference record's conditions varied instead"
    )
    parser.add_argument("--plants", default="short_period,dutch_roll")
    parser.add_argument("--estimators", default=",".join(ESTIMATORS))
    parser.add_argument("--json", action="store_true", help="one JSON object a line instead of the table")
    parser.add_argument("--list", action="store_true", help="name the situations and end")
    return parser


def main() -> int:
    parser = _parser()
    chosen = parser.parse_args()
    if chosen.list:
        print("\n".join([*SITUATIONS, *CONDITIONS]))
        return 0
    if chosen.seeds < 1:
        parser.error(f"--seeds is {chosen.seeds}; give at least 1")
    if not 5.0 <= chosen.seconds < np.inf:
        parser.error(f"--seconds is {chosen.seconds:g}; give at least 5")
    try:
        cases = _chosen_cases(chosen.cases, chosen.conditions)
        names = _chosen(chosen.estimators, list(ESTIMATORS), "--estimators")
        plants = _chosen(chosen.plants, [p.structure.name for p in PLANTS], "--plants")
    except ValueError as error:
        parser.error(str(error))
    found = []
    for plant in [p for p in PLANTS if p.structure.name in plants]:
        if not chosen.json:
            print(f"\n{plant.structure.name}, {chosen.seeds} flights of {chosen.seconds:g} s\n{HEADER}")
        for case, situation in cases.items():
            for name, readings in read(plant, situation, names, chosen.seeds, chosen.seconds).items():
                found.append(figures((plant.structure.name, case, name), readings))
                print(json.dumps(asdict(found[-1])) if chosen.json else line(found[-1]), flush=True)
    if not chosen.json:
        print("\n" + "\n".join(summary(found)))
    return 0


if __name__ == "__main__":
    run_benchmark(main)
