import pytest
from hypothesis import given
from hypothesis import strategies as st

from wingwatch.telemetry import KeyNameError, VehicleKey, alive_key, parse_key, service_alive_key, vehicle_key

NAMES = st.from_regex(r"[a-z0-9][a-z0-9_-]{0,62}", fullmatch=True)
STREAMS = st.sampled_from(["sensors", "aircraft", "derivatives", "status", "alerts"])


@given(NAMES, NAMES, STREAMS)
def test_a_key_is_taken_apart_as_it_was_built(fleet: str, vehicle: str, stream: str) -> None:
    assert parse_key(vehicle_key(fleet, vehicle, stream)) == VehicleKey(fleet, vehicle, stream)


def test_keys_are_those_of_the_contract() -> None:
    assert vehicle_key("default", "uav-1", "sensors") == "wingwatch/v1/default/uav-1/sensors"
    assert alive_key("default", "uav-1") == "wingwatch/alive/v1/default/uav-1"
    assert service_alive_key("a1") == "wingwatch/alive/v1/service/a1"


@pytest.mark.parametrize(
    "name", ["", "-a", "_a", "A", "a b", "a/b", "*", "**", "a\n", "ä", "a" * 64, "a$*", "a\0"]
)
def test_a_name_that_may_not_stand_in_a_key_is_said(name: str) -> None:
    with pytest.raises(KeyNameError, match="is no valid name"):
        vehicle_key(name, "a", "sensors")
    with pytest.raises(KeyNameError, match="is no valid name"):
        alive_key("a", name)


@pytest.mark.parametrize(
    "key",
    [
        "",
        "wingwatch/v1/default/uav/wheels",
        "wingwatch/v2/default/uav/sensors",
        "wingwatch/v1/default/uav",
        "wingwatch/v1/default/uav/sensors/more",
        "wingwatch/v1/default/*/sensors",
        "wingwatch/v1/**/sensors",
        "wingwatch/v1//uav/sensors",
        "wingwatch/v1/default/uav\n/sensors",
        "wingwatch/v1/" + "a" * 70_000 + "/uav/sensors",
    ],
)
def test_any_other_key_is_refused_in_a_short_sentence(key: str) -> None:
    with pytest.raises(KeyNameError) as caught:
        parse_key(key)
    assert len(str(caught.value)) < 250


@given(st.text())
def test_no_text_breaks_the_parser(text: str) -> None:
    with pytest.raises(KeyNameError):
        parse_key(text)


def test_an_unknown_stream_is_said() -> None:
    with pytest.raises(KeyNameError, match="no stream is called 'wheels'"):
        vehicle_key("a", "b", "wheels")
