"""Fourier memory by cell of the envelope: kept while a vehicle flies there, resumed when it comes back.

What a cell remembers are the vehicle's own blocks. It is where an estimate starts from, never evidence: the
monitor's test sees fresh blocks alone, and a fresh block that contradicts what a cell remembers has that dropped.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from wingwatch.aircraft import FlightCondition
from wingwatch.baselines import Cell, CellMemory, Reference, aged, cell_of, joined
from wingwatch.estimators import BlockEvidence
from wingwatch.monitor.detection.comparison import Coordinates, change_since, without_bias

__all__ = ["CellBook", "CellBookState", "CellPlace"]

Array = NDArray[np.float64]

CellPlace = tuple[str, Cell]
"""A structure's name and a cell."""

CONTRADICTION = 1e-4
"""Probability below which a fresh block contradicts what its cell remembers; the monitor's own for expectations."""

TRIAL_BLOCKS = 6
"""Informative blocks after which a new memory takes the place of a contradicted one; an alert comes within three."""

MAX_CELLS = 64
"""Cells in memory of one structure."""


@dataclass(slots=True)
class _Account:
    """What a cell taught, and when on the vehicle's clock; before this flight, how old it was at its start."""

    reference: Reference
    at_s: float | None
    age_s: float
    trial: bool = False
    """In the place of a memory that was contradicted: kept for other flights only when it has lasted."""


@dataclass(slots=True)
class _Visit:
    """The stay in a cell: what was resumed there, what was carried in from the cell before, has a block informed."""

    cell: Cell
    resumed: Reference | None
    carried: Reference | None
    informed: bool = False


@dataclass(slots=True)
class CellBookState:
    """What a book remembers: of each cell, of the stay in the present one, and which cells are not handed over yet."""

    accounts: dict[CellPlace, _Account] = field(default_factory=dict)
    visits: dict[str, _Visit] = field(default_factory=dict)
    changed: set[CellPlace] = field(default_factory=set)


class CellBook:
    """The cells of one vehicle and configuration.

    Args:
        coordinates: of the structures that are remembered.
        kept: what earlier flights left, with its age.

    Attributes:
        state: what it remembers.
    """

    def __init__(
        self, coordinates: Mapping[str, Coordinates], kept: Mapping[CellPlace, CellMemory] | None = None
    ) -> None:
        self._coordinates = coordinates
        self.state = CellBookState()
        self.adopt(kept or {})

    def adopt(self, kept: Mapping[CellPlace, CellMemory]) -> None:
        """Take in what earlier flights left; what this one has taught meanwhile is added to it."""
        for place, memory in kept.items():
            coordinates = self._coordinates.get(place[0])
            if coordinates is None or memory.reference.vector.size != _size(coordinates):
                continue
            own = self.state.accounts.get(place)
            if own is None:
                self.state.accounts[place] = _Account(memory.reference, None, memory.age_s)
            else:
                own.reference = memory.reference.plus(own.reference)
                self.state.changed.add(place)

    def renew(self, kept: Mapping[CellPlace, CellMemory]) -> None:
        """What is kept was changed by a person: it takes the place of all that is remembered."""
        self.state = CellBookState()
        self.adopt(kept)

    def restore(self, state: CellBookState) -> None:
        """Go on from where another book of this vehicle stopped.

        What that flight has learned is handed over once more: who it was handed to may have lost it.
        """
        learned = {
            p for p, account in state.accounts.items() if account.at_s is not None and not account.trial
        }
        self.state = CellBookState(state.accounts, state.visits, state.changed | learned)

    def take_changed(self) -> dict[CellPlace, Reference]:
        """What has been learned since the last call."""
        changed, self.state.changed = self.state.changed, set()
        return {
            place: self.state.accounts[place].reference for place in changed if place in self.state.accounts
        }

    @property
    def text(self) -> str:
        """What the present estimates have resumed, empty if nothing."""
        words = []
        for name, visit in self.state.visits.items():
            if visit.resumed is not None:
                seconds = visit.resumed.seconds
                words.append(f"{name} resumed from {seconds:.0f} s of own flight at {visit.cell.text}")
        return "; ".join(words)

    def block(
        self,
        name: str,
        block: BlockEvidence,
        condition: FlightCondition,
        natural: Array,
        *,
        alarmed: bool = False,
        rough: bool = False,
    ) -> tuple[Array, Array] | None:
        """Take in a closed block.

        Args:
            name: its structure.
            block: the Fourier estimator's evidence.
            condition: mean over the block.
            natural: natural size of each derivative in the structure's coordinates, (k,).
            alarmed: an alert stands: nothing is learned or resumed.
            rough: the air biases the block: nothing is learned from it, and it contradicts nothing.

        Returns:
            information (k, k) and vector (k,) of referred derivatives to take the place of the estimator's sums, when a
            cell is resumed or what was resumed is dropped; else None.
        """
        present = self.state.visits.get(name)
        try:
            cell = cell_of(
                condition.airspeed_true_m_s, condition.altitude_m, present.cell if present else None
            )
        except ValueError:
            return None
        if alarmed:
            self._end_trials(name)
            return None
        parts = block.information, block.vector, block.bias
        if not all(np.isfinite(part).all() for part in parts) or not (natural > 0.0).all():
            return None
        visit, rebuilt = present, False
        if visit is None or cell != visit.cell:
            visit = self._enter(name, cell, block.end_s, natural)
            rebuilt = visit.resumed is not None
        informs = float(np.trace(block.information)) > 0.0 and not rough
        if not (informs or rebuilt):
            return None
        at = self._coordinates[name].at(condition)
        fresh = at.of_evidence(*without_bias(*parts))
        if informs:
            account = self.state.accounts.get((name, cell))
            known = aged(CellMemory(account.reference, 0.0), natural) if account is not None else None
            if known is not None and _contradicts(known, fresh, natural):
                rebuilt = visit.resumed is not None and not visit.informed
                visit.resumed = None
                self.state.accounts[name, cell] = _Account(
                    Reference.empty(natural.size), None, 0.0, trial=True
                )
            visit.informed = True
            self._learn((name, cell), fresh, block)
        if not rebuilt:
            return None
        total, vector = (part.copy() for part in fresh)
        for part in (visit.resumed, visit.carried):
            if part is not None:
                total, vector = total + part.information, vector + part.vector
        return at.to_evidence(total, vector)

    def _enter(self, name: str, cell: Cell, now_s: float, natural: Array) -> _Visit:
        """A new visit. Cells hold different blocks, so what is resumed and what is carried in are independent."""
        before, account = self.state.visits.get(name), self.state.accounts.get((name, cell))
        resumed = carried = None
        if account is not None and account.reference.blocks:
            away = account.age_s if account.at_s is None else now_s - account.at_s
            resumed = aged(CellMemory(account.reference, max(0.0, away)), natural)
            self.state.accounts[name, cell] = _Account(resumed, now_s, 0.0, account.trial)
            left = self.state.accounts.get((name, before.cell)) if before is not None else None
            if left is not None:
                carried = aged(CellMemory(left.reference, 0.0), natural)
        visit = _Visit(cell, resumed, carried)
        self.state.visits[name] = visit
        return visit

    def _end_trials(self, name: str) -> None:
        """What contradicted a memory was a fault: it is not what this aircraft is like."""
        for place in [p for p, account in self.state.accounts.items() if p[0] == name and account.trial]:
            self.state.accounts.pop(place)

    def _learn(self, place: CellPlace, fresh: tuple[Array, Array], block: BlockEvidence) -> None:
        account = self.state.accounts.pop(place, None) or _Account(
            Reference.empty(block.vector.size), None, 0.0
        )
        learned = joined(account.reference, *fresh, block.end_s - block.start_s)
        trial = account.trial and learned.blocks < TRIAL_BLOCKS
        self.state.accounts[place] = _Account(learned, block.end_s, 0.0, trial)
        if not trial:
            self.state.changed.add(place)
        own = [p for p in self.state.accounts if p[0] == place[0]]
        for oldest in own[: max(0, len(own) - MAX_CELLS)]:
            self.state.accounts.pop(oldest)


def _size(coordinates: Coordinates) -> int:
    return len(coordinates.structure.derivatives)


def _contradicts(resumed: Reference, fresh: tuple[Array, Array], natural: Array) -> bool:
    """Whether a block and what was resumed cannot both be of this aircraft."""
    covariance = np.asarray(np.linalg.inv(resumed.information + np.diag((3.0 * natural) ** -2.0)))
    mean = np.asarray(covariance @ resumed.vector, dtype=np.float64)
    change = change_since(mean, covariance, *fresh, np.zeros_like(covariance), natural)
    freedom = float(np.linalg.matrix_rank(change.precision, tol=1e-9 * np.trace(change.precision) + 1e-300))
    distance = float(change.score @ np.linalg.pinv(change.precision, hermitian=True) @ change.score)
    return bool(freedom and chdtrc(freedom, distance) < CONTRADICTION)
