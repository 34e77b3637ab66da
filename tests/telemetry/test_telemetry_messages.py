import json
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
import orjson
import pytest
from google.protobuf.json_format import MessageToJson
from hypothesis import given, settings
from hypothesis import strategies as st
from telemetry_flights import THOR75, THOR75_MAP, flight_block, same

from wingwatch.telemetry import (
    CHANNEL_NAMES,
    JSON,
    PROTOBUF,
    AircraftMessage,
    MessageError,
    MessageLimits,
    SampleBlock,
    complete,
    decode_aircraft,
    decode_sensors,
    decode_service_object,
    encode_aircraft,
    encode_sensors,
    encode_service_object,
    load_flight,
    parse_map,
)
from wingwatch.telemetry.protocol import vehicle_pb2

BOTH = pytest.mark.parametrize("encoding", [PROTOBUF, JSON])


def as_json(value: Any) -> bytes:
    return json.dumps(value).encode()


def rejected(payload: bytes, encoding: str = JSON, limits: MessageLimits | None = None) -> MessageError:
    with pytest.raises(MessageError) as caught:
        decode_sensors(payload, encoding, limits)
    assert "\n" not in str(caught.value)
    return caught.value


class TestSensors:
    @BOTH
    def test_samples_arrive_to_the_bit_with_missing_values(self, encoding: str) -> None:
        draw = np.random.default_rng(5)
        block = complete(
            flight_block(10, elevator_rad=draw.normal(size=10) * 1e-300, rudder_rad=[np.nan] * 9 + [0.1])
        )
        message = decode_sensors(encode_sensors(17, block, encoding), encoding)
        assert message.sequence == 17
        np.testing.assert_array_equal(message.block.values, block.values)
        assert message.given == block.present

    @BOTH
    def test_a_publisher_may_send_indicated_airspeed_and_commands_only(self, encoding: str) -> None:
        block = SampleBlock.from_columns(
            {
                "time_s": [0.0],
                "airspeed_indicated_m_s": [20.0],
                "altitude_m": [3000.0],
                "rudder_command_rad": [0.1],
            }
        )
        message = decode_sensors(encode_sensors(0, block, encoding), encoding)
        assert same(message.block, complete(block))
        assert message.block.column("rudder_rad")[0] == 0.1
        assert message.block.column("airspeed_true_m_s")[0] > 20.0
        assert "rudder_rad" not in message.given

    @BOTH
    def test_columns_said_to_be_sent_are_sent_even_without_a_value(self, encoding: str) -> None:
        block = flight_block(4, elevator_rad=[np.nan] * 4, elevator_command_rad=[0.2] * 4)
        columns = ("time_s", "elevator_rad", "elevator_command_rad")
        message = decode_sensors(encode_sensors(0, block, encoding, columns), encoding)
        assert message.given == columns
        assert np.isnan(message.block.column("elevator_rad")).all()

    def test_protobufs_own_json_is_the_contracts(self) -> None:
        block = flight_block(3, rudder_rad=[np.nan, 0.1, np.nan])
        schema = vehicle_pb2.Sensors.FromString(encode_sensors(5, block))
        by_protobuf = MessageToJson(schema)
        assert sorted(json.loads(by_protobuf)["columns"]) == sorted(block.present)
        assert same(
            decode_sensors(by_protobuf.encode(), JSON).block,
            decode_sensors(encode_sensors(5, block), PROTOBUF).block,
        )
        assert decode_sensors(by_protobuf.encode(), JSON).sequence == 5

    def test_the_schema_has_the_channels_and_no_others_in_their_order(self) -> None:
        fields = vehicle_pb2.SensorColumns.DESCRIPTOR.fields
        assert tuple(field.name for field in fields) == CHANNEL_NAMES
        assert [field.number for field in fields] == list(range(1, len(CHANNEL_NAMES) + 1))
        assert all(field.json_name == field.name for field in fields)

    @pytest.mark.parametrize(
        "encoding", ["", "zenoh/bytes", "zenoh/string", "text/plain", "text/json", f"{JSON};v1"]
    )
    def test_json_is_known_by_its_first_character_where_the_encoding_does_not_say(
        self, encoding: str
    ) -> None:
        assert len(decode_sensors(b' \n{"columns": {"time_s": [1]}}', encoding).block) == 1

    @pytest.mark.parametrize("encoding", ["", "zenoh/bytes", f"{PROTOBUF};wingwatch.v1.Sensors"])
    def test_protobuf_is_what_else_it_can_be(self, encoding: str) -> None:
        assert decode_sensors(encode_sensors(3, flight_block(2)), encoding).sequence == 3

    @pytest.mark.parametrize(
        ("message", "reason", "said"),
        [
            ([], "malformed", "must be a JSON object"),
            ({}, "wrong_type", "columns must be an object"),
            ({"columns": []}, "wrong_type", "columns must be an object"),
            ({"columns": {}}, "missing_time", "no time_s"),
            ({"columns": {"pitch_rad": [1.0]}}, "missing_time", "no time_s"),
            ({"columns": {"time_s": [1], "q": [1]}}, "unknown_column", "'q' is no channel"),
            ({"columns": {"time_s": [1], "pitch_rad": [1, 2]}}, "unequal_lengths", "pitch_rad has 2"),
            ({"columns": {"time_s": 1.0}}, "wrong_type", "time_s must be a list"),
            ({"columns": {"time_s": ["1.0"]}}, "wrong_type", "time_s holds '1.0'"),
            ({"columns": {"time_s": [True]}}, "wrong_type", "time_s holds True"),
            ({"columns": {"time_s": [[1.0]]}}, "wrong_type", "time_s holds [1.0]"),
            ({"columns": {"time_s": [{}]}}, "wrong_type", "time_s holds {}"),
            ({"columns": {"time_s": [1]}, "sequenc": 1}, "unknown_field", "no field 'sequenc'"),
            ({"columns": {"time_s": [1]}, "sequence": -1}, "wrong_type", "sequence must be"),
            ({"columns": {"time_s": [1]}, "sequence": 1.5}, "wrong_type", "sequence must be"),
            ({"columns": {"time_s": [1]}, "sequence": 2**64}, "wrong_type", "sequence must be"),
            ({"columns": {"time_s": [1]}, "sequence": True}, "wrong_type", "sequence must be"),
            ({"columns": {"time_s": [1]}, "stream": "new"}, "wrong_type", "stream must be a number"),
            ({"columns": {"time_s": [1]}, "stream": True}, "wrong_type", "stream must be a number"),
            ({"columns": {"time_s": [1]}, "stream": 1e300}, "wrong_type", "stream must be a number"),
            ({"columns": {"time_s": [0] * 1001}}, "too_many_samples", "1001 samples"),
            ({"columns": {"time_s": [float("nan")]}}, "malformed", "null, not NaN"),
            ({"columns": {"time_s": [0.0, 9e15]}}, "bad_value", "time_s holds 9e+15"),
            ({"columns": {"time_s": [-1.7e308]}}, "bad_value", "time_s holds -1.7e+308"),
        ],
    )
    def test_what_is_no_message_has_a_reason_and_a_sentence(
        self, message: Any, reason: str, said: str
    ) -> None:
        problem = rejected(as_json(message))
        assert problem.reason == reason
        assert said in str(problem)

    @BOTH
    def test_the_stream_is_optional_and_comes_back(self, encoding: str) -> None:
        for stream in (None, 0, 17, 2**64 - 1):
            payload = encode_sensors(3, flight_block(2), encoding, stream=stream)
            assert decode_sensors(payload, encoding).stream == stream

    def test_any_number_names_a_stream(self) -> None:
        for sent, stream in (("1.5", 1.5), ("-3", -3), ('"18446744073709551615"', 2**64 - 1), ("null", None)):
            payload = f'{{"stream": {sent}, "columns": {{"time_s": [1]}}}}'
            assert decode_sensors(payload.encode(), JSON).stream == stream

    def test_a_null_is_a_missing_value(self) -> None:
        block = decode_sensors(b'{"columns": {"time_s": [1, 2], "pitch_rad": [null, 0.5]}}', JSON).block
        np.testing.assert_array_equal(block.column("pitch_rad"), [np.nan, 0.5])

    def test_protobuf_problems_have_the_same_reasons(self) -> None:
        assert rejected(b"\x12\x7f", PROTOBUF).reason == "malformed"
        assert rejected(b"", PROTOBUF).reason == "missing_time"
        unequal = vehicle_pb2.Sensors(columns={"time_s": [1.0, 2.0], "pitch_rad": [1.0]})
        assert rejected(unequal.SerializeToString(), PROTOBUF).reason == "unequal_lengths"
        field_99 = b"\xba\x06\x01x"  # number 99, length-delimited, one byte
        assert rejected(field_99, PROTOBUF).reason == "unknown_field"
        inner = vehicle_pb2.SensorColumns(time_s=[1.0]).SerializeToString() + field_99
        assert rejected(b"\x12" + bytes([len(inner)]) + inner, PROTOBUF).reason == "unknown_column"

    def test_a_payload_that_is_too_long_is_not_even_looked_at(self) -> None:
        assert rejected(b"{" * 65_537).reason == "too_large"
        assert rejected(b"\xff" * 10_000_000, PROTOBUF).reason == "too_large"
        small = encode_sensors(0, flight_block(2))
        assert rejected(small, PROTOBUF, MessageLimits(max_bytes=len(small) - 1)).reason == "too_large"
        assert rejected(small, PROTOBUF, MessageLimits(max_samples=1)).reason == "too_many_samples"

    def test_another_encoding_is_named(self) -> None:
        problem = rejected(b"\xa0", "application/cbor")
        assert problem.reason == "unsupported_encoding"
        assert "'application/cbor'" in str(problem)
        with pytest.raises(ValueError, match="not 'text/csv'"):
            encode_sensors(0, flight_block(1), "text/csv")


class TestAircraft:
    @BOTH
    @pytest.mark.parametrize(
        "message",
        [
            AircraftMessage(aircraft="aerosonde"),
            AircraftMessage(aircraft="my-uav.v2", configuration="flaps_10", mass_kg=11.5, cg_shift_m=-0.02),
            AircraftMessage(aircraft="aerosonde", cg_shift_m=0.0),
        ],
    )
    def test_it_comes_back(self, message: AircraftMessage, encoding: str) -> None:
        assert decode_aircraft(encode_aircraft(message, encoding), encoding) == message

    def test_the_rest_is_optional_and_whole_numbers_are_numbers(self) -> None:
        message = decode_aircraft(b'{"aircraft": "aerosonde", "mass_kg": 11}', "")
        assert message == AircraftMessage(aircraft="aerosonde", configuration="clean", mass_kg=11.0)

    @pytest.mark.parametrize(
        ("message", "reason", "said"),
        [
            ({}, "bad_value", "aircraft"),
            ({"aircraft": 5}, "wrong_type", "aircraft"),
            ({"aircraft": "../../etc/passwd"}, "bad_value", "aircraft"),
            ({"aircraft": "a", "mass_kg": -1}, "bad_value", "mass_kg"),
            ({"aircraft": "a", "mass_kg": "11"}, "wrong_type", "mass_kg"),
            ({"aircraft": "a", "weight": 1}, "unknown_field", "no field 'weight'"),
            ({"aircraft": "a" * 5000}, "bad_value", "aircraft"),
            ({"aircraft": "a", "mass_kg": 1e9}, "bad_value", "mass_kg"),
            ({"aircraft": "a", "cg_shift_m": -1e9}, "bad_value", "cg_shift_m"),
        ],
    )
    def test_what_is_no_message_has_a_reason_and_a_sentence(
        self, message: Any, reason: str, said: str
    ) -> None:
        with pytest.raises(MessageError, match=said) as caught:
            decode_aircraft(as_json(message), JSON)
        assert caught.value.reason == reason
        assert len(str(caught.value)) < 300

    def test_protobuf_is_held_to_the_same_rules(self) -> None:
        for bad in (vehicle_pb2.Aircraft(), vehicle_pb2.Aircraft(aircraft="a", mass_kg=float("nan"))):
            with pytest.raises(MessageError):
                decode_aircraft(bad.SerializeToString(), PROTOBUF)


ENCODINGS = st.sampled_from([PROTOBUF, JSON, "", "text/plain", "zenoh/bytes", "application/cbor"]) | st.text(
    max_size=20
)
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)
SHAPED = st.fixed_dictionaries(
    {
        "columns": st.dictionaries(
            st.sampled_from(CHANNEL_NAMES[:4]) | st.text(max_size=3), st.lists(VALUES, max_size=3) | VALUES
        )
    },
    optional={"sequence": VALUES, "aircraft": VALUES, "mass_kg": VALUES},
)


def is_decoded_or_refused(decode: Callable[[], object]) -> bool:
    """Whether there is a message, or a message error says why not; any other error is a failure."""
    try:
        return decode() is not None
    except MessageError as error:
        return bool(str(error))


@settings(deadline=None)
@given(st.binary(max_size=200), ENCODINGS)
def test_any_bytes_are_a_message_or_a_message_error(payload: bytes, encoding: str) -> None:
    for decode in (decode_sensors, decode_aircraft):
        assert is_decoded_or_refused(partial(decode, payload, encoding))
    for stream in ("derivatives", "status", "alerts"):
        assert is_decoded_or_refused(partial(decode_service_object, stream, payload, encoding))


@settings(deadline=None)
@given(SHAPED | VALUES)
def test_any_json_is_a_message_or_a_message_error(value: Any) -> None:
    payload = json.dumps(value).encode()
    for decode in (decode_sensors, decode_aircraft):
        assert is_decoded_or_refused(partial(decode, payload, JSON))


@settings(deadline=None)
@given(st.integers(0, 2**64 - 1), st.integers(0, 400), st.integers(0, 255))
def test_a_damaged_message_is_a_message_or_a_message_error(sequence: int, place: int, byte: int) -> None:
    payload = bytearray(encode_sensors(sequence, flight_block(3)))
    payload[place % len(payload)] = byte
    with suppress(MessageError):
        assert len(decode_sensors(bytes(payload), PROTOBUF).block) <= 1000


DERIVATIVES = {
    "fleet": "default",
    "vehicle": "uav1",
    "time_s": 12.5,
    "convention": "concise",
    "estimators": {
        "fourier": {
            "short_period": {
                "outcome": "converged",
                "derivatives": {
                    "m_q": {
                        "value": -6.0,
                        "standard_error": 0.1,
                        "unit": "1/s",
                        "outcome": "converged",
                        "expected": -6.1,
                        "expected_standard_error": 0.6,
                    }
                },
                "natural_frequency_rad_s": 9.0,
                "natural_frequency_rad_s_standard_error": 0.3,
                "damping_ratio": 0.5,
                "damping_ratio_standard_error": 0.02,
                "reason": "",
                "basis": "a-priori",
            }
        }
    },
}
STATUS = {
    "fleet": "default",
    "vehicle": "uav1",
    "aircraft": "aerosonde",
    "configuration": "clean",
    "state": "healthy",
    "state_since_s": 1.0,
    "reason": "as expected",
    "last_sample_time_s": 2.0,
    "basis": "empirical",
    "basis_text": "its own first flights",
    "worst": {
        "estimator": "ekf",
        "structure": "short_period",
        "derivative": "m_q",
        "z": 1.5,
        "unit": "1/s",
        "meaning": "pitch acceleration due to pitch rate",
    },
    "counts": {"accepted": 100, "duplicate": 2},
    "active_alerts": ["a1"],
    "condition": {"airspeed_true_m_s": 25.0},
    "could_see": [
        {
            "cause": "sensor_bias",
            "channel": "pitch_rate_rad_s",
            "smallest_size": 0.0125,
            "unit": "rad/s",
            "input": "",
        },
        {"cause": "icing", "unit": "", "input": "a doublet of the elevator"},
    ],
    "unseen_surfaces": ["rudder_rad"],
}
PROPOSAL = {
    "id": "p1",
    "fleet": "default",
    "vehicle": "uav1",
    "surface": "rudder_rad",
    "shape": "doublet",
    "amplitude_rad": 0.035,
    "width_s": 0.22,
    "duration_s": 0.44,
    "steps": [
        {"start_s": 0.0, "deflection_rad": 0.035},
        {"start_s": 0.22, "deflection_rad": -0.035},
        {"start_s": 0.44, "deflection_rad": 0.0},
    ],
    "why": "A stuck rudder would not have been noticed yet.",
    "proposed_s": 60.0,
    "valid_until_s": 120.0,
}
ALERT = {
    "id": "a1",
    "fleet": "default",
    "vehicle": "uav1",
    "kind": "icing",
    "cause": "icing",
    "level": "warning",
    "state": "active",
    "raised_s": 70.0,
    "cleared_s": 90.0,
    "size": {"value": 0.1, "standard_error": 0.02},
    "probability": 0.97,
    "basis": "a-priori",
    "text": "ice",
    "evidence": [
        {
            "derivative": "m_q",
            "estimate": -5.0,
            "standard_error": 0.1,
            "expected": -6.0,
            "expected_standard_error": 0.2,
            "z": 4.5,
            "unit": "1/s",
            "meaning": "pitch acceleration due to pitch rate",
        }
    ],
    "notes": ["seen"],
    "channel": "pitch_rate_rad_s",
    "candidates": [
        {"cause": "sensor_bias", "channel": "pitch_rate_rad_s", "probability": 0.7},
        {"cause": "icing", "probability": 0.3},
    ],
    "repeats": 2,
}


class TestServiceObjects:
    @BOTH
    @pytest.mark.parametrize(
        ("stream", "value"),
        [("derivatives", DERIVATIVES), ("status", STATUS), ("alerts", ALERT), ("proposals", PROPOSAL)],
    )
    def test_the_rest_object_comes_back(self, stream: Any, value: dict[str, Any], encoding: str) -> None:
        assert (
            decode_service_object(stream, encode_service_object(stream, value, encoding), encoding) == value
        )

    def test_values_that_are_not_finite_are_null_or_not_set(self) -> None:
        value = {
            "fleet": "f",
            "vehicle": "v",
            "time_s": float("nan"),
            "convention": "concise",
            "estimators": {},
        }
        assert orjson.loads(encode_service_object("derivatives", value))["time_s"] is None
        decoded = decode_service_object(
            "derivatives", encode_service_object("derivatives", value, PROTOBUF), PROTOBUF
        )
        assert "time_s" not in decoded

    def test_parts_and_sizes_that_rest_gives_as_null_are_not_set(self) -> None:
        nothing = {"cause": "icing", "channel": None}
        seen = nothing | {"smallest_size": None, "unit": "", "input": ""}
        status = {**STATUS, "could_see": [seen]}
        decoded = decode_service_object("status", encode_service_object("status", status, PROTOBUF), PROTOBUF)
        assert decoded["could_see"] == [{"cause": "icing", "unit": "", "input": ""}]
        alert = {**ALERT, "channel": None, "evidence": [], "candidates": [nothing | {"probability": None}]}
        decoded = decode_service_object("alerts", encode_service_object("alerts", alert, PROTOBUF), PROTOBUF)
        assert "channel" not in decoded
        assert (decoded["evidence"], decoded["candidates"]) == ([], [{"cause": "icing"}])

    def test_an_alert_of_an_older_service_has_neither_part_nor_candidates(self) -> None:
        older = {name: value for name, value in ALERT.items() if name not in ("channel", "candidates")}
        decoded = decode_service_object("alerts", encode_service_object("alerts", older, PROTOBUF), PROTOBUF)
        assert decoded == {**older, "candidates": []}

    def test_a_key_more_than_the_schema_has_stays_out_of_protobuf_and_in_json(self) -> None:
        value = {**ALERT, "colour": "red"}
        assert (
            decode_service_object("alerts", encode_service_object("alerts", value, PROTOBUF), PROTOBUF)
            == ALERT
        )
        assert decode_service_object("alerts", encode_service_object("alerts", value), JSON) == value

    def test_a_value_of_the_wrong_kind_is_a_programming_error(self) -> None:
        with pytest.raises(ValueError, match="does not fit its schema"):
            encode_service_object("alerts", {"raised_s": "soon"}, PROTOBUF)


@pytest.mark.skipif(not THOR75.exists(), reason="the recorded flight thor75 is not beside the repository")
@BOTH
@pytest.mark.parametrize("samples", [1, 10, 37])
def test_the_real_flight_through_messages_is_the_flight_from_the_file(encoding: str, samples: int) -> None:
    flight = load_flight(THOR75, parse_map(THOR75_MAP))
    values = flight.block.values[:2000]
    columns = flight.wire_columns
    pieces = [SampleBlock(values[i : i + samples]) for i in range(0, len(values), samples)]
    messages = [
        decode_sensors(encode_sensors(i, piece, encoding, columns), encoding)
        for i, piece in enumerate(pieces)
    ]
    assert np.array_equal(
        SampleBlock.concatenate([message.block for message in messages]).values, values, equal_nan=True
    )
    assert messages[0].given == tuple(name for name in CHANNEL_NAMES if name in columns)


@pytest.mark.parametrize(
    ("payload", "said"),
    [
        (b'{"sequence": 0, "columns": {"time_s": [0.0, NaN]}}', "a missing value is null, not NaN"),
        (b'{"sequence": 0, "columns": {"time_s": [0.0, -inf]}}', "a missing value is null, not NaN"),
        (b'{"sequence": 0, "columns": {"time_s": [0.0,]}}', "at character"),
        (b'{"sequence": 0', "at character"),
        ('{"sequence": 0}'.encode("utf-16"), "it is UTF-16 or UTF-32; send UTF-8"),
        (b" ", "it is empty"),
    ],
)
def test_what_is_no_json_is_named_by_its_own_fault(payload: bytes, said: str) -> None:
    with pytest.raises(MessageError) as caught:
        decode_sensors(payload, JSON)
    assert caught.value.reason == "malformed"
    assert said in str(caught.value)


def test_a_byte_order_mark_before_json_does_no_harm() -> None:
    payload = b'\xef\xbb\xbf{"sequence": 3, "columns": {"time_s": [0.5]}}'
    assert decode_sensors(payload, JSON).block.time_s.tolist() == [0.5]
    assert decode_aircraft(b'\xef\xbb\xbf{"aircraft": "aerosonde"}', JSON).aircraft == "aerosonde"
