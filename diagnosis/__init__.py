"""Diagnosis: what a simulation gets wrong against a measured flight, why, and how much better it is once mended."""

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
