"""How a vehicle is loaded: the mass and centre of gravity it announces, and the aircraft that is then expected.

What flights teach is kept about the file's centre of gravity and without the mass (American coordinates), so what was
learned at one loading serves at every other. Why: ``docs/decisions/0040-announced-mass-and-centre-of-gravity.md``.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from wingwatch.aircraft import STRUCTURES, Aircraft, american_map, at_loading
from wingwatch.baselines import Reference
from wingwatch.monitor.detection.cell_memory import CellPlace
from wingwatch.monitor.estimation.chain import nominal_condition
from wingwatch.monitor.ports import VehicleMemory
from wingwatch.telemetry import AircraftMessage

__all__ = ["Loading", "loading_of"]

MASS_RATIO = 3.0
"""A mass beyond three times the file's, or below a third of it, is a mistake: no aircraft flies at both."""

SHIFT_CHORDS = 0.5
"""A centre of gravity further than half a mean chord from the file's is one: no aircraft is trimmed there."""

MASS_STEP = 0.02
"""Share of the mass that may burn off before estimation begins anew. It moves z_w by as much, and the comparison allows
every block 3 % of its natural size."""

SHIFT_STEP_CHORDS = 0.003
"""The same of the centre of gravity: 3 % of m_w where that rests on a static margin of a tenth of the chord."""


@dataclass(frozen=True, slots=True)
class Loading:
    """One loading of a vehicle.

    Attributes:
        stated: the aircraft as its file has it.
        aircraft: as it is loaded, which is what is expected.
        unused: announced values that are not used, by the name they are counted under, each with a sentence.
    """

    stated: Aircraft
    aircraft: Aircraft
    unused: Mapping[str, str]

    @property
    def mass_kg(self) -> float | None:
        """In use; None where neither file nor announcement has one."""
        return None if self.aircraft.mass is None else self.aircraft.mass.mass_kg

    @property
    def cg_shift_m(self) -> float:
        """In use, aft of the file's centre of gravity."""
        return self.aircraft.cg_shift_m - self.stated.cg_shift_m

    @property
    def text(self) -> str:
        """What is expected because of the announcement, and what of it is not used; empty without one."""
        said = list(self.unused.values())
        if self.aircraft is not self.stated:
            said.insert(
                0,
                f"Expected at the announced loading: {self.mass_kg:.4g} kg, centre of gravity "
                f"{self.cg_shift_m:+.3f} m aft of the file's.",
            )
        return " ".join(said)

    def differs(self, other: "Loading") -> bool:
        """Whether derivatives estimated at the other loading are not those of this one."""
        mine, its = self.aircraft.mass, other.aircraft.mass
        if mine is None or its is None or self.aircraft.geometry is None:
            return False
        moved_m = abs(mine.cg_shift_m - its.cg_shift_m)
        return (
            abs(mine.mass_kg / its.mass_kg - 1.0) > MASS_STEP
            or moved_m > SHIFT_STEP_CHORDS * self.aircraft.geometry.mean_chord_m
        )

    def recalled(self, memory: VehicleMemory) -> VehicleMemory:
        """What is kept of the vehicle, as it is at this loading."""
        if self.aircraft is self.stated:
            return memory
        cells = {
            place: replace(c, reference=self._taken(place[0], c.reference))
            for place, c in memory.cells.items()
        }
        return VehicleMemory(
            {name: self._taken(name, reference) for name, reference in memory.references.items()},
            {name: envelope.at_loading(self.aircraft) for name, envelope in memory.envelopes.items()},
            cells,
        )

    def kept(self, references: Mapping[str, Reference]) -> Mapping[str, Reference]:
        """What the vehicle's flights taught at this loading, as it is kept."""
        if self.aircraft is self.stated:
            return references
        return {name: self._given(name, reference) for name, reference in references.items()}

    def kept_cells(self, cells: Mapping[CellPlace, Reference]) -> Mapping[CellPlace, Reference]:
        """The same of cells of the envelope."""
        if self.aircraft is self.stated:
            return cells
        return {place: self._given(place[0], reference) for place, reference in cells.items()}

    def _taken(self, structure: str, kept: Reference) -> Reference:
        """With a' = T a + t, J' = T^-T J T^-1 and h' = T^-T h + J' t."""
        matrix, offset = self._map(structure)
        back = np.linalg.inv(matrix)
        information = back.T @ kept.information @ back
        information = 0.5 * (information + information.T)
        return replace(kept, information=information, vector=back.T @ kept.vector + information @ offset)

    def _given(self, structure: str, learned: Reference) -> Reference:
        """The inverse of ``_taken``: J = T' J' T and h = T' (h' - J' t)."""
        matrix, offset = self._map(structure)
        information = matrix.T @ learned.information @ matrix
        vector = matrix.T @ (learned.vector - learned.information @ offset)
        return replace(learned, information=0.5 * (information + information.T), vector=vector)

    def _map(self, structure: str) -> tuple[np.ndarray, np.ndarray]:
        condition = nominal_condition(self.stated)
        size = len(STRUCTURES[structure].derivatives)
        if condition is None:
            return np.eye(size), np.zeros(size)
        return american_map(STRUCTURES[structure], condition, (self.stated, self.aircraft))


def loading_of(stated: Aircraft, message: AircraftMessage) -> Loading:
    """The loading that a vehicle announces, without what cannot be used of it."""
    mass, shift = message.mass_kg, message.cg_shift_m
    unused: dict[str, str] = {}
    if mass is None and shift is None:
        return Loading(stated, stated, unused)
    if stated.mass is None or stated.geometry is None:
        why = f"aircraft {stated.name} does not state both [mass] and [geometry]; add them to its file."
        given = {"unused_mass": mass, "unused_cg_shift": shift}
        names = {"unused_mass": "mass", "unused_cg_shift": "centre of gravity"}
        unused = {
            k: f"The announced {names[k]} is not used: {why}"
            for k, value in given.items()
            if value is not None
        }
        return Loading(stated, stated, unused)
    least, most = stated.mass.mass_kg / MASS_RATIO, stated.mass.mass_kg * MASS_RATIO
    if mass is not None and not least <= mass <= most:
        unused["unused_mass"] = (
            f"The announced mass of {mass:g} kg is not used, for it is not within {least:.3g} to {most:.3g} kg: "
            f"the file's {stated.mass.mass_kg:g} kg count."
        )
        mass = None
    furthest = SHIFT_CHORDS * stated.geometry.mean_chord_m
    if shift is not None and not abs(shift) <= furthest:
        unused["unused_cg_shift"] = (
            f"The announced centre of gravity, {shift:+g} m aft of the file's, is not used, for it is more than "
            f"{furthest:.3g} m from it: the file's counts."
        )
        shift = None
    return Loading(stated, at_loading(stated, mass, shift), unused)
