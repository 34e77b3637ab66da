"""Diagnosis: what a simulation gets wrong against a measured flight, why, and how much better it is once mended.

Example:
    A flight that cannot be diagnosed is refused with what it lacks (``diagnose`` has an example that is answered):

    >>> from wingwatch.aircraft import load_aircraft
    >>> from wingwatch.diagnosis import DiagnosisError, diagnose
    >>> from wingwatch.simulation import Scenario, simulate
    >>> from wingwatch.telemetry import SampleBlock
    >>> aerosonde = load_aircraft("aerosonde")
    >>> flown = simulate(Scenario(aerosonde), 5.0)
    >>> some = {name: flown.column(name) for name in flown.present if name != "altitude_m"}
    >>> try:
    ...     diagnose(SampleBlock.from_columns(some), aerosonde)
    ... except DiagnosisError as problem:
    ...     print(problem)
    the flight has no altitude_m; a replay needs them, map them (--map)
"""

from wingwatch.diagnosis.diagnose import diagnose
from wingwatch.diagnosis.measured import DiagnosisError
from wingwatch.diagnosis.report import write_report
from wingwatch.diagnosis.result import (
    Cause,
    Diagnosis,
    Gain,
    Interval,
    Misfit,
    MissingTerm,
    NotSeparable,
    ParameterEstimate,
    Traces,
)
from wingwatch.diagnosis.serialise import as_json

__all__ = [
    "Cause",
    "Diagnosis",
    "DiagnosisError",
    "Gain",
    "Interval",
    "Misfit",
    "MissingTerm",
    "NotSeparable",
    "ParameterEstimate",
    "Traces",
    "as_json",
    "diagnose",
    "write_report",
]
