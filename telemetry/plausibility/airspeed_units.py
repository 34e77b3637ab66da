"""What unit a factor from the recorded airspeed to the true one stands for."""

from wingwatch.telemetry.plausibility.finding import Finding, Verdict
from wingwatch.telemetry.plausibility.lines import Lines
from wingwatch.telemetry.units import units_of

__all__ = ["unit_of_airspeed"]

AIRSPEED = "airspeed_true_m_s"
_UNITS = ("km/h", "ft/s", "mph", "kt")
_NEAR = 0.15
"""How far a factor may be off that of a unit, relative to it."""
_DOUBTFUL = 1.6
"""Factor from 1 from which on an airspeed that stands for no unit is doubtful."""


def unit_of_airspeed(
    factor: float, error: float, from_what: str, lines: Lines, near: float = _NEAR
) -> list[Finding]:
    """The finding for a factor.

    Args:
        factor: true airspeed by the recorded one.
        error: its standard error.
        from_what: ``turns`` or ``lift``: the check, and where the factor comes from.
        lines: writes lines of the map.
        near: how far the factor may be off that of a unit, relative to it.
    """
    said = f"the airspeed that {from_what} need is {factor:.3g} ± {error:.1g} times {AIRSPEED}"
    measured = (AIRSPEED, from_what, factor, error, "")
    known = {unit: units_of("m/s")[unit].factor for unit in _UNITS}
    off = {unit: abs(factor / size - 1.0) for unit, size in known.items()}
    unit = min(off, key=lambda name: off[name])
    if off[unit] < near:
        others = [name for name in off if name != unit and abs(factor - known[name]) < 3.0 * error]
        maybe = f" (or {' or '.join(others)})" if others else ""
        text = f"{said}: it is in {unit}{maybe}"
        return [Finding(Verdict.REFUSAL, *measured, text, lines.in_unit(AIRSPEED, unit))]
    stated = lines.entry(AIRSPEED).unit
    if stated in known and abs(factor * known[stated] - 1.0) < near:
        text = f"{said}: it is in m/s and not in {stated}"
        return [Finding(Verdict.REFUSAL, *measured, text, lines.in_unit(AIRSPEED, "m/s"))]
    if not 1.0 / _DOUBTFUL < factor < _DOUBTFUL:
        return [Finding(Verdict.WARNING, *measured, f"{said}: they do not fit")]
    return [Finding(Verdict.RIGHT, *measured, said)]
