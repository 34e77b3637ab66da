"""Inertial sensors or vanes that do not sit where the file says."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.diagnosis.candidate import INDEX, Candidate, FreeParameter, Subject, updated
from wingwatch.diagnosis.replay import Model

__all__ = ["candidates"]

_OF = {"imu": "the accelerometers", "vane": "the vanes"}


def candidates(subject: Subject) -> list[Candidate]:
    """Along each axis; the vanes' along y turns nothing that is measured."""
    span = subject.aircraft.need_geometry("diagnosis").span_m
    vanes = subject.measures("angle_of_attack_rad") or subject.measures("sideslip_rad")
    places = ["imu_x", "imu_y", "imu_z", *(("vane_x", "vane_y", "vane_z") if vanes else ())]
    return [_moved(place, span) for place in places]


def _moved(place: str, span: float) -> Candidate:
    sensor, axis = place.split("_")
    column = INDEX[f"{place}_m"]

    def change(model: Model, v: NDArray[np.float64]) -> None:
        model.row[column] += v[0]

    def mend(aircraft: Aircraft, v: NDArray[np.float64]) -> Aircraft | None:
        key = f"{sensor}_position_m"
        position = list(getattr(aircraft.sensors, key))
        position["xyz".index(axis)] += float(v[0])
        return updated(aircraft, sensors=aircraft.sensors.model_dump() | {key: position})

    where = {"x": "[forward|aft]", "y": "to the [right|left]", "z": "[down|up]"}[axis]
    parameter = FreeParameter("distance_m", "m", 0.01 * span, 0.2 * span, 0.005 * span, -100.0, 100.0)
    says = f"{_OF[sensor]} sit {{0:.2f}} m further {where} than the file says"
    return Candidate("sensor_position", place, (parameter,), change, says, mend)
