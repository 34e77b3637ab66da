"""What sensors make of a flight, in a few lines of numpy: place, scale, delay, bias, noise; and effects on them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from diagnosis_hidden import FORCES, RATES, Array, Hidden
from scipy.interpolate import CubicSpline

from wingwatch.telemetry import CHANNEL_INDEX

__all__ = ["SENSOR_EFFECTS", "Motion", "Recorder", "readings"]

SENSOR_EFFECTS = (
    "sensor_delay", "sensor_bias", "sensor_scale", "sensor_position", "airspeed_error", "vane_upwash",
)  # fmt: skip
_VANES = [CHANNEL_INDEX[name] for name in ("angle_of_attack_rad", "sideslip_rad")]
_RATES, _FORCES = ([CHANNEL_INDEX[name] for name in group] for group in (RATES, FORCES))


@dataclass(frozen=True, slots=True)
class Motion:
    """A flight as it was.

    Attributes:
        table: true flight table, accelerometers at the centre of gravity, (samples, channels).
        spin: dp/dt, dq/dt, dr/dt, rad/s2, (samples, 3).
        air: velocity of the centre of gravity through the air, body axes, m/s, (samples, 3).
        sensors_ahead_m: of all sensors from the centre of gravity, along x body: what it has moved aft of where
            the file has it.
    """

    table: Array
    spin: Array
    air: Array
    sensors_ahead_m: float = 0.0


def readings(
    motion: Motion, effects: Sequence[Hidden], noise_std: Mapping[str, float], rng: np.random.Generator | None
) -> Array:
    """The flight table that is recorded, (samples, channels).

    Args:
        motion: the flight.
        effects: hidden ones; those that are not the sensors' are passed over.
        noise_std: by column.
        rng: of the noise; None for no noise.
    """
    out = motion.table.copy()
    _placed(out, motion, effects)
    for effect in effects:
        if effect.name in SENSOR_EFFECTS and effect.name != "sensor_position":
            _spoil(out, effect)
    if rng is not None:
        for name, std in noise_std.items():
            out[:, CHANNEL_INDEX[name]] += std * rng.standard_normal(len(out))
    return out


def _placed(out: Array, motion: Motion, effects: Sequence[Hidden]) -> None:
    """Accelerometers and vanes where they sit: f + spin x r + rate x (rate x r), v + rate x r."""
    place = {name: np.array([motion.sensors_ahead_m, 0.0, 0.0]) for name in ("imu", "vane")}
    for effect in effects:
        if effect.name == "sensor_position":
            sensor, axis = effect.target.split("_")
            place[sensor]["xyz".index(axis)] += effect.size
    rate = motion.table[:, _RATES]
    if place["imu"].any():
        turning = np.cross(motion.spin, place["imu"]) + np.cross(rate, np.cross(rate, place["imu"]))
        out[:, _FORCES] += turning
    if place["vane"].any():
        u, v, w = (motion.air + np.cross(rate, place["vane"])).T
        out[:, _VANES] = np.stack([np.arctan2(w, u), np.arctan2(v, np.hypot(u, w))], axis=1)


def _spoil(out: Array, effect: Hidden) -> None:
    """One effect on the reading of one column, in place."""
    column = effect.target
    if effect.name == "airspeed_error":
        column = "airspeed_true_m_s"
    elif effect.name == "vane_upwash":
        column = f"{effect.target}_rad"
    reading = out[:, CHANNEL_INDEX[column]]
    if effect.name == "sensor_delay":
        time_s = out[:, 0]
        late = CubicSpline(time_s, reading)(np.maximum(time_s - effect.size, time_s[0]))
        out[:, CHANNEL_INDEX[column]] = late
    elif effect.name == "sensor_bias":
        reading += effect.size
    else:
        reading *= 1.0 + effect.size


class Recorder:
    """Flight tables of one plan; what its sensors alone suffer is put on a flight that was flown before.

    Args:
        fly: the flight with effects (those that are not the sensors'), of the case (0) or held out (1), in still air or
            not; None where it cannot be flown.
        seed: of the noise.
        noise_std: by column.
        still: whether the plan's air is still anyway.
    """

    def __init__(
        self,
        fly: Callable[[tuple[Hidden, ...], int, bool], Motion | None],
        seed: int,
        noise_std: Mapping[str, float],
        still: bool,
    ) -> None:
        self._fly, self._seed, self._noise_std, self._still = fly, seed, noise_std, still
        self._flown: dict[tuple[tuple[Hidden, ...], int, bool], Motion | None] = {}

    def motion(self, effects: Sequence[Hidden], which: int, ideal: bool = False) -> Motion | None:
        """A flight; ``ideal`` in still air."""
        key = (tuple(e for e in effects if e.name not in SENSOR_EFFECTS), which, ideal or self._still)
        if key not in self._flown:
            self._flown[key] = self._fly(*key)
        return self._flown[key]

    def table(self, effects: Sequence[Hidden], which: int, ideal: bool = False) -> Array | None:
        """What is recorded of it, (samples, channels); ``ideal`` without noise."""
        motion = self.motion(effects, which, ideal)
        chance = None if ideal else np.random.default_rng([self._seed, 6, which])
        return None if motion is None else readings(motion, effects, self._noise_std, chance)
