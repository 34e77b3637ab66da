"""A diagnosis as plain data for JSON: the contract's object, with what is not known as None."""

import math
from collections.abc import Mapping
from typing import Any

from wingwatch.aircraft import MODEL_DERIVATIVES
from wingwatch.diagnosis.result import Cause, Diagnosis, Gain, Interval, Misfit, ParameterEstimate

__all__ = ["as_json"]


def as_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """The object of ``wingwatch diagnose --json``; it holds only dicts, lists, texts, finite numbers and None."""
    d = diagnosis
    return {
        "source": d.source,
        "aircraft": d.aircraft.name,
        "seconds": _number(d.seconds),
        "windows": d.windows,
        "misfit": {channel: _misfit(m) for channel, m in d.misfit.items()},
        "causes": [_cause(c) for c in d.causes],
        "ranking": [
            {"label": label, "gain": _number(gain), "probability": _number(probability)}
            for label, gain, probability in d.ranking
        ],
        "unexplained_fraction": _number(d.unexplained_fraction),
        "unexplained": d.unexplained,
        "not_judged": list(d.not_judged),
        "another_aircraft": d.another_aircraft,
        "missing_terms": [
            {
                "coefficient": t.coefficient,
                "signal": t.signal,
                "value": _number(t.value),
                "standard_error": _number(t.standard_error),
                "gain": _number(t.gain),
            }
            for t in d.missing_terms
        ],
        "gain": _gain(d.gain),
        "not_separable": [{"causes": list(s.causes), "reason": s.reason} for s in d.not_separable],
        "derivatives": {
            symbol: {"before": _number(before), "after": _number(after), "unit": _unit(symbol)}
            for symbol, (before, after) in d.derivatives.items()
        },
        "notes": list(d.notes),
        "model": None if d.model is None else d.model.model_dump(mode="json", exclude_none=True),
    }


def _misfit(misfit: Misfit) -> dict[str, Any]:
    return {
        "r_squared": _number(misfit.r_squared),
        "tic": _number(misfit.tic),
        "bias": _number(misfit.bias),
        "variance": _number(misfit.variance),
        "covariance": _number(misfit.covariance),
        "noise_fraction": _number(misfit.noise_fraction),
        "whiteness": _number(misfit.whiteness),
        "coherence": {name: _number(value) for name, value in misfit.coherence.items()},
    }


def _cause(cause: Cause) -> dict[str, Any]:
    return {
        "name": cause.name,
        "target": cause.target,
        "label": cause.label,
        "parameters": {name: _parameter(p) for name, p in cause.parameters.items()},
        "channels": list(cause.channels),
        "probability": _number(cause.probability),
        "set_probability": _number(cause.set_probability),
        "gain": _number(cause.gain),
        "held_out_gain": _number(cause.held_out_gain),
        "indistinguishable_from": list(cause.indistinguishable_from),
        "separating_manoeuvre": cause.separating_manoeuvre,
        "text": cause.text,
    }


def _parameter(parameter: ParameterEstimate) -> dict[str, Any]:
    return {
        "value": _number(parameter.value),
        "standard_error": _number(parameter.standard_error),
        "unit": parameter.unit,
    }


def _gain(gain: Gain | None) -> dict[str, Any]:
    """The same keys whether an extension is offered or not."""
    if gain is None:
        return {"source": "", "held_out": {}}
    return {
        "source": gain.source,
        "held_out": {
            channel: {
                "before": _misfit(before),
                "after": _misfit(gain.after[channel]),
                "change": _interval(gain.change.get(channel)),
                "intervals": {
                    name: {"before": _interval(one), "after": _interval(other)}
                    for name, (one, other) in gain.intervals.get(channel, {}).items()
                },
            }
            for channel, before in gain.before.items()
            if channel in gain.after
        },
    }


def _interval(interval: Interval | None) -> Mapping[str, Any] | None:
    if interval is None:
        return None
    return {"value": _number(interval.value), "low": _number(interval.low), "high": _number(interval.high)}


def _unit(symbol: str) -> str:
    known = MODEL_DERIVATIVES.get(symbol)
    return known.unit if known is not None else ""


def _number(value: float) -> float | None:
    """A finite float as Python's own, else None."""
    return float(value) if math.isfinite(value) else None
