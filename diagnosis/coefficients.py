"""The aircraft file with other coefficients."""

from collections.abc import Mapping

from wingwatch.aircraft import Aircraft
from wingwatch.diagnosis.candidate import updated

__all__ = ["with_added", "with_coefficients"]


def with_coefficients(aircraft: Aircraft, factors: Mapping[str, float], size: float) -> Aircraft | None:
    """Coefficients (``CL_alpha``) times 1 + factor times size; None where the file states none."""
    if aircraft.coefficients is None:
        return None
    stated = dict(aircraft.coefficients.items())
    return with_added(
        aircraft, {name: factor * float(size) * stated[name] for name, factor in factors.items()}
    )


def with_added(aircraft: Aircraft, added: Mapping[str, float]) -> Aircraft | None:
    """Coefficients (``CL_alpha``) with something added; None where the file states none or has no place for one."""
    coefficients = aircraft.coefficients
    if coefficients is None:
        return None
    stated = dict(coefficients.items())
    for name, value in added.items():
        if name not in stated:
            return None
        coefficients = coefficients.with_value(name, stated[name] + float(value))
    return updated(aircraft, coefficients=coefficients.model_dump())
