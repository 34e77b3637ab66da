"""What is diagnosed: the flight as windows, and the simulation as the aircraft file states it."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.diagnosis.candidate import INDEX, Subject
from wingwatch.diagnosis.linear_aircraft import entry_near, row_of_derivatives
from wingwatch.diagnosis.measured import OUTPUTS, DiagnosisError, MeasuredFlight, measure
from wingwatch.diagnosis.replay import Model
from wingwatch.simulation.layout import parameter_row
from wingwatch.telemetry import SampleBlock

__all__ = ["subject_of"]

Array = NDArray[np.float64]


def subject_of(block: SampleBlock, aircraft: Aircraft, kinds: Mapping[str, str]) -> Subject:
    """The subject of a flight.

    Raises:
        DiagnosisError: a flight or an aircraft file that cannot be replayed.
    """
    for table in ("mass", "geometry"):
        if getattr(aircraft, table) is None:
            raise DiagnosisError(
                f"aircraft {aircraft.name} states no [{table}]; a replay needs it, add that table"
            )
    flight = measure(block, aircraft, kinds)
    row, trims_known = _row(aircraft, flight)
    throttle_known = (
        trims_known and aircraft.propulsion is not None and bool(np.isfinite(_throttle(flight)).all())
    )
    model = Model(row, _sensors(aircraft))
    if not throttle_known:
        _without_thrust(model)
    return Subject(aircraft, flight, model, throttle_known, trims_known)


def _row(aircraft: Aircraft, flight: MeasuredFlight) -> tuple[Array, bool]:
    if aircraft.coefficients is not None:
        return parameter_row(aircraft), True
    entry = entry_near(aircraft, float(np.nanmean(flight.outputs[:, 0])))
    if entry is None:
        raise DiagnosisError(
            f"aircraft {aircraft.name} states neither [coefficients] nor [[conditions]]; there is nothing to simulate"
        )
    return row_of_derivatives(aircraft, entry), False


def _throttle(flight: MeasuredFlight) -> Array:
    return np.concatenate([flight.throttle[w.start : w.stop] for w in flight.windows])


def _without_thrust(model: Model) -> None:
    """Thrust is what a window's own drag makes it."""
    for name in ("electric", "slipstream_share", "thrust_share"):
        model.row[INDEX[name]] = 0.0


def _sensors(aircraft: Aircraft) -> Array:
    """A stated lag counts as a delay of the same size."""
    sensors = np.zeros((len(OUTPUTS), 3))
    for k, name in enumerate(OUTPUTS):
        sensors[k, 0] = aircraft.sensors.lag_s.get(name, 0.0)
    return sensors
