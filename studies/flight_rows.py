"""A study's row: what was drawn, what was said, and how much information the truth says had arrived."""

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from wingwatch.aircraft import ModeStructure, TrimError
from wingwatch.monitor import AlertView
from wingwatch.monitor.detection.comparison import Coordinates
from wingwatch.simulation import (
    Effect,
    linearise,
)
from wingwatch.studies.alert_history import after_onset
from wingwatch.studies.fault_names import part_of
from wingwatch.studies.plan import FlightPlan
from wingwatch.studies.versions import code_version, settings_version
from wingwatch.studies.watched_flight import ScoredBlock, WatchedFlight, effects_of

__all__ = ["row_of", "sentence_of", "unflown_row"]

Array = NDArray[np.float64]

RATE_WINDOW_S = 60.0
"""After the onset, over which the information's rate is taken."""

_SOON_S = 30.0
"""After the onset, within which an operator wants to know (``evidence_max_30_s``)."""
_MOST_SCORED_BLOCKS = 40
"""Of a structure that a row holds."""
_REASON_WINDOW_S = 60.0
"""Before a false alarm, in which its least likely block is looked for."""
_SHARES = (1.0, 0.5, 0.25, 0.125)
"""Parts of an effect under which a trim is looked for."""


def unflown_row(plan: FlightPlan, command: str, why: str) -> dict[str, Any]:
    """The row of a flight that was not flown to its end."""
    onset_s, nan = plan.onset_s, float("nan")
    return {
        "kind": plan.kind,
        "seed": plan.seed,
        "failed": why,
        "command": command.format(seed=plan.seed),
        "aircraft": plan.aircraft,
        "airspeed_true_m_s": plan.airspeed_true_m_s,
        "altitude_m": plan.altitude_m,
        "route": plan.route,
        "turbulence": plan.turbulence,
        "turbulence_model": plan.turbulence_model,
        "excitation": plan.excitation,
        "excitation_period_s": plan.excitation_period_s,
        "noise_scale": plan.noise_scale,
        "sensors": plan.sensors,
        "surfaces": plan.surfaces,
        "expectation": plan.expectation,
        "expectation_error": "",
        "effect": plan.effect,
        "target": plan.target,
        "channel": part_of(plan.effect, plan.target),
        "severity": nan if plan.severity is None else plan.severity,
        "onset_s": nan if onset_s is None else onset_s,
        "ramp_s": nan if plan.ramp_s is None else plan.ramp_s,
        "icing_kind": plan.target if plan.effect == "icing" else "",
        "icing_factors": json.dumps(dict(plan.icing_factors)) if plan.effect == "icing" else "",
        "flight_s": 0.0,
        "observed_s": 0.0,
        "healthy_h": 0.0,
        "detected": False,
        "detected_s": nan,
        "delay_s": nan,
        "derivatives_delay_s": nan,
        "first_kind": "",
        "first_cause": "",
        "first_channel": "",
        "first_right": False,
        "first_in_set": False,
        "said_kind": "",
        "said_cause": "",
        "said_channel": "",
        "said_level": "",
        "said_probability": nan,
        "right_delay_s": nan,
        "right_at_end": False,
        "other_kind_delay_s": nan,
        "size": nan,
        "size_standard_error": nan,
        "false_alerts": 0,
        "false_derivative_alerts": 0,
        "false_causes": "[]",
        "false_reasons": "[]",
        "alerts": "[]",
        "evidence_max": nan,
        "evidence_max_30_s": nan,
        "evidence_max_before": nan,
        "information": nan,
        "information_rate_per_s": nan,
        "block_scores": "{}",
        "bayes_factor_max": nan,
        "threshold": nan,
        "code_version": code_version(),
        "settings_version": settings_version(),
        "wall_s": 0.0,
        "processor_s": 0.0,
    }


def row_of(plan: FlightPlan, command: str, watch: WatchedFlight) -> dict[str, Any]:
    """The row of a flight that was flown; where its figures cannot be worked out, the row says why.

    Args:
        command: that flies it again, with ``{seed}``.
    """
    try:
        return unflown_row(plan, command, "") | _said(watch) | _truth(watch)
    except Exception as error:
        return unflown_row(plan, command, sentence_of(error))


def _said(watch: WatchedFlight) -> dict[str, Any]:
    """What the monitor said, and when."""
    plan, observed, monitor = watch.plan, watch.observed, watch.monitor
    flight_s = watch.samples / plan.rate_hz
    healthy_s = flight_s if plan.onset_s is None else min(plan.onset_s, flight_s)
    ends_s = np.inf if plan.onset_s is None else plan.onset_s
    false = [a.raised for a in observed.alerts.values() if a.raised.raised_s < ends_s]
    before = [e for t, e in observed.evidence if t <= ends_s]
    after = [e for t, e in observed.evidence if t > ends_s]
    soon = [e for t, e in observed.evidence if ends_s < t <= ends_s + _SOON_S]
    return {
        "flight_s": flight_s,
        "observed_s": monitor.observable_s,
        "healthy_h": healthy_s / 3600.0,
        "false_alerts": len(false),
        "false_derivative_alerts": sum(a.channel is None for a in false),
        "false_causes": json.dumps([[a.raised_s, a.kind, a.cause, a.channel] for a in false]),
        "false_reasons": json.dumps([_reason(a, observed.blocks) for a in false]),
        "evidence_max": max(after, default=np.nan),
        "evidence_max_30_s": max(soon, default=np.nan),
        "evidence_max_before": max(before, default=np.nan),
        "block_scores": json.dumps(_block_scores(observed.blocks)),
        "bayes_factor_max": _largest_bayes_factor(watch) if plan.effect == "" else np.nan,
        "threshold": monitor.judge.config.log_threshold,
        "wall_s": watch.wall_s,
        "processor_s": watch.processor_s,
        "alerts": json.dumps([a.as_json() for a in observed.alerts.values()]),
        **after_onset(observed.alerts.values(), plan.effect, plan.target, ends_s),
    }


def _block_scores(blocks: Sequence[ScoredBlock]) -> dict[str, list[list[float]]]:
    """The first blocks of each structure: end, chi-square and degrees of freedom."""
    found: dict[str, list[list[float]]] = {}
    for block in blocks:
        scores = found.setdefault(block.structure, [])
        if len(scores) < _MOST_SCORED_BLOCKS:
            scores.append([block.end_s, block.chi_square, block.freedom])
    return found


def _reason(alert: AlertView, blocks: Sequence[ScoredBlock]) -> dict[str, Any]:
    """What misled the monitor: the derivative that departed most when the alert was raised, and the least likely block
    of the minute before it."""
    found: dict[str, Any] = {}
    if alert.evidence:
        most = max(alert.evidence, key=lambda e: abs(e.z))
        found |= {"derivative": most.derivative, "z": most.z}
    recent = [
        b for b in blocks if b.freedom > 0.0 and alert.raised_s - _REASON_WINDOW_S < b.end_s <= alert.raised_s
    ]
    if recent:
        log_probability = [float(chi2.logsf(b.chi_square, b.freedom)) for b in recent]
        least = int(np.argmin(log_probability))
        found |= {
            "structure": recent[least].structure,
            "block_end_s": recent[least].end_s,
            "log10_probability": log_probability[least] / math.log(10.0),
        }
    return found


def _largest_bayes_factor(watch: WatchedFlight) -> float:
    """Largest Bayes factor of "a change in some block of this flight" against none.

    Each of the flight's N blocks is as likely a priori to begin the change: after n blocks the statistic R, the sum
    over their onsets, gives (R + N - n)/N. Without a change that is a martingale from 1 (a supermartingale once old
    onsets are dropped), so by Ville's inequality its maximum passes c with a probability of no more than 1/c.
    """
    blocks = max(1, round(watch.plan.seconds / watch.monitor.judge.config.block_s))
    factors = [
        (np.exp(min(e, 700.0)) + max(0, blocks - n)) / blocks
        for n, (_, e) in enumerate(watch.observed.evidence, start=1)
    ]
    return float(max(factors, default=1.0))


def _truth(watch: WatchedFlight) -> dict[str, Any]:
    """What the truth says of the expectation and of the information that had arrived."""
    plan, monitor = watch.plan, watch.monitor
    found: dict[str, Any] = {}
    if plan.expectation == "drawn":
        found["expectation_error"] = json.dumps(
            {s.name: _expectation_error(watch, s) for s in monitor.chain.structures}
        )
    change = _change(watch)
    if change is None or plan.onset_s is None:
        return found
    parts = [
        (
            end_s,
            0.5 * _mean_square_share(plan, end_s, monitor.judge.config.block_s) * float(d @ information @ d),
        )
        for end_s, name, information in watch.observed.information
        if (d := change.get(name)) is not None and end_s > plan.onset_s
    ]
    window_s = min(RATE_WINDOW_S, watch.samples / plan.rate_hz - plan.onset_s)
    early = float(sum(part for end_s, part in parts if end_s <= plan.onset_s + window_s))
    found["information"] = float(sum(part for _, part in parts))
    found["information_rate_per_s"] = early / window_s if window_s > 0.0 else np.nan
    return found


def _expectation_error(watch: WatchedFlight, structure: ModeStructure) -> dict[str, float]:
    """Expectation less truth of each concise derivative at the flight's condition."""
    expected = watch.monitor.chain.envelopes[structure.name].lookup(watch.plan.condition)
    truth = watch.truth[structure.name].lookup(watch.plan.condition)
    error = getattr(expected, "value", np.nan) - getattr(truth, "value", np.nan)
    return dict(zip(structure.derivatives, np.atleast_1d(error).tolist(), strict=False))


def _change(watch: WatchedFlight) -> dict[str, Array] | None:
    """The full effect's change of the derivatives in the monitor's coordinates, by structure.

    Where the aircraft has no level trim left under the effect, a part of it is carried over in proportion. None in a
    healthy flight, under a sensor's fault, and without a trim under any part.
    """
    effects = effects_of(watch.plan)
    if not effects or effects[0].sensor_faults():
        return None
    effect = effects[0]
    for share in _SHARES:
        part = replace(effect, size=share * effect.size)
        try:
            return {
                name: _change_under(watch, coordinates, part) / share
                for name, coordinates in watch.monitor.judge.coordinates.items()
            }
        except TrimError:
            continue
    return None


def _change_under(watch: WatchedFlight, coordinates: Coordinates, effect: Effect) -> Array:
    """Change of one structure's derivatives, in the monitor's coordinates, once an effect has fully grown."""
    condition, structure = watch.plan.condition, coordinates.structure
    clean = linearise(watch.aircraft, condition, structure)
    changed = linearise(watch.aircraft, condition, structure, (effect,), effect.onset_s + effect.ramp_s + 1.0)
    scale = coordinates.at(condition).scale
    return np.array([changed[d] - clean[d] for d in structure.derivatives]) / scale


def _mean_square_share(plan: FlightPlan, end_s: float, block_s: float) -> float:
    """Mean square over a block of how far the effect has grown, 0 before the onset and 1 after the ramp."""
    onset_s, ramp_s = plan.onset_s or 0.0, plan.ramp_s or 0.0
    since = end_s - block_s * (np.arange(20) + 0.5) / 20.0 - onset_s
    share = np.clip(since / ramp_s, 0.0, 1.0) if ramp_s > 0.0 else since >= 0.0
    return float(np.mean(np.square(share, dtype=np.float64)))


def sentence_of(error: Exception) -> str:
    """Why a flight was not flown: kind and text of an error, on one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"[:300]
