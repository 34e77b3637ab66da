"""Requests made from the service's own OpenAPI description (schemathesis): the answers are as described.

More of them: WINGWATCH_SCHEMA_EXAMPLES=500 pytest tests/api/test_api_schema.py
"""

import os
from typing import Any

import pytest
import schemathesis
from api_fakes import VERSION, FakeBaselines, FakeDiagnoses, FakeHistory, alert, diagnosis_view, past
from hypothesis import HealthCheck, settings
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
)
from test_api_routes import fleet

from wingwatch.api import AppSettings, DiagnosisState, create_app

EXAMPLES = int(os.environ.get("WINGWATCH_SCHEMA_EXAMPLES", "8"))
CHECKS = [
    schemathesis.checks.not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
]


def app() -> Any:
    """The application over fakes that hold some of everything."""
    monitor = fleet()
    history = FakeHistory([past(float(k), "ekf", "short_period", [-6.0] * 6, [0.1] * 6) for k in range(5)])
    diagnoses = FakeDiagnoses()
    diagnoses.views = [
        diagnosis_view("d1"),
        diagnosis_view("d2", state=DiagnosisState.DONE, result={"model": None}),
    ]
    diagnoses.page = b"<p>report</p>"
    shown = AppSettings(diagnoses=diagnoses, baselines=FakeBaselines())
    made = create_app(monitor, lambda: {"zenoh": None}, history, VERSION, shown)
    assert alert(1).id in {a.id for a in monitor.raised}
    return made


@pytest.fixture(scope="module")
def description() -> Any:
    """Read where the test runs: as the tests are collected, every process would make all requests."""
    schema = schemathesis.openapi.from_asgi("/openapi.json", app(), headers={"host": "127.0.0.1"})
    schema.config.update(base_url="http://127.0.0.1")
    return schema


@pytest.fixture(autouse=True)
def _name_of_the_test(request: pytest.FixtureRequest) -> None:
    """schemathesis 4.32 asks for the name that pytest 9 keeps elsewhere."""
    vars(request.node)["_nodeid"] = request.node.nodeid


schema = schemathesis.pytest.from_fixture("description")


@schema.exclude(path="/v1/events").parametrize()  # an event stream has no end; test_api_events reads it
@settings(max_examples=EXAMPLES, derandomize=True, deadline=None, suppress_health_check=list(HealthCheck))
def test_every_answer_is_as_described(case: schemathesis.Case[Any]) -> None:
    case.call_and_validate(checks=CHECKS)
