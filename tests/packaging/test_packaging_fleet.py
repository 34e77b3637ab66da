"""What starts a fleet of workers in containers, on one machine and in a cluster: sound, and of one piece.

No engine and no cluster is at hand: files are parsed, and every name that one part uses of another is looked up.
"""

import re
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
import yaml

from wingwatch.cli.arguments import build_parser

DOCKER = Path(__file__).parents[2] / "docker"
ALONE: dict[str, Any] = yaml.safe_load((DOCKER / "compose.yaml").read_text())["services"]
COMPOSE: dict[str, Any] = yaml.safe_load((DOCKER / "compose.fleet.yaml").read_text())
SERVICES: dict[str, dict[str, Any]] = COMPOSE["services"]
FOLDER = DOCKER / "kubernetes"
KUSTOMIZATION: dict[str, Any] = yaml.safe_load((FOLDER / "kustomization.yaml").read_text())
OBJECTS: dict[tuple[str, str], dict[str, Any]] = {
    (found["kind"], found["metadata"]["name"]): found
    for name in KUSTOMIZATION["resources"]
    for found in yaml.safe_load_all((FOLDER / name).read_text())
}
VERSIONS = {
    "Deployment": "apps/v1",
    "Service": "v1",
    "PersistentVolumeClaim": "v1",
    "HorizontalPodAutoscaler": "autoscaling/v2",
}


def parsed(command: Sequence[str]) -> Any:
    """A command as `wingwatch` understands it; it ends the test where it does not."""
    return build_parser("0").parse_args(list(command))


def filled(text: str) -> str:
    """A compose value with each variable at its default."""
    return re.sub(r"\$\{\w+:-([^}]*)\}", r"\1", text)


# -- on one machine ---------------------------------------------------------------------------------------


def test_the_fleet_is_a_router_a_database_a_gateway_and_two_workers() -> None:
    assert set(SERVICES) == {"router", "database", "gateway", "worker"}
    assert filled(SERVICES["worker"]["deploy"]["replicas"]) == "2"
    for name in ("router", "database"):
        shared = {key: value for key, value in ALONE[name].items() if key != "profiles"}
        assert SERVICES[name] == shared
    for name in ("gateway", "worker"):
        assert {
            key: SERVICES[name][key] for key in ("image", "build", "read_only", "cap_drop", "security_opt")
        } == {
            key: ALONE["service"][key] for key in ("image", "build", "read_only", "cap_drop", "security_opt")
        }


def test_gateway_and_workers_are_commands_that_reach_the_router_and_share_data_and_database() -> None:
    gateway, worker = (parsed(SERVICES[name]["command"]) for name in ("gateway", "worker"))
    assert (gateway.command, worker.command) == ("gateway", "worker")
    for given in (gateway, worker):
        assert given.connect == ["tcp/router:7447"]
        assert given.data == Path("/data")
    for key in ("volumes", "environment", "depends_on"):
        assert SERVICES["gateway"][key] == SERVICES["worker"][key]
    assert set(SERVICES["worker"]["depends_on"]) == {"router", "database"}


def test_ports_open_on_this_machine_alone_and_workers_open_none() -> None:
    ports = {name: [filled(port) for port in one.get("ports", [])] for name, one in SERVICES.items()}
    assert ports == {
        "router": ["127.0.0.1:7447:7447"],
        "gateway": ["127.0.0.1:8000:8000"],
        "worker": [],
        "database": [],
    }
    assert SERVICES["worker"]["healthcheck"] == {"disable": True}
    assert filled(SERVICES["worker"]["environment"]["WINGWATCH_DATABASE_URL"]) == (
        "postgresql://wingwatch:@database/wingwatch"
    )


# -- in a cluster -----------------------------------------------------------------------------------------


def containers(kind: str = "Deployment") -> Iterator[tuple[str, dict[str, Any], dict[str, Any]]]:
    """Each deployment's name, pod and container."""
    for (of_kind, name), found in OBJECTS.items():
        if of_kind == kind:
            pod = found["spec"]["template"]["spec"]
            (container,) = pod["containers"]
            yield name, pod, container


def test_every_manifest_is_named_and_of_a_version_that_there_is() -> None:
    names = {path.name for path in FOLDER.iterdir()}
    assert names == {"kustomization.yaml", *KUSTOMIZATION["resources"]}
    assert {key: found["apiVersion"] for key, found in OBJECTS.items()} == {
        key: VERSIONS[key[0]] for key in OBJECTS
    }
    assert {name for kind, name in OBJECTS if kind == "Deployment"} == {"router", "gateway", "worker"}


def test_selectors_find_their_pods_and_ports_their_names() -> None:
    for name, _, container in containers():
        spec = OBJECTS["Deployment", name]["spec"]
        labels = spec["template"]["metadata"]["labels"]
        assert spec["selector"]["matchLabels"] == labels
        service = OBJECTS.get(("Service", name))
        if service is not None:
            assert service["spec"]["selector"] == labels
            served = {port["targetPort"] for port in service["spec"]["ports"]}
            assert served == {port["name"] for port in container["ports"]}
    assert ("Service", "worker") not in OBJECTS


def test_volumes_that_are_mounted_are_there() -> None:
    for _, pod, container in containers():
        volumes = {volume["name"]: volume for volume in pod.get("volumes", [])}
        assert {mount["name"] for mount in container.get("volumeMounts", [])} == set(volumes)
        for volume in volumes.values():
            if "persistentVolumeClaim" in volume:
                assert ("PersistentVolumeClaim", volume["persistentVolumeClaim"]["claimName"]) in OBJECTS


@pytest.mark.parametrize("name", ["gateway", "worker"])
def test_pods_run_commands_that_reach_the_router_without_rights(name: str) -> None:
    (container,) = [container for of, _, container in containers() if of == name]
    given = parsed(container["args"])
    assert (given.command, given.connect) == (name, ["tcp/router:7447"])
    assert container["image"] == KUSTOMIZATION["images"][0]["name"]
    assert container["securityContext"] == {
        "allowPrivilegeEscalation": False,
        "readOnlyRootFilesystem": True,
        "capabilities": {"drop": ["ALL"]},
    }
    (variable,) = container["env"]
    assert variable["name"] == "WINGWATCH_DATABASE_URL"


def test_a_worker_is_ready_by_its_file_and_has_time_to_hand_over() -> None:
    ((pod, container),) = [(pod, container) for name, pod, container in containers() if name == "worker"]
    file = parsed(container["args"]).ready_file
    for probe in ("readinessProbe", "startupProbe"):
        assert container[probe]["exec"]["command"] == ["test", "-f", str(file)]
    assert str(file.parent) in {mount["mountPath"] for mount in container["volumeMounts"]}
    assert pod["terminationGracePeriodSeconds"] > 10.0 + 10.0  # handing over, and writing what waits
    assert "ports" not in container


def test_workers_are_added_by_their_load() -> None:
    spec = OBJECTS["HorizontalPodAutoscaler", "worker"]["spec"]
    target = spec["scaleTargetRef"]
    assert (target["kind"], target["name"]) in OBJECTS
    assert "replicas" not in OBJECTS["Deployment", "worker"]["spec"]  # the autoscaler's to say
    (metric,) = spec["metrics"]
    assert metric["external"]["metric"]["name"] == "wingwatch_worker_load_average"
    assert "avg(wingwatch_worker_load)" in (FOLDER / "autoscaler.yaml").read_text()


@pytest.mark.skipif(shutil.which("kubectl") is None, reason="kubectl is not here")
def test_kustomize_builds_all_manifests() -> None:
    built = subprocess.run(
        ["kubectl", "kustomize", str(FOLDER)], capture_output=True, text=True, check=True, timeout=60.0
    )
    found = list(yaml.safe_load_all(built.stdout))
    assert {(one["kind"], one["metadata"]["name"]) for one in found} == set(OBJECTS)
    assert {one["metadata"]["namespace"] for one in found} == {"wingwatch"}
