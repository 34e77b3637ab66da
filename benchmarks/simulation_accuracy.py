"""How exactly a flight is integrated: the step that is flown against finer ones, and conservation without forces.

Run: python benchmarks/simulation_accuracy.py
"""

import math

import numpy as np
from numpy.typing import NDArray
from saving import run_benchmark

from wingwatch.aircraft import Aircraft, load_aircraft
from wingwatch.simulation import FleetSimulation, Icing, Scenario, doublet_schedule, patrol
from wingwatch.simulation.dynamics import fly_held, quaternion
from wingwatch.simulation.layout import (
    AREA,
    ELECTRIC,
    INERTIA_X,
    INERTIA_XY,
    INERTIA_XZ,
    INERTIA_Y,
    INERTIA_YZ,
    INERTIA_Z,
    MASS,
    STATE,
    SURFACES,
    THRUST_MAX,
    parameter_row,
)  # fmt: skip
from wingwatch.simulation.prepared import GRAVITY, working_row
from wingwatch.telemetry import CHANNEL_INDEX

Array = NDArray[np.float64]

COLUMNS = (
    "airspeed_true_m_s", "angle_of_attack_rad", "sideslip_rad", "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s",
    "specific_force_y_m_s2", "specific_force_z_m_s2", "roll_rad", "pitch_rad",
)  # fmt: skip
SECONDS = 60.0
FINEST = 16
TUMBLING_S = 600.0


def scenario(aircraft: Aircraft, rough: bool) -> Scenario:
    """A patrol with doublets on top and ice on the way, in calm or rough air."""
    envelope = aircraft.envelope
    assert envelope is not None
    cruise = envelope.cruise
    return Scenario(
        aircraft, cruise.airspeed_true_m_s, cruise.altitude_m, (doublet_schedule(aircraft, cruise, start_s=2.0),),
        effects=(Icing(0.1, 10.0, 30.0),), turbulence="light" if rough else "none", seed=1, noise=False,
        route=patrol(aircraft, cruise),
    )  # fmt: skip


def flight(s: Scenario, refine: int) -> Array:
    return np.asarray(FleetSimulation([s], refine=refine).step(round(SECONDS * 50.0))[0])


def without_rate_limits(aircraft: Aircraft) -> Aircraft:
    """The aircraft with servos that move smoothly."""
    free = {
        surface: actuator.model_copy(update={"rate_limit_rad_s": None})
        for surface in SURFACES
        if (actuator := getattr(aircraft.actuators, surface)) is not None
    }
    return aircraft.model_copy(update={"actuators": aircraft.actuators.model_copy(update=free)})


def convergence(aircraft: Aircraft, rough: bool, note: str = "") -> None:
    s = scenario(aircraft, rough)
    finest = flight(s, FINEST)
    errors = {n: flight(s, n) - finest for n in (1, 2, 4)}
    steps = FleetSimulation([s]).steps_hz[0]
    air = "light turbulence" if rough else "calm air"
    print(f"\n{aircraft.name}{note}, {air}: flown with {steps:g} steps a second")
    print(
        f"{'largest error of':26}{'step flown':>14}{'half':>14}{'quarter':>14}{'order':>8}{'noise':>12}{'of noise':>12}"
    )
    for name in COLUMNS:
        column = CHANNEL_INDEX[name]
        worst = [float(np.abs(errors[n][:, column]).max()) for n in (1, 2, 4)]
        noise = aircraft.sensors.noise_std.get(name)
        order = math.log2(worst[0] / worst[1])
        beside = f"{'':12}{'':12}" if not noise else f"{noise:12.2g}{worst[0] / noise:12.1e}"
        print(f"{name:26}" + "".join(f"{e:14.1e}" for e in worst) + f"{order:8.2f}{beside}")


def tumbling() -> tuple[Array, Array, Array]:
    """A body without forces, its inertia tensor with every product, and its state at 1.7 rad/s."""
    row = parameter_row(load_aircraft("aerosonde"))
    row[AREA] = row[ELECTRIC] = row[THRUST_MAX] = 0.0
    row[INERTIA_XY], row[INERTIA_YZ] = 0.11, -0.07
    ix, iy, iz = row[INERTIA_X], row[INERTIA_Y], row[INERTIA_Z]
    xy, xz, yz = row[INERTIA_XY], row[INERTIA_XZ], row[INERTIA_YZ]
    start = np.zeros(len(STATE))
    start[2], start[3:6], start[10:13] = -1000.0, (20.0, 3.0, -5.0), (0.9, 1.3, -0.7)
    start[6:10] = quaternion(0.4, -0.3, 1.1)
    body = working_row(row)
    body[GRAVITY] = 0.0
    return body, np.array([[ix, -xy, -xz], [-xy, iy, -yz], [-xz, -yz, iz]]), start


def rotation(state: Array) -> Array:
    """Body to earth."""
    q0, q1, q2, q3 = state[6:10]
    return np.array([
        [1 - 2 * (q2**2 + q3**2), 2 * (q1 * q2 - q0 * q3), 2 * (q1 * q3 + q0 * q2)],
        [2 * (q1 * q2 + q0 * q3), 1 - 2 * (q1**2 + q3**2), 2 * (q2 * q3 - q0 * q1)],
        [2 * (q1 * q3 - q0 * q2), 2 * (q2 * q3 + q0 * q1), 1 - 2 * (q1**2 + q2**2)],
    ])  # fmt: skip


def conservation() -> None:
    body, inertia, start = tumbling()
    spinning = float(np.linalg.norm(start[10:13]))
    print(f"\nwithout forces, tumbling at {spinning:.2f} rad/s for {TUMBLING_S:g} s, relative change")
    print(f"{'step':>10}{'energy':>14}{'angular momentum':>20}{'momentum':>14}")
    for step_s in (0.02, 0.01, 0.005, 0.003, 0.0015, 0.001):
        end = start.copy()
        fly_held(body, end, np.zeros(3), 0.0, step_s, round(TUMBLING_S / step_s))
        states = (start, end)
        energy = [0.5 * (s[10:13] @ inertia @ s[10:13] + body[MASS] * s[3:6] @ s[3:6]) for s in states]
        spin = [rotation(s) @ inertia @ s[10:13] for s in states]
        drift = [rotation(s) @ s[3:6] for s in states]
        changes = (
            abs(energy[1] / energy[0] - 1.0),
            float(np.linalg.norm(spin[1] - spin[0]) / np.linalg.norm(spin[0])),
            float(np.linalg.norm(drift[1] - drift[0]) / np.linalg.norm(drift[0])),
        )
        print(f"{step_s * 1e3:8.1f}ms{changes[0]:14.1e}{changes[1]:20.1e}{changes[2]:14.1e}")


def main() -> None:
    print(f"error over {SECONDS:g} s of patrol, doublets and growing ice, against {FINEST} times the steps")
    for name in ("aerosonde", "ultrastick25e", "twinotter"):
        convergence(load_aircraft(name), rough=False)
    smooth = without_rate_limits(load_aircraft("aerosonde"))
    convergence(smooth, rough=False, note=" without its servos' rate limits (a kink in the motion)")
    convergence(load_aircraft("aerosonde"), rough=True)
    conservation()


if __name__ == "__main__":
    run_benchmark(main)
