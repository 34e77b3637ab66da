"""Conditioning: what was injected into simulated flights, what was found, and what error was stated for it.

    .venv/bin/python benchmarks/conditioning.py [delays] [path] [gusts] [static] [centre] [--flights 10]

Seeds are fixed. ``scatter`` is the standard deviation over flights, ``z`` the root mean square of misses over stated
errors: 1 where errors tell the truth.
"""

import argparse
import math
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from saving import run_benchmark

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.diagnosis.static_derivatives import static_derivatives
from wingwatch.simulation import (
    CgShift,
    Effect,
    FleetSimulation,
    Route,
    Scenario,
    SensorDelay,
    SensorErrors,
    SensorPosition,
    Turbulence,
    Waypoint,
    doublet_schedule,
    gust_scales,
    multisine,
    patrol,
    trim,
)
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock
from wingwatch.telemetry.conditioning import (
    AirConfig,
    Parameter,
    PathConfig,
    centre_of_gravity,
    estimate_delays,
    estimate_servo_delay,
    imu_separation,
    reconstruct_path,
    steady_segments,
    turbulence_intensity,
)

AIRCRAFT = load_aircraft("aerosonde")
CRUISE = FlightCondition(25.0, 1000.0)
FIRST_SEED = 8000
DELAYS_S = {
    "roll_rad": 0.02, "pitch_rad": 0.04, "heading_rad": 0.1, "angle_of_attack_rad": 0.06,
    "specific_force_z_m_s2": 0.02, "sideslip_rad": 0.04, "altitude_m": 0.2, "elevator_rad": 0.04,
}  # fmt: skip
ERRORS = SensorErrors(
    bias={
        "roll_rate_rad_s": 0.01, "pitch_rate_rad_s": -0.008, "yaw_rate_rad_s": 0.006, "specific_force_x_m_s2": 0.15,
        "specific_force_y_m_s2": -0.1, "specific_force_z_m_s2": 0.2, "angle_of_attack_rad": 0.015,
        "sideslip_rad": -0.02,
    },
    scale={"airspeed_true_m_s": 0.04, "angle_of_attack_rad": 0.1, "sideslip_rad": -0.08},
)  # fmt: skip


def table(title: str, found: Sequence[Sequence[Parameter]], injected: Mapping[str, float]) -> None:
    print(f"\n{title}, {len(found)} flights")
    print(f"  {'':44s}{'injected':>10s}{'found':>11s}{'scatter':>10s}{'stated':>10s}{'z':>7s}")
    for name in dict.fromkeys(p.name for parameters in found for p in parameters):
        observable = [p for parameters in found for p in parameters if p.name == name and p.observable]
        truth = injected.get(name, 0.0)
        if not observable:
            reason = next(p.reason for parameters in found for p in parameters if p.name == name)
            print(f"  {name:44s}{truth:10.4f}  not observable: {reason}")
            continue
        value, error = (
            np.array([p.value for p in observable]),
            np.array([p.standard_error for p in observable]),
        )
        z = float(np.sqrt(np.mean(((value - truth) / error) ** 2)))
        few = "" if len(observable) == len(found) else f"  observable in {len(observable)}"
        print(
            f"  {name:44s}{truth:10.4f}{value.mean():11.5f}{value.std():10.5f}{error.mean():10.5f}{z:7.2f}{few}"
        )


def flown(
    flights: int,
    seconds: float,
    turbulence: Turbulence = "none",
    effects: tuple[Effect, ...] = (),
    errors: SensorErrors | None = None,
    altitude_m: float = 1000.0,
) -> list[SampleBlock]:
    condition = FlightCondition(25.0, altitude_m)
    scenarios = [
        Scenario(
            AIRCRAFT, altitude_m=altitude_m, manoeuvres=(doublet_schedule(AIRCRAFT, condition),), effects=effects,
            turbulence=turbulence, seed=FIRST_SEED + s, sensor_errors=errors or SensorErrors(),
            route=patrol(AIRCRAFT, condition) if altitude_m > 500.0 else None,
        )
        for s in range(flights)
    ]  # fmt: skip
    return [SampleBlock(v) for v in FleetSimulation(scenarios).step(round(50.0 * seconds))]


def delays(flights: int) -> None:
    effects = tuple(SensorDelay(d, target=c) for c, d in DELAYS_S.items())
    actuator = AIRCRAFT.actuators.elevator
    constant = 0.0 if actuator is None else 1.0 / (2.0 * math.pi * actuator.bandwidth_hz)
    injected = {f"delay of {name}": d for name, d in DELAYS_S.items()}
    injected |= {"delay of elevator_rad behind elevator_command_rad": DELAYS_S["elevator_rad"]}
    injected |= {"time constant of elevator": constant}
    levels: tuple[Turbulence, ...] = ("none", "light")
    for level in levels:
        found = [
            estimate_delays(block) + estimate_servo_delay(block, "elevator")
            for block in flown(flights, 120.0, level, effects)
        ]
        table(f"delays in s, patrol with doublets of 120 s, turbulence {level}", found, injected)


def path(flights: int) -> None:
    injected = {f"bias of {c}": v for c, v in ERRORS.bias.items()}
    injected |= {f"scale of {c}": v for c, v in ERRORS.scale.items()}
    levels: tuple[Turbulence, ...] = ("none", "light")
    for level in levels:
        gust = gust_scales(level, 1000.0).sigma_w_m_s if level != "none" else 0.0
        config = PathConfig(noise_std=AIRCRAFT.sensors.noise_std, gust_std_m_s=(gust, gust, gust))
        blocks = flown(flights, 120.0, level, errors=ERRORS)
        reconstruct_path(SampleBlock(blocks[0].values[:100]), config)  # compiles
        start = time.process_time()
        paths = [reconstruct_path(block, config) for block in blocks]
        spent = time.process_time() - start
        table(
            f"flight-path reconstruction, patrol with doublets of 120 s, turbulence {level}",
            [p.parameters for p in paths],
            injected,
        )
        print(f"  hardly distinguished: {sorted({pair for p in paths for pair in p.confounded})}")
        print(f"  CPU time {spent / (2.0 * flights):.2f} s a minute of flight")


def gusts(flights: int) -> None:
    for level, altitude_m in (("none", 1000.0), ("light", 1000.0), ("moderate", 1000.0), ("light", 100.0)):
        name: Turbulence = "light" if level == "light" else "moderate" if level == "moderate" else "none"
        scales = gust_scales(name if name != "none" else "light", altitude_m)
        config = AirConfig(vertical_length_m=scales.length_w_m, lateral_length_m=scales.length_u_m)
        found = [turbulence_intensity(b, config) for b in flown(flights, 120.0, name, altitude_m=altitude_m)]
        injected = (
            {}
            if name == "none"
            else {"vertical gust": scales.sigma_w_m_s, "lateral gust": scales.sigma_u_m_s}
        )
        table(
            f"gusts in m/s, 120 s at {altitude_m:g} m, turbulence {level}", [a.sigma for a in found], injected
        )
        print(f"  {found[0].text}")


def static(flights: int) -> None:
    speeds = (25.0, 20.5, 23.0, 26.0, 29.0, 27.0, 22.0)
    legs = tuple(Waypoint(600.0 * (i + 1), 0.0, 1000.0, v) for i, v in enumerate(speeds))
    scenarios = [
        Scenario(AIRCRAFT, seed=FIRST_SEED + s, route=Route(legs, loops=False)) for s in range(flights)
    ]
    blocks = [SampleBlock(v) for v in FleetSimulation(scenarios).step(50 * 170)]
    points = [trim(AIRCRAFT, FlightCondition(v, 1000.0)) for v in speeds]
    alpha = [p.angle_of_attack_rad for p in points]
    slope, at_zero = np.polyfit(alpha, [p.elevator_rad for p in points], 1)
    mass = AIRCRAFT.need_mass("this benchmark").mass_kg
    area = AIRCRAFT.need_geometry("this benchmark").wing_area_m2
    found = [static_derivatives(steady_segments(b), mass, area) for b in blocks]
    speed = float(np.mean([f.airspeed_m_s for f in found]))
    injected = {"d eta / d alpha": slope, "eta at alpha 0": at_zero, "m_w / m_eta": -slope / speed}
    rows = [(f.elevator_slope, f.elevator_at_zero, f.moment_ratio) for f in found]
    table("static derivatives, legs at 20.5 to 29 m/s, truth from exact trims", rows, injected)


def centre(flights: int) -> None:
    places = ((0.3, 0.0, 0.02), (-0.4, 0.05, -0.03))
    forces = [CHANNEL_INDEX[f"specific_force_{axis}_m_s2"] for axis in "xyz"]
    for shift in (0.0, 0.06):
        rng = np.random.default_rng(FIRST_SEED)
        pair = []
        for place in places:
            effects: tuple[Effect, ...] = tuple(
                SensorPosition(d, target=f"imu_{a}") for a, d in zip("xyz", place, strict=True) if d
            )
            effects += (CgShift(shift),) if shift else ()
            excited = (multisine(AIRCRAFT, math.radians(4.0), period_s=12.0),)
            route = patrol(AIRCRAFT, CRUISE)
            scenarios = [
                Scenario(AIRCRAFT, manoeuvres=excited, effects=effects, noise=False, seed=s, route=route)
                for s in range(flights)
            ]
            pair.append(FleetSimulation(scenarios).step(50 * 200))
        rows = []
        for first, second in zip(*pair, strict=True):
            for name, std in AIRCRAFT.sensors.noise_std.items():
                first[:, CHANNEL_INDEX[name]] += std * rng.standard_normal(len(first))
            other = second[:, forces] + 0.0245 * rng.standard_normal((len(second), 3))
            block = SampleBlock(first)
            rows.append(imu_separation(block, other) + centre_of_gravity(block, places, (other,)))
        apart = np.subtract(places[1], places[0])
        injected = {f"separation {a}": float(d) for a, d in zip("xyz", apart, strict=True)} | {
            "centre x": -shift
        }
        table(f"two IMUs, 200 s of patrol with multisines, c.g. {shift:g} m aft, in m", rows, injected)


PARTS: Mapping[str, Callable[[int], None]] = {
    "delays": delays, "path": path, "gusts": gusts, "static": static, "centre": centre,
}  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description="Conditioning: injected against found.")
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="all where none is named")
    parser.add_argument("--flights", type=int, default=10)
    chosen = parser.parse_args(arguments)
    for name in chosen.parts or PARTS:
        PARTS[name](chosen.flights)
    return 0


if __name__ == "__main__":
    run_benchmark(main)
