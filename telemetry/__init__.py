"""Telemetry: the sample, how it arrives, and what is done before an estimator may see it."""

from wingwatch.telemetry.cleaning import Cleaner, CleanerConfig, CleanerState, CleaningReport, CleanResult
from wingwatch.telemetry.completion import complete, derivations
from wingwatch.telemetry.flight import (
    REQUIRED_CHANNELS,
    FlightError,
    FlightReport,
    FlightTable,
    load_flight,
    missing_for,
    write_flight,
)
from wingwatch.telemetry.keys import (
    KeyNameError,
    VehicleKey,
    alive_key,
    check_name,
    parse_key,
    service_alive_key,
    vehicle_key,
)
from wingwatch.telemetry.maps import ChannelEntry, ChannelMap, MapError, RowSelection, load_map, parse_map
from wingwatch.telemetry.readers import RawTable, TableError, read_table
from wingwatch.telemetry.sample import CHANNEL_INDEX, CHANNEL_NAMES, CHANNELS, Channel, SampleBlock

__all__ = [
    "Channel",
    "CHANNELS",
    "CHANNEL_INDEX",
    "CHANNEL_NAMES",
    "SampleBlock",
    "RawTable",
    "TableError",
    "read_table",
    "ChannelEntry",
    "ChannelMap",
    "MapError",
    "RowSelection",
    "load_map",
    "parse_map",
    "complete",
    "derivations",
    "REQUIRED_CHANNELS",
    "FlightError",
    "FlightReport",
    "FlightTable",
    "load_flight",
    "missing_for",
    "write_flight",
    "CleanResult",
    "Cleaner",
    "CleanerConfig",
    "CleanerState",
    "CleaningReport",
    "KeyNameError",
    "VehicleKey",
    "alive_key",
    "check_name",
    "parse_key",
    "service_alive_key",
    "vehicle_key",
]
