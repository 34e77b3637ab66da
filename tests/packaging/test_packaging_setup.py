"""The set-up: quick when nothing changed, from scratch when stale, and one clear sentence when it cannot."""

import importlib.util
import json
import os
import re
import shutil
import stat
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """tools/install.py over a copy of the two files that it reads."""
    spec = importlib.util.spec_from_file_location("wingwatch_install_here", ROOT / "tools" / "install.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, module)
    spec.loader.exec_module(module)
    for name in ("pyproject.toml", "constraints.txt"):
        shutil.copy(ROOT / name, tmp_path)
    monkeypatch.setattr(module, "ROOT", tmp_path)
    return module


@pytest.fixture
def commands(install: ModuleType, monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The commands that set-up would run; making the environment makes its folder empty, as --clear does."""
    seen: list[list[str]] = []

    def record(command: Sequence[str], log: Path) -> None:
        seen.append(list(command))
        if "venv" in command:
            shutil.rmtree(log.parent, ignore_errors=True)
            log.parent.mkdir()

    monkeypatch.setattr(install, "run", record)
    return seen


@pytest.fixture
def set_up(install: ModuleType, commands: list[list[str]], tmp_path: Path) -> Callable[..., list[str]]:
    """Runs the set-up and says in one word each what it did."""

    def run(*arguments: str) -> list[str]:
        commands.clear()
        assert install.main(["--venv", str(tmp_path / "venv"), *arguments]) == 0
        return [what(command) for command in commands]

    return run


def what(command: Sequence[str]) -> str:
    """What a command of the set-up does, in one word."""
    if "--require-hashes" in command:
        return {"wingwatch-pip.txt": "pip", "wingwatch-pins.txt": "pins"}[Path(command[-1]).name]
    return "make" if "venv" in command else "link" if "-e" in command else "copy"


def test_the_second_time_nothing_is_done(set_up: Callable[..., list[str]]) -> None:
    assert set_up() == ["make", "pip", "pins", "link"]
    assert set_up() == []


def test_an_extra_is_added_to_what_is_there(set_up: Callable[..., list[str]], tmp_path: Path) -> None:
    set_up()
    assert set_up("--extra", "dev") == ["pins", "link"]
    assert set_up() == set_up("--extra", "dev") == []
    assert "\npytest==" in (tmp_path / "venv" / "wingwatch-pins.txt").read_text()


@pytest.mark.parametrize("file", ["constraints.txt", "pyproject.toml"])
def test_a_stale_environment_is_made_anew(
    set_up: Callable[..., list[str]], tmp_path: Path, file: str
) -> None:
    set_up("--extra", "dev")
    text = (tmp_path / file).read_text()
    changed = (
        text.replace('"rich",', '"rich", "pyyaml",') if file == "pyproject.toml" else text + "# another\n"
    )
    assert changed != text
    (tmp_path / file).write_text(changed)
    assert set_up() == ["make", "pip", "pins", "link"]
    assert "\npytest==" not in (tmp_path / "venv" / "wingwatch-pins.txt").read_text()


def test_a_setting_of_a_tool_makes_nothing_stale(set_up: Callable[..., list[str]], tmp_path: Path) -> None:
    set_up()
    with (tmp_path / "pyproject.toml").open("a") as file:
        file.write("\n[tool.other]\nkey = 1\n")
    assert set_up() == []


def test_a_set_up_that_was_cut_short_starts_again(
    install: ModuleType, set_up: Callable[..., list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def cut(command: Sequence[str], log: Path) -> None:
        log.parent.mkdir(exist_ok=True)
        if "--require-hashes" in command:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(install, "run", cut)
        assert install.main(["--venv", str(tmp_path / "venv")]) == 130
    assert set_up() == ["make", "pip", "pins", "link"]


def test_a_broken_note_of_the_last_set_up_counts_as_none(
    set_up: Callable[..., list[str]], tmp_path: Path
) -> None:
    set_up()
    (tmp_path / "venv" / "wingwatch-setup.json").write_text("[1, 2")
    assert set_up() == ["make", "pip", "pins", "link"]


def test_dependencies_first_then_a_copy_of_the_project(set_up: Callable[..., list[str]]) -> None:
    assert set_up("--dependencies-only", "--extra", "postgres") == ["make", "pip", "pins"]
    assert set_up("--copy", "--extra", "postgres") == ["pins", "copy"]
    assert set_up("--copy", "--extra", "postgres") == []


def test_the_pip_that_installs_is_the_pinned_one(
    install: ModuleType, set_up: Callable[..., list[str]], tmp_path: Path
) -> None:
    set_up()
    (pin,) = install.read_pins((tmp_path / "venv" / "wingwatch-pip.txt").read_text())
    assert pin.name == "pip"
    assert pin.text in (tmp_path / "constraints.txt").read_text()
    assert "--hash=sha256:" in pin.text


def test_hashes_are_demanded_and_nothing_is_built(
    set_up: Callable[..., list[str]], commands: list[list[str]]
) -> None:
    set_up()
    pip, pins = [c for c in commands if what(c) in ("pip", "pins")]
    (project,) = [c for c in commands if "-e" in c]
    for command in (pip, pins):
        assert {"--require-hashes", "--only-binary=:all:"} <= set(command)
    assert {"--no-deps", "--no-build-isolation", "--no-index"} <= set(project)


def test_byte_code_is_made_where_its_user_may_not_write(
    set_up: Callable[..., list[str]], commands: list[list[str]], tmp_path: Path
) -> None:
    set_up()
    (beside_a_clone,) = [c for c in commands if what(c) == "pins"]
    assert "--no-compile" in beside_a_clone
    set_up("--venv", str(tmp_path / "image"), "--dependencies-only")
    (in_an_image,) = [c for c in commands if what(c) == "pins"]
    assert "--no-compile" not in in_an_image


def sentence(install: ModuleType, capsys: pytest.CaptureFixture[str], venv: Path) -> str:
    """The one line on standard error of a set-up that fails."""
    assert install.main(["--venv", str(venv)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    return lines[0]


def test_an_old_python_is_told_what_is_needed(
    install: ModuleType, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(install, "MINIMUM_PYTHON", (99, 1))
    said = sentence(install, capsys, tmp_path / "venv")
    assert "needs 99.1 or newer" in said
    assert "PYTHON=python99.1" in said
    assert not (tmp_path / "venv").exists()


def test_a_python_without_venv_is_told_the_package(
    install: ModuleType, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "ensurepip" else find(name))
    assert "python3-venv" in sentence(install, capsys, tmp_path / "venv")


@pytest.mark.parametrize(
    ("output", "said"),
    [
        (
            "WARNING: Retrying (Retry(total=4, connect=None)) after connection broken by ...",
            "cannot be reached",
        ),
        ("THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE.", "nothing of it was installed"),
        ("ERROR: No matching distribution found for numpy==9", "no ready-built file"),
        ("OSError: [Errno 28] No space left on device", "disk is full"),
        ("ERROR: something else", "set-up failed with 'ERROR: something else'"),
    ],
)
def test_a_failure_of_pip_is_one_sentence_with_its_log(
    install: ModuleType, tmp_path: Path, output: str, said: str
) -> None:
    log = tmp_path / "log"
    with pytest.raises(install.SetupError, match=said) as raised:
        install.run([sys.executable, "-c", f"print({output!r}); raise SystemExit(1)"], log)
    assert str(log) in str(raised.value)
    assert log.read_text().strip() == output


def test_without_network_the_real_pip_ends_in_the_sentence(tmp_path: Path) -> None:
    environment = {
        k: v for k, v in os.environ.items() if not k.upper().startswith(("PIP_", "HTTP", "ALL_PROXY"))
    }
    environment |= {
        "PIP_CONFIG_FILE": os.devnull,
        "PIP_NO_CACHE_DIR": "1",
        "PIP_RETRIES": "1",
        "PIP_INDEX_URL": "http://127.0.0.1:9/none",  # the discard port: nobody answers
    }
    done = subprocess.run(
        [sys.executable, "tools/install.py", "--venv", str(tmp_path / "venv")],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "the package index cannot be reached" in done.stderr
    assert not (tmp_path / "venv" / "wingwatch-setup.json").exists()


def test_a_python_that_is_not_there_is_one_sentence() -> None:
    done = subprocess.run(
        ["make", "run", "PYTHON=no-such-python"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "there is no 'no-such-python' on this machine" in done.stderr.splitlines()[0]


def test_make_alone_lists_every_target_once() -> None:
    done = subprocess.run(
        ["make", "--no-print-directory"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    listed = " ".join(line.split()[1] for line in done.stdout.splitlines())
    assert listed == "help run test constraints proto wheel docs reference sbom clean"


def test_make_test_makes_every_check() -> None:
    command = ["make", "--no-print-directory", "-n", "test"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    for check in (
        "ruff check",
        "ruff format --check",
        "mypy wingwatch tests benchmarks tools examples",
        "lint-imports",
    ):
        assert check in done.stdout
    *before, last = done.stdout.splitlines()
    assert last == ".venv/bin/pytest -n 3 --dist worksteal"
    assert ".venv/bin/wingwatch kernels" in before


def test_what_make_starts_keeps_its_byte_code() -> None:
    """A container that forbids it makes every start of Python several seconds longer."""
    done = subprocess.run(
        ["make", "--no-print-directory", "-f", "-", "show"],
        input="include Makefile\nshow:\n\t@env\n",
        cwd=ROOT, env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert "PATH=" in done.stdout
    assert "PYTHONDONTWRITEBYTECODE" not in done.stdout


def test_make_run_starts_the_service_as_soon_as_packages_are_installed() -> None:
    command = ["make", "--no-print-directory", "-n", "run", "ARGS=--port 8010"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    *_, set_up, last = done.stdout.splitlines()
    assert set_up.endswith("tools/install.py")
    assert last == ".venv/bin/wingwatch demo --port 8010"


def test_the_ci_script_is_executable_and_ends_in_make_test() -> None:
    script = ROOT / ".ci" / "run"
    assert script.stat().st_mode & stat.S_IXUSR
    subprocess.run(["bash", "-n", str(script)], check=True)
    lines = script.read_text().splitlines()
    assert lines[0] == "#!/usr/bin/env bash"
    assert "set -euo pipefail" in lines
    assert "make clean" in lines
    assert lines[-1] == "make test"


def test_the_ci_script_sets_up_what_make_test_asks_for() -> None:
    """It begins while the system's packages are installed; with other extras all of it would be done twice."""
    (early,) = re.findall(r"tools/install\.py ([a-z -]+) &\n", (ROOT / ".ci" / "run").read_text())
    recipe = (ROOT / "Makefile").read_text().partition("\ntest: python")[2]
    (asked,) = re.findall(r"\$\(SETUP\) ([a-z -]+)\n", recipe)[:1]
    assert early == asked


def test_the_note_of_a_finished_set_up_is_plain(set_up: Callable[..., list[str]], tmp_path: Path) -> None:
    set_up("--extra", "dev")
    note = json.loads((tmp_path / "venv" / "wingwatch-setup.json").read_text())
    assert note["extras"] == ["dev"]
    assert note["project"] == "editable"
