"""The derivatives of a flight as an aircraft file: its entries stand at the flight's condition and are identified."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from wingwatch.aircraft import Aircraft, ConditionEntry, DerivativeEntry, Provenance, aircraft_toml
from wingwatch.cli.estimate_validation import Fitted
from wingwatch.operations.faults import CommandError
from wingwatch.pages.whole_file import write_whole

__all__ = ["save_model"]

_NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,62}")


def save_model(path: Path, aircraft: Aircraft, fitted: Mapping[str, Fitted], source: str) -> tuple[str, ...]:
    """Write an aircraft file with the derivatives of a flight; the structures that could not be saved, with the reason.

    What the flight did not tell of a structure stands in it as it was expected, with its error. The file's name without
    suffix is the aircraft's name.

    Raises:
        CommandError: a name that no aircraft can have, or no structure to save.
    """
    name = path.stem.lower()
    if _NAME.fullmatch(name) is None:
        raise CommandError(
            f"--save {path}: {path.stem!r} is no name of an aircraft; "
            "use a-z, 0-9, '_' and '-', such as my_aircraft.toml"
        )
    entries, left = [], []
    for one in fitted.values():
        if not (
            np.isfinite(one.value).all()
            and (one.standard_error > 0.0).all()
            and np.isfinite(one.standard_error).all()
        ):
            unknown = [
                s for s, v in zip(one.structure.derivatives, one.value, strict=True) if not np.isfinite(v)
            ]
            left.append(f"{one.structure.name}: nothing is known of {', '.join(unknown) or 'an error'}")
            continue
        entries.append(_entry(one, source))
    if not entries:
        raise CommandError(f"--save {path}: no structure of the flight could be saved; {'; '.join(left)}")
    symbols = {symbol for entry in entries for symbol in entry.derivatives}
    kept = [c for c in aircraft.conditions if not symbols & set(c.derivatives)]
    made = aircraft.model_copy(update={"name": name, "conditions": (*kept, *entries)})
    comment = f"{aircraft.name} with the derivatives of {source}"
    write_whole(path, aircraft_toml(made, comment))
    return tuple(left)


def _entry(one: Fitted, source: str) -> ConditionEntry:
    airspeed, altitude, density, alpha = one.condition
    expected = [s for s, seen in zip(one.structure.derivatives, one.observed, strict=True) if not seen]
    said = f"; as expected: {', '.join(expected)}" if expected else ""
    return ConditionEntry(
        airspeed_true_m_s=airspeed, altitude_m=altitude, air_density_kg_m3=density,
        angle_of_attack_rad=alpha if np.isfinite(alpha) else 0.0, provenance=Provenance.IDENTIFIED,
        source=f"{source}, {one.estimator}{said}",
        derivatives={
            symbol: DerivativeEntry(value=float(value), standard_error=float(error))
            for symbol, value, error in zip(one.structure.derivatives, one.value, one.standard_error, strict=True)
        },
    )  # fmt: skip
