"""Study tables whose truth is known: drawn figures in place of flights, in the columns of a study."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import orjson
import pyarrow as pa
from numpy.typing import NDArray

__all__ = ["Truth", "drawn_table"]

Array = NDArray[np.float64]

AIR = ("none", "light", "moderate", "severe", "changing")
EXCITATION = ("doublet", "3211", "multisine", "autopilot", "none")
AIRCRAFT = ("aerosonde", "twinotter", "ultrastick25e")


@dataclass(frozen=True)
class Truth:
    """What the rows are drawn from.

    Attributes:
        size_95: noticed with 95 % probability in the first air with the first excitation; each further air, and each
            further excitation, needs ``harder`` times the size.
        slope: of the logistic curve in the logarithm of size.
        delay_s: mean of the exponential delays of flights that are noticed.
        false_per_hour: rate of false alarms in the first air, each further one has so much again.
        error_ratio: of the sizes' errors over their stated standard errors.
        scatter: of the blocks' squared distances over their stated variances.
        evidence_per_hour: rate at which healthy evidence passes 0; it passes c with ``exp(-c)`` times that rate.
        effects: names; healthy, sensor_fault: fractions of the flights.
    """

    size_95: float = 0.1
    harder: float = 1.2
    slope: float = 5.0
    delay_s: float = 8.0
    false_per_hour: float = 0.05
    error_ratio: float = 1.0
    scatter: float = 1.0
    evidence_per_hour: float = 20.0
    effects: tuple[str, ...] = ("icing",)
    healthy: float = 0.2
    sensor_fault: float = 0.0
    flight_s: float = 300.0
    onset_s: float = 120.0
    threshold: float = 12.8


def drawn_table(flights: int, seed: int = 0, truth: Truth | None = None) -> pa.Table:
    """A study's table; the same for the same arguments."""
    t, rng = truth or Truth(), np.random.default_rng(seed)
    kind = rng.choice(3, flights, p=(1.0 - t.healthy - t.sensor_fault, t.healthy, t.sensor_fault))
    faulty, sensor = kind == 0, kind == 2
    air, excitation = rng.integers(0, len(AIR), flights), rng.integers(0, len(EXCITATION), flights)
    effect = np.where(faulty, rng.choice(t.effects, flights), np.where(sensor, "sensor_bias", ""))
    severity = np.where(faulty, rng.uniform(0.02, 0.4, flights), np.where(sensor, 0.01, np.nan))
    onset = np.where(effect != "", t.onset_s, np.nan)
    watched = t.flight_s - t.onset_s
    at_95 = t.size_95 * t.harder ** (air + excitation)
    chance = 1.0 / (1.0 + np.exp(-(np.log(19.0) + t.slope * np.log(np.abs(severity) / at_95))))
    delay = np.where(faulty & (rng.random(flights) < chance), rng.exponential(t.delay_s, flights), np.nan)
    delay = np.where(sensor & (rng.random(flights) < 0.3), rng.uniform(0.0, watched, flights), delay)
    detected = delay < watched
    delay = np.where(detected, delay, np.nan)
    healthy_s = np.where(effect != "", t.onset_s, t.flight_s)
    alarms = rng.poisson(t.false_per_hour * (1.0 + air) * healthy_s / 3600.0)
    times = [
        np.sort(rng.uniform(0.0, s, n)).round(1).tolist() for s, n in zip(healthy_s, alarms, strict=True)
    ]
    known, channel = detected & (rng.random(flights) < 0.9), np.where(sensor, "pitch_rate_rad_s", "")
    error = rng.uniform(0.005, 0.02, flights)
    peaks = np.log(np.maximum(rng.gamma(1.0, 1.0, flights), 1e-9))
    # largest of Poisson many exponential ones
    before = np.log(t.evidence_per_hour * healthy_s / 3600.0) - peaks
    before = np.where(alarms > 0, np.maximum(before, t.threshold + rng.exponential(1.0, flights)), before)
    after = np.where(
        detected, t.threshold + rng.exponential(30.0, flights), rng.uniform(0.0, t.threshold, flights)
    )
    rate = np.where(faulty, 40.0 * severity**2 / (1.0 + excitation), np.nan)
    nothing = np.full(flights, "")
    words: dict[str, Sequence[str] | NDArray[np.str_]] = {
        "kind": np.where(sensor, "healthy", "icing"), "failed": nothing, "aircraft": rng.choice(AIRCRAFT, flights),
        "command": [f"wingwatch study replay STUDY.parquet --seed {k}" for k in range(flights)],
        "route": rng.choice(("straight", "patrol"), flights), "turbulence": np.array(AIR)[air],
        "turbulence_model": np.full(flights, "dryden"), "excitation": np.array(EXCITATION)[excitation],
        "sensors": np.full(flights, "vanes"), "surfaces": rng.choice(("positions", "commands"), flights),
        "expectation": rng.choice(("exact", "drawn"), flights), "expectation_error": nothing, "effect": effect,
        "target": np.where(faulty, rng.choice(("all", "wing", "tail"), flights), channel), "icing_kind": nothing,
        "icing_factors": nothing, "channel": channel,
        "said_level": np.where(detected, "watch", ""), "block_scores": _scores(rng, flights, t),
        "false_causes": [_json([[at, "icing", "icing", None] for at in when]) for when in times],
        "false_reasons": [_json([_reason(at) for at in when]) for when in times],
        "code_version": np.full(flights, "1"), "settings_version": np.full(flights, "1"),
    }  # fmt: skip
    numbers = {
        "airspeed_true_m_s": np.full(flights, 25.0), "altitude_m": np.full(flights, 1000.0),
        "excitation_period_s": np.full(flights, 30.0), "noise_scale": np.ones(flights), "severity": severity,
        "onset_s": onset, "ramp_s": np.where(faulty, 0.0, np.nan), "flight_s": np.full(flights, t.flight_s),
        "observed_s": np.full(flights, 0.9 * t.flight_s), "healthy_h": healthy_s / 3600.0,
        "detected_s": onset + delay, "delay_s": delay, "said_probability": np.where(detected, 0.95, np.nan),
        "size": np.where(detected, severity + t.error_ratio * error * rng.standard_normal(flights), np.nan),
        "size_standard_error": np.where(detected, error, np.nan),
        "evidence_max": np.where(effect != "", after, np.nan), "evidence_max_before": before,
        "evidence_max_30_s": np.where(effect != "", np.where(delay <= 30.0, after, np.minimum(after, 0.0)), np.nan),
        "information": rate * watched, "information_rate_per_s": rate,
        "bayes_factor_max": np.where(effect == "", 1.0 / rng.uniform(1e-12, 1.0, flights), np.nan),
        "derivatives_delay_s": delay, "right_delay_s": np.where(known, delay, np.nan),
        "other_kind_delay_s": np.where(sensor & ~known, delay, np.nan),
        "threshold": np.full(flights, t.threshold), "wall_s": np.ones(flights), "processor_s": np.ones(flights),
    }  # fmt: skip
    columns = {name: pa.array(list(values), pa.string()) for name, values in words.items()}
    columns |= {name: pa.array(values, pa.float64()) for name, values in numbers.items()}
    columns |= {"seed": pa.array(range(flights), pa.int64()), "detected": pa.array(detected)}
    columns |= _named(effect, channel, detected, known) | _alerts(onset + delay)
    return pa.table(
        columns | dict.fromkeys(("false_alerts", "false_derivative_alerts"), pa.array(alarms, pa.int32()))
    )


def _named(
    effect: NDArray[np.str_], channel: NDArray[np.str_], detected: NDArray[np.bool_], known: NDArray[np.bool_]
) -> dict[str, pa.Array]:
    """What was said: icing by its kind, the truth or nothing known by its cause."""
    said = np.where(known, effect, np.where(detected, "unknown", ""))
    columns = {
        "first_right": pa.array(known),
        "right_at_end": pa.array(known),
        "first_in_set": pa.array(detected),
    }
    for when in ("first", "said"):
        columns[f"{when}_kind"] = pa.array(np.where(detected, "icing", "").tolist())
        columns[f"{when}_cause"] = pa.array(said.tolist())
        columns[f"{when}_channel"] = pa.array(np.where(detected, channel, "").tolist())
    return columns


def _json(value: object) -> str:
    """As text; a table has hundreds of thousands of them, which ``json`` takes five times as long for."""
    return orjson.dumps(value).decode()


def _alerts(raised_s: Array) -> dict[str, pa.Array]:
    """The one alert of a flight, if any; unlike the rows' names, for summaries go by those."""
    name = {"kind": "icing", "cause": "icing", "channel": None}
    found = [
        [{"raised_s": at_s, "cleared_s": None, "names": [name | {"since_s": at_s}]}] if at_s > 0.0 else []
        for at_s in raised_s.tolist()
    ]
    return {"alerts": pa.array(map(_json, found))}


def _reason(alarm_s: float) -> dict[str, str | float]:
    return {
        "derivative": "m_q", "z": 4.0, "structure": "short_period", "block_end_s": alarm_s, "log10_probability": -5.0
    }  # fmt: skip


def _scores(rng: np.random.Generator, flights: int, t: Truth) -> list[str]:
    """Blocks of 10 s of two structures, as many as a row may hold."""
    ends = [10.0 * (k + 1) for k in range(min(40, int(t.flight_s // 10.0)))]
    rows = []
    for chi_square in t.scatter * rng.chisquare(5.0, (flights, 2, len(ends))):
        short, lateral = (
            [[e, c, 5.0] for e, c in zip(ends, part, strict=True)] for part in chi_square.tolist()
        )
        rows.append(_json({"short_period": short, "lateral": lateral}))
    return rows
