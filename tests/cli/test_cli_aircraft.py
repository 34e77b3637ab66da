"""`aircraft`: files from what people have, checked, and handed on."""

from pathlib import Path

import pytest
from cli_flights import run

from wingwatch.aircraft import aircraft_toml, load_aircraft


def test_the_library_is_listed_and_shown(capsys: pytest.CaptureFixture[str]) -> None:
    listed = run(capsys, ["aircraft", "list", "--json"]).json["aircraft"]
    assert {"aerosonde", "jetstream31", "twinotter", "ultrastick25e"} <= {one["name"] for one in listed}
    shown = run(capsys, ["aircraft", "show", "aerosonde", "--json"]).json
    assert shown["mass_kg"] == 11.0
    assert shown["structures"] == ["short_period", "dutch_roll", "lateral"]
    assert "aerosonde" in run(capsys, ["aircraft", "list"]).out
    assert "span_m = 2.8956" in run(capsys, ["aircraft", "show", "aerosonde"]).out


def test_a_plausible_file_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    ran = run(capsys, ["aircraft", "check", "twinotter"])
    assert (ran.code, ran.out) == (0, "twinotter: nothing implausible\n")
    result = run(capsys, ["aircraft", "check", "twinotter", "--json"]).json
    assert result == {"aircraft": "twinotter", "usable": True, "findings": [], "not_checked": []}


def test_what_is_unusual_is_a_line_and_what_cannot_be_used_exits_with_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    aircraft, file = load_aircraft("aerosonde"), tmp_path / "a.toml"
    mass = aircraft.need_mass("a test")
    file.write_text(
        aircraft_toml(aircraft.model_copy(update={"mass": mass.model_copy(update={"cg_shift_m": 0.2})}))
    )
    ran = run(capsys, ["aircraft", "check", file])
    assert ran.code == 0
    assert ran.out.startswith("warning: static margin")
    wrong = mass.model_copy(update={"inertia_z_kg_m2": 17.0})
    file.write_text(aircraft_toml(aircraft.model_copy(update={"mass": wrong})))
    ran = run(capsys, ["aircraft", "check", file, "--json"])
    assert ran.code == 2
    assert not ran.json["usable"]
    assert "no body has more than 1" in ran.err
    assert ran.err.count("\n") == 1


def test_level_flight_is_looked_at_where_asked(capsys: pytest.CaptureFixture[str]) -> None:
    found = run(capsys, ["aircraft", "check", "aerosonde", "--airspeed", "90", "--json"]).json["findings"]
    assert {"lift_coefficient"} <= {f["check"] for f in found}
    assert "give both" in run(capsys, ["aircraft", "check", "aerosonde", "--altitude", "90"]).sentence
