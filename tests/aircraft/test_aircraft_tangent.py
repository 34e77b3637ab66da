"""Coefficients that give stated derivatives, and the covariance of derivatives that coefficients give."""

import numpy as np
import pytest

from wingwatch.aircraft import (
    LATERAL,
    SHORT_PERIOD,
    AircraftDataError,
    ConditionEntry,
    DerivativeEntry,
    FlightCondition,
    Provenance,
    coefficient_standard_error,
    derivative_covariance,
    linearised_derivatives,
    load_aircraft,
    trimmed,
    with_stated_derivatives,
)

TWIN = load_aircraft("twinotter")
CRUISE = FlightCondition(65.0, 1500.0)


def entry(factor: float, structures: tuple[str, ...] = ("short_period", "lateral")) -> ConditionEntry:
    at = trimmed(TWIN, CRUISE)
    values: dict[str, float] = {}
    for structure in (SHORT_PERIOD, LATERAL):
        if structure.name in structures:
            values |= linearised_derivatives(TWIN, CRUISE, structure)
    return ConditionEntry(
        airspeed_true_m_s=65.0, altitude_m=1500.0, angle_of_attack_rad=at.angle_of_attack_rad,
        provenance=Provenance.IDENTIFIED,
        derivatives={
            s: DerivativeEntry(value=v * (1.0 if s in ("z_q", "y_r", "y_p") else factor), standard_error=0.1)
            for s, v in values.items()
        },
    )  # fmt: skip


@pytest.mark.parametrize("with_coefficients", [True, False])
def test_the_linearisation_has_the_stated_derivatives(with_coefficients: bool) -> None:
    stated = entry(0.8)
    start = TWIN if with_coefficients else TWIN.model_copy(update={"coefficients": None})
    made = with_stated_derivatives(start, stated)
    assert trimmed(made, CRUISE).angle_of_attack_rad == pytest.approx(stated.angle_of_attack_rad, abs=0.01)
    for structure in (SHORT_PERIOD, LATERAL):
        for symbol, value in linearised_derivatives(made, CRUISE, structure).items():
            assert value == pytest.approx(stated.derivatives[symbol].value, rel=0.01, abs=0.01), symbol


def test_a_condition_without_a_whole_structure_is_refused() -> None:
    some = entry(1.0).model_copy(
        update={"derivatives": {"m_q": DerivativeEntry(value=-2.0, standard_error=0.1)}}
    )
    with pytest.raises(AircraftDataError, match=r"states no structure in full"):
        with_stated_derivatives(TWIN, some)


def test_the_covariance_is_that_of_every_combination() -> None:
    """A weighted sum of derivatives, moved by one coefficient after the other."""
    aircraft, cruise = load_aircraft("aerosonde"), FlightCondition(25.0, 1000.0)
    c = aircraft.need_coefficients("a test")
    weights = np.random.default_rng(3).normal(size=len(LATERAL.derivatives))
    covariance = derivative_covariance(aircraft, cruise, LATERAL)
    variance = 0.0
    base = np.array(list(linearised_derivatives(aircraft, cruise, LATERAL).values()))
    for name, value in c.items():
        if name.split("_")[0] not in ("CY", "Cl", "Cn"):
            continue  # those of the trim are held, and move nothing lateral there
        moved = c.with_value(name, value + coefficient_standard_error(c, name))
        there = aircraft.model_copy(update={"coefficients": moved})
        change = np.array(list(linearised_derivatives(there, cruise, LATERAL).values())) - base
        variance += float(weights @ change) ** 2
    assert float(weights @ covariance @ weights) == pytest.approx(variance, rel=1e-6)
    assert np.linalg.eigvalsh(covariance).min() > -1e-9
