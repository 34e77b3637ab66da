"""`baseline predict`: derivatives from dimensions, beside the aircraft file's, and into the database where asked."""

from pathlib import Path

import pytest
from cli_flights import run

from wingwatch.aircraft import SHORT_PERIOD, STRUCTURES, aircraft_toml, load_aircraft
from wingwatch.baselines import open_database

PREDICT = ("baseline", "predict")


def test_a_prediction_is_of_dimensions_alone_and_stands_beside_the_file(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    aircraft = load_aircraft("aerosonde")
    result = run(capsys, [*PREDICT, "--aircraft", "aerosonde", "--json"]).json
    assert result["structures"].keys() == STRUCTURES.keys()
    short = result["structures"]["short_period"]
    assert list(short["derivatives"]) == list(SHORT_PERIOD.derivatives)
    for row in short["derivatives"].values():
        joint = (row["predicted"]["standard_error"] ** 2 + row["a_priori"]["standard_error"] ** 2) ** 0.5
        assert row["z"] == pytest.approx((row["predicted"]["value"] - row["a_priori"]["value"]) / joint)
    assert short["within_95"] == sum(abs(row["z"]) <= 1.96 for row in short["derivatives"].values())
    assert short["derivatives"]["m_q"]["predicted"]["standard_error"] > 4.0  # a factor of three, decision 95
    bare = tmp_path / "bare.toml"
    bare.write_text(aircraft_toml(aircraft.model_copy(update={"coefficients": None, "conditions": ()}), ""))
    blind = run(capsys, [*PREDICT, "--aircraft", bare, "--json"]).json["structures"]["short_period"]
    assert blind["compared"] == 0
    for symbol, row in blind["derivatives"].items():
        assert row["predicted"] == short["derivatives"][symbol]["predicted"]
        assert row["a_priori"] is None


def test_a_stated_tail_is_read(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    aircraft = load_aircraft("aerosonde")
    geometry = aircraft.need_geometry("a test")
    found = []
    for share in (0.1, 0.2):
        path = tmp_path / f"tail{share}.toml"
        stated = {"tail_area_m2": share * geometry.wing_area_m2, "tail_arm_m": 1.0, "fin_area_m2": 0.05}
        changed = aircraft.model_copy(update={"geometry": geometry.model_copy(update=stated)})
        path.write_text(aircraft_toml(changed, ""))
        result = run(capsys, [*PREDICT, "--aircraft", path, "--json"]).json
        assert result["tail"] == "as stated"
        found.append(result["structures"]["short_period"]["derivatives"]["m_eta"]["predicted"]["value"])
    assert found[1] == pytest.approx(
        2.0 * found[0], rel=0.01
    )  # M_eta = -V_T a2 (table B.1); alphadot adds to it


def test_it_is_stored_where_asked_and_takes_no_better_number_s_place(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "w.db"
    own = [*PREDICT, path, "--aircraft", "aerosonde", "--save"]
    assert "states numbers of its own (short_period, dutch_roll, lateral)" in run(capsys, own).sentence
    assert not path.exists()
    assert run(capsys, [*own, "--anyway", "--json"]).json["stored"] > 0
    assert run(capsys, [*own, "--anyway", "--json"]).json["stored"] > 0  # newer of date
    with open_database(path) as database:
        entry = database.expectations("aerosonde", "clean", "short_period")[0]
    assert (entry.provenance, "B.1, B.2" in entry.source) == ("a-priori", True)
    history = run(capsys, ["baseline", "history", path, "--aircraft", "aerosonde", "--json"]).json["changes"]
    assert history[0]["text"] == "predicted by the empirical tables (thesis B.1, B.2) from dimensions"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--aircraft", "jetstream31"), "states no [geometry]"),
        (("--aircraft", "aerosonde", "--save"), "--save needs the database"),
        (("--aircraft", "aerosonde", "--at", "5,1000"), "near a stall or beyond"),
        (("--aircraft", "aerosonde", "--static-margin", "nan"), "--static-margin nan"),
    ],
)
def test_what_cannot_be_predicted_is_told_in_one_sentence(
    capsys: pytest.CaptureFixture[str], options: tuple[str, ...], said: str
) -> None:
    assert said in run(capsys, [*PREDICT, *options]).sentence
