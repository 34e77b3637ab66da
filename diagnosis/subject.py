"""What is diagnosed: the flight as windows, and the simulation as the aircraft file states it."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import DUTCH_ROLL, GRAVITY_M_S2, LATERAL, SHORT_PERIOD, Aircraft, Geometry, Mass
from wingwatch.diagnosis.candidate import INDEX, Subject
from wingwatch.diagnosis.linear_aircraft import entry_near, row_of_derivatives
from wingwatch.diagnosis.measured import FORCE_X, OUTPUTS, WINDOW_S, DiagnosisError, MeasuredFlight, measure
from wingwatch.diagnosis.replay import Model
from wingwatch.diagnosis.steady_angle import with_steady_angle
from wingwatch.simulation.layout import parameter_row
from wingwatch.telemetry import SampleBlock

__all__ = ["states_at_rest", "subject_of"]

Array = NDArray[np.float64]

_LONGITUDINAL, _SIDEWAYS, _ROLL = {0, 2, 4, 7}, {1, 3, 5, 6}, {3, 6}
"""Places in ``START``: u, w, q, pitch; v, p, r, roll; p, roll."""
_ROLL_RATE, _PITCH_RATE, _YAW_RATE = (
    OUTPUTS.index(name) for name in ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s")
)


def subject_of(
    block: SampleBlock, aircraft: Aircraft, kinds: Mapping[str, str], window_s: float = WINDOW_S
) -> Subject:
    """The subject of a flight.

    Raises:
        DiagnosisError: a flight or an aircraft file that cannot be replayed.
    """
    stated, aircraft = aircraft, _whole(aircraft)
    flight = measure(block, aircraft, kinds, window_s)
    aircraft = with_steady_angle(aircraft, flight)
    row, followed = _row(aircraft, flight)
    thrust = aircraft.coefficients is not None and aircraft.propulsion is not None
    throttle_known = thrust and bool(np.isfinite(_throttle(flight)).all())
    trims_known = throttle_known  # without thrust no steady flight is simulated
    model = Model(row, _sensors(aircraft))
    if not throttle_known:
        _without_thrust(model)
    return Subject(aircraft, stated, flight, model, throttle_known, trims_known, followed)


_USUAL_LIFT = 0.5
_GYRATION = (0.12, 0.9, 0.18)
"""Radii of gyration in parts of span, chord and span."""


def _lengths(geometry: Geometry) -> tuple[float, float, float]:
    return geometry.span_m, geometry.mean_chord_m, geometry.span_m


def _whole(aircraft: Aircraft) -> Aircraft:
    """With a mass and a geometry: derivatives alone are motion per motion, whatever the mass that goes with them."""
    if aircraft.coefficients is None:
        speed = max((c.airspeed_true_m_s for c in aircraft.conditions), default=25.0)
        span = max(0.15 * speed, 1.0)
        geometry = aircraft.geometry or Geometry(
            wing_area_m2=span**2 / 8.0, span_m=span, mean_chord_m=span / 8.0
        )
        kg = 0.5 * speed**2 * geometry.wing_area_m2 * _USUAL_LIFT / GRAVITY_M_S2
        roll, pitch, yaw = (kg * (a * b) ** 2 for a, b in zip(_GYRATION, _lengths(geometry), strict=True))
        mass = Mass(mass_kg=kg, inertia_x_kg_m2=roll, inertia_y_kg_m2=pitch, inertia_z_kg_m2=yaw)
        return aircraft.model_copy(update={"mass": aircraft.mass or mass, "geometry": geometry})
    for table in ("mass", "geometry"):
        if getattr(aircraft, table) is None:
            raise DiagnosisError(
                f"aircraft {aircraft.name} states no [{table}]; a replay needs it, add that table"
            )
    return aircraft


def states_at_rest(flight: MeasuredFlight) -> set[int]:
    """Places in ``START`` of the axis whose rates never change, which is held at rest; of neither where both move."""
    moves = set(flight.compared)
    if not moves & {_ROLL_RATE, _YAW_RATE}:
        return set(_SIDEWAYS)
    return set(_LONGITUDINAL) if _PITCH_RATE not in moves else set()


def _row(aircraft: Aircraft, flight: MeasuredFlight) -> tuple[Array, tuple[int, ...]]:
    """Parameters, and the states that they have no equations for."""
    resting = states_at_rest(flight)
    if aircraft.coefficients is not None:
        return parameter_row(aircraft), tuple(sorted(resting))
    entry = entry_near(aircraft, flight.airspeed_m_s)
    if entry is None:
        raise DiagnosisError(
            f"aircraft {aircraft.name} states neither [coefficients] nor [[conditions]]; there is nothing to simulate"
        )
    # no such file states a force along x, but its accelerometer may be there
    followed = resting | (set() if FORCE_X in flight.compared else {0})
    if not entry.covers(SHORT_PERIOD):
        followed |= _LONGITUDINAL
    if not entry.covers(LATERAL):
        followed |= _ROLL if entry.covers(DUTCH_ROLL) else _SIDEWAYS
    if followed >= _LONGITUDINAL | _SIDEWAYS:
        raise DiagnosisError(
            f"aircraft {aircraft.name} states no whole structure at {entry.airspeed_true_m_s:g} m/s; give all "
            "derivatives of short_period, lateral or dutch_roll"
        )
    return row_of_derivatives(aircraft, entry), tuple(sorted(followed))


def _throttle(flight: MeasuredFlight) -> Array:
    return np.concatenate([flight.throttle[w.start : w.stop] for w in flight.windows])


def _without_thrust(model: Model) -> None:
    """Thrust is a window's own, through the centre of gravity."""
    for name in ("electric", "slipstream_share", "thrust_max_n", "thrust_line_z_m"):
        model.row[INDEX[name]] = 0.0
    model.row[INDEX["thrust_share"]] = 1.0


def _sensors(aircraft: Aircraft) -> Array:
    """A stated lag counts as a delay of the same size."""
    sensors = np.zeros((len(OUTPUTS), 3))
    for k, name in enumerate(OUTPUTS):
        sensors[k, 0] = aircraft.sensors.lag_s.get(name, 0.0)
    return sensors
