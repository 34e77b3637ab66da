"""Manoeuvres: windows of a flight without gaps, as the estimators that work on files read them.

Derivatives are common to all manoeuvres of a call, whether of one flight or of several; trim, drift, biases and
initial states belong to each. A long flight is cut into windows, for its trim changes on the way.
"""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.structures import ModeStructure
from wingwatch.estimators.signals import SignalLayout
from wingwatch.telemetry import MAX_GAP_S

__all__ = [
    "FlightColumns",
    "Manoeuvre",
    "ManoeuvreConfig",
    "cut",
    "manoeuvres",
    "signal_columns",
]

Array = NDArray[np.float64]

_COLUMNS = ("states", "accelerometer", "inputs", "known", "rest", "stability", "control", "pressure")

_JITTER = 1e-3
"""Fraction of a step by which stamps may deviate and still count as evenly spaced."""


@dataclass(frozen=True, slots=True)
class ManoeuvreConfig:
    """How signal rows are cut into manoeuvres, and what all of them share.

    Attributes:
        structure: which mode.
        reference: (airspeed_true_m_s, air_density_kg_m3) to which derivatives are referred.
        held: for each input, whether it is held between samples (a command) or moves on a line (a position).
        imu_position_m: (x, y, z) of the accelerometer from the c.g., body axes.
        window_s: longest manoeuvre; longer windows are cut into equal parts.
        shortest_s: windows below this are left out.
        use_accelerometer: whether force equations may rest on the accelerometer.
        lever_m: an accelerometer reads its equation's force less lever times state derivatives (7.1, 7.3),
            (equations, states).
    """

    structure: ModeStructure
    reference: tuple[float, float]
    held: tuple[bool, ...] = ()
    imu_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    window_s: float = 12.0
    shortest_s: float = 2.0
    use_accelerometer: bool = True
    lever_m: Array = field(init=False)

    def __post_init__(self) -> None:
        s = self.structure
        if not self.held:
            object.__setattr__(self, "held", (False,) * len(s.inputs))
        if len(self.held) != len(s.inputs):
            raise ValueError(f"held has {len(self.held)} entries; {s.name} has {len(s.inputs)} inputs")
        if not 0.0 < self.shortest_s <= self.window_s:
            raise ValueError(
                f"shortest_s is {self.shortest_s}, window_s {self.window_s}; give 0 < shortest_s <= window_s"
            )
        x, y, z = self.imu_position_m
        arms = {"x": {"q": -z, "r": y}, "y": {"p": z, "r": -x}, "z": {"p": -y, "q": x}}
        lever = [[arms.get(row, {}).get(state, 0.0) for state in s.states] for row in s.equations]
        object.__setattr__(self, "lever_m", np.array(lever))


@dataclass(frozen=True, slots=True)
class Manoeuvre:
    """One window of n samples of dx/dt = (known + aerodynamics) x + ..., in the order of the structure.

    Attributes:
        config: shared by all manoeuvres of a call.
        time_s: (n,), increasing.
        states: measured, (n, states).
        accelerometer: of each equation, m/s2, (n, equations); NaN where there is none, as for moments.
        inputs: (n, inputs), rad.
        known: kinematic part of A, (n, states, states): U in the column of q, and so on.
        rest: part of dx/dt that is known from measurement, (n, states): gravity above all, and in the rows of the rates
            inertia coupling.
        stability, control: factor from referred to present derivatives, (n,) each.
        pressure: dynamic pressure over that of the reference, (n,).
        measured: (states,), whether each state was measured (a reconstructed velocity is not).
        condition: mean airspeed_true_m_s, altitude_m, air_density_kg_m3, angle_of_attack_rad.
    """

    config: ManoeuvreConfig
    time_s: Array
    states: Array
    accelerometer: Array
    inputs: Array
    known: Array
    rest: Array
    stability: Array
    control: Array
    pressure: Array
    measured: NDArray[np.bool_]
    condition: tuple[float, float, float, float]

    def __len__(self) -> int:
        return int(self.time_s.size)

    @property
    def dt(self) -> float:
        """Mean step, s."""
        return float(self.time_s[-1] - self.time_s[0]) / (len(self) - 1)

    @property
    def duration_s(self) -> float:
        """From the first to the last stamp."""
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def forces(self) -> NDArray[np.bool_]:
        """Which equations can rest on an accelerometer, (equations,)."""
        whole = np.isfinite(self.accelerometer).all(axis=0)
        return np.asarray(whole & self.config.use_accelerometer)

    @property
    def regressors(self) -> Array:
        """Columns that the referred derivatives multiply, (n, states + inputs): scaled states, inputs; SI units."""
        return np.column_stack([self.states * self.stability[:, None], self.inputs * self.control[:, None]])

    @property
    def regressor_scale(self) -> Array:
        """Mean factor of each column of ``regressors``, (states + inputs,), a ratio to the reference condition."""
        means = float(self.stability.mean()), float(self.control.mean())
        return np.repeat(means, [self.states.shape[1], self.inputs.shape[1]])

    @property
    def held_steps(self) -> NDArray[np.bool_]:
        """Whether each input is held over each step, (n - 1, inputs): commands, and positions that stood still."""
        steps = np.tile(np.array(self.config.held), (len(self) - 1, 1))
        steps[1:] |= self.inputs[1:-1] == self.inputs[:-2]
        return steps

    def even(self) -> "Manoeuvre":
        """The manoeuvre on evenly spaced stamps: itself where they are even already, else interpolated on a line."""
        n, t = len(self), self.time_s
        grid = np.linspace(t[0], t[-1], n)
        if np.abs(t - grid).max() <= _JITTER * self.dt:
            return self
        return self.on(grid)

    def on(self, grid: Array) -> "Manoeuvre":
        """The manoeuvre at other stamps (m,), every column on a line between its samples."""
        columns = {}
        for name in _COLUMNS:
            values = getattr(self, name)
            flat = [np.interp(grid, self.time_s, c) for c in values.reshape(len(self), -1).T]
            columns[name] = np.column_stack(flat).reshape(grid.size, *values.shape[1:])
        return Manoeuvre(self.config, grid, measured=self.measured, condition=self.condition, **columns)


@dataclass(frozen=True, slots=True)
class FlightColumns:
    """A whole flight as the columns of its manoeuvres, (n, ...) each as in ``Manoeuvre``.

    Attributes:
        measured: (n, states), whether a state was measured in that sample.
        condition: (n, 4): airspeed_true_m_s, altitude_m, air_density_kg_m3, angle_of_attack_rad.
    """

    time_s: Array
    states: Array
    accelerometer: Array
    inputs: Array
    known: Array
    rest: Array
    stability: Array
    control: Array
    pressure: Array
    measured: NDArray[np.bool_]
    condition: Array

    def rows(self, which: slice | NDArray[np.bool_]) -> "FlightColumns":
        """Some of the samples: a slice, or a mask of shape (samples,)."""
        return FlightColumns(*(getattr(self, name)[which] for name in self.__dataclass_fields__))


def manoeuvres(config: ManoeuvreConfig, signals: Array) -> tuple[Manoeuvre, ...]:
    """Cut signal rows of one flight into manoeuvres.

    Args:
        config: what they share; its structure one of those that ``Signals`` knows.
        signals: shape (samples, columns) as ``Signals`` lays them out; rows that are not finite are left out.

    Returns:
        none where the flight has no window of ``shortest_s``.

    Raises:
        ValueError: another shape.
    """
    layout = SignalLayout(len(config.structure.states), len(config.structure.inputs))
    if signals.ndim != 2 or signals.shape[1] != layout.columns:
        raise ValueError(f"signals have shape (samples, {layout.columns}), got {signals.shape}")
    return cut(config, signal_columns(config.structure, config.reference, signals))


def cut(config: ManoeuvreConfig, flight: FlightColumns) -> tuple[Manoeuvre, ...]:
    """Cut a flight at gaps, where a state begins or ends to be measured, and into windows.

    Samples without all states, inputs and conditions are left out; none comes back where no window has
    ``shortest_s``. Where forward velocity is a state, what airspeed does to the forces is in its column: the scales are
    then those of each manoeuvre's mean, and its trim does not follow the dynamic pressure.
    """
    needed = np.column_stack(
        [flight.time_s, flight.states, flight.inputs, flight.rest, flight.stability, flight.control,
         flight.pressure, flight.condition[:, :3]]
    )  # fmt: skip
    finite = np.isfinite(needed).all(axis=1) & np.isfinite(flight.known).all(axis=(1, 2))
    whole = flight.rows(np.asarray(finite))
    step = np.diff(whole.time_s)
    changed = (np.diff(whole.measured, axis=0)).any(axis=1)
    cuts = [0, *(np.flatnonzero((step <= 0.0) | (step > MAX_GAP_S) | changed) + 1), whole.time_s.size]
    parts: list[Manoeuvre] = []
    for start, end in pairwise(cuts):
        if end - start < 2:
            continue
        count = int(np.ceil((whole.time_s[end - 1] - whole.time_s[start]) / config.window_s - 1e-9))
        edges = np.linspace(start, end, max(count, 1) + 1).astype(int)
        for a, b in pairwise(edges):
            duration = whole.time_s[b - 1] - whole.time_s[a]
            if b - a > 8 and duration >= config.shortest_s - 1e-9:
                parts.append(_manoeuvre(config, whole.rows(slice(a, b))))
    return tuple(parts)


def _manoeuvre(config: ManoeuvreConfig, rows: FlightColumns) -> Manoeuvre:
    columns = {name: getattr(rows, name).copy() for name in _COLUMNS}
    if "u" in config.structure.states:
        for name in ("stability", "control"):
            columns[name][:] = columns[name].mean()
        columns["pressure"][:] = 1.0
    airspeed, altitude, density, alpha = rows.condition.mean(axis=0).tolist()
    return Manoeuvre(
        config, rows.time_s.copy(), **columns, measured=np.asarray(rows.measured.all(axis=0)),
        condition=(airspeed, altitude, density, alpha),
    )  # fmt: skip


def signal_columns(structure: ModeStructure, reference: tuple[float, float], rows: Array) -> FlightColumns:
    """Signal rows (samples, columns of ``SignalLayout``) as columns; the kinematic term is split into what multiplies
    the states and the rest. ``reference``: airspeed in m/s and density in kg/m3 that derivatives refer to."""
    layout = SignalLayout(len(structure.states), len(structure.inputs))
    ns, c = layout.states, layout.kinematic
    pressure, airspeed, density, altitude, alpha = rows[:, c + 1 : c + 6].T
    angle = np.where(np.isfinite(alpha), alpha, 0.0)
    states = rows[:, 1 : 1 + ns]
    known = np.zeros((len(rows), ns, ns))
    turn = {"z_q": 1.0, "y_r": -1.0}
    for column, state in enumerate(structure.states):
        symbol = f"{structure.equations[0]}_{state}"
        known[:, 0, column] = turn.get(symbol, 0.0) * airspeed * np.cos(angle)
        if symbol == "y_p":
            known[:, 0, column] = airspeed * np.sin(angle)
    rest = np.zeros((len(rows), ns))
    rest[:, 0] = rows[:, c] - np.einsum("nj,nj->n", known[:, 0], states)
    rest[:, 1:] = rows[:, layout.known_moments : layout.ahead]
    accelerometer = np.full((len(rows), len(structure.equations)), np.nan)
    accelerometer[:, 0] = rows[:, layout.accelerometer]
    measured = np.ones((len(rows), ns), dtype=bool)
    measured[:, 0] = rows[:, c + 6] == 1.0
    return FlightColumns(
        rows[:, 0], states, accelerometer, rows[:, layout.first_input : c], known, rest,
        density * airspeed / (reference[0] * reference[1]), pressure, pressure, measured,
        np.column_stack([airspeed, altitude, density, alpha]),
    )  # fmt: skip
