"""Channels that come later than the file says: one, or the inertial sensors together."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.diagnosis.candidate import Candidate, FreeParameter, Subject, output_index, updated
from wingwatch.diagnosis.measured import OUTPUTS
from wingwatch.diagnosis.replay import DELAY, Model
from wingwatch.diagnosis.summary import display

__all__ = ["candidates"]

_DELAY = FreeParameter("delay_s", "s", 0.004, 0.06, 0.003, -0.25, 0.28)
_GROUPS = {"inertial": OUTPUTS[1:9], "imu": OUTPUTS[1:7], "vanes": OUTPUTS[9:11]}
"""Inertial: rates, forces and attitude."""
_WORDS = {
    "inertial": "the inertial sensors are",
    "imu": "gyros and accelerometers are",
    "vanes": "the vanes are",
}


def candidates(subject: Subject) -> list[Candidate]:
    """Each measured channel, and groups of which every channel is measured."""
    found = [_late(name, (name,), 2.0) for name in OUTPUTS[:11] if subject.measures(name)]
    found += [
        _late(group, names, 2.0) for group, names in _GROUPS.items() if all(map(subject.measures, names))
    ]
    return found


def _late(target: str, names: tuple[str, ...], odds: float) -> Candidate:
    columns = [output_index(name) for name in names]

    def change(model: Model, v: NDArray[np.float64]) -> None:
        model.sensors[columns, DELAY] += v[0]

    def mend(aircraft: Aircraft, v: NDArray[np.float64]) -> Aircraft | None:
        delays = dict(aircraft.sensors.delay_s)
        if any(delays.get(name, 0.0) + v[0] < 0.0 for name in names):
            return None
        delays |= {name: delays.get(name, 0.0) + float(v[0]) for name in names}
        return updated(aircraft, sensors=aircraft.sensors.model_dump() | {"delay_s": delays})

    what = _WORDS[target] if target in _WORDS else f"{display(target).name} is"
    says = f"{what} {{0:.3f}} s [later|earlier] than the file says"
    return Candidate("sensor_delay", target, (_DELAY,), change, says, mend, odds)
