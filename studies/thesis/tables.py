"""One table of the thesis beside wingwatch: row by row as figures, whatever shows them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import natural_frequency_and_damping, state_matrix
from wingwatch.studies.thesis.cases import Case, Outcome, case_of, outcome
from wingwatch.studies.thesis.printed import Plant, PrintedCase, PrintedTable

__all__ = ["FIT", "FREQUENCY", "Compared", "Quantity", "compared", "frequency_of_the_plant"]

Array = NDArray[np.float64]

FIT = ("R2 %", "Theil", "bias", "variance", "covariance")
FREQUENCY = ("natural rad/s", "damped rad/s", "damping")
Z_95 = 1.959964


@dataclass(frozen=True, slots=True)
class Quantity:
    """One printed number beside ours.

    Attributes:
        case, name: of which case, which quantity.
        true: of the plant; None where it has none (fits).
        printed, printed_error: as the thesis prints them; the error None where it prints none.
        ours, ours_error: of the first draw of noise, with its stated standard error (None for fits); None where the
            case cannot be repeated or the estimator has no such quantity.
        mean, scatter: of all draws; the scatter None without noise.
        rms_error: over the draws against the truth.
        inside: share of draws whose 95 % interval holds the truth; None without noise.
        apart: ours less printed, in joint standard errors; None without noise, or where no error is stated.
    """

    case: str
    name: str
    true: float | None
    printed: float
    printed_error: float | None
    ours: float | None = None
    ours_error: float | None = None
    mean: float | None = None
    scatter: float | None = None
    rms_error: float | None = None
    inside: float | None = None
    apart: float | None = None


@dataclass(frozen=True, slots=True)
class Compared:
    """A table beside ours.

    Attributes:
        table: as printed.
        cases: how each was repeated.
        quantities: case by case in the order of the thesis.
        notes: what stands in for what, and what differs by itself; a clause each.
        draws: of noise.
    """

    table: PrintedTable
    cases: tuple[Case, ...]
    quantities: tuple[Quantity, ...]
    notes: tuple[str, ...]
    draws: int

    @property
    def repeated(self) -> int:
        """How many of its cases are repeated."""
        return sum(not case.missing for case in self.cases)


def compared(table: PrintedTable, draws: int) -> Compared:
    """The table repeated with ``draws`` draws of noise."""
    cases = tuple(case_of(table.plant, one.name) for one in table.cases)
    rows: list[Quantity] = []
    for case, one in zip(cases, table.cases, strict=True):
        found = None if case.missing else outcome(table.plant.name, case.name, draws)
        rows += _quantities(table, case, one, found)
    notes = list(dict.fromkeys(note for case in cases for note in case.notes))
    notes += [*_own_notes(table), *_clean_note(table, cases, draws)]
    return Compared(table, cases, tuple(rows), tuple(notes), draws)


def _quantities(table: PrintedTable, case: Case, one: PrintedCase, found: Outcome | None) -> list[Quantity]:
    names, true, value, error = _parts(table, found)
    rows = []
    for k, name in enumerate(names):
        printed = float(one.values[k])
        printed_error = None if one.errors is None else float(one.errors[k])
        base = Quantity(case.name, name, None if true is None else float(true[k]), printed, printed_error)
        rows.append(
            base if value is None else _filled(base, value[:, k], None if error is None else error[:, k])
        )
    return rows


def _parts(
    table: PrintedTable, found: Outcome | None
) -> tuple[tuple[str, ...], Array | None, Array | None, Array | None]:
    """Names, truth, values (draws, n) and stated errors (draws, n) of a kind of table."""
    if table.kind == "derivatives":
        truth = np.array(table.plant.derivatives)
        return (
            table.plant.structure.derivatives,
            truth,
            None if found is None else found.value,
            None if found is None else found.error,
        )
    if table.kind == "frequency":
        return (
            FREQUENCY,
            frequency_of_the_plant(table.plant),
            None if found is None else found.frequency,
            None if found is None else found.frequency_error,
        )
    if found is None:
        return FIT, None, None, None
    k = table.state
    return FIT, None, np.column_stack([found.r_squared[:, k], found.theil[:, k]]), None


def _filled(base: Quantity, value: Array, error: Array | None) -> Quantity:
    """Ours beside the printed figure."""
    if not np.isfinite(value[0]):
        return base
    noisy = value.size > 1
    stated = None if error is None else float(error[0])
    rms = inside = apart = None
    if base.true is not None:
        rms = float(np.sqrt(np.mean((value - base.true) ** 2)))
    if noisy and error is not None and base.true is not None and stated is not None:
        inside = float(np.mean(np.abs(value - base.true) <= Z_95 * error))
        apart = (float(value[0]) - base.printed) / math.hypot(stated, base.printed_error or 0.0)
    return Quantity(
        base.case,
        base.name,
        base.true,
        base.printed,
        base.printed_error,
        float(value[0]),
        stated,
        float(value.mean()),
        float(value.std(ddof=1)) if noisy else None,
        rms,
        inside,
        apart,
    )


def frequency_of_the_plant(plant: Plant) -> Array:
    """Natural and damped frequency, rad/s, and damping ratio that follow from the printed derivatives, (3,)."""
    natural, damping = natural_frequency_and_damping(
        plant.structure, state_matrix(plant.structure, plant.by_symbol)
    )
    return np.array([natural, natural * math.sqrt(1.0 - damping**2), damping])


def _clean_note(table: PrintedTable, cases: tuple[Case, ...], draws: int) -> list[str]:
    """What R2 is of, where the thesis names another comparison beside it."""
    if table.kind != "fit" or not table.number.startswith("7."):
        return []
    said = "our R2 is of the smoothed, noisy left side of the equation that the estimator fits"
    noisy = [case for case in cases if case.noisy and not case.missing]
    if table.plant.flown:
        return [said]
    clean = [
        float(outcome(table.plant.name, case.name, draws).r_squared_clean[:, table.state].mean())
        for case in noisy
    ]
    return [
        f"{said}; against the plant's response without noise, which section 7.4 says the thesis compares with, it is "
        f"{min(clean):.2f} to {max(clean):.2f} % (means of the draws with noise)"
    ]


def _own_notes(table: PrintedTable) -> list[str]:
    """What the printed numbers themselves disagree in."""
    plant = table.plant
    true = frequency_of_the_plant(plant)
    said = []
    if table.kind == "frequency" and abs(true[0] / plant.frequency[0] - 1.0) > 0.01:
        y_v, y_r, n_r = plant.by_symbol["y_v"], plant.by_symbol["y_r"], plant.by_symbol["n_r"]
        implied = (plant.frequency[0] ** 2 - y_v * n_r) / -y_r
        said.append(
            f"the printed derivatives have {true[0]:.3f} rad/s and damping {true[2]:.4f}; the table prints "
            f"{plant.frequency[0]:.3f} and {plant.frequency[2]:.4f} for the same plant, a frequency that needs n_v = "
            f"{implied:.2f} where {plant.by_symbol['n_v']:.3f} is printed"
        )
    if table.kind == "derivatives" and plant.name == "aerosonde_dutch_roll":
        said.append(
            "all printed estimates of n_v lie near 1.3, about twice the linearised value, with and without noise: the "
            "thesis's simulation did not fly as its printed linearised derivatives, the plant here does"
        )
    return said
