"""`aircraft`: files from what people have, checked, and handed on."""

import json
import math
from pathlib import Path

import pytest
from avl_texts import st_text
from cli_flights import run

from wingwatch.aircraft import (
    LATERAL,
    SHORT_PERIOD,
    ConditionEntry,
    DerivativeEntry,
    FlightCondition,
    Provenance,
    aircraft_toml,
    at_loading,
    coefficient_standard_error,
    derivative_standard_errors,
    jsbsim_aircraft,
    linearised_derivatives,
    load_aircraft,
    trim,
    trimmed,
)
from wingwatch.cli.main import main


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
    assert coefficient_standard_error(c, "Cl_p") == pytest.approx(
        math.hypot(0.2, 0.7, 0.14) * abs(c.Cl.p), rel=1e-3
    )
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
            ["--span-m", "2", "--mass-kg", "3", "--area-m2", "0.5", "--inertia-z", "9"],
            "no body has more than 1",
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


def test_json_has_values_errors_units_and_covariance(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, aircraft = tmp_path / "a.json", load_aircraft("aerosonde")
    result = run(capsys, ["aircraft", "export", "aerosonde", "--to", "json", "--out", out, "--json"]).json
    assert (result["aircraft"], result["to"]) == ("aerosonde", "json")
    found = json.loads(out.read_text())
    assert found["mass"]["inertia_y_kg_m2"] == 1.135
    assert found["coefficients"]["values"]["Cm_q"] == {
        "value": -38.21,
        "standard_error": pytest.approx(7.642),
    }
    cruise = FlightCondition(25.0, 1000.0)
    lateral = found["linearised"]["structures"]["lateral"]
    assert lateral["order"] == list(LATERAL.derivatives)
    values, errors = (
        linearised_derivatives(aircraft, cruise, LATERAL),
        derivative_standard_errors(aircraft, cruise, LATERAL),
    )
    for k, symbol in enumerate(lateral["order"]):
        row = lateral["derivatives"][symbol]
        assert row["value"] == values[symbol]
        assert row["standard_error"] == pytest.approx(errors[symbol])
        assert lateral["covariance"][k][k] == pytest.approx(errors[symbol] ** 2)
    assert found["linearised"]["structures"]["short_period"]["derivatives"]["m_q"]["unit"] == "1/s"
    run(capsys, ["aircraft", "export", "jetstream31", "--to", "json", "--out", out])
    entry = json.loads(out.read_text())["conditions"][0]
    assert entry["derivatives"]["m_q"] == {"value": -1.547, "standard_error": 0.46, "unit": "1/s"}


def test_identified_derivatives_are_what_jsbsim_flies(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A condition that flights have identified goes before the coefficients, drag and alphadot terms stay."""
    aircraft = load_aircraft("aerosonde")
    condition = trimmed(aircraft, FlightCondition(25.0, 1000.0))
    values = linearised_derivatives(aircraft, condition, SHORT_PERIOD) | linearised_derivatives(
        aircraft, condition, LATERAL
    )
    factors = {"m_q": 0.7, "z_w": 1.1, "m_eta": 0.8, "l_p": 0.9, "n_v": 1.3, "n_zeta": 0.6, "y_v": 1.2}
    entry = ConditionEntry(
        airspeed_true_m_s=25.0, altitude_m=1000.0, angle_of_attack_rad=condition.angle_of_attack_rad,
        provenance=Provenance.IDENTIFIED,
        derivatives={
            s: DerivativeEntry(value=v * factors.get(s, 1.0), standard_error=0.1) for s, v in values.items()
        },
    )  # fmt: skip
    file, out = tmp_path / "mine.toml", tmp_path / "mine" / "mine.xml"
    out.parent.mkdir()
    file.write_text(aircraft_toml(aircraft.model_copy(update={"conditions": (entry,), "name": "mine"})))
    result = run(capsys, ["aircraft", "export", file, "--to", "jsbsim", "--out", out, "--json"]).json
    assert "identified" in result["basis"]
    back, _ = jsbsim_aircraft(out, "back", FlightCondition(25.0, 1000.0))
    for structure in (SHORT_PERIOD, LATERAL):
        found = linearised_derivatives(back, FlightCondition(25.0, 1000.0), structure)
        for symbol, value in found.items():
            stated = entry.derivatives[symbol].value
            assert value == pytest.approx(stated, rel=0.01, abs=0.02), symbol


def test_what_cannot_be_exported_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    to = ["--to", "jsbsim", "--out", tmp_path / "x.xml"]
    assert "states no [geometry]" in run(capsys, ["aircraft", "export", "jetstream31", *to]).sentence
    wrong = ["--to", "jsbsim", "--out", tmp_path / "x.json"]
    assert ".xml" in run(capsys, ["aircraft", "export", "aerosonde", *wrong]).sentence


def test_a_written_file_flies_and_is_watched_without_an_alert(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, flight = tmp_path / "kite.toml", tmp_path / "flight.parquet"
    run(capsys, [*KITE, "--out", out])
    flown = run(
        capsys,
        [
            "simulate",
            "--aircraft",
            out,
            "--seconds",
            "45",
            "--seed",
            "1",
            "--out",
            flight,
            "--json",
        ],
    )
    assert not flown.json["lost"]
    watched = run(capsys, ["monitor", flight, "--aircraft", out, "--json"]).json
    assert watched["alerts"] == []
    assert watched["observable_s"] > 30.0


def test_an_aircraft_of_avl_with_its_mass_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    twin, out = load_aircraft("twinotter"), tmp_path / "twin.toml"
    run_file, mass_file = tmp_path / "twin.st", tmp_path / "twin.mass"
    run_file.write_text(st_text(twin, 0.05))
    m = twin.need_mass("a test")
    own = f"{m.inertia_x_kg_m2} {m.inertia_y_kg_m2} {m.inertia_z_kg_m2} 0.0 {m.inertia_xz_kg_m2}"
    mass_file.write_text(f"{m.mass_kg} 0.694 0.0 -0.043 {own}\n")
    options = ["--from-avl", run_file, "--airspeed", "65", "--altitude", "1500", "--out", out, "--json"]
    result = run(capsys, ["aircraft", "new", "twin", *options, "--mass-file", mass_file]).json
    assert result["findings"] == []
    assert any("aileron is turned" in note for note in result["notes"])
    made = load_aircraft(out)
    assert made.need_mass("a test").inertia_xz_kg_m2 == pytest.approx(m.inertia_xz_kg_m2)
    assert made.cg_shift_m == pytest.approx(0.2)  # Xref is 0.494
    at = FlightCondition(65.0, 1500.0)
    shifted = at_loading(twin, None, 0.2)
    for structure in (SHORT_PERIOD, LATERAL):
        said, known = (
            linearised_derivatives(made, at, structure),
            linearised_derivatives(shifted, at, structure),
        )
        for symbol, value in known.items():
            assert said[symbol] == pytest.approx(value, rel=0.02, abs=0.02), symbol
    result = run(capsys, ["aircraft", "new", "twin", *options, "--mass-kg", "4600"]).json
    assert result["usable"]
    assert (
        load_aircraft(out).need_coefficients("a test").relative_standard_error["Cl_p"] > 0.7
    )  # inertia guessed


def test_an_aircraft_of_jsbsim_of_any_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Written here, so that every derivative is known; its file has another name than its folder."""
    file, out = tmp_path / "plane.xml", tmp_path / "plane.toml"
    run(capsys, ["aircraft", "export", "twinotter", "--to", "jsbsim", "--out", file])
    at = ["--airspeed", "65", "--altitude", "1500"]
    result = run(
        capsys, ["aircraft", "new", "plane", "--from-jsbsim", file, *at, "--out", out, "--json"]
    ).json
    assert result["findings"] == []
    assert result["notes"] == []
    made, twin = load_aircraft(out), load_aircraft("twinotter")
    condition = FlightCondition(65.0, 1500.0)
    for structure in (SHORT_PERIOD, LATERAL):
        known = linearised_derivatives(twin, condition, structure)
        for symbol, value in linearised_derivatives(made, condition, structure).items():
            assert value == pytest.approx(known[symbol], rel=0.01, abs=0.02), symbol


@pytest.mark.parametrize(
    ("content", "options", "sentence"),
    [
        ("<fdm_config/>", [], "--airspeed is missing"),
        ("<fdm_config/>", ["--airspeed", "20"], "has no <metrics>"),
        ("no xml", ["--airspeed", "20"], "is not XML"),
        ("<aircraft/>", ["--airspeed", "20"], "not JSBSim's <fdm_config>"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><fdm_config/>', ["--airspeed", "20"], "entities"),
        ("<fdm_config/>", ["--airspeed", "20", "--mass-kg", "3"], "--mass-kg has no effect with --from-jsbsim"),
        ("<fdm_config/>", ["--airspeed", "20", "--mass-file", "x"], "--mass-file goes with --from-avl alone"),
        (
            "<fdm_config><metrics/><mass_balance><location name='CG'/></mass_balance><aerodynamics><axis name='LIFT'>"
            "<function><product><property>a/b</property></product></function></axis></aerodynamics></fdm_config>",
            ["--airspeed", "20"], "plane.xml: ",
        ),
    ],
)  # fmt: skip
def test_what_is_no_aircraft_of_jsbsim_is_refused_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str, options: list[str], sentence: str
) -> None:
    file = tmp_path / "plane.xml"
    file.write_text(content)
    arguments = ["aircraft", "new", "plane", "--from-jsbsim", file, *options, "--out", tmp_path / "a.toml"]
    assert sentence in run(capsys, arguments).sentence


def test_an_aircraft_of_avl_needs_a_mass(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "twin.st"
    file.write_text(st_text(load_aircraft("twinotter"), 0.05))
    new = ["aircraft", "new", "twin", "--from-avl", file, "--out", tmp_path / "a.toml"]
    assert "--mass-kg is missing" in run(capsys, new).sentence
    assert "write SURFACE=NAME" in run(capsys, [*new, "--mass-kg", "5", "--control", "flap=a"]).sentence
    assert "--span-m has no effect" in run(capsys, [*new, "--span-m", "5"]).sentence


def test_span_and_mass_are_enough_for_an_aircraft_like_another(tmp_path: Path) -> None:
    path = tmp_path / "large.toml"
    arguments = ["--span-m", "2.54", "--mass-kg", "16", "--like", "ultrastick25e", "--out", str(path)]
    assert main(["aircraft", "new", "large", *arguments]) == 0
    other, made = load_aircraft("ultrastick25e").geometry, load_aircraft(path).geometry
    assert other is not None
    assert made is not None
    scale = 2.54 / other.span_m
    assert made.wing_area_m2 == pytest.approx(scale**2 * other.wing_area_m2)
    assert made.mean_chord_m == pytest.approx(scale * other.mean_chord_m)
