"""Alerts before and after their diagnosis: named right, size in its interval, processor time; and on healthy flights.

Flights are drawn: kind and size of the fault, its onset at 50 to 70 s, air (still, light, moderate), doublets or a
patrol with doublets. In every second flight the aircraft's file is wrong: each main derivative of what flies is off
by a normal error of 10 % from the start. Each flight is watched by ``VehicleMonitor`` as live, until its first alert
after the onset and 12 s of flight since the onset. Then the last two minutes are diagnosed, as in the service.

Surfaces are known by their commands alone in flights with an offset of one: where the position is measured the monitor
names it by itself. Where the monitor raises nothing within 40 s, and on healthy flights, an alert of unknown cause
(healthy: of ice) stands in for it.

Run: python benchmarks/alert_diagnosis.py [--flights N] [--healthy N] [--seed N] [--aircraft NAME]
"""

import argparse
import itertools
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from saving import run_benchmark

from wingwatch.aircraft import Aircraft, load_aircraft
from wingwatch.api import DiagnosisState, DiagnosisView
from wingwatch.diagnosis import DiagnosisError
from wingwatch.diagnosis.change import change_as_json, diagnose_change
from wingwatch.monitor import AlertState, AlertView, SampleRing, VehicleMonitor, surface_kinds
from wingwatch.operations.diagnosis_change import RING_CHANNELS
from wingwatch.service.alert_diagnoses import is_diagnosed
from wingwatch.service.alert_findings import asked_causes, finding_of
from wingwatch.simulation import (
    Effect,
    Scenario,
    Turbulence,
    doublet_schedule,
    parse_effect,
    patrol,
    simulate,
)
from wingwatch.telemetry import CHANNEL_INDEX, CHANNELS, Cleaner, SampleBlock, complete

AIRS: tuple[Turbulence, ...] = ("none", "light", "moderate")
SECONDS, WAITED_S, SINCE_S = 125.0, 40.0, 12.0
POSITIONS = ("elevator_rad", "aileron_rad", "rudder_rad")
MAIN = ("z_w", "m_w", "m_eta", "y_v", "l_v", "l_p", "l_xi", "n_v", "n_r", "n_zeta")
REFERENCE_ERROR = 0.1

_Draw = Callable[[np.random.Generator], float]


def _between(low: float, high: float, signed: bool = False) -> _Draw:
    def draw(rng: np.random.Generator) -> float:
        size = math.exp(rng.uniform(math.log(low), math.log(high)))
        return float(size * (rng.choice((-1.0, 1.0)) if signed else 1.0))

    return draw


KINDS: dict[str, tuple[tuple[str, ...], _Draw]] = {
    "icing": (("icing",), _between(0.08, 0.3)),
    "effectiveness": (
        ("elevator_effectiveness", "aileron_effectiveness", "rudder_effectiveness"), _between(0.2, 0.6),
    ),
    "cg_shift": (("cg_shift",), _between(0.015, 0.035)),
    "wing_damage": (("wing_damage[left]", "wing_damage[right]"), _between(0.05, 0.2)),
    "surface_offset": (("surface_offset[elevator]", "surface_offset[aileron]"), _between(0.01, 0.04, True)),
}  # fmt: skip
"""By kind its effects and how their size is drawn."""


@dataclass(frozen=True, slots=True)
class Drawn:
    """One flight: its fault (None: healthy), what else is not as in the file, the air, and how it is flown."""

    kind: str
    effect: Effect | None
    off: tuple[Effect, ...]
    air: Turbulence
    on_patrol: bool
    onset_s: float
    seed: int


@dataclass(frozen=True, slots=True)
class Diagnosed:
    """A flight with its alert before and after.

    Attributes:
        raised: whether the monitor raised the alert, and nothing stands in for it.
        own: whether the alert is one that the service has diagnosed.
    """

    drawn: Drawn
    raised: bool
    own: bool
    before: tuple[str, str | None]
    after: tuple[str, str | None]
    size: float
    size_standard_error: float
    decided: bool
    note: str
    processor_s: float

    @property
    def truth(self) -> tuple[str, str | None]:
        """Cause and part."""
        effect = self.drawn.effect
        if effect is None:
            return "", None
        return effect.name, f"{effect.target}_rad" if effect.name == "surface_offset" else None


def draw(flights: int, healthy: int, seed: int) -> list[Drawn]:
    """Faults, every kind as often, then healthy flights."""
    rng, found = np.random.default_rng(seed), []
    for number in range(flights + healthy):
        kind = list(KINDS)[number % len(KINDS)] if number < flights else "healthy"
        onset_s = float(rng.uniform(50.0, 70.0))
        effect = None
        if kind in KINDS:
            effects, size = KINDS[kind]
            effect = parse_effect(f"{rng.choice(effects)}:{size(rng):.6g}@{onset_s:.2f}")
        errors = rng.normal(0.0, REFERENCE_ERROR, len(MAIN))
        wrong = (number // len(KINDS)) % 2 == 1 if kind in KINDS else number % 2 == 1
        off = [parse_effect(f"derivative[{s}]:{e:.6g}@0") for s, e in zip(MAIN, errors, strict=True)]
        air, flown = AIRS[int(rng.integers(3))], bool(rng.integers(2))
        found.append(Drawn(kind, effect, tuple(off) if wrong else (), air, flown, onset_s, seed + number))
    return found


def fly(aircraft: Aircraft, drawn: Drawn) -> SampleBlock:
    """The flight; without positions of surfaces where one is offset."""
    assert aircraft.envelope is not None
    condition = aircraft.envelope.cruise
    start_s = float(np.random.default_rng(drawn.seed).uniform(5.0, 25.0))
    scenario = Scenario(
        aircraft, condition.airspeed_true_m_s, condition.altitude_m,
        manoeuvres=(doublet_schedule(aircraft, condition, start_s=start_s),),
        effects=(*drawn.off, *(() if drawn.effect is None else (drawn.effect,))), turbulence=drawn.air,
        seed=drawn.seed, route=patrol(aircraft, condition) if drawn.on_patrol else None,
    )  # fmt: skip
    flown = simulate(scenario, SECONDS)
    if drawn.kind == "surface_offset":
        flown.values[:, [CHANNEL_INDEX[name] for name in POSITIONS]] = np.nan
    return flown


def diagnosed(aircraft: Aircraft, drawn: Drawn) -> Diagnosed:
    """Watch a flight and diagnose its alert."""
    given = fly(aircraft, drawn)
    block, kinds = complete(given), surface_kinds(given.present)
    alert, onset_s, ring, raised = _watched(aircraft, drawn, block, kinds)
    time_s, values = ring.latest()
    rows = np.full((len(time_s), len(CHANNELS)), np.nan)
    rows[:, CHANNEL_INDEX["time_s"]] = time_s
    rows[:, [CHANNEL_INDEX[name] for name in ring.names]] = values
    began_s, asked = time.process_time(), asked_causes(alert)
    state, problem, result = DiagnosisState.DONE, "", None
    try:
        found = diagnose_change(
            Cleaner().clean(SampleBlock(rows)).block, aircraft, onset_s, kinds=kinds, asked=asked
        )
        result = change_as_json(found)
    except DiagnosisError as error:
        state, problem = DiagnosisState.FAILED, str(error)
    spent_s = time.process_time() - began_s
    finding = finding_of(alert, DiagnosisView("", state, aircraft.name, "", 0, "", 1.0, problem, result))
    c = finding.correction
    return Diagnosed(
        drawn, raised, is_diagnosed(alert), (alert.cause, alert.channel),
        (alert.cause, alert.channel) if c is None else (c.cause, c.channel),
        alert.size if c is None else c.size, alert.size_standard_error if c is None else c.size_standard_error,
        c is not None, finding.note, spent_s,
    )  # fmt: skip


def _watched(
    aircraft: Aircraft, drawn: Drawn, block: SampleBlock, kinds: dict[str, str]
) -> tuple[AlertView, float, SampleRing, bool]:
    """The alert, about when its change began, the last minutes, and whether the monitor raised it."""
    ids = itertools.count(1)
    monitor = VehicleMonitor(
        aircraft, "benchmark", "uav", block.present, kinds, new_id=lambda: str(next(ids))
    )
    ring = SampleRing([name for name in RING_CHANNELS if name in block.present])
    alert: AlertView | None = None
    for start in range(0, len(block), 10):
        piece = SampleBlock(block.values[start : start + 10])
        now_s = float(piece.time_s[-1])
        versions = [a for a in monitor.feed(piece).alerts if a.raised_s >= drawn.onset_s]
        ring.add(piece)
        if drawn.kind != "healthy" and versions:
            alert = versions[-1]
        if now_s >= drawn.onset_s + (SINCE_S if alert is not None else WAITED_S):
            break
    if alert is None:
        cause = ("icing", "icing") if drawn.kind == "healthy" else ("unexplained", "unknown")
        stands_in = AlertView(
            "x", "benchmark", "uav", *cause, "watch", AlertState.ACTIVE, drawn.onset_s + 10.0, None, 0.1, 0.02, 0.9,
            "empirical", "", (),
        )  # fmt: skip
        return stands_in, drawn.onset_s, ring, False
    onset_s = monitor.book.onset_s
    own = monitor.book.active is not None and monitor.book.active.id == alert.id
    if not own or onset_s is None or not math.isfinite(onset_s):
        onset_s = alert.raised_s - 3.0
    return alert, onset_s, ring, True


def _row(name: str, some: Sequence[Diagnosed]) -> str:
    right = [d for d in some if d.decided and d.after == d.truth]
    inside = [
        d for d in right
        if d.drawn.effect is not None and abs(d.size - d.drawn.effect.size) <= 1.96 * d.size_standard_error
    ]  # fmt: skip
    wrong = sum(d.decided and d.after != d.truth for d in some)
    spent = sorted(d.processor_s for d in some)
    return (
        f"{name:<20}{len(some):4d}{sum(d.raised for d in some):8d}{sum(d.before == d.truth for d in some):8d}"
        f"{sum(d.after == d.truth for d in some):7d}{wrong:7d}{len(some) - wrong - len(right):11d}"
        f"{len(inside):6d}/{len(right):<4d}{spent[len(spent) // 2]:8.1f}{spent[-1]:8.1f}"
    )


def main() -> None:
    """Print a line a flight, then the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--flights", type=int, default=40, help="with a fault")
    parser.add_argument("--healthy", type=int, default=10)
    parser.add_argument("--seed", type=int, default=20261129)
    parser.add_argument("--aircraft", default="aerosonde")
    given = parser.parse_args()
    aircraft = load_aircraft(given.aircraft)
    print(f"{given.aircraft}, seed {given.seed}")
    found = []
    for drawn in draw(given.flights, given.healthy, given.seed):
        found.append(diagnosed(aircraft, replace(drawn)))
        one = found[-1]
        fault = (
            ""
            if drawn.effect is None
            else f"{drawn.effect.name} {drawn.effect.target} {drawn.effect.size:.3f}"
        )
        print(
            f"{drawn.kind:<15}{fault:<32}{drawn.air:<9}{'off' if drawn.off else '':<4}{one.before[0]:<24}{one.note} "
            f"({one.processor_s:.1f} s)",
            flush=True,
        )
    print(
        f"{'':<20}{'n':>4}{'raised':>8}{'before':>8}{'after':>7}{'wrong':>7}{'undecided':>11}{'in 95 %':>10}"
        f"{'s p50':>9}{'s max':>8}"
    )
    faulty = [d for d in found if d.drawn.effect is not None]
    for kind in KINDS:
        if some := [d for d in faulty if d.drawn.kind == kind]:
            print(_row(kind, some))
    for name, wrong in (("file right", False), ("file off", True)):
        if some := [d for d in faulty if bool(d.drawn.off) is wrong]:
            print(_row(name, some))
    if faulty:
        print(_row("all", faulty))
    if healthy := [d for d in found if d.drawn.effect is None]:
        confirmed = sum(d.decided and d.after == ("icing", None) for d in healthy)
        other = sum(d.decided for d in healthy) - confirmed
        print(f"healthy, stand-in alert of ice: {len(healthy)}, confirmed {confirmed}, another cause {other}")


if __name__ == "__main__":
    run_benchmark(main)
