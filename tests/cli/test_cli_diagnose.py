"""`diagnose`: what it prints and writes, and its refusals; the numerics are handed in."""

import dataclasses
import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from cli_flights import demo_block, run
from diagnosis_examples import AGREES, FOUND, NOTHING_FOUND

from wingwatch import diagnosis
from wingwatch.aircraft import Aircraft, load_aircraft
from wingwatch.cli.main import main
from wingwatch.diagnosis import Cause, Diagnosis, DiagnosisError, as_json
from wingwatch.telemetry import SampleBlock, write_flight


@dataclasses.dataclass
class Numerics:
    """What the command asks of them, and what it gets."""

    answer: Diagnosis | BaseException = FOUND
    asked: list[Mapping[str, Any]] = dataclasses.field(default_factory=list)

    def diagnose(self, flight: SampleBlock, aircraft: Aircraft, **more: Any) -> Diagnosis:
        self.asked.append({"flight": flight, "aircraft": aircraft, **more})
        progress: Callable[[str, float], None] = more["progress"]
        progress("simulating the flight", 0.5)
        if isinstance(self.answer, BaseException):
            raise self.answer
        return self.answer


@pytest.fixture
def numerics(monkeypatch: pytest.MonkeyPatch) -> Numerics:
    fake = Numerics()
    monkeypatch.setattr(diagnosis, "diagnose", fake.diagnose, raising=False)
    return fake


@pytest.fixture
def flight(tmp_path: Path) -> Path:
    path = tmp_path / "flight.csv"
    write_flight(SampleBlock(demo_block("healthy", 10.0).values[:200]), path)
    return path


def test_the_page_says_the_answer_and_all_that_it_rests_on(
    capsys: pytest.CaptureFixture[str], numerics: Numerics, flight: Path
) -> None:
    ran = run(capsys, ["diagnose", flight, "--aircraft", "aerosonde"])
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.startswith("The simulation of aerosonde departs from this flight")
    order = [
        ran.out.index(words)
        for words in (
            "misfit of the simulation", "causes tried", "probability 0.97", "delay 0.0603 ± 0.0019 s",
            "no flight tells apart", "judged on windows left out", "-92.05", "17 %", "note: ",
        )
    ]  # fmt: skip
    assert order == sorted(order)


@pytest.mark.parametrize("answer", [NOTHING_FOUND, AGREES], ids=["nothing", "agrees"])
def test_there_is_a_page_where_nothing_was_found(
    capsys: pytest.CaptureFixture[str], numerics: Numerics, flight: Path, answer: Diagnosis
) -> None:
    numerics.answer = answer
    ran = run(capsys, ["diagnose", flight, "--aircraft", "aerosonde"])
    assert ran.code == 0
    assert "misfit of the simulation" in ran.out


def test_json_is_the_contracts_object_and_the_files_are_written(
    capsys: pytest.CaptureFixture[str], numerics: Numerics, flight: Path, tmp_path: Path
) -> None:
    report, model = tmp_path / "report.html", tmp_path / "extended.toml"
    arguments = [
        "diagnose",
        flight,
        "--aircraft",
        "aerosonde",
        "--report",
        report,
        "--model",
        model,
        "--json",
    ]
    result = run(capsys, arguments).json
    assert (result.pop("report"), result.pop("model_file")) == (str(report), str(model))
    assert {one["standing"] for one in result.pop("plausibility")} == {"right"}
    assert result == json.loads(json.dumps(as_json(FOUND)))
    assert report.read_text().startswith("<!doctype html>")
    assert load_aircraft(model) == FOUND.model
    head = model.read_text().split("format = 1")[0]
    assert all(line.startswith("#") for line in head.splitlines())
    assert re.search(r"on \d{4}-\d\d-\d\d\.", head)
    for words in ("flight <7>.csv", "elevator effectiveness", "0.301 ± 0.012", "delay 0.0603 ± 0.0019 s"):
        assert words in head
    assert sorted(p.name for p in tmp_path.iterdir()) == ["extended.toml", "flight.csv", "report.html"]


def test_the_numerics_get_clean_samples_kinds_and_the_other_flight(
    capsys: pytest.CaptureFixture[str], numerics: Numerics, flight: Path, tmp_path: Path
) -> None:
    other = tmp_path / "other.csv"
    write_flight(SampleBlock(demo_block("healthy", 10.0).values[:300]), other)
    run(capsys, ["diagnose", flight, "--aircraft", "aerosonde", "--validate", other])
    (asked,) = numerics.asked
    assert len(asked["flight"]) == 200
    assert len(asked["validate"]) == 300
    assert asked["aircraft"] == load_aircraft("aerosonde")
    assert asked["kinds"]["elevator_rad"] == "position"
    assert asked["source"] == str(flight)


def test_the_other_flight_may_have_a_map_of_its_own(
    capsys: pytest.CaptureFixture[str], numerics: Numerics, flight: Path, tmp_path: Path
) -> None:
    other = tmp_path / "commands.toml"
    other.write_text(
        'format = 1\n[rows]\nto_s = 2.0\n[channels]\nelevator_rad = { source = "elevator_rad", kind = "command" }\n'
    )
    run(
        capsys, ["diagnose", flight, "--aircraft", "aerosonde", "--validate", flight, "--validate-map", other]
    )
    (asked,) = numerics.asked
    assert len(asked["validate"]) < len(asked["flight"]) == 200
    assert asked["kinds"]["elevator_rad"] == "position"
    assert asked["validate_kinds"]["elevator_rad"] == "command"
    alone = run(capsys, ["diagnose", flight, "--aircraft", "aerosonde", "--validate-map", other])
    assert "--validate" in alone.sentence


def test_with_no_model_to_offer_none_is_written_and_that_is_said(
    capsys: pytest.CaptureFixture[str], numerics: Numerics, flight: Path, tmp_path: Path
) -> None:
    numerics.answer, model = NOTHING_FOUND, tmp_path / "extended.toml"
    ran = run(capsys, ["diagnose", flight, "--aircraft", "aerosonde", "--model", model, "--json"])
    assert ran.json["model_file"] is None
    assert "no extended model is offered" in ran.err
    assert not model.exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--report", "x.txt"], ".html or .htm"),
        (["--report", "absent/x.html"], "create it"),
        (["--model", "x.json"], ".toml"),
        (["--model", "absent/x.toml"], "create it"),
        (["--model", "map.toml", "--map", "map.toml"], "is a file that is read"),
        (["--validate", "absent.csv"], "absent.csv"),
        (["--map", "absent.toml"], "absent.toml"),
    ],
)
def test_bad_input_is_one_sentence(
    capsys: pytest.CaptureFixture[str], numerics: Numerics, flight: Path, options: list[str], said: str
) -> None:
    (flight.parent / "map.toml").write_text("format = 1\n[channels]\n")
    paths = [o if o.startswith("--") else flight.parent / o for o in options]
    assert said in run(capsys, ["diagnose", flight, "--aircraft", "aerosonde", *paths]).sentence
    assert numerics.asked == []


def test_what_the_numerics_refuse_is_one_sentence(
    capsys: pytest.CaptureFixture[str], numerics: Numerics, flight: Path
) -> None:
    numerics.answer = DiagnosisError("the flight is too short:\n4 s of the 20 that are needed")
    ran = run(capsys, ["diagnose", flight, "--aircraft", "aerosonde"])
    assert ran.sentence == "wingwatch: error: the flight is too short: 4 s of the 20 that are needed"


def test_an_aircraft_that_is_not_known_is_refused_before_the_flight_is_read(
    capsys: pytest.CaptureFixture[str], numerics: Numerics, tmp_path: Path
) -> None:
    assert "zeppelin" in run(capsys, ["diagnose", tmp_path / "no.csv", "--aircraft", "zeppelin"]).sentence


def test_an_interrupt_leaves_no_file(
    capsys: pytest.CaptureFixture[str], numerics: Numerics, flight: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupted)
    report = flight.parent / "report.html"
    assert main(["diagnose", str(flight), "--aircraft", "aerosonde", "--report", str(report)]) == 130
    assert [p.name for p in flight.parent.iterdir()] == ["flight.csv"]
    assert capsys.readouterr().err == "wingwatch: interrupted\n"


def test_texts_cannot_break_out_of_the_models_comment(
    capsys: pytest.CaptureFixture[str], numerics: Numerics, flight: Path, tmp_path: Path
) -> None:
    cause: Cause = dataclasses.replace(FOUND.causes[0], name="icing\nname = 'owned'\n[mass]")
    numerics.answer = dataclasses.replace(FOUND, source="a\r\nname = 'owned'\x00", causes=(cause,))
    model = tmp_path / "extended.toml"
    assert run(capsys, ["diagnose", flight, "--aircraft", "aerosonde", "--model", model]).code == 0
    assert load_aircraft(model) == FOUND.model


def test_a_model_that_cannot_be_read_back_is_not_handed_out(
    capsys: pytest.CaptureFixture[str], numerics: Numerics, flight: Path, tmp_path: Path
) -> None:
    assert FOUND.model is not None
    numerics.answer = dataclasses.replace(FOUND, model=FOUND.model.model_copy(update={"name": "No Name"}))
    model = tmp_path / "extended.toml"
    ran = run(capsys, ["diagnose", flight, "--aircraft", "aerosonde", "--model", model])
    assert ran.code == 2
    assert not model.exists()
