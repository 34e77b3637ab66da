"""Plausibility: whether a flight's channels can be what they are called, before anything is estimated from them."""

from wingwatch.telemetry.plausibility.check import check_flight
from wingwatch.telemetry.plausibility.finding import Finding, Verdict

__all__ = ["Finding", "Verdict", "check_flight"]
