"""Faults of surfaces, thrust, sensors and the airframe: seen, how soon, by which name? Healthy flights: silent?

Flights are drawn: kind and size of the fault, its onset at 45 to 75 s, air (still, light, moderate), doublets or a
patrol with doublets, wind. All channels of the simulated aircraft are sent. Each flight is watched by
``VehicleMonitor`` as live, without earlier flights. A fault counts as seen where an alert is raised after its onset, as
early where one is raised before; the last column counts flights whose first alert is ``icing``.

Run: python benchmarks/redundancy.py [--flights N] [--healthy N] [--seconds S] [--seed N] [--aircraft NAME ...]
"""

import argparse
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from saving import run_benchmark

from wingwatch.aircraft import Aircraft, load_aircraft
from wingwatch.monitor import AlertView, VehicleMonitor, surface_kinds
from wingwatch.simulation import (
    Effect,
    FleetSimulation,
    Scenario,
    Turbulence,
    doublet_schedule,
    parse_effect,
    patrol,
)
from wingwatch.telemetry import SampleBlock, complete

RATE_HZ = 50.0
AIRS: tuple[Turbulence, ...] = ("none", "light", "moderate")
HEALTHY_AIRS: tuple[Turbulence, ...] = ("none", "light", "moderate", "severe")
WITHIN_S = 5.0
BATCH = 12

_Draw = Callable[[np.random.Generator], str]


def _log(low: float, high: float, signed: bool = False) -> _Draw:
    def draw(rng: np.random.Generator) -> str:
        size = float(np.exp(rng.uniform(math.log(low), math.log(high))))
        return f"{size * (rng.choice((-1.0, 1.0)) if signed else 1.0):.6g}"

    return draw


KINDS: dict[str, tuple[str, _Draw]] = {
    "surface_stuck[elevator]": ("surfaces", lambda _: "here"),
    "surface_stuck[aileron]": ("surfaces", lambda _: "here"),
    "surface_stuck[rudder]": ("surfaces", lambda _: "here"),
    "surface_offset[elevator]": ("surfaces", _log(0.01, 0.04, True)),
    "surface_offset[aileron]": ("surfaces", _log(0.01, 0.04, True)),
    "actuator_lag[elevator]": ("surfaces", _log(0.05, 0.2)),
    "thrust_loss": ("thrust", _log(0.05, 0.7)),
    "airspeed_error": ("airspeed", _log(0.04, 0.2, True)),
    "sensor_freeze[airspeed_true_m_s]": ("airspeed", lambda _: "1"),
    "sensor_freeze[sideslip_rad]": ("vanes", lambda _: "1"),
    "sensor_bias[angle_of_attack_rad]": ("vanes", _log(0.01, 0.05, True)),
    "sensor_bias[pitch_rate_rad_s]": ("gyros", _log(0.004, 0.03, True)),
    "sensor_bias[roll_rate_rad_s]": ("gyros", _log(0.004, 0.03, True)),
    "sensor_bias[yaw_rate_rad_s]": ("gyros", _log(0.004, 0.03, True)),
    "sensor_scale[roll_rate_rad_s]": ("gyros", _log(0.1, 0.3, True)),
    "sensor_delay[pitch_rate_rad_s]": ("gyros", _log(0.03, 0.2)),
    "sensor_bias[pitch_rad]": ("attitude", _log(0.01, 0.05, True)),
    "sensor_bias[roll_rad]": ("attitude", _log(0.01, 0.05, True)),
    "sensor_bias[specific_force_x_m_s2]": ("accelerometers", _log(0.2, 1.0, True)),
    "sensor_bias[specific_force_z_m_s2]": ("accelerometers", _log(0.2, 1.0, True)),
    "icing": ("ice", _log(0.03, 0.3)),
    "icing[left]": ("ice", _log(0.03, 0.3)),
    "wing_damage[left]": ("airframe", _log(0.05, 0.3)),
    "elevator_effectiveness": ("airframe", _log(0.1, 0.6)),
    "aileron_effectiveness": ("airframe", _log(0.1, 0.6)),
    "rudder_effectiveness": ("airframe", _log(0.1, 0.6)),
    "cg_shift": ("airframe", _log(0.004, 0.02, True)),
    "mass_inertia": ("airframe", _log(0.03, 0.15, True)),
}
"""By effect, its group and how its size is drawn."""


@dataclass(frozen=True, slots=True)
class Drawn:
    """One flight: its fault (None: healthy) with kind and onset, the air, and how it is flown."""

    kind: str | None
    effect: Effect | None
    air: Turbulence
    on_patrol: bool
    seed: int


@dataclass(frozen=True, slots=True)
class Flown:
    """A flight and every version of its alerts."""

    drawn: Drawn
    versions: Sequence[AlertView]

    @property
    def onset_s(self) -> float:
        """Of the fault; infinite for a healthy flight."""
        return math.inf if self.drawn.effect is None else self.drawn.effect.onset_s

    @property
    def early(self) -> list[AlertView]:
        """Alerts while nothing was wrong, as they stood last."""
        return list({a.id: a for a in self.versions if a.raised_s < self.onset_s}.values())

    @property
    def first(self) -> AlertView | None:
        """The first alert after the onset, as it stood last; None after an early one."""
        found = [a for a in self.versions if a.raised_s >= self.onset_s]
        if not found or self.early:
            return None
        return [a for a in found if a.id == found[0].id][-1]

    @property
    def named(self) -> bool:
        """Whether the first alert names cause and part."""
        if self.first is None or self.drawn.kind is None:
            return False
        cause, _, part = self.drawn.kind.rstrip("]").partition("[")
        channel = {"": self.first.channel, "left": None}.get(
            part, part if part.endswith(("_s", "_rad", "_s2")) else f"{part}_rad"
        )
        return (self.first.cause, self.first.channel) == (cause, channel)


def draw(flights: int, seed: int) -> list[Drawn]:
    """Faults, every kind as often."""
    rng, found = np.random.default_rng(seed), []
    for number in range(flights):
        kind = list(KINDS)[number % len(KINDS)]
        size = KINDS[kind][1](rng)
        effect = parse_effect(f"{kind}:{size}@{rng.uniform(45.0, 75.0):.2f}")
        found.append(Drawn(kind, effect, AIRS[int(rng.integers(3))], bool(rng.integers(2)), seed + number))
    return found


def fly(aircraft: Aircraft, drawn: Sequence[Drawn], seconds: float) -> list[Flown]:
    """All flights, some at a time."""
    return [f for i in range(0, len(drawn), BATCH) for f in _fly(aircraft, drawn[i : i + BATCH], seconds)]


def _fly(aircraft: Aircraft, drawn: Sequence[Drawn], seconds: float) -> list[Flown]:
    assert aircraft.envelope is not None
    condition = aircraft.envelope.cruise
    scenarios = []
    for d in drawn:
        rng = np.random.default_rng(d.seed)
        schedule = doublet_schedule(aircraft, condition, start_s=float(rng.uniform(5.0, 25.0)))
        scenarios.append(
            Scenario(
                aircraft, condition.airspeed_true_m_s, condition.altitude_m, manoeuvres=(schedule,),
                effects=() if d.effect is None else (d.effect,), turbulence=d.air, seed=d.seed,
                route=patrol(aircraft, condition) if d.on_patrol else None,
                wind_m_s=(float(rng.normal(0.0, 3.0)), float(rng.normal(0.0, 3.0)), 0.0),
            )
        )  # fmt: skip
    simulation, monitors = FleetSimulation(scenarios, RATE_HZ), list[VehicleMonitor]()
    versions: list[list[AlertView]] = [[] for _ in drawn]
    for _ in range(round(seconds)):
        for i, values in enumerate(simulation.step(round(RATE_HZ))):
            given = SampleBlock(values)
            block = complete(given)
            if len(monitors) <= i:
                ids = itertools.count(1)
                monitors.append(
                    VehicleMonitor(
                        aircraft, "benchmark", str(i), block.present, surface_kinds(given.present),
                        new_id=lambda ids=ids: str(next(ids)),  # type: ignore[misc]
                    )
                )  # fmt: skip
            for start in range(0, len(block), 10):
                versions[i] += monitors[i].feed(SampleBlock(block.values[start : start + 10])).alerts
    return [Flown(d, t) for d, t in zip(drawn, versions, strict=True)]


def _row(name: str, flown: Sequence[Flown]) -> str:
    seen = [f for f in flown if f.first is not None]
    delays = sorted(f.first.raised_s - f.onset_s for f in seen if f.first is not None)
    soon = sum(d <= WITHIN_S for d in delays)
    sized = [f for f in seen if f.named and f.first is not None and f.first.size_standard_error]
    honest = sum(
        abs(f.first.size - f.drawn.effect.size) <= 1.96 * f.first.size_standard_error
        for f in sized
        if f.first is not None and f.drawn.effect is not None
    )
    airframe = sum(f.first is not None and f.first.kind == "icing" for f in flown)
    median = f"{delays[len(delays) // 2]:8.1f}" if delays else "       -"
    return (
        f"{name:<34}{len(flown):5d}{sum(bool(f.early) for f in flown):7d}{len(seen):6d}{soon:8d}{median}"
        f"{sum(f.named for f in flown):7d}{honest:5d}/{len(sized):<3d}{airframe:7d}"
    )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--flights", type=int, default=120, help="with a fault, of each aircraft")
    parser.add_argument("--healthy", type=int, default=24, help="healthy ones, of each aircraft")
    parser.add_argument(
        "--seconds",
        type=float,
        default=110.0,
        help="of a flight; healthy ones are thrice as long",
    )
    parser.add_argument("--seed", type=int, default=20261128)
    parser.add_argument("--aircraft", nargs="+", default=["aerosonde", "twinotter", "ultrastick25e"])
    given = parser.parse_args()
    for name in given.aircraft:
        aircraft = load_aircraft(name)
        flown = fly(aircraft, draw(given.flights, given.seed), given.seconds)
        print(f"{name}, seed {given.seed}")
        print(
            f"{'':<34}{'n':>5}{'early':>7}{'seen':>6}{'<= 5 s':>8}{'median s':>8}{'named':>7}{'in 95 %':>9}{'icing':>7}"
        )
        for group in dict.fromkeys(group for group, _ in KINDS.values()):
            print(
                _row(
                    group, [f for f in flown if f.drawn.kind is not None and KINDS[f.drawn.kind][0] == group]
                )
            )
        for air in AIRS:
            print(_row(f"air: {air}", [f for f in flown if f.drawn.air == air]))
        print(_row("all", flown))
        healthy = [
            Drawn(None, None, HEALTHY_AIRS[k % 4], bool(k // 4 % 2), given.seed + 50_000 + k)
            for k in range(given.healthy)
        ]
        for air in HEALTHY_AIRS:
            silent = fly(aircraft, [d for d in healthy if d.air == air], 3.0 * given.seconds)
            wrong = [a for f in silent for a in f.early]
            hours = len(silent) * 3.0 * given.seconds / 3600.0
            print(
                f"healthy, {air:<9} {hours:5.2f} h   false alerts {len(wrong)}  {[(a.cause, a.channel) for a in wrong]}"
            )
        print()


if __name__ == "__main__":
    run_benchmark(main)
