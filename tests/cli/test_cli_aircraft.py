"""`aircraft`: files from what people have, checked, and handed on."""

from pathlib import Path

import pytest
from cli_flights import run

from wingwatch.aircraft import (
    FlightCondition,
    aircraft_toml,
    coefficient_standard_error,
    load_aircraft,
    trim,
)


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


KITE = [
    "aircraft",
    "new",
    "kite",
    "--span-m",
    "2.1",
    "--mass-kg",
    "3.4",
    "--area-m2",
    "0.55",
    "--airspeed",
    "15",
]


def test_a_file_from_dimensions_is_plausible_and_wide(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "kite.toml"
    result = run(capsys, [*KITE, "--out", out, "--json"]).json
    assert (result["findings"], result["not_checked"], result["usable"]) == ([], [], True)
    assert "empirical" in result["basis"]
    made = load_aircraft(out)
    c = made.need_coefficients("a test")
    assert made.need_geometry("a test").mean_chord_m == pytest.approx(0.55 / 2.1)
    assert coefficient_standard_error(c, "Cm_q") > abs(c.Cm.q)
    assert coefficient_standard_error(c, "Cl_p") == pytest.approx(0.2 * abs(c.Cl.p))
    assert trim(made, FlightCondition(15.0, 0.0)).elevator_rad == pytest.approx(0.0, abs=1e-3)
    assert "nothing implausible" in run(capsys, ["aircraft", "check", out]).out


def test_what_is_stated_is_in_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "kite.toml"
    stated = ["--inertia-x", "0.2", "--inertia-y", "0.3", "--inertia-z", "0.45", "--inertia-xz", "-0.01"]
    tail = [
        "--tail-area-m2",
        "0.08",
        "--tail-arm-m",
        "0.8",
        "--fin-area-m2",
        "0.04",
        "--static-margin",
        "0.1",
    ]
    assert (
        run(capsys, [*KITE, *stated, *tail, "--chord-m", "0.28", "--altitude", "500", "--out", out]).code == 0
    )
    made = load_aircraft(out)
    assert (made.need_mass("a test").inertia_xz_kg_m2, made.need_geometry("a test").mean_chord_m) == (
        -0.01,
        0.28,
    )
    c = made.need_coefficients("a test")
    assert -c.Cm.alpha / c.CL.alpha == pytest.approx(0.1)
    assert c.relative_standard_error["Cm_alpha"] == c.relative_standard_error["CL_alpha"]
    assert made.envelope is not None
    assert made.envelope.cruise == FlightCondition(15.0, 500.0)


def test_a_file_like_another_of_its_own_dimensions_is_that_aircraft(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, other = tmp_path / "twin.toml", load_aircraft("ultrastick25e")
    g, m = other.need_geometry("a test"), other.need_mass("a test")
    size = [
        "--span-m",
        g.span_m,
        "--mass-kg",
        m.mass_kg,
        "--area-m2",
        g.wing_area_m2,
        "--chord-m",
        g.mean_chord_m,
    ]
    ran = run(
        capsys,
        ["aircraft", "new", "twin", *size, "--altitude", "300", "--like", "ultrastick25e", "--out", out],
    )
    assert ran.code == 0
    made = load_aircraft(out)
    assert made.mass == m
    assert dict(made.need_coefficients("a test").items()) == dict(other.need_coefficients("a test").items())
    assert made.envelope is not None
    assert made.envelope.cruise.airspeed_true_m_s == 17.0


def test_inertias_of_an_aircraft_twice_as_large_go_with_mass_and_square_of_span(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, m = tmp_path / "large.toml", load_aircraft("ultrastick25e").need_mass("a test")
    size = ["--span-m", 2.54, "--mass-kg", 8.0 * m.mass_kg, "--area-m2", 4.0 * 0.3097]
    run(
        capsys,
        ["aircraft", "new", "large", *size, "--altitude", "300", "--like", "ultrastick25e", "--out", out],
    )
    made = load_aircraft(out)
    assert made.need_mass("a test").inertia_y_kg_m2 == pytest.approx(32.0 * m.inertia_y_kg_m2)
    assert made.envelope is not None
    assert made.envelope.cruise.airspeed_true_m_s == pytest.approx(17.0 * 2**0.5, abs=0.05)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--span-m", "2"], "--mass-kg is missing"),
        (["--span-m", "2", "--mass-kg", "3", "--area-m2", "0.5", "--airspeed", "5"], "above 9.8"),
        (
            ["--span-m", "2", "--mass-kg", "3", "--area-m2", "0.5", "--inertia-xz", "9"],
            "its square must be below",
        ),
        (
            ["--span-m", "2", "--mass-kg", "3", "--area-m2", "0.5", "--like", "jetstream31"],
            "states no [coefficients]",
        ),
        (["--span-m", "2", "--mass-kg", "3", "--area-m2", "0.5", "--like", "nobody"], "not in the library"),
    ],
)
def test_what_makes_no_aircraft_is_refused_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], sentence: str
) -> None:
    out = tmp_path / "x.toml"
    assert sentence in run(capsys, ["aircraft", "new", "x", *options, "--out", out]).sentence
    assert not out.exists()


def test_names_and_files_are_checked_first(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        "'My Kite'"
        in run(capsys, ["aircraft", "new", "My Kite", *KITE[3:], "--out", tmp_path / "x.toml"]).sentence
    )
    assert ".toml" in run(capsys, [*KITE, "--out", tmp_path / "x.json"]).sentence
