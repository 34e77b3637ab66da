"""Telemetry: the sample, how it arrives, and what is done before an estimator may see it.

Example:
    Two samples as a vehicle publishes them, and as the service takes them in:

    >>> from wingwatch.telemetry import JSON, SampleBlock, decode_sensors, encode_sensors
    >>> samples = SampleBlock.from_columns({"time_s": [0.00, 0.02], "pitch_rate_rad_s": [0.01, 0.03]})
    >>> payload = encode_sensors(0, samples, JSON)
    >>> payload
    b'{"sequence":0,"columns":{"time_s":[0.0,0.02],"pitch_rate_rad_s":[0.01,0.03]}}'
    >>> decode_sensors(payload, JSON).block.column("pitch_rate_rad_s").tolist()
    [0.01, 0.03]
"""

from wingwatch.telemetry.access_rules import access_rules, vehicle_subject
from wingwatch.telemetry.alignment import Aligner, AlignerState, aligned_delays
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
from wingwatch.telemetry.link_security import LinkSecurity, LinkSecurityError
from wingwatch.telemetry.logs.log import LogError
from wingwatch.telemetry.maps import ChannelEntry, ChannelMap, MapError, RowSelection, load_map, parse_map
from wingwatch.telemetry.messages import (
    JSON,
    PROTOBUF,
    AircraftMessage,
    MessageError,
    MessageLimits,
    SensorsMessage,
    decode_aircraft,
    decode_sensors,
    encode_aircraft,
    encode_sensors,
)
from wingwatch.telemetry.publisher import FlightPublisher
from wingwatch.telemetry.readers import RawTable, TableError, read_table
from wingwatch.telemetry.sample import (
    CHANNEL_INDEX,
    CHANNEL_NAMES,
    CHANNELS,
    INPUT_CHANNELS,
    MAX_GAP_S,
    Channel,
    SampleBlock,
)
from wingwatch.telemetry.sequence import SECOND_PUBLISHER, SequenceState, SequenceTracker
from wingwatch.telemetry.service_messages import ServiceStream, decode_service_object, encode_service_object
from wingwatch.telemetry.subscriber import SensorSubscriber
from wingwatch.telemetry.vehicle_queues import InboundMessage
from wingwatch.telemetry.zenoh_link import (
    DEFAULT_ENDPOINT,
    LinkError,
    ZenohSettings,
    open_session,
    with_free_ports,
)

__all__ = [
    "Channel",
    "CHANNELS",
    "CHANNEL_INDEX",
    "INPUT_CHANNELS",
    "MAX_GAP_S",
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
    "LogError",
    "missing_for",
    "write_flight",
    "Aligner",
    "AlignerState",
    "aligned_delays",
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
    "JSON",
    "PROTOBUF",
    "AircraftMessage",
    "MessageError",
    "MessageLimits",
    "SensorsMessage",
    "decode_aircraft",
    "decode_sensors",
    "encode_aircraft",
    "encode_sensors",
    "ServiceStream",
    "decode_service_object",
    "encode_service_object",
    "DEFAULT_ENDPOINT",
    "LinkError",
    "ZenohSettings",
    "open_session",
    "with_free_ports",
    "LinkSecurity",
    "LinkSecurityError",
    "access_rules",
    "vehicle_subject",
    "InboundMessage",
    "SensorSubscriber",
    "SequenceState",
    "SECOND_PUBLISHER",
    "SequenceTracker",
    "FlightPublisher",
]
