"""``docker/grafana/``: every metric and label that the dashboard and the rules name is one that ``/metrics`` has."""

import json
import re
from collections.abc import Mapping
from pathlib import Path

import pytest
import yaml
from api_fakes import FakeMonitor, alert, served, vehicle
from prometheus_client.parser import text_string_to_metric_families
from test_api_metrics import FIGURES

FOLDER = Path(__file__).parents[2] / "docker" / "grafana"
DASHBOARD = json.loads((FOLDER / "dashboard.json").read_text())
RULES = [
    rule for group in yaml.safe_load((FOLDER / "rules.yaml").read_text())["groups"] for rule in group["rules"]
]
EXPRESSIONS = {
    **{
        f"panel {one['title']}, {t['refId']}": t["expr"]
        for one in DASHBOARD["panels"]
        for t in one["targets"]
    },
    **{f"rule {rule['alert']}": rule["expr"] for rule in RULES},
}
METRIC = re.compile(r"\b(?:wingwatch|process)_\w+")
OF_PROMETHEUS = {"job", "instance"}
"""Labels that Prometheus adds itself."""
COUNTERS = {
    "monitor": {"faults": 0}, "loop": {"faults": 0}, "store": {"refused": 0}, "messages": {"overflow": 0},
    "notifications": dict.fromkeys(("delivered", "retried", "refused", "expired", "dropped"), 0),
    "access": {"no_token": 0},
}  # fmt: skip

Known = Mapping[str, Mapping[str, set[str]]]


@pytest.fixture(scope="module")
def known() -> Known:
    """Labels with their values, by metric, of a service with aircraft and alerts."""
    monitor = FakeMonitor()
    monitor.views, monitor.raised = [vehicle("aero-1")], [alert(1)]
    with served(monitor, figures=FIGURES, counters=COUNTERS, checks={"zenoh": None}) as (_, client):
        text = client.get("/metrics").text
    found: dict[str, dict[str, set[str]]] = {}
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            labels = found.setdefault(sample.name, {})
            for label, value in sample.labels.items():
                labels.setdefault(label, set()).add(value)
    return found


@pytest.mark.parametrize("expression", EXPRESSIONS.values(), ids=EXPRESSIONS)
def test_metrics_of_an_expression_exist_with_their_labels(expression: str, known: Known) -> None:
    names = METRIC.findall(expression)
    assert names or expression.startswith("up{")
    assert set(names) <= set(known)
    has = set().union(*(known[name] for name in names)) | OF_PROMETHEUS
    for labels in re.findall(r"\bby \(([^)]*)\)", expression):
        assert {label.strip() for label in labels.split(",")} <= has
    for name, chosen in re.findall(r"((?:wingwatch|process)_\w+)\{([^}]*)\}", expression):
        for label, operator, value in re.findall(r'(\w+)(=~|=)"([^"]*)"', chosen):
            if label in OF_PROMETHEUS:
                continue
            wanted = set(value.split("|")) if operator == "=~" else {value}
            assert wanted <= known[name][label]


def test_panels_lie_beside_each_other_and_legends_name_labels_that_are_kept() -> None:
    taken: set[tuple[int, int]] = set()
    for panel in DASHBOARD["panels"]:
        place = panel["gridPos"]
        cells = {
            (x, y)
            for x in range(place["x"], place["x"] + place["w"])
            for y in range(place["y"], place["y"] + place["h"])
        }
        assert not cells & taken
        assert max(x for x, _ in cells) < 24
        taken |= cells
        for target in panel["targets"]:
            shown = set(re.findall(r"\{\{(\w+)\}\}", target["legendFormat"]))
            kept = {
                label
                for labels in re.findall(r"by \(([^)]*)\)", target["expr"])
                for label in labels.split(", ")
            }
            assert shown <= kept | OF_PROMETHEUS
    assert len({panel["id"] for panel in DASHBOARD["panels"]}) == len(DASHBOARD["panels"])


def test_rules_say_what_is_wrong_and_how_bad_it_is() -> None:
    assert len({rule["alert"] for rule in RULES}) == len(RULES)
    assert {rule["labels"]["severity"] for rule in RULES} == {"warning", "critical"}
    assert all(rule["annotations"]["summary"].endswith(".") for rule in RULES)
