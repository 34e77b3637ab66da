"""Derivatives in other conventions: values, errors and expectations as ``wingwatch.aircraft`` gives them."""

import math
from collections.abc import Generator
from typing import Any

import httpx
import pytest
from api_fakes import FakeMonitor, derivative, served, vehicle

from wingwatch.aircraft import (
    LATERAL,
    SHORT_PERIOD,
    Convention,
    FlightCondition,
    ModeStructure,
    convert,
    convert_standard_errors,
    load_aircraft,
    unit,
)

CONDITION = {
    "airspeed_true_m_s": 25.0,
    "altitude_m": 1000.0,
    "air_density_kg_m3": 1.1116,
    "angle_of_attack_rad": 0.05,
}
VALUES = {
    structure: {symbol: -1.0 - 0.5 * place for place, symbol in enumerate(structure.derivatives)}
    for structure in (SHORT_PERIOD, LATERAL)
}


def mode(structure: ModeStructure, **more: Any) -> dict[str, Any]:
    entries = {
        symbol: derivative(value, 0.125, expected=value + 1.0, expected_standard_error=0.25)
        for symbol, value in VALUES[structure].items()
    }
    return {"outcome": "converged", "derivatives": entries, "damping_ratio": 0.5, **more}


@pytest.fixture(scope="module")
def client() -> Generator[httpx.Client]:
    monitor = FakeMonitor()
    names = ("given", "latest", "young", "bare", "part")
    monitor.views = [vehicle(name) for name in names[:2]]
    monitor.views += [
        vehicle("young", condition={}),
        vehicle("bare", aircraft="jetstream31"),
        vehicle("part"),
        vehicle("loaded", mass_kg=20.0, cg_shift_m=0.01),
    ]
    modes = {
        "given": {
            "short_period": mode(SHORT_PERIOD, condition=CONDITION),
            "lateral": mode(LATERAL, condition=CONDITION),
        },
        "latest": {"short_period": mode(SHORT_PERIOD)},
        "young": {"short_period": mode(SHORT_PERIOD)},
        "bare": {"short_period": mode(SHORT_PERIOD)},
        "part": {"short_period": mode(SHORT_PERIOD)},
        "loaded": {"short_period": mode(SHORT_PERIOD, condition=CONDITION)},
    }
    modes["part"]["short_period"]["derivatives"] = {
        "z_w": derivative(math.nan, math.inf, expected=-4.0),
        "m_q": derivative(-6.0, 0.1),
    }
    for name in (*names, "loaded"):
        monitor.current["default", name] = {"time_s": 9.0, "estimators": {"fourier": modes[name]}}
    with served(monitor) as (_, connection):
        yield connection


def shown(client: httpx.Client, name: str, convention: Convention) -> Any:
    answer = client.get(f"/v1/vehicles/{name}/derivatives?convention={convention}")
    assert answer.status_code == 200, answer.text
    assert answer.json()["convention"] == convention
    return answer.json()["estimators"]["fourier"]


@pytest.mark.parametrize("structure", [SHORT_PERIOD, LATERAL], ids=lambda s: s.name)
@pytest.mark.parametrize("convention", [Convention.DIMENSIONAL, Convention.BRITISH, Convention.AMERICAN])
def test_values_errors_and_expectations_are_converted_at_the_estimates_own_condition(
    client: httpx.Client, structure: ModeStructure, convention: Convention
) -> None:
    aircraft, condition = load_aircraft("aerosonde"), FlightCondition(configuration="clean", **CONDITION)
    values = convert(
        VALUES[structure],
        aircraft=aircraft,
        condition=condition,
        structure=structure,
        source=Convention.CONCISE,
        target=convention,
    )
    errors = convert_standard_errors(
        dict.fromkeys(structure.derivatives, 0.25),
        aircraft=aircraft,
        condition=condition,
        structure=structure,
        source=Convention.CONCISE,
        target=convention,
    )
    entries = shown(client, "given", convention)[structure.name]["derivatives"]
    for symbol in structure.derivatives:
        assert entries[symbol]["value"] == values[symbol]
        assert entries[symbol]["expected_standard_error"] == errors[symbol]
        # exactly half: the conversion is linear, and 0.125 is 0.25 times a power of two
        assert entries[symbol]["standard_error"] == 0.5 * errors[symbol]
        assert entries[symbol]["unit"] == unit(symbol, convention)


def test_what_is_not_a_derivative_stays(client: httpx.Client) -> None:
    assert shown(client, "given", Convention.BRITISH)["short_period"]["damping_ratio"] == 0.5
    concise = shown(client, "given", Convention.CONCISE)["short_period"]["derivatives"]
    assert {symbol: entry["value"] for symbol, entry in concise.items()} == VALUES[SHORT_PERIOD]


def test_american_pitch_damping_by_hand(client: httpx.Client) -> None:
    """Cm_q = m_q I_y 2 V / (half rho V^2 S c^2), plus alphadot's part, absent from the Aerosonde's file."""
    aircraft = load_aircraft("aerosonde")
    assert aircraft.geometry is not None
    assert aircraft.mass is not None
    assert aircraft.coefficients is not None
    assert aircraft.coefficients.Cm.alphadot == 0.0
    moment = VALUES[SHORT_PERIOD]["m_q"] * aircraft.mass.inertia_y_kg_m2
    area, chord = aircraft.geometry.wing_area_m2, aircraft.geometry.mean_chord_m
    wanted = moment * 2.0 * 25.0 / (0.5 * 1.1116 * 25.0**2 * area * chord**2)
    entry = shown(client, "latest", Convention.AMERICAN)["short_period"]["derivatives"]["m_q"]
    assert entry["value"] == pytest.approx(wanted, rel=1e-14)  # a dozen roundings of 1.1e-16
    assert entry["name"] == "Cm_q"


def test_a_loaded_vehicle_is_converted_at_its_own_mass(client: httpx.Client) -> None:
    entries = shown(client, "loaded", Convention.DIMENSIONAL)["short_period"]["derivatives"]
    assert entries["z_w"]["value"] == pytest.approx(20.0 * VALUES[SHORT_PERIOD]["z_w"], rel=1e-12)


def test_an_unknown_derivative_stays_unknown_and_spoils_no_other(client: httpx.Client) -> None:
    entries = shown(client, "part", Convention.BRITISH)["short_period"]["derivatives"]
    assert set(entries) == {"z_w", "m_q"}
    assert entries["z_w"]["value"] is None
    assert entries["z_w"]["standard_error"] is None
    assert entries["z_w"]["expected"] < 0.0
    assert entries["m_q"]["value"] < 0.0


@pytest.mark.parametrize(("name", "words"), [("young", "airspeed"), ("bare", "[mass]")])
def test_what_cannot_be_converted_says_why(client: httpx.Client, name: str, words: str) -> None:
    answer = client.get(f"/v1/vehicles/{name}/derivatives?convention=american")
    assert answer.status_code == 422
    assert f"'{name}'" in answer.json()["detail"]
    assert words in answer.json()["detail"]
    assert not answer.json()["detail"].endswith("..")
