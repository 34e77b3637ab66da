"""How rough the air was in the last whole half minute of the samples' own clock."""

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock
from wingwatch.telemetry.conditioning import GUST_CHANNELS, VANES, AirConfig, AirQuality, turbulence_intensity

__all__ = ["AirState", "AirWatch", "PendingAir"]

Array = NDArray[np.float64]

WINDOW_S = 30.0
"""Long enough to tell a gust's strength to about 5 %: some 350 bins between 0.1 and 12 Hz."""

_MOST_ROWS = 6000
"""The window at 200 Hz; of faster samples a shorter one is kept."""

_LEAST_ROWS = 250
"""The window at about 8 Hz; slower samples do not reach the band of the modes (0.5 to 3 Hz) with room to spare."""

_KEPT = (*GUST_CHANNELS, *VANES)
_INDEX = np.array([CHANNEL_INDEX[name] for name in _KEPT])


@dataclass(slots=True)
class AirState:
    """The last rows and what was found in them; how they were cut into messages leaves no trace."""

    pieces: deque[tuple[Array, NDArray[np.float32]]] = field(default_factory=deque)
    """Stamps and rows, a piece from each look to the next."""
    growing: bool = False
    """Whether the last piece ends with the last sample, not with a look."""
    next_look_s: float = float("nan")
    window: tuple[Array, NDArray[np.float32]] | None = None
    """Stamps and rows of the last whole half minute, until somebody asks what its air was like."""
    found: AirQuality | None = None
    """What was found when somebody asked."""


@dataclass(frozen=True, slots=True)
class PendingAir:
    """A half minute whose air nobody has asked for yet.

    Measuring takes milliseconds and changes nothing, so it needs no lock; ``keep`` does.

    Attributes:
        config: what is supposed of the air.
        state: that the window is of.
        window: stamps (n,), s, and rows (n, channels) of ``_KEPT``.
    """

    config: AirConfig
    state: AirState
    window: tuple[Array, NDArray[np.float32]]

    def measure(self) -> AirQuality | None:
        """What the air was like; None where a channel is missing, or the window is torn by gaps."""
        stamps, rows = self.window
        if len(stamps) < _LEAST_ROWS:
            return None
        there = {"time_s": stamps} | dict(zip(_KEPT, rows.T.astype(np.float64), strict=True))
        try:
            return turbulence_intensity(SampleBlock.from_columns(there), self.config)
        except ValueError:
            return None

    def keep(self, found: AirQuality | None) -> None:
        """This is what was found, unless another half minute is over by now."""
        if self.state.window is self.window:
            self.state.found, self.state.window = found, None


class AirWatch:
    """Measures the gusts of one aircraft's air (``turbulence_intensity``).

    Args:
        aircraft: places of its vane and accelerometers.
    """

    def __init__(self, aircraft: Aircraft) -> None:
        sensors = aircraft.sensors
        self._config = AirConfig(
            vane_position_m=sensors.vane_position_m, imu_position_m=sensors.imu_position_m
        )

    def take(self, state: AirState, values: Array) -> None:
        """Remember clean samples, shape (n, columns), as far as the window may reach."""
        stamps, rows = (
            values[:, CHANNEL_INDEX["time_s"]].copy(),
            values[:, _INDEX].astype(np.float32, order="C"),
        )
        if state.growing:
            before = state.pieces.pop()
            stamps, rows = np.concatenate([before[0], stamps]), np.concatenate([before[1], rows])
        state.pieces.append((stamps[-_MOST_ROWS:], rows[-_MOST_ROWS:]))
        state.growing = True

    def look(self, state: AirState, time_s: float) -> None:
        """At a solution's time: put the last half minute by when it is due."""
        state.growing = False
        _forget(state.pieces, time_s - WINDOW_S)
        due_s = state.next_look_s - time_s
        if not -WINDOW_S < due_s <= WINDOW_S:  # the first, or after a jump of the clock
            state.next_look_s = time_s + WINDOW_S
            state.window = state.found = None
        elif due_s <= 1e-6:
            state.next_look_s += WINDOW_S
            stamps = np.concatenate([piece[0] for piece in state.pieces])
            rows = np.concatenate([piece[1] for piece in state.pieces])
            with np.errstate(invalid="ignore"):
                inside = (stamps > time_s - WINDOW_S - 1e-6) & (stamps <= time_s)
                later = stamps > state.next_look_s - WINDOW_S - 1e-6  # no other is looked at again
            state.pieces = deque([(stamps[later], rows[later])] if later.any() else [])
            state.window, state.found = (stamps[inside], rows[inside]), None

    def quality(self, state: AirState) -> AirQuality | None:
        """The air of the last whole half minute, worked out when it is asked for first.

        None before the first, or where a channel that this needs has no readings.
        """
        if (pending := self.pending(state)) is not None:
            pending.keep(pending.measure())
        return state.found

    def pending(self, state: AirState) -> PendingAir | None:
        """The last whole half minute, where its air has not been measured yet."""
        return None if state.window is None else PendingAir(self._config, state, state.window)


def _forget(pieces: deque[tuple[Array, NDArray[np.float32]]], before_s: float) -> None:
    """Drop the first pieces that end before that time, or that are more than is kept."""
    rows = sum(map(len, next(zip(*pieces, strict=True), ())))
    while len(pieces) > 1 and (rows - len(pieces[0][0]) >= _MOST_ROWS or pieces[0][0][-1] < before_s):
        rows -= len(pieces.popleft()[0])
