"""Diagnosis: what a simulation gets wrong against a measured flight, why, and how much better it is once mended."""

from wingwatch.diagnosis.diagnose import diagnose
from wingwatch.diagnosis.measured import DiagnosisError
from wingwatch.diagnosis.result import (
    Cause,
    Diagnosis,
    Gain,
    Interval,
    Misfit,
    NotSeparable,
    ParameterEstimate,
    Traces,
)

__all__ = [
    "Cause",
    "Diagnosis",
    "DiagnosisError",
    "Gain",
    "Interval",
    "Misfit",
    "NotSeparable",
    "ParameterEstimate",
    "Traces",
    "diagnose",
]
