"""`baseline`: entries go in from an aircraft file, come out in any convention, and keep their history."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_flights import ROOT, run

from wingwatch.aircraft import (
    LATERAL,
    SHORT_PERIOD,
    Aircraft,
    ConditionEntry,
    Convention,
    DerivativeEntry,
    FlightCondition,
    Provenance,
    aircraft_toml,
    convert,
    linearised_derivatives,
    load_aircraft,
    trimmed,
)
from wingwatch.baselines import Reference, ReferenceKey, open_database

AEROSONDE = load_aircraft("aerosonde")
ACTIONS = ("list", "show", "history", "import", "export", "predict", "learn", "revert", "delete")
CRUISE = trimmed(AEROSONDE, FlightCondition(25.0, 1000.0))
SHORT = linearised_derivatives(AEROSONDE, CRUISE, SHORT_PERIOD)


def identified(factor: float = 1.0) -> Aircraft:
    entry = ConditionEntry(
        airspeed_true_m_s=25.0, altitude_m=1000.0, angle_of_attack_rad=CRUISE.angle_of_attack_rad,
        provenance=Provenance.IDENTIFIED, source="flight 7",
        derivatives={s: DerivativeEntry(value=factor * v, standard_error=0.1) for s, v in SHORT.items()},
    )  # fmt: skip
    return AEROSONDE.model_copy(update={"conditions": (entry,)})


@pytest.fixture
def kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> tuple[Path, Path]:
    """A database with two generations of one entry and two versions of a vehicle's reference, and the aircraft file."""
    file, database = tmp_path / "identified.toml", tmp_path / "b.db"
    for factor in (0.5, 1.0):
        file.write_text(aircraft_toml(identified(factor)))
        assert run(capsys, ["baseline", "import", database, "--aircraft", file, "--json"]).json == {
            "aircraft": "aerosonde", "imported": 1, "stored": 1,
        }  # fmt: skip
    with open_database(database) as opened:
        key = ReferenceKey("default", "uav1", "aerosonde", "clean", "short_period")
        for blocks in (3, 7):
            opened.save_reference(key, Reference(np.eye(6), np.ones(6), blocks, 10.0 * blocks), float(blocks))
    return database, file


def entries(result: dict[str, Any], structure: str = "short_period") -> list[dict[str, Any]]:
    found = result["structures"][structure]
    assert isinstance(found, list)
    return found


def test_what_is_imported_is_shown(capsys: pytest.CaptureFixture[str], kept: tuple[Path, Path]) -> None:
    database, file = kept
    result = run(capsys, ["baseline", "show", database, "--aircraft", file, "--json"]).json
    (entry,) = entries(result)
    assert {s: row["value"] for s, row in entry["derivatives"].items()} == SHORT
    assert all(row["standard_error"] == pytest.approx(0.1) for row in entry["derivatives"].values())
    assert (entry["provenance"], entry["source"], entry["superseded_by"]) == ("identified", "flight 7", None)
    assert entries(result, LATERAL.name) == []
    assert "references" not in result
    british = run(
        capsys, ["baseline", "show", database, "--aircraft", file, "--convention", "british", "--json"]
    ).json
    wanted = convert(
        SHORT, aircraft=AEROSONDE, condition=CRUISE, structure=SHORT_PERIOD,
        source=Convention.CONCISE, target=Convention.BRITISH,
    )  # fmt: skip
    assert {s: row["value"] for s, row in entries(british)[0]["derivatives"].items()} == wanted
    people = run(capsys, ["baseline", "show", database, "--aircraft", file, "--convention", "british"]).out
    assert " M_q " in people
    assert "lateral: the database has no entries" in people


def test_history_keeps_what_was_superseded(
    capsys: pytest.CaptureFixture[str], kept: tuple[Path, Path]
) -> None:
    database, file = kept
    command = ["--aircraft", file, "--vehicle", "uav1", "--json"]
    first, second = entries(past := run(capsys, ["baseline", "history", database, *command]).json)
    assert first["superseded_by"] == second["id"]
    assert first["derivatives"]["m_q"]["value"] == 0.5 * SHORT["m_q"]
    assert [v["blocks"] for v in past["references"]["short_period"]] == [3, 7]
    now = run(capsys, ["baseline", "show", database, *command]).json
    (version,) = now["references"]["short_period"]
    assert (
        version.items() >= {"updated_at_s": 7.0, "blocks": 7, "seconds": 70.0, "withdrawn_by": None}.items()
    )
    people = run(capsys, ["baseline", "history", database, *command[:-1]]).out
    assert f"superseded by {second['id']}" in people
    assert (
        "3 blocks, 30 s (1970-01-01 00:00 UTC, version 1: learned live by a service); 7 blocks"
        in " ".join(people.split())
    )


def test_bad_input_is_one_sentence(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    absent = tmp_path / "absent.db"
    assert "no such file" in run(capsys, ["baseline", "show", absent, "--aircraft", "aerosonde"]).sentence
    bare = tmp_path / "bare.toml"
    bare.write_text('format = 1\nname = "bare"\n')
    assert "[[conditions]]" in run(capsys, ["baseline", "import", absent, "--aircraft", bare]).sentence
    assert "nothing to import" in run(capsys, ["baseline", "import", absent]).sentence
    for at in ("27", "0,1000", "27,nan"):
        said = run(capsys, ["baseline", "show", absent, "--aircraft", "aerosonde", "--at", at]).sentence
        assert "AIRSPEED,ALTITUDE" in said
    assert not absent.exists()


def test_the_manual_names_every_option_and_no_other(capsys: pytest.CaptureFixture[str]) -> None:
    general, *sections = (ROOT / "docs" / "commands.md").read_text().split("\n## ")
    (section,) = (s for s in sections if s.startswith("`wingwatch baseline`"))
    helps = [run(capsys, ["baseline", action, "--help"]).out for action in ACTIONS]
    options = set(re.findall(r"--[a-z][a-z-]+", "".join(helps))) - {"--help"}
    assert options <= set(re.findall(r"--[a-z][a-z-]+", general + section))
    assert set(re.findall(r"--[a-z][a-z-]+", section)) - {"--baseline", "--model"} <= options
