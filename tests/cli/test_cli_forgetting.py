"""`--forgetting`: the time constant with which the estimators that run live forget."""

import math
from pathlib import Path

import pytest
from cli_flights import demo_block, run

from wingwatch.cli.arguments.values import ENDLESS_S, forgetting
from wingwatch.telemetry import write_flight


def test_a_factor_is_a_time_constant_at_its_rate() -> None:
    assert forgetting("0.998") == pytest.approx(20.0, rel=2e-3)  # thesis 9.2, at 25 Hz
    assert forgetting("0.9998") == pytest.approx(200.0, rel=2e-3)
    assert math.exp(-1.0 / (50.0 * forgetting("0.999@50"))) == pytest.approx(0.999)
    assert forgetting("1") == forgetting("none") == ENDLESS_S
    assert forgetting("12.5s") == 12.5


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("20", "'20' is no forgetting"),
        ("0.998@0", "'0.998@0' is no forgetting"),
        ("nans", "'nans' is no forgetting"),
        ("0.9", "'0.9' forgets in 0.38 s, and the estimators read blocks of 10 s"),
    ],
)
def test_what_is_no_time_constant_is_refused(
    capsys: pytest.CaptureFixture[str], text: str, said: str
) -> None:
    assert (
        said in run(capsys, ["estimate", "no.csv", "--aircraft", "aerosonde", "--forgetting", text]).sentence
    )


def test_a_shorter_memory_knows_less(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    flight = tmp_path / "flight.parquet"
    write_flight(demo_block("healthy", 40.0), flight)
    command = ["estimate", flight, "--aircraft", "aerosonde", "--json"]
    answers = [
        run(capsys, [*command, *more]).json
        for more in (["--forgetting", "none"], [], ["--forgetting", "10s"])
    ]
    assert answers[0]["forgetting"]["text"] == "nothing is forgotten"
    assert "forgetting" not in answers[1]
    assert answers[2]["forgetting"]["factor"] == pytest.approx(math.exp(-0.02 / 10.0))
    for estimator in ("fourier", "ekf"):
        modes = [answer["estimators"][estimator]["short_period"]["derivatives"] for answer in answers]
        for symbol in ("m_w", "m_eta"):
            errors = [rows[symbol]["standard_error"] for rows in modes]
            assert errors == sorted(errors)
            assert errors[0] < 0.95 * errors[2]
