"""JSBSim's own aircraft as aircraft files: derivatives as its accelerations have them, and as its flights show them."""

import json
import xml.etree.ElementTree as ET
from pathlib import Path

import jsbsim_aircraft as bundled
import numpy as np
import pytest
from jsbsim_peer import Peer

from wingwatch.aircraft import (
    LATERAL,
    SHORT_PERIOD,
    Aircraft,
    EnvelopeLimits,
    Sensors,
    aircraft_toml,
    jsbsim_aircraft,
    linearised_derivatives,
)
from wingwatch.cli.main import main
from wingwatch.telemetry import CHANNELS, SampleBlock

NAMES = [channel.name for channel in CHANNELS]


def as_file(peer: Peer, folder: Path, name: str) -> Aircraft:
    """The description that a peer has loaded, read as any other."""
    path = folder / "any.xml"
    ET.ElementTree(peer.description).write(path)
    return jsbsim_aircraft(path, name.lower(), bundled.AIRCRAFT[name])[0]


@pytest.mark.parametrize("name", ["c172r", "c182", "F80C", "T37", "DHC6"])
def test_derivatives_are_those_of_jsbsim_s_accelerations(name: str, tmp_path: Path) -> None:
    """Tables, hysteresis, alphadot and inertia coupling; a different way round: by accelerations, not by forces."""
    peer, condition = Peer(name), bundled.AIRCRAFT[name]
    truth = peer.concise(condition, peer.trim(condition))
    aircraft = as_file(peer, tmp_path, name)
    for structure in (SHORT_PERIOD, LATERAL):
        said = linearised_derivatives(aircraft, condition, structure)
        for row in structure.equations:
            # Against the row's own size: derivatives times what they meet in flight, m/s for velocities, rad/s and rad.
            sizes = {
                s: abs(truth[s]) * (10.0 if s[2:] in ("w", "v") else 1.0) for s in said if s.startswith(row)
            }
            for symbol in sizes:
                scale = 10.0 if symbol[2:] in ("w", "v") else 1.0
                assert scale * abs(said[symbol] - truth[symbol]) < 0.01 * max(sizes.values()), symbol


def test_a_flight_of_jsbsim_is_estimated_to_the_file_that_was_read_from_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Signs and units of file, flight and estimator are one: c172r, a doublet a surface, noise of a small UAV."""
    monkeypatch.setattr(bundled, "SECONDS", 24.0)
    subject = bundled.Subject("c172r")
    clean, _ = bundled.fly(subject)
    aircraft = as_file(subject.peer, tmp_path, "c172r").model_copy(
        update={
            "envelope": EnvelopeLimits(airspeed_true_m_s=(50.0, 60.0), altitude_m=(0.0, 2000.0)),
            "modes": subject.file(False, 0).modes,
            "sensors": Sensors(noise_std=bundled.NOISE),
        }
    )
    file, flight = tmp_path / "c172r.toml", tmp_path / "flight.csv"
    file.write_text(aircraft_toml(aircraft))
    block = SampleBlock(bundled.noisy(clean, np.random.default_rng(1)))
    columns = {name: block.column(name) for name in NAMES if np.isfinite(block.column(name)).all()}
    rows = np.column_stack(list(columns.values()))
    np.savetxt(flight, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.10g")
    assert main(["estimate", str(flight), "--aircraft", str(file), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["estimators"]
    for structure, symbols in (
        (SHORT_PERIOD, ("z_w", "m_w", "m_q", "m_eta")), (LATERAL, ("l_p", "l_xi", "n_v", "n_zeta", "l_v", "n_r")),
    ):  # fmt: skip
        said = linearised_derivatives(aircraft, bundled.AIRCRAFT["c172r"], structure)
        for symbol in symbols:
            for estimator in ("fourier", "ekf"):
                row = found[estimator][structure.name]["derivatives"][symbol]
                assert row["value"] == pytest.approx(said[symbol], rel=0.1), symbol
                assert abs(row["value"] - said[symbol]) < 3.0 * row["standard_error"], symbol
