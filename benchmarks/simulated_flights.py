"""Simulated flights with the autopilot closed, what an estimator may know of the aircraft, and the truth beside it.

What several benchmarks share: how a flight is flown and recorded, how a file's aircraft becomes a misstated one, the
form in which estimators of whole flights are given a flight, and the linearisation that an estimate is held against.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import (
    LATERAL,
    SHORT_PERIOD,
    Aircraft,
    FlightCondition,
    linearised_derivatives,
    trimmed,
)
from wingwatch.estimators import Estimate, FlightForm, InertiaCoupling, offsets
from wingwatch.monitor import VehicleMonitor
from wingwatch.monitor.estimation.chain import Chain, Solution
from wingwatch.simulation import FleetSimulation, Manoeuvre, Scenario, Turbulence
from wingwatch.telemetry import SampleBlock, complete
from wingwatch.telemetry.conditioning import align

Array = NDArray[np.float64]

STRUCTURES = (SHORT_PERIOD, LATERAL)
RATE_HZ = 50
AMPLITUDE_RAD = math.radians(2.0)
PERIOD_S = 20.0
"""Between doublets of the same surface: three in a minute."""
START_OFF = 0.3
Z_95 = 1.959964


def cruise_of(aircraft: Aircraft) -> FlightCondition:
    """The cruise that the file states."""
    if aircraft.envelope is None:
        raise ValueError(f"aircraft {aircraft.name} states no [envelope]; choose one that does")
    return aircraft.envelope.cruise


def fly(
    aircraft: Aircraft,
    manoeuvres: Sequence[Manoeuvre],
    seed: int,
    seconds: float,
    turbulence: Turbulence = "none",
) -> SampleBlock:
    """One flight at cruise, its sensors' stated delays taken out."""
    at = cruise_of(aircraft)
    scenario = Scenario(
        aircraft,
        at.airspeed_true_m_s,
        at.altitude_m,
        tuple(manoeuvres),
        turbulence=turbulence,
        seed=seed,
    )
    values = FleetSimulation([scenario], RATE_HZ).step(round(RATE_HZ * seconds))[0]
    return align(complete(SampleBlock(values)), aircraft.sensors.delay_s)


def misstated(aircraft: Aircraft, seed: int) -> Aircraft:
    """A file whose coefficients of motion and surfaces are ``START_OFF`` too large or too small, by chance."""
    if aircraft.coefficients is None:
        raise ValueError(f"aircraft {aircraft.name} states no [coefficients]; choose one that does")
    rng, tables = np.random.default_rng(seed), {}
    for table in ("CL", "CY", "Cl", "Cm", "Cn"):
        stated = getattr(aircraft.coefficients, table)
        names = [n for n in type(stated).model_fields if n != "zero"]
        off = {n: getattr(stated, n) * (1.0 + START_OFF * rng.choice([-1.0, 1.0])) for n in names}
        tables[table] = stated.model_copy(update=off)
    return aircraft.model_copy(update={"coefficients": aircraft.coefficients.model_copy(update=tables)})


def last_solution(file: Aircraft, block: SampleBlock) -> Solution:
    """What the live chain with an aircraft file says at the end of a flight."""
    chain = Chain(file, block.present, {})
    return list(chain.advance(chain.init(), block))[-1]


def last_estimates(
    aircraft: Aircraft, block: SampleBlock, kinds: Mapping[str, str] | None = None
) -> list[Estimate]:
    """Both online estimators' last estimates of short period and lateral structure, as the service shows them.

    ``kinds``: of the surfaces' channels, where they are commands.
    """
    monitor = VehicleMonitor(aircraft, "default", "uav", block.present, kinds or {}, new_id=lambda: "alert")
    modes = list(monitor.feed(block).solutions)[-1].modes
    return [e for s in STRUCTURES for e in modes[s.name].estimates]


def flight_form(
    aircraft: Aircraft, at: FlightCondition, inertia: InertiaCoupling | None = None, window_s: float = 12.0
) -> FlightForm:
    """What a file tells an estimator of whole flights, referred to a condition."""
    servos = {
        "eta": aircraft.actuators.elevator,
        "xi": aircraft.actuators.aileron,
        "zeta": aircraft.actuators.rudder,
    }
    return FlightForm(
        (at.airspeed_true_m_s, at.air_density_kg_m3),
        imu_position_m=aircraft.sensors.imu_position_m,
        vane_position_m=aircraft.sensors.vane_position_m,
        servo_rad_s={u: 2.0 * math.pi * servo.bandwidth_hz for u, servo in servos.items() if servo},
        window_s=window_s,
        inertia=inertia,
    )


def truth_of(aircraft: Aircraft, estimate: Estimate) -> Array:
    """Linearisation at an estimate's airspeed and density. W in y_p is that of the angle of attack that the estimate
    reports, which gusts take away from the trim's; without vanes it is the trim's."""
    airspeed, altitude, density, alpha = estimate.condition
    at = trimmed(aircraft, FlightCondition(airspeed, altitude, density))
    table = linearised_derivatives(aircraft, at, estimate.structure)
    concise = np.array([table[d] for d in estimate.structure.derivatives])
    seen_at = alpha if math.isfinite(alpha) else at.angle_of_attack_rad
    seen = offsets(estimate.structure, airspeed, seen_at)
    return np.asarray(concise + seen - offsets(estimate.structure, airspeed, at.angle_of_attack_rad))
