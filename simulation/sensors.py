"""What the sensors make of a flight, column by column.

The order, for every column: the place (the flown table has specific forces at the IMU's and flow angles at the
vane's place), first-order lag, second-order lag, delay, gain (scale error, vane upwash, faults), bias, white noise,
rounding to the resolution, the column's own rate, freezing, dropouts. Gain follows lag and delay because that is how a
fault is defined (``SensorFault``); a constant gain commutes with both. Angles that leap by a turn (roll, heading) are
lagged and delayed along the shorter way and end in [-pi, pi].
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from wingwatch.simulation.effects import Effect, SensorFault, freeze_s
from wingwatch.simulation.random_numbers import random_streams
from wingwatch.simulation.scenario import Scenario
from wingwatch.simulation.sensor_errors import NAVIGATION, READINGS
from wingwatch.simulation.sensor_kernels import (
    ENTRY,
    FAULT,
    LAG_STATES,
    MEMORY,
    SensorState,
    SensorTable,
    read_sensors,
)
from wingwatch.telemetry import CHANNEL_INDEX

__all__ = ["Sensors", "lag_filter"]

_ANGLES = ("roll_rad", "heading_rad")
_Lag = tuple[float, float, float]
"""Time constant in s (0: none), natural frequency in rad/s (0: none), damping ratio."""
_NO_LAG: _Lag = (0.0, 0.0, 0.0)


@lru_cache(maxsize=256)
def lag_filter(
    lag_s: float, natural_frequency_rad_s: float, damping_ratio: float, step_s: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """A first-order lag, then a second-order one, exactly discrete for an input that is linear between samples.

    The state is (z, x, x'/w): lag_s z' = u - z; x'' = w^2 (z - x) - 2 D w x'. Without the first x follows u, without
    the second z is what is read; either is absent where its number is 0.

    Returns:
        Phi (3, 3), and gains of the older and of the newer input (3,): z' = Phi z + older u + newer u', from the
        exponential of the system extended by u and its rate.
    """
    w, damping = natural_frequency_rad_s, damping_ratio
    system = np.zeros((LAG_STATES + 2, LAG_STATES + 2))
    if lag_s > 0.0:
        system[0, 0], system[0, 3] = -1.0 / lag_s, 1.0 / lag_s
    if w > 0.0:
        system[1, 2] = w
        system[2, 0 if lag_s > 0.0 else 3] = w
        system[2, 1:3] = -w, -2.0 * damping * w
    system[3, 4] = 1.0 / step_s
    grown = np.asarray(expm(step_s * system), dtype=np.float64)[:LAG_STATES]
    newer = grown[:, 4]
    return grown[:, :LAG_STATES], grown[:, 3] - newer, newer


class Sensors:
    """The sensors of a fleet, from each scenario's aircraft file, ``sensor_errors`` and effects.

    A flight's readings depend on its scenario and generator, not on its neighbours nor on how it is cut into steps; its
    white noise, its turn-on biases and its dropouts are independent of one another. The navigation receiver's noise is
    drawn from a generator spawned from the vehicle's, which takes no number from that.

    Args:
        scenarios: one a vehicle; ``noise`` false leaves out white noise alone.
        generators: one a vehicle, consumed here.
        rate_hz: samples a second.

    Raises:
        ValueError: an effect on the sensor of a column that is not simulated.
    """

    def __init__(
        self, scenarios: Sequence[Scenario], generators: Sequence[np.random.Generator], rate_hz: float
    ) -> None:
        noise, chance = random_streams(generators), random_streams(generators)
        navigation = random_streams([g.spawn(1)[0] for g in generators])
        self._rate_hz = float(rate_hz)
        self._samples = 0
        columns = [_columns(s) for s in scenarios]
        turned_on = [_turn_on(s, g) for s, g in zip(scenarios, generators, strict=True)]
        self._table = _table(scenarios, columns, turned_on, self._rate_hz)
        n, width = self._table.entries.shape[:2]
        self._state = SensorState(
            noise=np.stack([noise, navigation], axis=1),
            chance=chance,
            memory=np.zeros((n, width, len(MEMORY))),
            ring=np.zeros(_ring_length(self._table.entries)),
            missing=np.zeros((n, 1 + width), dtype=np.bool_),
        )

    def read(self, values: NDArray[np.float64]) -> None:
        """True columns, shape (vehicles, samples, channels), become what the sensors report, in place.

        Consecutive calls are consecutive pieces of the flight.
        """
        read_sensors(values, self._samples, self._rate_hz, self._table, self._state)
        self._samples += values.shape[1]


def _columns(scenario: Scenario) -> list[str]:
    """Columns that are not simply true, in the order of the flight table."""
    stated, errors = scenario.aircraft.sensors, scenario.sensor_errors
    named: set[str] = {fault.column for _, fault in _faults(scenario.effects)}
    named.update(stated.second_order)
    tables: list[Mapping[str, float]] = [
        stated.delay_s, stated.lag_s, stated.resolution, stated.rate_hz, stated.noise_std if scenario.noise else {},
        errors.bias, errors.bias_std, errors.scale, errors.vane_upwash, errors.column_dropout_fraction,
    ]  # fmt: skip
    for table in tables:
        named.update(c for c, value in table.items() if value != 0.0)
    return [c for c in READINGS if c in named]


def _faults(effects: Iterable[Effect]) -> list[tuple[Effect, SensorFault]]:
    """Every fault with its effect."""
    found = []
    for effect in effects:
        for fault in effect.sensor_faults():
            if fault.column not in READINGS:
                raise ValueError(
                    f"{effect.name} acts on the sensor of {fault.column!r}, which is not simulated; "
                    f"give one of {', '.join(READINGS)}"
                )
            found.append((effect, fault))
    return found


def _turn_on(scenario: Scenario, generator: np.random.Generator) -> dict[str, float]:
    """Turn-on biases; a number for every column of ``READINGS``, so that none depends on which others have one."""
    std = scenario.sensor_errors.bias_std
    if not std:
        return {}
    drawn = dict(zip(READINGS, generator.standard_normal(len(READINGS)).tolist(), strict=True))
    return {column: std[column] * drawn[column] for column in std}


def _lag(scenario: Scenario, column: str) -> _Lag:
    stated = scenario.aircraft.sensors
    second = stated.second_order.get(column)
    if second is None:
        return stated.lag_s.get(column, 0.0), 0.0, 0.0
    frequency = 2.0 * math.pi * second.natural_frequency_hz
    return stated.lag_s.get(column, 0.0), frequency, second.damping_ratio


def _table(
    scenarios: Sequence[Scenario],
    columns: Sequence[list[str]],
    turned_on: Sequence[dict[str, float]],
    rate_hz: float,
) -> SensorTable:
    n, width = len(scenarios), max((len(c) for c in columns), default=0)
    fault_rows = [_fault_rows(s, c, rate_hz) for s, c in zip(scenarios, columns, strict=True)]
    entries, dropout = np.zeros((n, width, len(ENTRY))), np.zeros((n, 1 + width, 3))
    faults = np.full((n, max((len(f) for f in fault_rows), default=0), len(FAULT)), -1.0)
    lags: dict[_Lag, int] = {}
    for i, (scenario, names) in enumerate(zip(scenarios, columns, strict=True)):
        faults[i, : len(fault_rows[i])] = fault_rows[i]
        dropout[i, : 1 + len(names)] = _dropout_rows(scenario, names, rate_hz)
        for j, name in enumerate(names):
            entry = _entry(scenario, name, rate_hz)
            lag = _lag(scenario, name)
            entry["lag"] = -1 if lag == _NO_LAG else lags.setdefault(lag, len(lags))
            entry["bias"] += turned_on[i].get(name, 0.0)
            entries[i, j] = [entry.get(number, 0.0) for number in ENTRY]
    _lay_rings(entries, faults)
    filters = [np.column_stack(lag_filter(*lag, 1.0 / rate_hz)) for lag in lags]
    return SensorTable(
        entry_count=np.array([len(c) for c in columns], dtype=np.int64),
        entries=entries,
        faults=faults,
        dropout=dropout,
        lags=np.array(filters).reshape(-1, LAG_STATES, LAG_STATES + 2),
    )


def _entry(scenario: Scenario, column: str, rate_hz: float) -> dict[str, float]:
    """Numbers of ``ENTRY``, zero where not named."""
    stated, errors = scenario.aircraft.sensors, scenario.sensor_errors
    own_hz = stated.rate_hz.get(column, rate_hz)
    return {
        "column": CHANNEL_INDEX[column],
        "angle": column in _ANGLES,
        "output": column in stated.second_order,
        "delay": stated.delay_s.get(column, 0.0) * rate_hz,
        "gain": (1.0 + errors.scale.get(column, 0.0)) * (1.0 + errors.vane_upwash.get(column, 0.0)),
        "bias": errors.bias.get(column, 0.0),
        "noise_std": stated.noise_std.get(column, 0.0) if scenario.noise else 0.0,
        "stream": column in NAVIGATION,
        "resolution": stated.resolution.get(column, 0.0),
        "rate_hz": own_hz if own_hz < rate_hz else 0.0,
        "held": errors.slow_columns == "held",
        "freeze_s": freeze_s(scenario.effects, column),
    }


def _fault_rows(scenario: Scenario, columns: list[str], rate_hz: float) -> NDArray[np.float64]:
    """All but those that freeze, shape (faults, FAULT)."""
    rows = [
        (
            columns.index(f.column), f.bias, f.scale, f.delay_s * rate_hz,
            effect.size, effect.onset_s, effect.ramp_s,
        )
        for effect, f in _faults(scenario.effects)
        if not f.frozen
    ]  # fmt: skip
    return np.array(rows, dtype=np.float64).reshape(-1, len(FAULT))


def _dropout_rows(scenario: Scenario, columns: list[str], rate_hz: float) -> NDArray[np.float64]:
    """Fraction f, chance to begin and chance to end at a sample, of whole samples and of each column; (1 + columns, 3).

    Dropouts of m samples on average end with 1/m; f = begin / (begin + end). Losses independent of one another last
    1/(1 - f) samples on average, and none are made shorter.
    """
    errors = scenario.sensor_errors
    fraction = np.array(
        [errors.dropout_fraction, *(errors.column_dropout_fraction.get(c, 0.0) for c in columns)]
    )
    end = 1.0 / np.maximum(errors.dropout_length_s * rate_hz, 1.0 / (1.0 - fraction))
    return np.stack([fraction, end * fraction / (1.0 - fraction), end], axis=1)


def _lay_rings(entries: NDArray[np.float64], faults: NDArray[np.float64]) -> None:
    """Mark faulty and delayed entries and give each delayed one its piece of the ring.

    A piece is as long as the longest delay that the entry's faults can grow to.
    """
    longest = entries[:, :, ENTRY.index("delay")].copy()
    vehicles, rows = np.nonzero(faults[:, :, 0] >= 0.0)
    acting = faults[vehicles, rows]
    entry = acting[:, 0].astype(np.int64)
    np.add.at(longest, (vehicles, entry), np.maximum(acting[:, 3] * acting[:, 4], 0.0))
    entries[vehicles, entry, ENTRY.index("faulty")] = 1.0
    delayed = longest > 0.0
    lengths = np.where(delayed, 2.0 ** np.ceil(np.log2(np.floor(longest) + 2.0)), 0.0)
    entries[:, :, ENTRY.index("delayed")] = delayed
    entries[:, :, ENTRY.index("ring_mask")] = np.where(delayed, lengths - 1.0, 0.0)
    entries[:, :, ENTRY.index("ring_start")] = (np.cumsum(lengths) - lengths.ravel()).reshape(lengths.shape)


def _ring_length(entries: NDArray[np.float64]) -> int:
    mask, delayed = entries[:, :, ENTRY.index("ring_mask")], entries[:, :, ENTRY.index("delayed")]
    return int(np.sum((mask + 1.0) * delayed))
