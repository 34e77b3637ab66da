"""Memory of one cell of the envelope: what a vehicle's blocks there said, aged when the aircraft returns.

A cell is so small that decision 0011 carries coefficients across it: 15 % of airspeed and 1000 m. Coordinates and
normal equations are those of ``Reference``.
Why, and what it must not do: ``docs/decisions/0016-memory-by-cell.md``.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.baselines.reference import Reference

__all__ = ["Cell", "CellMemory", "aged", "cell_of", "joined"]

Array = NDArray[np.float64]

AIRSPEED_RATIO = 1.15
ALTITUDE_M = 1000.0
MARGIN = 0.75
"""A cell is left when the condition is this many widths from its middle, entered at half a width: a flight along an
edge does not change cells with every block."""

VISIT_SHARE = 0.03
"""Standard error of natural size by which derivatives may differ from one visit to the next: what the monitor allows a
block for reasons that the linear model does not know."""

WEAR_SHARE_PER_ROOT_DAY = 0.05
"""And by which they walk in a day on the ground or in the air (loading, repair, wear); stated, not measured."""

MEMORY_S = 600.0
"""Of informative flight in the cell: what a cell knows follows an aircraft that changes slowly."""

DAY_S = 86_400.0


@dataclass(frozen=True, slots=True, order=True)
class Cell:
    """Where in the envelope: steps of 15 % in true airspeed from 1 m/s, and of 1000 m in altitude."""

    airspeed: int
    altitude: int

    @property
    def airspeed_limits_m_s(self) -> tuple[float, float]:
        """Its lowest and highest true airspeed."""
        low, high = (AIRSPEED_RATIO ** (self.airspeed + side) for side in (-0.5, 0.5))
        return low, high

    @property
    def altitude_limits_m(self) -> tuple[float, float]:
        """Its lowest and highest altitude."""
        below, above = ((self.altitude + side) * ALTITUDE_M for side in (-0.5, 0.5))
        return below, above

    @property
    def text(self) -> str:
        """Its edges, for a person."""
        (low, high), (below, above) = self.airspeed_limits_m_s, self.altitude_limits_m
        return f"{low:.0f} to {high:.0f} m/s, {below:.0f} to {above:.0f} m"


@dataclass(frozen=True, slots=True)
class CellMemory:
    """What a cell taught, and how long ago its last block was."""

    reference: Reference
    age_s: float


def cell_of(airspeed_true_m_s: float, altitude_m: float, present: Cell | None = None) -> Cell:
    """The cell of a condition; ``present`` is kept until the condition is clearly outside.

    Raises:
        ValueError: an airspeed that is not positive, or anything not finite.
    """
    if not (0.0 < airspeed_true_m_s < math.inf and math.isfinite(altitude_m)):
        raise ValueError(f"no cell at {airspeed_true_m_s} m/s, {altitude_m} m")
    step, level = math.log(airspeed_true_m_s) / math.log(AIRSPEED_RATIO), altitude_m / ALTITUDE_M
    if present is not None and max(abs(step - present.airspeed), abs(level - present.altitude)) < MARGIN:
        return present
    return Cell(round(step), round(level))


def aged(memory: CellMemory, natural: Array) -> Reference:
    """What is still known after a time away: (J^-1 + Q)^-1, Q the variance that derivatives may have gained.

    Args:
        memory: of the cell.
        natural: natural size of each derivative, (k,).
    """
    days = max(memory.age_s, 0.0) / DAY_S
    variance = np.square(natural) * (VISIT_SHARE**2 + WEAR_SHARE_PER_ROOT_DAY**2 * days)
    information, vector = memory.reference.information, memory.reference.vector
    inner = np.eye(vector.size) + information * variance
    solved = np.asarray(np.linalg.solve(inner, np.column_stack([information, vector])), dtype=np.float64)
    reduced = _symmetric(solved[:, :-1])
    return Reference(reduced, solved[:, -1], memory.reference.blocks, memory.reference.seconds)


def joined(reference: Reference, information: Array, vector: Array, seconds: float) -> Reference:
    """One more block of ``seconds``, information (k, k) and vector (k,), after all before it has faded."""
    keep = math.exp(-seconds / MEMORY_S)
    old = Reference(
        keep * reference.information, keep * reference.vector, reference.blocks, reference.seconds
    )
    return old.add(_symmetric(information), vector, seconds)


def _symmetric(matrix: Array) -> Array:
    """Without the rounding that makes it asymmetric or gives it eigenvalues below zero."""
    power, axes = np.linalg.eigh(0.5 * (matrix + matrix.T))
    made = (axes * np.maximum(power, 0.0)) @ axes.T
    return np.asarray(0.5 * (made + made.T))
