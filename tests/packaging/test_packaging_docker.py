"""The image's build steps run in a temporary folder, and the compose file is sound; no engine is needed.

COPY and RUN of the build stage are carried out on a copy of what the ignore file lets through, with the
image's folders moved below a temporary one. Steps that change the system (users, owners) are only looked at.
"""

import fnmatch
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path, PurePosixPath
from typing import Any

import pytest
import yaml
import zenoh

from wingwatch.cli.arguments import build_parser
from wingwatch.service.kernel_steps import LIVE
from wingwatch.service.kernel_steps import STEPS as STEPS_OF_KERNELS
from wingwatch.service.settings import serve_settings
from wingwatch.telemetry import ZenohSettings

ROOT = Path(__file__).parents[2]
DOCKERFILE = ROOT / "docker" / "Dockerfile"
IGNORE = ROOT / "docker" / "Dockerfile.dockerignore"
CONSTRAINTS = (ROOT / "constraints.txt").read_text()
INSTRUCTIONS = {
    "FROM",
    "WORKDIR",
    "COPY",
    "RUN",
    "ENV",
    "USER",
    "VOLUME",
    "EXPOSE",
    "HEALTHCHECK",
    "ENTRYPOINT",
    "CMD",
}
SERVE_OPTIONS = {
    "--config",
    "--host",
    "--port",
    "--listen",
    "--connect",
    "--name",
    "--certificate",
    "--private-key",
    "--data",
    "--aircraft",
}


@dataclass(frozen=True)
class Step:
    """One instruction of a Dockerfile."""

    stage: int
    word: str
    text: str


def read_steps(text: str) -> list[Step]:
    """The instructions of a Dockerfile, comments and continuation lines resolved."""
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    joined = re.sub(r"\\\n\s*", "", "\n".join(lines))
    steps, stage = [], -1
    for line in joined.splitlines():
        word, rest = line.split(None, 1)
        stage += word == "FROM"
        steps.append(Step(stage, word, rest))
    return steps


STEPS = read_steps(DOCKERFILE.read_text())


def ignored(name: str, patterns: list[str]) -> bool:
    """Whether an ignore file keeps a path out: the last pattern that fits it, or a folder above it, wins."""
    out = False
    path = PurePosixPath(name)
    above = [path, *(parent for parent in path.parents if parent.name)]
    for pattern in patterns:
        bare = pattern.removeprefix("!")
        anywhere = bare.startswith("**/")  # otherwise a pattern starts at the root
        tried = [part.name if anywhere else str(part) for part in above]
        if fnmatch.filter(tried, bare.removeprefix("**/")):
            out = not pattern.startswith("!")
    return out


def ignore_patterns() -> list[str]:
    """Lines of the ignore file without comments."""
    lines = IGNORE.read_text().splitlines()
    return [line.strip() for line in lines if line.strip() and not line.startswith("#")]


@pytest.fixture(scope="module")
def context(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The build context: the project's files, links kept as links, without what the ignore file keeps out."""
    listing = subprocess.run(
        ["git", "-c", "safe.directory=*", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        check=False,
    )
    if listing.returncode:
        pytest.skip("this is not a git clone, so there is no list of the project's files to build from")
    target = tmp_path_factory.mktemp("context")
    for name in listing.stdout.decode().split("\0"):
        source = ROOT / name
        if name and (source.is_file() or source.is_symlink()) and not ignored(name, ignore_patterns()):
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target / name, follow_symlinks=False)
    return target


def copy_step(step: Step, context: Path, workdir: Path) -> None:
    """COPY as the engine does it: the contents of a folder, or files into a folder."""
    *sources, target = shlex.split(step.text)
    place = workdir / target
    for source in sources:
        origin = context / source
        assert origin.exists(), f"COPY {step.text}: {source} is not in the build context"
        if origin.is_dir():
            shutil.copytree(origin, place, symlinks=True, dirs_exist_ok=True)
        else:
            assert target.endswith("/"), "several files need a folder as target, with a slash at its end"
            place.mkdir(parents=True, exist_ok=True)
            shutil.copy2(origin, place / origin.name)


@pytest.fixture(scope="module")
def image(context: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The build stage carried out below a temporary folder that stands for the image's root."""
    root = tmp_path_factory.mktemp("image")
    workdir = root
    for step in (s for s in STEPS if s.stage == 0):
        if step.word == "WORKDIR":
            workdir = root / step.text.lstrip("/")
            workdir.mkdir(parents=True)
        elif step.word == "COPY":
            copy_step(step, context, workdir)
        elif step.word == "RUN":
            command = step.text.replace("/opt/", f"{shlex.quote(str(root))}/opt/")
            command = re.sub(r"^python ", f"{shlex.quote(sys.executable)} ", command)
            (root / "opt").mkdir(exist_ok=True)
            done = subprocess.run(
                ["sh", "-c", command], cwd=workdir, capture_output=True, text=True, check=False,
                env=os.environ | {"PIP_COMPILE": "0"},
            )  # fmt: skip
            if "the package index cannot be reached" in done.stderr:
                pytest.skip("the package index cannot be reached, and the image's packages come from it")
            assert done.returncode == 0, f"RUN {step.text}\n{done.stdout}\n{done.stderr}"
    return root


def last(word: str) -> str:
    """Text of the last instruction of this name in the final stage."""
    return [s.text for s in STEPS if s.word == word and s.stage == max(t.stage for t in STEPS)][-1]


def test_every_instruction_is_one_that_these_tests_understand() -> None:
    assert {s.word for s in STEPS} <= INSTRUCTIONS


def test_two_stages_on_one_pinned_slim_python() -> None:
    bases = [s.text for s in STEPS if s.word == "FROM"]
    assert len(bases) == 2
    assert bases[0].endswith(" AS build")
    assert bases[0].split()[0] == bases[1]
    assert re.fullmatch(r"python:3\.11\.\d+-slim-[a-z]+(@sha256:[0-9a-f]{64})?", bases[1])


def test_the_image_runs_as_a_user_who_owns_only_the_data() -> None:
    assert last("USER") == "wingwatch"
    create = last("RUN")
    assert "useradd --uid 10001" in create
    assert "install -d -o wingwatch -g wingwatch /data" in create
    subprocess.run(["sh", "-n", "-c", create], check=True)
    order = [s.word for s in STEPS if s.stage == 1]
    assert order.index("RUN") < order.index("USER") < order.index("ENTRYPOINT")
    assert last("VOLUME") == last("WORKDIR") == "/data"


def test_what_the_final_stage_takes_is_what_the_first_made() -> None:
    assert last("COPY") == "--from=build /opt/wingwatch /opt/wingwatch"
    assert "PATH=/opt/wingwatch/bin:$PATH" in last("ENV")


def test_the_command_says_only_what_serve_understands() -> None:
    assert json.loads(last("ENTRYPOINT")) == ["wingwatch"]
    verb, *options = json.loads(last("CMD"))
    assert verb == "serve"
    given = dict(zip(options[::2], options[1::2], strict=True))
    assert set(given) <= SERVE_OPTIONS
    assert given["--data"] == last("VOLUME")
    assert {given["--port"], given["--listen"].rsplit(":", 1)[1]} == set(last("EXPOSE").split())


def test_the_ignore_file_lets_in_what_the_wheel_needs_and_no_more(context: Path) -> None:
    tops = {p.name for p in context.iterdir()}
    packages = {p.parent.name for p in ROOT.glob("*/__init__.py")}
    assert tops == packages | {"LICENSE", "README.md", "constraints.txt", "pyproject.toml", "tools"}
    assert not list(context.rglob("__pycache__"))


@pytest.mark.parametrize(
    ("name", "out"),
    [
        ("tests/packaging/test_packaging_docker.py", True),
        (".git/config", True),
        ("data/wingwatch.db", True),
        ("tools/install.py", False),
        ("tools/other.py", True),
        ("monitor/views.py", False),
        ("monitor/__pycache__/views.pyc", True),
        ("wingwatch/monitor", False),
        ("proto/wingwatch/v1/vehicle.proto", True),
        ("tests/aircraft/test_aircraft.py", True),
    ],
)
def test_the_reading_of_the_ignore_file(name: str, out: bool) -> None:
    assert ignored(name, ignore_patterns()) is out


@pytest.mark.slow
def test_the_build_stage_installs_a_copy_without_developers_tools(image: Path) -> None:
    program = image / "opt" / "wingwatch" / "bin"
    listing = subprocess.run(
        [program / "python", "-m", "pip", "list", "--format=json"], capture_output=True, check=True
    )
    have = {row["name"].lower(): row for row in json.loads(listing.stdout)}
    assert {"wingwatch", "psycopg", "numpy"} <= set(have)
    assert "editable_project_location" not in have["wingwatch"]
    assert not {"pytest", "mypy", "ruff"} & set(have)
    shutil.rmtree(image / "src")  # the final stage does not have it
    where = subprocess.run(
        [program / "python", "-c", "import wingwatch; print(wingwatch.__file__)"],
        cwd=image,
        env={k: v for k, v in os.environ.items() if k != "PYTHONPATH"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert where.stdout.startswith(str(image / "opt" / "wingwatch" / "lib"))
    assert os.access(program / json.loads(last("ENTRYPOINT"))[0], os.X_OK)


class Door(BaseHTTPRequestHandler):
    """A service that answers its readiness with one fixed status."""

    status = 200

    def do_GET(self) -> None:
        self.send_response(self.status if self.path == "/health/ready" else 404)
        self.end_headers()

    def log_message(self, format: str, *args: object) -> None:
        """Says nothing."""


@pytest.fixture
def door() -> Iterator[HTTPServer]:
    server = HTTPServer(("127.0.0.1", 0), Door)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05})
    thread.start()
    yield server
    server.shutdown()
    thread.join()
    server.server_close()


def healthcheck(port: int) -> int:
    """Exit code of the image's healthcheck against a port of this machine."""
    command = json.loads(last("HEALTHCHECK").split("CMD", 1)[1])
    assert command[0] == "python"
    assert ":8000/" in command[2]
    call = [sys.executable, *command[1:-1], command[-1].replace(":8000/", f":{port}/")]
    return subprocess.run(call, capture_output=True, check=False, timeout=30).returncode


@pytest.mark.parametrize(("status", "healthy"), [(200, True), (503, False), (404, False)])
def test_the_healthcheck_tells_ready_from_not_ready(
    door: HTTPServer, monkeypatch: pytest.MonkeyPatch, status: int, healthy: bool
) -> None:
    monkeypatch.setattr(Door, "status", status)
    assert (healthcheck(door.server_port) == 0) is healthy


def test_the_start_period_is_longer_than_the_first_compilation_on_one_slow_processor() -> None:
    found = re.search(r"--start-period=(\d+)s", last("HEALTHCHECK"))
    assert found is not None
    assert int(found.group(1)) > 4.0 * sum(STEPS_OF_KERNELS[name].seconds for name in LIVE)


def test_the_healthcheck_fails_where_nobody_listens(door: HTTPServer) -> None:
    port = door.server_port
    door.server_close()
    assert healthcheck(port) != 0


COMPOSE: dict[str, Any] = yaml.safe_load((ROOT / "docker" / "compose.yaml").read_text())
SERVICES: dict[str, dict[str, Any]] = COMPOSE["services"]
SERVICE_KEYS = {
    "build",
    "cap_drop",
    "command",
    "depends_on",
    "deploy",
    "entrypoint",
    "environment",
    "healthcheck",
    "image",
    "init",
    "ports",
    "profiles",
    "read_only",
    "restart",
    "security_opt",
    "tmpfs",
    "volumes",
}


def filled(text: str) -> str:
    """A compose value with each variable at its default, as with an empty environment."""
    return re.sub(r"\$\{\w+:-([^}]*)\}", r"\1", text)


def test_the_compose_file_has_the_keys_of_the_specification() -> None:
    assert set(COMPOSE) == {"name", "services", "volumes"}
    assert set(SERVICES) == {"router", "service", "database", "scheduler", "worker"}
    for service in SERVICES.values():
        assert set(service) <= SERVICE_KEYS


def test_every_image_is_pinned_to_one_release() -> None:
    for service in SERVICES.values():
        assert re.fullmatch(r"[a-z/]+:\d+\.\d+(\.\d+)?(-[a-z]+)?(@sha256:[0-9a-f]{64})?", service["image"])


def test_the_router_is_of_the_library_s_release() -> None:
    pinned = re.search(r"^eclipse-zenoh==(\S+)", CONSTRAINTS, re.MULTILINE)
    assert pinned is not None
    assert SERVICES["router"]["image"].partition("@")[0] == f"eclipse/zenoh:{pinned.group(1)}"
    assert "--no-multicast-scouting" in SERVICES["router"]["command"]


def test_the_service_s_image_carries_the_project_s_version_and_is_built_here() -> None:
    version = re.search(
        r'^__version__ = "(.+)"', (ROOT / "wingwatch" / "__init__.py").read_text(), re.MULTILINE
    )
    assert version is not None
    assert SERVICES["service"]["image"] == f"wingwatch:{version.group(1)}"
    build = SERVICES["service"]["build"]
    base = (ROOT / "docker" / build["context"]).resolve()
    assert base == ROOT.resolve()
    assert (base / build["dockerfile"]).is_file()


def test_ports_open_on_this_machine_alone_unless_told_otherwise() -> None:
    ports = [filled(port) for service in SERVICES.values() for port in service.get("ports", [])]
    assert sorted(ports) == ["127.0.0.1:7447:7447", "127.0.0.1:8000:8000", "127.0.0.1:8786:8786"]
    assert not SERVICES["database"].get("ports")


def test_the_service_is_told_the_router_and_keeps_its_data_in_a_volume() -> None:
    verb, *options = SERVICES["service"]["command"]
    given = dict(zip(options[::2], options[1::2], strict=True))
    assert verb == "serve"
    assert set(given) <= SERVE_OPTIONS
    assert given["--connect"] == "tcp/router:7447"
    assert f"data:{given['--data']}" in SERVICES["service"]["volumes"]
    assert given["--data"] == last("VOLUME")
    assert SERVICES["service"]["read_only"] is True


def test_named_volumes_are_declared_and_used() -> None:
    used = {volume.split(":")[0] for service in SERVICES.values() for volume in service.get("volumes", [])}
    assert used == set(COMPOSE["volumes"])


def test_postgresql_stands_in_a_profile_that_nothing_needs() -> None:
    database = SERVICES["database"]
    assert database["profiles"] == ["postgres"]
    assert database["image"].startswith("postgres:")
    assert SERVICES["router"].keys() & {"profiles"} == SERVICES["service"].keys() & {"profiles"} == set()
    assert SERVICES["service"]["depends_on"]["database"]["required"] is False
    assert filled(SERVICES["service"]["environment"]["WINGWATCH_DATABASE_URL"]) == ""


def test_a_cluster_for_studies_stands_in_a_profile_of_its_own() -> None:
    scheduler, worker = SERVICES["scheduler"], SERVICES["worker"]
    assert scheduler["profiles"] == worker["profiles"] == ["dask"]
    assert scheduler["image"] == worker["image"] == SERVICES["service"]["image"]
    assert worker["entrypoint"] == ["dask", "worker", "tcp://scheduler:8786"]
    assert worker["deploy"] == {"replicas": 2}
    assert "--extra dask" in (ROOT / "docker" / "Dockerfile").read_text()


def test_who_is_waited_for_says_when_it_is_healthy() -> None:
    for service in SERVICES.values():
        for name, wait in service.get("depends_on", {}).items():
            assert wait["condition"] == "service_healthy"
            check = SERVICES[name]["healthcheck"]
            assert check["test"][0] == "CMD"
            assert all(re.fullmatch(r"\d+s", check[key]) for key in ("interval", "timeout"))


def test_no_secret_is_written_down() -> None:
    assert filled(SERVICES["database"]["environment"]["POSTGRES_PASSWORD"]) == ""


def test_the_docker_folder_holds_only_these() -> None:
    assert {p.name for p in (ROOT / "docker").iterdir() if p.name not in (".env", "secure")} == {
        "Dockerfile",
        "Dockerfile.dockerignore",
        "compose.yaml",
        "compose.documents.yaml",
        "compose.secure.yaml",
        "compose.fleet.yaml",
        "kubernetes",
        "service.secure.toml",
        "grafana",
    }


SECURE: dict[str, dict[str, Any]] = yaml.safe_load((ROOT / "docker" / "compose.secure.yaml").read_text())[
    "services"
]


def test_the_secure_router_s_settings_are_zenoh_s_own_and_say_what_ours_do() -> None:
    given = dict(
        option.removeprefix("--").split("=", 1) for option in SECURE["router"]["command"] if "=" in option
    )
    assert given["config"] == "/secure/access.json5"
    assert given["listen"].startswith("tls/")
    entries = [
        o.removeprefix("--cfg=").split(":", 1) for o in SECURE["router"]["command"] if o.startswith("--cfg=")
    ]
    config = zenoh.Config()
    for key, value in entries:
        config.insert_json5(key, value)  # raises where there is no such setting
    ours = ZenohSettings(mode="router", listen=(given["listen"],)).config()
    for key in ("transport/unicast/accept_pending", "transport/unicast/accept_timeout"):
        assert config.get_json(key) == ours.get_json(key)
    tls = json.loads(config.get_json("transport/link/tls"))
    assert (tls["enable_mtls"], tls["close_link_on_expiration"]) == (True, True)
    assert all(tls[key] for key in ("root_ca_certificate", "listen_certificate", "listen_private_key"))
    assert "./secure:/secure:ro" in SECURE["router"]["volumes"]


def test_the_secure_service_has_certificates_and_the_router_s_name() -> None:
    service = SECURE["service"]
    file, place = next(v.split(":")[:2] for v in service["volumes"] if v.startswith("./service"))
    verb, *options = service["command"]
    path = ROOT / "docker" / file
    flags = [str(path) if option == place else option for option in options]
    settings = serve_settings(build_parser("0").parse_args([verb, *flags]), {})
    assert settings.connect == ("tls/router:7447",)
    assert (settings.host, settings.data) == ("0.0.0.0", Path("/data"))
    of_zenoh = settings.zenoh.model_dump(exclude_none=True)
    assert set(of_zenoh) == {"authority", "certificate", "private_key"}
    assert all(value.parent == Path("/secure") for value in of_zenoh.values())


def test_the_documents_are_mounted_where_the_service_is_told_to_find_them() -> None:
    added = yaml.safe_load((ROOT / "docker" / "compose.documents.yaml").read_text())["services"]["service"]
    command = list(SERVICES["service"]["command"])
    assert added["command"] == [*command, "--documents", "/documents"]
    assert added["volumes"] == ["../dist/site:/documents:ro"]
    assert "site_dir: dist/site" in (ROOT / "mkdocs.yml").read_text()
    asked = build_parser("0").parse_args(added["command"])
    assert asked.documents == Path("/documents")
