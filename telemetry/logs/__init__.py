"""Autopilot logs: PX4's ULog, ArduPilot's DataFlash and telemetry logs as flights.

A log is read as topics with stamps of their own (``read_autopilot_log``); a map that fits it says which of them are
channels of the flight table, and ``log_table`` brings these to one clock.
"""

from wingwatch.telemetry.logs.airborne import AirborneLimits, Interval, airborne_intervals
from wingwatch.telemetry.logs.log import AutopilotLog, LogError, Topic
from wingwatch.telemetry.logs.log_table import ChannelFacts, LogTable, log_table
from wingwatch.telemetry.logs.map_text import map_text
from wingwatch.telemetry.logs.reading import is_autopilot_log, read_autopilot_log

__all__ = [
    "AirborneLimits",
    "AutopilotLog",
    "ChannelFacts",
    "Interval",
    "LogError",
    "LogTable",
    "Topic",
    "airborne_intervals",
    "is_autopilot_log",
    "log_table",
    "map_text",
    "read_autopilot_log",
]
