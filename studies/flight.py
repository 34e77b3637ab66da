"""From plans to rows: flights simulated together, each watched by the code that runs live.

Nothing that the simulation knows reaches the monitor but the channels of the flight. The truth serves afterwards, to
say how much information about the change had arrived.
"""

import itertools
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from wingwatch.aircraft import Aircraft, ModeStructure, TrimError
from wingwatch.monitor import AlertView, Chain, Report, VehicleMonitor, surface_kinds
from wingwatch.monitor.chain import STRUCTURES_WATCHED
from wingwatch.monitor.comparison import Coordinates, change_since
from wingwatch.monitor.judge import BlockView, ModeBlock
from wingwatch.monitor.together import feed_together
from wingwatch.simulation import (
    EFFECTS,
    Effect,
    FleetSimulation,
    Scenario,
    TurbulenceOnset,
    linearise,
    patrol,
)
from wingwatch.simulation.sensor_errors import SIMULATED
from wingwatch.studies.drawn_icing import drawn_icing
from wingwatch.studies.expectation import Expectations
from wingwatch.studies.plan import FlightPlan, manoeuvres
from wingwatch.studies.versions import code_version, settings_version
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock, complete, derivations

__all__ = ["FlightMaker", "scenario_of", "unflown_row"]

Array = NDArray[np.float64]

MOST_SCORED_BLOCKS = 40
RATE_WINDOW_S = 60.0
"""After the onset, over which the information's rate is taken."""

_SOON_S = 30.0
"""After the onset, within which an operator wants to know (``evidence_max_30_s``)."""
_PIECE_S = 0.5
"""No more than one solution of the monitor falls into a piece."""
_UNSENSED = "pitch_demand_rad"
"""Follows from the motion, and no sensor may lose it."""
_VANES = ("angle_of_attack_rad", "sideslip_rad")
_POSITIONS = ("elevator_rad", "aileron_rad", "rudder_rad")
_RANK = 1e-9
_SHARES = (1.0, 0.5, 0.25, 0.125)
"""Parts of an effect under which a trim is looked for."""


def scenario_of(plan: FlightPlan, aircraft: Aircraft) -> Scenario:
    """The flight to be simulated.

    Raises:
        AircraftDataError, TrimError, ValueError: a flight that cannot be flown, in one sentence.
    """
    condition = plan.condition
    changes = (TurbulenceOnset(g.rms_m_s, g.onset_s, g.ramp_s) for g in plan.gusts)
    return Scenario(
        _noisier(aircraft, plan.noise_scale),
        plan.airspeed_true_m_s,
        plan.altitude_m,
        manoeuvres=manoeuvres(
            plan.excitation, aircraft, condition, plan.excitation_period_s, plan.excitation_start_s
        ),
        effects=(*_effects(plan), *changes),
        turbulence=plan.air,  # type: ignore[arg-type]  # the grid takes the levels' words only
        turbulence_model=plan.turbulence_model,  # type: ignore[arg-type]
        seed=plan.seed,
        route=patrol(aircraft, condition) if plan.route == "patrol" else None,
    )


def _noisier(aircraft: Aircraft, scale: float) -> Aircraft:
    if scale == 1.0:
        return aircraft
    noise = {column: scale * std for column, std in aircraft.sensors.noise_std.items()}
    return aircraft.model_copy(update={"sensors": aircraft.sensors.model_copy(update={"noise_std": noise})})


def _effects(plan: FlightPlan) -> tuple[Effect, ...]:
    """What befalls the aircraft; nothing in a healthy flight."""
    if plan.severity is None or plan.onset_s is None or plan.ramp_s is None:
        return ()
    if plan.effect == "icing":
        return (drawn_icing(plan.severity, plan.onset_s, plan.ramp_s, plan.target, plan.icing_factors),)
    return (EFFECTS[plan.effect](plan.severity, plan.onset_s, plan.ramp_s, plan.target),)


def _left_out(plan: FlightPlan) -> tuple[str, ...]:
    """Channels that the aircraft's sensors do not give."""
    return (
        *(_VANES if plan.sensors == "no_vanes" else ()),
        *(_POSITIONS if plan.surfaces == "commands" else ()),
    )


@dataclass(slots=True)
class _Heard:
    """What a flight led to so far."""

    raised: dict[str, AlertView] = field(default_factory=dict)
    last: dict[str, AlertView] = field(default_factory=dict)
    evidence: list[tuple[float, float]] = field(default_factory=list)
    """Time and log statistic of every verdict."""
    scores: dict[str, list[list[float]]] = field(default_factory=dict)
    information: list[tuple[float, str, Array]] = field(default_factory=list)
    """End of a block, structure, and the information that it brought."""


class _Watch:
    """One flight's monitor, and what it said."""

    def __init__(
        self,
        plan: FlightPlan,
        aircraft: Aircraft,
        expectations: Expectations,
        chains: dict[tuple[str, tuple[str, ...]], Chain],
    ) -> None:
        self.plan, self.aircraft = plan, aircraft
        self._given = tuple(c for c in SIMULATED if c not in _left_out(plan))
        self._lacking = [CHANNEL_INDEX[c] for c in _left_out(plan)]
        drawn = plan.expectation == "drawn"
        self.truth, self._drawn = expectations.exact(), drawn
        numbers = itertools.count(1)
        kind = plan.aircraft, self._given
        self.monitor = VehicleMonitor(
            aircraft, "study", str(plan.seed), [*self._given, *derivations(self._given)], surface_kinds(self._given),
            envelopes=expectations.drawn(plan.expectation_errors) if drawn else self.truth,
            chain=None if drawn else chains.get(kind), new_id=lambda: str(next(numbers)),
        )  # fmt: skip
        if not drawn:
            chains.setdefault(kind, self.monitor.chain.of_another())
        self.heard = _Heard()
        self.samples = 0
        self.lost = False
        self.wall_s = self.processor_s = 0.0
        self._block: BlockView | None = None

    def sensed(self, values: Array) -> SampleBlock:
        """The next samples, as the flight's sensors report them; a flight that goes beyond all numbers ends there."""
        beyond = np.flatnonzero(~np.isfinite(values[:, CHANNEL_INDEX[_UNSENSED]]))
        if beyond.size:
            self.lost = True
            values = values[: beyond[0]]
        self.samples += len(values)
        values = values.copy()
        values[:, self._lacking] = np.nan
        return complete(SampleBlock(values), self._given)

    def hear(self, report: Report) -> None:
        """What the monitor made of them."""
        heard, monitor = self.heard, self.monitor
        for alert in report.alerts:
            heard.raised.setdefault(alert.id, alert)
            heard.last[alert.id] = alert
        active = monitor.book.active
        if active is not None:
            heard.last[active.id] = active
        block = monitor.last_block
        if block is None or block is self._block:
            return
        self._block = block
        if monitor.last_verdict is not None:
            heard.evidence.append((block.end_s, monitor.last_verdict.log_statistic))
        for name, mode in block.modes.items():
            scores, score = heard.scores.setdefault(name, []), self._score(mode)
            if len(scores) < MOST_SCORED_BLOCKS and np.isfinite(score).all():
                scores.append([block.end_s, *score])
        for solution in report.solutions:
            for name, mode_solution in solution.modes.items():
                found = mode_solution.block
                if name in block.modes and found is not None:
                    information, _ = monitor.judge.coordinates[name].of_evidence(
                        found.information, found.vector, block.condition
                    )
                    heard.information.append((block.end_s, name, information))

    def _score(self, mode: ModeBlock) -> tuple[float, float]:
        """Chi-square of expectation minus block value over the covariance stated of both, and degrees of freedom.

        An exact expectation has no error; a drawn one that which the file states. The bias that gusts are expected to
        have caused counts as error, as it does for the monitor.
        """
        covariance = mode.expected_covariance if self._drawn else np.zeros_like(mode.information)
        bias = np.linalg.pinv(mode.information, rcond=_RANK, hermitian=True) @ mode.bias
        natural = np.ones(mode.expected.size)
        change = change_since(
            mode.expected, covariance, mode.information, mode.vector, np.outer(bias, bias), natural
        )
        scale = np.sqrt(
            np.maximum(np.diagonal(change.weight), 0.0)
        )  # what is next to nothing may be rounded below it
        seen = scale > 0.0
        if not seen.any():
            return 0.0, 0.0
        weight = change.weight[np.ix_(seen, seen)] / np.outer(scale[seen], scale[seen])
        pull = change.pull[seen] / scale[seen]
        freedom = float(np.linalg.matrix_rank(weight, tol=_RANK * weight.shape[0], hermitian=True))
        return float(pull @ np.linalg.pinv(weight, rcond=_RANK, hermitian=True) @ pull), freedom


class FlightMaker:
    """Flies plans and makes their rows; keeps what the aircraft share.

    Args:
        aircraft: by the name under which plans know them.
    """

    def __init__(self, aircraft: Mapping[str, Aircraft]) -> None:
        self._aircraft = aircraft
        self._expectations: dict[str, Expectations] = {}
        self._chains: dict[tuple[str, tuple[str, ...]], Chain] = {}

    def rows(self, plans: Sequence[FlightPlan], command: str) -> list[dict[str, Any]]:
        """One row a plan, in their order.

        Args:
            command: that flies one of them again, with ``{seed}``.
        """
        with threadpool_limits(limits=1):  # more threads would change the last bit of sums, and help nobody
            flown = self._flown(plans)
        return [
            _row(plan, command, watch) if isinstance(watch, _Watch) else unflown_row(plan, command, watch)
            for plan, watch in zip(plans, flown, strict=True)
        ]

    def samples(self, plan: FlightPlan) -> SampleBlock:
        """The whole flight of a plan, all channels, as its sensors report it."""
        simulation = FleetSimulation([scenario_of(plan, self._aircraft[plan.aircraft])], plan.rate_hz)
        values = simulation.step(round(plan.seconds * plan.rate_hz))[0]
        beyond = np.flatnonzero(~np.isfinite(values[:, CHANNEL_INDEX[_UNSENSED]]))
        return SampleBlock(values[: beyond[0]] if beyond.size else values)

    def _flown(self, plans: Sequence[FlightPlan]) -> list["_Watch | str"]:
        """A watched flight of each plan, or why there is none."""
        out: list[_Watch | str] = []
        scenarios: list[Scenario] = []
        watches: list[_Watch] = []
        for plan in plans:
            try:
                aircraft = self._aircraft[plan.aircraft]
                scenario = scenario_of(plan, aircraft)
                FleetSimulation([scenario], plan.rate_hz)
                watch = _Watch(plan, aircraft, self._expected(plan.aircraft), self._chains)
            except Exception as error:  # one flight that cannot be flown must not stop the others
                out.append(_sentence(error))
                continue
            out.append(watch)
            scenarios.append(scenario)
            watches.append(watch)
        problems = _fly(scenarios, watches) if watches else {}
        return [problems.get(id(w), w) for w in out]

    def _expected(self, name: str) -> Expectations:
        if name not in self._expectations:
            self._expectations[name] = Expectations(self._aircraft[name], STRUCTURES_WATCHED)
        return self._expectations[name]


def _fly(scenarios: Sequence[Scenario], watches: Sequence[_Watch]) -> dict[int, str]:
    """Fly and watch to the end; the sentence of each watch that failed, by its identity."""
    plan = watches[0].plan
    simulation = FleetSimulation(scenarios, plan.rate_hz)
    piece = max(1, int(_PIECE_S * plan.rate_hz))
    left = round(plan.seconds * plan.rate_hz)
    problems: dict[int, str] = {}
    while left > 0:
        with _timed(watches):
            values = simulation.step(min(piece, left))
        left -= piece
        flying = [n for n, w in enumerate(watches) if not w.lost and id(w) not in problems]
        with _timed([watches[n] for n in flying]):
            blocks = {n: block for n in flying if len(block := watches[n].sensed(values[n]))}
            reports = feed_together([watches[n].monitor for n in blocks], list(blocks.values()))
            for n, report in zip(blocks, reports, strict=True):
                watch = watches[n]
                try:
                    if isinstance(report, Exception):
                        raise report
                    watch.hear(report)
                except Exception as error:  # a fault over one flight is that flight's row
                    problems[id(watch)] = _sentence(error)
    return problems


@contextmanager
def _timed(watches: Sequence[_Watch]) -> Iterator[None]:
    """The time spent, shared out evenly."""
    wall_s, processor_s = time.perf_counter(), time.process_time()
    yield
    for watch in watches:
        watch.wall_s += (time.perf_counter() - wall_s) / len(watches)
        watch.processor_s += (time.process_time() - processor_s) / len(watches)


def _sentence(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"[:300]


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
        "said_kind": "",
        "said_cause": "",
        "said_level": "",
        "said_probability": nan,
        "size": nan,
        "size_standard_error": nan,
        "false_alerts": 0,
        "false_causes": "[]",
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


def _row(plan: FlightPlan, command: str, watch: _Watch) -> dict[str, Any]:
    try:
        return unflown_row(plan, command, "") | _said(watch) | _truth(watch)
    except Exception as error:
        return unflown_row(plan, command, _sentence(error))


def _said(watch: _Watch) -> dict[str, Any]:
    """What the monitor said, and when."""
    plan, heard, monitor = watch.plan, watch.heard, watch.monitor
    flight_s = watch.samples / plan.rate_hz
    healthy_s = flight_s if plan.onset_s is None else min(plan.onset_s, flight_s)
    ends_s = np.inf if plan.onset_s is None else plan.onset_s
    false = [a for a in heard.raised.values() if a.raised_s < ends_s]
    hit = next((heard.last[a.id] for a in heard.raised.values() if a.raised_s >= ends_s), None)
    before = [e for t, e in heard.evidence if t <= ends_s]
    after = [e for t, e in heard.evidence if t > ends_s]
    soon = [e for t, e in heard.evidence if ends_s < t <= ends_s + _SOON_S]
    said: dict[str, Any] = {
        "flight_s": flight_s,
        "observed_s": monitor.observable_s,
        "healthy_h": healthy_s / 3600.0,
        "detected": hit is not None,
        "false_alerts": len(false),
        "false_causes": json.dumps([[a.raised_s, a.kind, a.cause] for a in false]),
        "evidence_max": max(after, default=np.nan),
        "evidence_max_30_s": max(soon, default=np.nan),
        "evidence_max_before": max(before, default=np.nan),
        "block_scores": json.dumps(heard.scores),
        "bayes_factor_max": _largest_bayes_factor(watch) if plan.effect == "" else np.nan,
        "threshold": monitor.judge.config.log_threshold,
        "wall_s": watch.wall_s,
        "processor_s": watch.processor_s,
    }
    if hit is not None:
        said |= {
            "detected_s": hit.raised_s,
            "delay_s": hit.raised_s - ends_s,
            "said_kind": hit.kind,
            "said_cause": hit.cause,
            "said_level": hit.level,
            "said_probability": hit.probability,
            "size": hit.size,
            "size_standard_error": hit.size_standard_error,
        }
    return said


def _largest_bayes_factor(watch: _Watch) -> float:
    """Largest Bayes factor of "a change in some block of this flight" against none.

    Each of the flight's N blocks is as likely a priori to begin the change: after n blocks the statistic R, the sum
    over their onsets, gives (R + N - n)/N. Without a change that is a martingale from 1 (a supermartingale once old
    onsets are dropped), so by Ville's inequality its maximum passes c with a probability of no more than 1/c.
    """
    blocks = max(1, round(watch.plan.seconds / watch.monitor.judge.config.block_s))
    factors = [
        (np.exp(min(e, 700.0)) + max(0, blocks - n)) / blocks
        for n, (_, e) in enumerate(watch.heard.evidence, start=1)
    ]
    return float(max(factors, default=1.0))


def _truth(watch: _Watch) -> dict[str, Any]:
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
        for end_s, name, information in watch.heard.information
        if (d := change.get(name)) is not None and end_s > plan.onset_s
    ]
    window_s = min(RATE_WINDOW_S, watch.samples / plan.rate_hz - plan.onset_s)
    early = float(sum(part for end_s, part in parts if end_s <= plan.onset_s + window_s))
    found["information"] = float(sum(part for _, part in parts))
    found["information_rate_per_s"] = early / window_s if window_s > 0.0 else np.nan
    return found


def _expectation_error(watch: _Watch, structure: ModeStructure) -> dict[str, float]:
    """Expectation less truth of each concise derivative at the flight's condition."""
    expected = watch.monitor.chain.envelopes[structure.name].lookup(watch.plan.condition)
    truth = watch.truth[structure.name].lookup(watch.plan.condition)
    error = getattr(expected, "value", np.nan) - getattr(truth, "value", np.nan)
    return dict(zip(structure.derivatives, np.atleast_1d(error).tolist(), strict=False))


def _change(watch: _Watch) -> dict[str, Array] | None:
    """The full effect's change of the derivatives in the monitor's coordinates, by structure.

    Where the aircraft has no level trim left under the effect, a part of it is carried over in proportion. None in a
    healthy flight, under a sensor's fault, and without a trim under any part.
    """
    effects = _effects(watch.plan)
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


def _change_under(watch: _Watch, coordinates: Coordinates, effect: Effect) -> Array:
    """Change of one structure's derivatives, in the monitor's coordinates, once an effect has fully grown."""
    condition, structure = watch.plan.condition, coordinates.structure
    clean = linearise(watch.aircraft, condition, structure)
    changed = linearise(watch.aircraft, condition, structure, (effect,), effect.onset_s + effect.ramp_s + 1.0)
    scale, _ = coordinates.to_concise(condition)
    return np.array([changed[d] - clean[d] for d in structure.derivatives]) / scale


def _mean_square_share(plan: FlightPlan, end_s: float, block_s: float) -> float:
    """Mean square over a block of how far the effect has grown, 0 before the onset and 1 after the ramp."""
    onset_s, ramp_s = plan.onset_s or 0.0, plan.ramp_s or 0.0
    since = end_s - block_s * (np.arange(20) + 0.5) / 20.0 - onset_s
    share = np.clip(since / ramp_s, 0.0, 1.0) if ramp_s > 0.0 else since >= 0.0
    return float(np.mean(np.square(share, dtype=np.float64)))
