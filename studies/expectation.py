"""What the monitor expects of an aircraft: the truth as its file has it, or wrong by what the file admits to.

The file states a standard error of every coefficient. A drawn expectation moves each coefficient by its error times a
drawn number and every derivative by the first-order effect of all of them: the very propagation by which the file's
coefficients give the derivatives' standard errors, so drawn and stated errors belong together.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft, FlightCondition, ModeStructure, linearised_at, trim
from wingwatch.aircraft.uncertainty import coefficient_standard_error
from wingwatch.baselines import Envelope, apriori_envelope
from wingwatch.baselines.expectation import DECLARED

__all__ = ["Expectations"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Structure:
    """One structure's part.

    Attributes:
        exact: what the file says.
        moved: effect of one standard error of each coefficient on each derivative at each of the envelope's points,
            (points, k, coefficients).
    """

    exact: Envelope
    moved: Array


class Expectations:
    """Exact and drawn expectations of one aircraft.

    Args:
        aircraft: with [coefficients].
        structures: those that a monitor watches.
    """

    def __init__(self, aircraft: Aircraft, structures: Sequence[ModeStructure]) -> None:
        self._aircraft = aircraft
        self._errors = {
            name: error
            for name, _ in aircraft.need_coefficients("drawn expectations").items()
            if (error := coefficient_standard_error(aircraft.need_coefficients("drawn"), name)) > 0.0
        }
        self._structures: dict[str, _Structure] = {}
        for structure in structures:
            exact = apriori_envelope(aircraft, structure)
            moved = np.array([self._effects(structure, p.condition) for p in exact.points])
            self._structures[structure.name] = _Structure(exact, moved)

    def _effects(self, structure: ModeStructure, condition: FlightCondition) -> Array:
        """Change of each derivative by one standard error of each coefficient, (k, coefficients)."""
        at = trim(self._aircraft, condition)
        coefficients = self._aircraft.need_coefficients("drawn expectations")
        values = dict(coefficients.items())
        base = linearised_at(self._aircraft, condition, structure, at)
        columns = []
        for name, error in self._errors.items():
            moved = self._aircraft.model_copy(
                update={"coefficients": coefficients.with_value(name, values[name] + error)}
            )
            found = linearised_at(moved, condition, structure, at)
            columns.append([found[s] - base[s] for s in structure.derivatives])
        return np.array(columns).T

    def exact(self) -> dict[str, Envelope]:
        """What the file says, by structure."""
        return {name: s.exact for name, s in self._structures.items()}

    def drawn(self, errors: Mapping[str, float]) -> dict[str, Envelope]:
        """What a wrong file would say, by structure; ``errors`` of coefficients in their standard errors."""
        sizes = np.array([errors.get(name, 0.0) for name in self._errors])
        envelopes = {}
        for name, s in self._structures.items():
            points = [
                replace(p, value=p.value + moved @ sizes)
                for p, moved in zip(s.exact.points, s.moved, strict=True)
            ]
            envelopes[name] = Envelope(
                self._aircraft,
                s.exact.structure,
                points,
                configuration=s.exact.configuration,
                neighbourhood=DECLARED,
            )
        return envelopes
