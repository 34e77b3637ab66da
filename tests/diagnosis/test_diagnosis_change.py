"""The diagnosis of a change: the time before is the reference, and a healthy flight has none."""

from collections.abc import Sequence

import numpy as np
import pytest

from wingwatch.aircraft import load_aircraft
from wingwatch.api import DiagnosisState, DiagnosisView
from wingwatch.diagnosis.candidate import Subject
from wingwatch.diagnosis.change import Outcome, change_as_json, diagnose_change
from wingwatch.diagnosis.change.competing import competing, reference_errors, reference_spread
from wingwatch.diagnosis.change.gaussian import Belief, Quadratic, met
from wingwatch.diagnosis.measured import DiagnosisError
from wingwatch.diagnosis.subject import subject_of
from wingwatch.monitor import AlertState, AlertView
from wingwatch.service.alert_findings import finding_of
from wingwatch.simulation import EFFECTS, Effect, Icing, Scenario, doublet_schedule, simulate
from wingwatch.telemetry import SampleBlock

AEROSONDE = load_aircraft("aerosonde")
ONSET_S, RATE_HZ = 28.0, 25.0
ICING = AlertView(
    id="a", fleet="default", vehicle="uav", kind="icing", cause="icing", level="watch", state=AlertState.ACTIVE,
    raised_s=33.0, cleared_s=None, size=0.1, size_standard_error=0.02, probability=0.95, basis="empirical",
    text="Icing.", evidence=(),
)  # fmt: skip
"""That a monitor might raise."""


def flight(seconds: float, effects: Sequence[Effect] = ()) -> SampleBlock:
    assert AEROSONDE.envelope is not None
    doublets = doublet_schedule(AEROSONDE, AEROSONDE.envelope.cruise, start_s=5.0)
    scenario = Scenario(AEROSONDE, manoeuvres=(doublets,), effects=tuple(effects), turbulence="light", seed=5)
    return simulate(scenario, seconds, RATE_HZ)


@pytest.fixture(scope="module")
def subject() -> Subject:
    return subject_of(flight(12.0), AEROSONDE, {})


def test_ice_on_an_aircraft_that_its_file_describes_wrongly_all_the_time() -> None:
    """Severity 0.05 before and 0.2 since: the change is 0.15, within what severities add to."""
    found = diagnose_change(flight(46.0, [Icing(0.05, 0.0), Icing(0.15, ONSET_S)]), AEROSONDE, ONSET_S + 3.0)
    best = found.explanations[0]
    assert (found.outcome, best.cause) == (Outcome.DECIDED, "icing")
    assert found.onset_s == pytest.approx(ONSET_S, abs=2.0)
    assert best.size == pytest.approx(0.15, abs=0.015)
    assert found.nothing_probability < 1e-6


def test_an_alert_of_ice_on_a_healthy_flight_is_not_confirmed() -> None:
    found = diagnose_change(flight(42.0), AEROSONDE, ONSET_S, asked=("icing",))
    assert found.outcome is Outcome.NOTHING
    (icing,) = [e for e in found.explanations if e.cause == "icing"]
    assert abs(icing.size) < 3.0 * icing.size_standard_error + 0.01
    assert icing.probability < 0.5
    view = DiagnosisView("d", DiagnosisState.DONE, "aerosonde", "", 0, "", 1.0, "", change_as_json(found))
    finding = finding_of(ICING, view)
    assert finding.correction is None
    assert finding.note.startswith("diagnosis: does not confirm icing (icing")


@pytest.mark.parametrize(
    ("onset_s", "said"), [(6.0, "before the onset"), (11.0, "too little flight|before the onset")]
)
def test_too_little_flight_is_said(onset_s: float, said: str) -> None:
    with pytest.raises(DiagnosisError, match=said):
        diagnose_change(flight(12.0), AEROSONDE, onset_s)


def test_causes_that_compete_have_the_names_of_the_simulations_effects(subject: Subject) -> None:
    names = {cause.name for cause in competing(subject)}
    assert names <= set(EFFECTS)
    assert {"icing", "cg_shift", "wing_damage", "surface_offset", "airspeed_error", "thrust_loss"} <= names


def test_the_reference_may_be_wrong_by_what_the_aircraft_file_states(subject: Subject) -> None:
    """Handbook figures of docs/decisions/0003: lift slope 10 %, pitch damping 20 %."""
    errors = reference_errors(subject)
    spread = dict(zip([e.label for e in errors], reference_spread(subject, errors), strict=True))
    assert spread["derivative[z_w]"] == pytest.approx(0.10)
    assert spread["pitch_damping"] == pytest.approx(0.20)
    assert spread["derivative[n_r]"] == pytest.approx(0.20)


def test_a_linear_gaussian_problem_is_met_exactly() -> None:
    """Evidence of y = X d + e, e ~ N(0, 1), by the marginal covariance of y."""
    rng = np.random.default_rng(1)
    x, prior = rng.normal(size=(30, 3)), Belief(np.array([0.3, -0.2, 0.1]), np.diag([4.0, 2.0, 1.0]))
    y = x @ np.array([0.5, 0.1, -0.4]) + rng.normal(size=30)
    at = np.array([0.2, 0.0, 0.3])
    off = y - x @ at
    found = met(Quadratic(at, 0.5 * float(off @ off), x.T @ off, x.T @ x), prior)
    whole = np.eye(30) + x @ prior.covariance @ x.T
    left = y - x @ prior.mean
    exact = -0.5 * float(left @ np.linalg.solve(whole, left)) - 0.5 * np.linalg.slogdet(whole)[1]
    assert found.log_evidence == pytest.approx(exact, abs=1e-9)
    mode = np.linalg.solve(x.T @ x + prior.precision, x.T @ y + prior.precision @ prior.mean)
    assert found.mode == pytest.approx(mode)


def test_a_parameter_at_its_limit_leaves_the_others_at_their_best_beside_it() -> None:
    information, score = np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([1.0, -3.0])
    likelihood = Quadratic(np.zeros(2), 0.0, score, information)
    prior = Belief(np.zeros(2), np.eye(2))
    found = met(likelihood, prior, np.array([0.0]), np.array([1.0]))
    assert found.mode == pytest.approx([1.0 / 3.0, 0.0])
