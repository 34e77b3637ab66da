"""`wingwatch aircraft export`: an aircraft file handed on, as JSON or as a JSBSim aircraft."""

import argparse
from typing import Any

import orjson
from rich.markup import escape

from wingwatch.aircraft import (
    DERIVATIVES,
    MODEL_DERIVATIVES,
    STRUCTURES,
    Aircraft,
    AircraftDataError,
    ConditionEntry,
    FlightCondition,
    Provenance,
    coefficient_standard_error,
    derivative_covariance,
    jsbsim_xml,
    linearised_derivatives,
    load_aircraft,
    trimmed,
    with_stated_derivatives,
)
from wingwatch.operations.faults import CommandError
from wingwatch.operations.output_files import check_output
from wingwatch.operations.progress import page, write_json
from wingwatch.pages.whole_file import write_whole

__all__ = ["export_aircraft"]

_SUFFIXES = {"json": (".json",), "jsbsim": (".xml",)}


def export_aircraft(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    aircraft = load_aircraft(arguments.file)
    check_output("--out", arguments.out, _SUFFIXES[arguments.to])
    condition = _condition(aircraft, arguments)
    if arguments.to == "json":
        text = orjson.dumps(aircraft_object(aircraft, condition), option=orjson.OPT_INDENT_2).decode() + "\n"
        basis = "coefficients and conditions with standard errors"
    else:
        entry = _newest_identified(aircraft)
        if entry is None:
            basis = "its coefficients"
        else:
            aircraft = with_stated_derivatives(aircraft, entry)
            basis = f"its {entry.provenance.value} derivatives at {entry.airspeed_true_m_s:g} m/s"
        text = jsbsim_xml(aircraft, f"{aircraft.name} by {basis}, written by wingwatch.")
    write_whole(arguments.out, text)
    result = {"aircraft": aircraft.name, "to": arguments.to, "file": str(arguments.out), "basis": basis}
    if arguments.json:
        write_json(result)
    else:
        page().print(escape(f"{arguments.out}  {aircraft.name}: {basis}"), soft_wrap=True)
    return 0


def _condition(aircraft: Aircraft, arguments: argparse.Namespace) -> FlightCondition | None:
    """Where coefficients are linearised: as asked, else cruise."""
    if arguments.airspeed is not None:
        return FlightCondition(arguments.airspeed, arguments.altitude or 0.0)
    if arguments.altitude is not None:
        raise CommandError("--altitude is given without --airspeed; give both")
    return None if aircraft.envelope is None else aircraft.envelope.cruise


def _newest_identified(aircraft: Aircraft) -> ConditionEntry | None:
    """The last condition that flights have identified; of a file without coefficients the last at all."""
    stated = [c for c in aircraft.conditions if c.provenance is Provenance.IDENTIFIED]
    if not stated and aircraft.coefficients is None:
        stated = list(aircraft.conditions)
    return stated[-1] if stated else None


def aircraft_object(aircraft: Aircraft, condition: FlightCondition | None) -> dict[str, Any]:
    """Everything of an aircraft file as plain JSON, units in names, with standard errors."""
    result: dict[str, Any] = {"format": 1, "name": aircraft.name, "description": aircraft.description.strip()}
    for key in ("geometry", "mass", "envelope", "propulsion"):
        table = getattr(aircraft, key)
        result[key] = None if table is None else table.model_dump(mode="json")
    c = aircraft.coefficients
    result["coefficients"] = None
    if c is not None:
        values = {n: {"value": v, "standard_error": coefficient_standard_error(c, n)} for n, v in c.items()}
        result["coefficients"] = {
            "convention": "american, per rad, rates by c/2V and b/2V, moments about cg_shift_m ahead of the cg",
            "force_axes": c.force_axes,
            "values": values,
        }
    result["conditions"] = [_stated(entry) for entry in aircraft.conditions]
    result["linearised"] = None if c is None or condition is None else _linearised(aircraft, condition)
    return result


def _stated(entry: ConditionEntry) -> dict[str, Any]:
    head = entry.model_dump(mode="json", exclude={"derivatives"})
    rows = {
        symbol: {"value": d.value, "standard_error": d.standard_error, "unit": MODEL_DERIVATIVES[symbol].unit}
        for symbol, d in entry.derivatives.items()
    }
    return head | {"derivatives": rows}


def _linearised(aircraft: Aircraft, condition: FlightCondition) -> dict[str, Any]:
    here = trimmed(aircraft, condition)
    structures: dict[str, Any] = {}
    for name, structure in STRUCTURES.items():
        try:
            covariance = derivative_covariance(aircraft, condition, structure)
        except AircraftDataError as error:
            raise CommandError(str(error)) from None
        values = linearised_derivatives(aircraft, condition, structure)
        errors = covariance.diagonal() ** 0.5
        rows = {
            symbol: {"value": value, "standard_error": float(error), "unit": DERIVATIVES[symbol].unit}
            for (symbol, value), error in zip(values.items(), errors, strict=True)
        }
        structures[name] = {"derivatives": rows, "order": list(values), "covariance": covariance.tolist()}
    return {
        "airspeed_true_m_s": here.airspeed_true_m_s,
        "altitude_m": here.altitude_m,
        "air_density_kg_m3": here.air_density_kg_m3,
        "angle_of_attack_rad": here.angle_of_attack_rad,
        "structures": structures,
    }
