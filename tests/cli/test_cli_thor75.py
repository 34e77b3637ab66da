"""The real flight: the UltraStick 25e's flight 75 through the same code as live."""

import pytest
from cli_flights import THOR75, THOR75_MAP, run

from wingwatch.telemetry import load_flight

pytestmark = pytest.mark.skipif(
    not THOR75.exists(), reason="the real flight ../shared/data/thor75 is not on this machine"
)
ARGUMENTS = (THOR75, "--aircraft", "ultrastick25e", "--map", THOR75_MAP)


def test_the_map_selects_the_rows_that_the_autopilot_flew() -> None:
    flight = load_flight(THOR75, THOR75_MAP)
    assert len(flight.block) == 14_850  # 297 s at 50 Hz
    assert flight.block.time_s[0] >= 235.0
    assert flight.block.time_s[-1] <= 532.0
    assert {flight.kinds[f"{s}_rad"] for s in ("elevator", "aileron", "rudder")} == {"command"}
    # The field lies at about 240 m (GPS, on the ground); the circuit is flown within 100 m above it.
    altitude = flight.block.column("altitude_m")
    assert 240.0 < altitude.min() < altitude.max() < 340.0
    # True airspeed at 300 m exceeds indicated by the root of the density ratio, 1.5 % in the standard atmosphere.
    ratio = flight.block.column("airspeed_true_m_s") / flight.block.column("airspeed_indicated_m_s")
    assert 1.01 < ratio.min() < ratio.max() < 1.02


def test_estimate_says_every_mode_with_its_standing(capsys: pytest.CaptureFixture[str]) -> None:
    result = run(capsys, ["estimate", *ARGUMENTS, "--json"]).json
    assert result["cleaning"]["accepted"] == 14_850
    assert result["not_estimated"] == {"dutch_roll": "part of the lateral structure"}
    rows = {name: modes["short_period"]["derivatives"] for name, modes in result["estimators"].items()}
    for estimator in ("fourier", "ekf"):
        for symbol in ("z_w", "m_eta"):
            assert rows[estimator][symbol]["outcome"] in ("converged", "settling")
    # A stable aircraft whose elevator works: signs that no error of the baseline excuses.
    for estimator in ("fourier", "ekf"):
        for symbol in ("z_w", "m_w", "m_eta"):
            assert rows[estimator][symbol]["value"] < 0.0


def test_monitor_calls_nothing_damage_and_says_what_it_rests_on(capsys: pytest.CaptureFixture[str]) -> None:
    """The published numbers are known to be wrong for this aircraft; that is no damage and no ice."""
    result = run(capsys, ["monitor", *ARGUMENTS, "--json"]).json
    assert [a for a in result["alerts"] if a["kind"] in ("damage", "icing")] == []
    assert result["status"] in ("healthy", "not_observable")
    assert result["basis"] == "empirical"
    assert result["duration_s"] == pytest.approx(297.0, abs=0.1)
    assert 0.5 * result["duration_s"] < result["observable_s"] <= result["duration_s"]
    assert "own flights" in result["basis_text"]
