"""Every code block of the documents: commands are parsed and, where nothing says why not, run; data are read."""

import contextlib
import io
import json
import re
import subprocess
import tomllib
from collections.abc import Callable, Generator, Mapping, Sequence
from pathlib import Path
from urllib.parse import parse_qsl, urlsplit

import httpx
import pytest
import yaml
from api_fakes import FakeHistory, FakeMonitor, alert, past, served, vehicle
from document_blocks import BLOCKS, LANGUAGES, ROOT, Block, written_in

from wingwatch.api import create_app
from wingwatch.cli.arguments import build_parser
from wingwatch.cli.main import main
from wingwatch.monitor.views import VehicleState
from wingwatch.service.settings import ServeSettings
from wingwatch.studies import load_grid
from wingwatch.telemetry.maps import parse_map

ELSEWHERE: Mapping[tuple[str, str], str] = {
    ("docs/tutorial/your_log.md", "sh"): "tests/cli/test_cli_your_log.py",
    ("docs/baselines.md", "sh"): "tests/cli/test_cli_baselines_document.py",
    ("docs/telemetry.md", "python"): "tests/telemetry/test_telemetry_zenoh.py",
    ("docs/security.md", "python"): "tests/notifications/test_notifications_webhook.py",
}
"""Blocks that a test of their own runs: page and language, and the test."""

SHELL = written_in("sh", "console")
FOREIGN = ("grype", "trivy", "openssl")
"""Programs of others, in blocks that say so."""


def named(block: Block) -> str:
    return block.name


def runs(block: Block) -> bool:
    return not block.why and (block.page, block.language) not in ELSEWHERE


def test_every_block_says_what_it_is() -> None:
    assert [block.name for block in BLOCKS if block.language not in LANGUAGES] == []
    assert [block.name for block in BLOCKS if block.why and block.language not in ("sh", "console")] == []
    assert len(SHELL) > 60


@pytest.mark.parametrize(("page", "test"), [(page, test) for (page, _), test in ELSEWHERE.items()])
def test_blocks_that_run_elsewhere_do(page: str, test: str) -> None:
    assert f'"{Path(page).name}"' in (ROOT / test).read_text()


@pytest.fixture(scope="module")
def routes() -> Mapping[str, Mapping[str, object]]:
    app = create_app(FakeMonitor(), dict, None, "0")
    found: Mapping[str, Mapping[str, object]] = app.openapi()["paths"]
    return found


@pytest.mark.parametrize("block", SHELL, ids=named)
def test_commands_of_a_block_exist_with_their_options(
    block: Block, routes: Mapping[str, Mapping[str, object]]
) -> None:
    if block.language == "sh":
        subprocess.run(["bash", "-n"], input=block.text, text=True, check=True)
    if any(word in block.text for word in FOREIGN):
        assert block.why
        return
    assert block.commands
    for words in block.commands:
        check(words, routes)


def check(words: Sequence[str], routes: Mapping[str, Mapping[str, object]]) -> None:
    """AssertionError for a command that is none of ours, or an option that it does not have."""
    program, *rest = words
    if program == "wingwatch":
        build_parser("0").parse_args(rest)
    elif program == "curl":
        method, url = request_of(rest)
        path = urlsplit(url).path
        known = {pattern: found for pattern, found in routes.items() if fits(pattern, path)}
        assert known, path
        (operation,) = known.values()
        assert method.lower() in operation
    elif program == "make":
        assert re.search(rf"^{rest[0]}:", (ROOT / "Makefile").read_text(), re.MULTILINE)
    elif program == "python":
        assert (ROOT / rest[0]).is_file()
    elif program == "docker":
        files = [rest[k + 1] for k, word in enumerate(rest) if word == "-f"]
        assert files
        assert all((ROOT / name).is_file() for name in files)
    else:
        raise AssertionError(f"{program} is no program that documents use")


def fits(pattern: str, path: str) -> bool:
    return re.fullmatch(re.sub(r"\{[^}]+\}", "[^/]+", pattern), path) is not None


def request_of(words: Sequence[str]) -> tuple[str, str]:
    """Method and address that curl is asked for."""
    (url,) = [word for word in words if re.match(r"https?://", word)]
    if "-X" in words:
        return words[list(words).index("-X") + 1], url
    return ("POST" if any(word.startswith(("-d", "--data")) for word in words) else "GET"), url


RUN = [block for block in SHELL if runs(block) and block.page != "docs/rest.md"]


@pytest.mark.parametrize("page", sorted({block.page for block in RUN}))
def test_commands_of_a_page_run(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In order, in one folder, with the documents beside them."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    for block in RUN:
        for program, *arguments in block.commands if block.page == page else ():
            assert program == "wingwatch"
            said = io.StringIO()
            with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
                code = main(arguments)
            assert code == 0, f"{block.name}: {' '.join(arguments)}\n{said.getvalue()}"


@pytest.fixture
def service() -> Generator[httpx.Client]:
    monitor = FakeMonitor()
    monitor.views = [vehicle("aero-2", VehicleState.DEGRADED)]
    monitor.raised = [alert(1)]
    monitor.current["default", "aero-2"] = {"time_s": 1.0, "estimators": {"fourier": {}}}
    history = FakeHistory([past(130.5, "ekf", "short_period", [1.0] * 6, [0.1] * 6)])
    with served(monitor, history) as (_, client):
        yield client


def test_requests_of_the_rest_page_are_answered(service: httpx.Client) -> None:
    asked = [
        words for block in SHELL if block.page == "docs/rest.md" and runs(block) for words in block.commands
    ]
    assert len(asked) >= 10
    for program, *words in asked:
        assert program == "curl"
        method, url = request_of(words)
        parts = urlsplit(url)
        headers = dict(words[k + 1].split(": ", 1) for k, word in enumerate(words) if word == "-H")
        content = next((words[k + 1] for k, word in enumerate(words) if word == "-d"), None)
        answer = service.request(
            method, parts.path, params=dict(parse_qsl(parts.query)), headers=headers, content=content
        )
        assert answer.status_code == (422 if "state=open" in url else 200), (url, answer.text)


@pytest.mark.parametrize("block", written_in("json"), ids=named)
def test_json_is_json(block: Block) -> None:
    assert json.loads(block.text)


def as_settings(text: str, folder: Path) -> object:
    return ServeSettings.model_validate(tomllib.loads(text))


def as_grid(text: str, folder: Path) -> object:
    file = folder / "grid.toml"
    file.write_text(text)
    return load_grid("icing", file)


def as_map(text: str, folder: Path) -> object:
    return parse_map(text)


READERS: Mapping[str, Callable[[str, Path], object]] = {
    "docs/commands.md": as_settings,
    "docs/service.md": as_settings,
    "docs/security.md": as_settings,
    "docs/how_to/phone.md": as_settings,
    "docs/studies.md": as_grid,
    "docs/tutorial/icing_threshold.md": as_grid,
    "docs/telemetry.md": as_map,
}
"""What a page's TOML is: the settings of a service, the grid of a study, a channel map."""


@pytest.mark.parametrize("block", written_in("toml"), ids=named)
def test_toml_is_what_its_page_is_about(block: Block, tmp_path: Path) -> None:
    assert READERS[block.page](block.text, tmp_path) is not None


@pytest.mark.parametrize("block", written_in("yaml"), ids=named)
def test_yaml_is_a_configuration_of_prometheus(block: Block) -> None:
    (job,) = yaml.safe_load(block.text)["scrape_configs"]
    assert {"job_name", "static_configs"} <= set(job)


@pytest.mark.parametrize("page", sorted({block.page for block in written_in("python") if runs(block)}))
def test_python_of_a_page_runs(page: str) -> None:
    names: dict[str, object] = {}
    for block in written_in("python"):
        if block.page == page:
            exec(compile(block.text, block.name, "exec"), names)
    assert len(names) > 1
