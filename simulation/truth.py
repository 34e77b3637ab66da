"""The truth of a simulated flight, for those who judge what was made of its record: ready for JSON."""

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from wingwatch.aircraft import STRUCTURES, Aircraft, TrimError
from wingwatch.simulation.effects import Effect, effect_text
from wingwatch.simulation.linearise import linearise
from wingwatch.simulation.scenario import Scenario
from wingwatch.simulation.trim import trim

__all__ = ["flight_truth", "truth"]

_START_S = -1.0
"""Before every onset."""


def truth(scenario: Scenario, time_s: float) -> dict[str, Any]:
    """What is true of a flight at a time, ready for JSON.

    Returns:
        ``time_s``; ``effects``: for each effect of the scenario its ``name``, its ``target`` (empty for one that
        has none), its ``size`` at that time, whether it is ``acting``, the size it grows to (``size_final``),
        ``onset_s`` and ``ramp_s``. A size that is a word (a surface stuck ``here``) is that word once it acts.
    """
    return {
        "time_s": time_s,
        "effects": [
            _effect_now(effect, time_s)
            | {"size_final": _size(effect), "onset_s": effect.onset_s, "ramp_s": effect.ramp_s}
            for effect in scenario.effects
        ],
    }


def flight_truth(scenario: Scenario, seconds: float, window_s: float = 10.0) -> dict[str, Any]:
    """What is true of a whole flight, ready for JSON.

    Derivatives are concise, of every model structure, at the level trim of the scenario's airspeed and altitude
    under the effects as they are flown; null where the aircraft, as it is then, has no such trim, with the reason
    in ``why``.

    Args:
        scenario: the flight.
        seconds: its length.
        window_s: length of the windows; the last may be shorter.

    Returns:
        ``scenario`` (all of it but the aircraft's own file), ``seconds``, ``window_s``; ``effects`` with their
        texts; ``trim`` before any effect; ``before`` and ``after``: {"derivatives", "why"} without effects and at
        the end; ``windows``: each ``from_s``, ``to_s``, ``time_s`` (its middle), ``effects`` as they are there, and
        "derivatives" and "why".

    Raises:
        ValueError: a length or a window that is not positive.
        AircraftDataError, TrimError: as ``trim`` of the whole aircraft.
    """
    for name, value in (("seconds", seconds), ("window_s", window_s)):
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} is {value}; give a positive number of seconds")
    point = trim(scenario.aircraft, scenario.condition)
    known = _Linearisations(scenario)
    windows = []
    for k in range(math.ceil(seconds / window_s - 1e-9)):
        start, end = k * window_s, min((k + 1) * window_s, seconds)
        middle = 0.5 * (start + end)
        effects = [_effect_now(effect, middle) for effect in scenario.effects]
        windows.append(
            {"from_s": start, "to_s": end, "time_s": middle, "effects": effects} | known.at(middle)
        )
    return {
        "scenario": {
            field.name: _plain(getattr(scenario, field.name))
            for field in fields(scenario)
            if field.name != "effects"
        },
        "seconds": seconds,
        "window_s": window_s,
        "effects": [
            {"text": effect_text(e), "name": e.name, "target": e.target, "size_final": _size(e)}
            | {"onset_s": e.onset_s, "ramp_s": e.ramp_s}
            for e in scenario.effects
        ],
        "trim": {f.name: _plain(getattr(point, f.name)) for f in fields(point) if f.name != "state"},
        "before": known.at(_START_S),
        "after": known.at(seconds),
        "windows": windows,
    }


class _Linearisations:
    """Derivatives at times of a flight; times at which the aircraft is the same share one linearisation."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._known: dict[str, dict[str, Any]] = {}

    def at(self, time_s: float) -> dict[str, Any]:
        """``derivatives`` by structure, or null and ``why``."""
        of_the_aircraft = (e for e in self._scenario.effects if type(e).apply is not Effect.apply)
        key = repr([(e.acts(time_s), e.severity(time_s)) for e in of_the_aircraft])
        if key not in self._known:
            self._known[key] = self._fresh(time_s)
        return self._known[key]

    def _fresh(self, time_s: float) -> dict[str, Any]:
        s = self._scenario
        try:
            derivatives = {
                name: linearise(s.aircraft, s.condition, structure, s.effects, time_s)
                for name, structure in STRUCTURES.items()
            }
        except TrimError as error:
            return {"derivatives": None, "why": str(error)}
        return {"derivatives": derivatives, "why": None}


def _effect_now(effect: Effect, time_s: float) -> dict[str, Any]:
    acting = effect.acts(time_s)
    size: float | str = 0.0
    if acting:
        size = effect.word or effect.severity(time_s)
    return {"name": effect.name, "target": effect.target, "size": size, "acting": acting}


def _size(effect: Effect) -> float | str:
    return effect.word or effect.size


def _plain(value: object) -> Any:
    """A value as JSON has it; a part of a scenario by the name of its type and its fields, an aircraft by its
    name."""
    if isinstance(value, Aircraft):
        return value.name
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list | np.ndarray):
        return [_plain(item) for item in value]
    if is_dataclass(value):
        return {"kind": type(value).__name__} | {
            f.name: _plain(getattr(value, f.name)) for f in fields(value)
        }
    return str(value)
