"""The aircraft file with a cause in it."""

from collections.abc import Mapping

from wingwatch.aircraft import Aircraft

__all__ = ["with_added", "with_coefficients"]


def with_coefficients(aircraft: Aircraft, factors: Mapping[str, float], size: float) -> Aircraft | None:
    """Coefficients times 1 + factor times size; None where the file states none."""
    c = aircraft.coefficients
    if c is None:
        return None
    stated = {name: getattr(getattr(c, name[:2]), name[3:]) for name in factors}
    return with_added(aircraft, {name: factors[name] * float(size) * value for name, value in stated.items()})


def with_added(aircraft: Aircraft, added: Mapping[str, float]) -> Aircraft | None:
    """Coefficients with something added; None where the file states none or has no place for one."""
    if aircraft.coefficients is None:
        return None
    tables = aircraft.coefficients.model_dump()
    for name, value in added.items():
        table, field = name[:2], name[3:]
        if field not in tables[table]:
            return None
        tables[table][field] += float(value)
    mended: Aircraft = type(aircraft).model_validate(aircraft.model_dump() | {"coefficients": tables})
    return mended
