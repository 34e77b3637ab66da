"""Diagnosis: what a simulation gets wrong against a measured flight, why, and how much better it is once mended."""

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
    "Gain",
    "Interval",
    "Misfit",
    "NotSeparable",
    "ParameterEstimate",
    "Traces",
]
