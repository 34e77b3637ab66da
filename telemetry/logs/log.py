"""An autopilot's log as every reader hands it on: topics with stamps of their own, parameters, what was lost."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["AutopilotLog", "Columns", "LogError", "Topic", "topic_key"]

Array = NDArray[np.float64]

_LARGEST = 1e6


class LogError(ValueError):
    """An autopilot log that cannot be read or holds no flight; one sentence."""


def topic_key(name: str, instance: int) -> str:
    """What a topic is called in expressions: ``IMU[0]``."""
    return f"{name}[{instance}]"


class Columns(Mapping[str, Array]):
    """Columns kept as the file has them and given as float64 in their unit each time one is asked for.

    A log is mostly what nobody asks for, and a column of single bytes is eight times as large in float64.

    Args:
        kept: numeric columns by name, of one length.
        units: by name, what a column is multiplied with; 1 where not named.
    """

    def __init__(self, kept: Mapping[str, NDArray[Any]], units: Mapping[str, float] | None = None) -> None:
        self._kept, self._units = kept, units or {}

    def __getitem__(self, name: str) -> Array:
        column = np.asarray(self._kept[name], dtype=np.float64)
        unit = self._units.get(name, 1.0)
        return column if unit == 1.0 else column * unit

    def __iter__(self) -> Iterator[str]:
        return iter(self._kept)

    def __len__(self) -> int:
        return len(self._kept)


@dataclass(frozen=True, slots=True)
class Topic:
    """Messages of one name and one instance.

    Attributes:
        name: of the message, such as ``IMU`` or ``vehicle_attitude``.
        instance: 0 where the log tells none apart.
        time_s: stamps on the clock since boot as the file has them, in the order of the file, shape (messages,).
        fields: numeric fields by name, an array's elements as ``xyz[0]``, each of shape (messages,), float64.
    """

    name: str
    instance: int
    time_s: Array
    fields: Mapping[str, Array]

    @property
    def key(self) -> str:
        """Name and instance as expressions write them."""
        return topic_key(self.name, self.instance)

    def __len__(self) -> int:
        return int(self.time_s.size)


@dataclass(frozen=True, slots=True)
class AutopilotLog:
    """A whole log.

    Attributes:
        source: the file.
        format: ``ulog``, ``dataflash``, ``dataflash-text``, ``tlog`` or ``mcap``.
        autopilot: ``px4``, ``ardupilot`` or empty where the log does not say.
        vehicle: ``fixed wing``, ``multicopter``, ``vtol``, another word, or empty where the log does not say.
        firmware: the autopilot's own words about itself.
        topics: by ``topic_key``.
        parameters: the autopilot's, as last set.
        notes: what was lost or doubtful, one clause each.
    """

    source: str
    format: str
    autopilot: str
    vehicle: str
    firmware: str
    topics: Mapping[str, Topic]
    parameters: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def number(self, parameter: str, otherwise: int = 0) -> int:
        """A parameter that counts or names something; what it is otherwise where absent or no such number."""
        value = self.parameters.get(parameter, float(otherwise))
        return int(value) if abs(value) < _LARGEST else otherwise

    def get(self, name: str, instance: int = 0) -> Topic | None:
        """A topic, None where the log has none."""
        return self.topics.get(topic_key(name, instance))
