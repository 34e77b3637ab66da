"""Makes the virtual environment and fills it from constraints.txt, each file checked against its hash.

Runs on the machine's own Python with the standard library alone, because nothing else is there yet. One
constraints file serves every purpose: the subset for a purpose is found by walking the "via" notes that
pip-compile leaves behind each pin, from the names that pyproject.toml asks for. pip still resolves what it
is given, so a subset that lacks something fails instead of installing half a program.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import json
import re
import subprocess
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
MINIMUM_PYTHON = (3, 11)  # tomllib, and requires-python of pyproject.toml
STATE = "wingwatch-setup.json"
LOG = "wingwatch-setup.log"

FAILURES = (
    (
        r"DO NOT MATCH THE HASHES",
        "a downloaded package is not the one that constraints.txt pins, so nothing of it was installed: check"
        " which package index pip is set to use",
    ),
    (
        r"No space left on device",
        "the disk is full: free about 1 GB, then run make again",
    ),
    (
        r"Permission denied",
        "a file of the virtual environment may not be written: check who owns it, or run make clean and try"
        " again",
    ),
    (
        r"Retrying \(Retry|NewConnectionError|ConnectTimeout|ProxyError|Read timed out",
        "the package index cannot be reached: check the network or pip's own settings, then run make again",
    ),
    (
        r"No matching distribution found for",
        "no ready-built file of a pinned package was found: check the network, pip's own settings, and that"
        " this is Linux on x86_64 with Python 3.11 to 3.13",
    ),
)


class SetupError(Exception):
    """A set-up that cannot go on; its text is the one sentence the user reads."""


@dataclass(frozen=True)
class Pin:
    """One pinned package of constraints.txt.

    Attributes:
        name: normalised name.
        text: its lines as they stand, hashes included.
        via: normalised names of the packages that asked for it.
    """

    name: str
    text: str
    via: frozenset[str]


def normalise(requirement: str) -> str:
    """The normalised package name at the start of a requirement such as ``Foo_bar[x]>=1``."""
    match = re.match(r"[A-Za-z0-9._-]+", requirement.strip())
    if match is None:
        raise SetupError(
            f"{requirement!r} is not the name of a package: correct pyproject.toml or constraints.txt"
        )
    return re.sub(r"[-_.]+", "-", match.group()).lower()


def read_pins(text: str) -> list[Pin]:
    """The pins of a constraints file made by pip-compile, in its order."""
    pins = []
    for block in re.split(r"\n(?=[A-Za-z0-9])", "\n" + text)[1:]:
        lines = [line for line in block.splitlines() if line.strip() and not line.startswith("#")]
        notes = [line.strip().lstrip("#").strip().removeprefix("via") for line in lines if "#" in line]
        via = {normalise(name) for note in notes for name in note.split(",") if name.strip()}
        pins.append(Pin(normalise(lines[0]), "\n".join(lines) + "\n", frozenset(via)))
    return pins


def select(pins: Sequence[Pin], wanted: Iterable[str]) -> list[Pin]:
    """The pins of the wanted names and of everything they lead to, in the file's order.

    Raises:
        SetupError: a wanted name has no pin.
    """
    chosen = {normalise(name) for name in wanted}
    missing = sorted(chosen - {pin.name for pin in pins})
    if missing:
        raise SetupError(
            f"constraints.txt pins no {', '.join(missing)}: run make constraints and commit the result"
        )
    while True:
        more = {pin.name for pin in pins if pin.name not in chosen and pin.via & chosen}
        if not more:
            return [pin for pin in pins if pin.name in chosen]
        chosen |= more


def wanted_names(pyproject: Mapping[str, Any], extras: Iterable[str]) -> list[str]:
    """What pyproject.toml asks for directly: the build backend, the core, and the extras.

    Raises:
        SetupError: an extra that does not exist.
    """
    project = pyproject["project"]
    names = [*pyproject["build-system"]["requires"], *project["dependencies"]]
    for extra in extras:
        known = project["optional-dependencies"]
        if extra not in known:
            raise SetupError(f"there is no extra {extra!r}: choose among {', '.join(sorted(known))}")
        names += known[extra]
    return names


def check_python() -> None:
    """Raises SetupError where this Python is too old, or cannot make virtual environments."""
    have = f"{sys.version_info[0]}.{sys.version_info[1]}"
    need = f"{MINIMUM_PYTHON[0]}.{MINIMUM_PYTHON[1]}"
    if sys.version_info[:2] < MINIMUM_PYTHON:
        raise SetupError(
            f"this is Python {have}, and wingwatch needs {need} or newer: name one with PYTHON=, as in"
            f" 'make run PYTHON=python{need}'"
        )
    if importlib.util.find_spec("venv") is None or importlib.util.find_spec("ensurepip") is None:
        raise SetupError(
            f"this Python {have} cannot make virtual environments: install the system's package python3-venv,"
            " or name another Python with PYTHON="
        )


def environment_digest(venv: Path, pyproject: Mapping[str, Any], constraints: str) -> str:
    """What the environment depends on, as one string: when it changes, the environment is stale."""
    parts = [sys.version_info[:2], str(venv), constraints, pyproject["project"], pyproject["build-system"]]
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def read_state(venv: Path) -> dict[str, Any]:
    """What an earlier run noted as its last act; empty where there was none or it was cut short."""
    try:
        state = json.loads((venv / STATE).read_text())
    except (OSError, ValueError):
        return {}
    return state if isinstance(state, dict) else {}


def run(command: Sequence[str], log: Path) -> None:
    """Runs a command with its output in the log.

    Raises:
        SetupError: it failed; the sentence is the known cause, or where the log is.
    """
    done = subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=ROOT, check=False
    )
    if log.parent.is_dir():
        with log.open("a") as file:
            file.write(done.stdout)
    if done.returncode == 0:
        return
    for pattern, sentence in FAILURES:
        if re.search(pattern, done.stdout):
            raise SetupError(f"{sentence} (details in {log})")
    last = next((line for line in reversed(done.stdout.splitlines()) if line.strip()), "no output").strip()
    raise SetupError(f"set-up failed with '{last}': details in {log}")


def set_up(venv: Path, extras: Sequence[str], editable: bool, dependencies_only: bool) -> None:
    """Brings the environment to what is asked; returns at once when it is there already.

    Raises:
        SetupError: with the sentence for the user.
    """
    check_python()
    import tomllib  # only now known to exist

    started = time.monotonic()
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text())
    constraints = (ROOT / "constraints.txt").read_text()
    digest = environment_digest(venv, pyproject, constraints)
    state = read_state(venv)
    fresh = state.get("digest") == digest
    have = set(state.get("extras", [])) if fresh else set()
    whole = dependencies_only or state.get("project") == ("editable" if editable else "copy")
    if fresh and have >= set(extras) and whole:
        return
    known = read_pins(constraints)
    pins = select(known, wanted_names(pyproject, sorted(have | set(extras))))
    pip = [str(venv / "bin" / "python"), "-m", "pip", "--disable-pip-version-check", "--no-input", "install"]
    # In an image its user may not write byte code; beside a clone each module is compiled when it is first imported.
    how = ["--no-compile"] if editable and not dependencies_only else []

    def install(some: Sequence[Pin], name: str) -> None:
        subset = venv / name
        subset.write_text("".join(pin.text for pin in some))
        run([*pip, *how, "--require-hashes", "--only-binary=:all:", "-r", str(subset)], venv / LOG)

    if not fresh:
        say(f"virtual environment {venv.name}, Python {sys.version_info[0]}.{sys.version_info[1]}")
        run([sys.executable, "-m", "venv", "--clear", str(venv)], venv / LOG)
        # Python brings a pip as old as itself, which takes twice as long to look through the lists of an index.
        install([pin for pin in known if pin.name == "pip"], "wingwatch-pip.txt")
    say(f"{len(pins)} pinned packages, each checked against its hash (a minute or two the first time)")
    install(pins, "wingwatch-pins.txt")
    if not dependencies_only:
        say("wingwatch itself")
        where = ["-e", "."] if editable else ["."]
        run([*pip, "--no-deps", "--no-build-isolation", "--no-index", *where], venv / LOG)
    noted = "" if dependencies_only else "editable" if editable else "copy"
    note = {"digest": digest, "extras": sorted(have | set(extras)), "project": noted}
    (venv / STATE).write_text(json.dumps(note))
    say(f"ready after {time.monotonic() - started:.0f} s")


def say(text: str) -> None:
    """One line of progress."""
    print(f"[set-up] {text}", flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; 0 when the environment stands, else 2 and one sentence on standard error."""
    parser = argparse.ArgumentParser(description="Make wingwatch's virtual environment from constraints.txt.")
    parser.add_argument("--venv", type=Path, default=ROOT / ".venv", help="where it goes (default .venv)")
    parser.add_argument(
        "--extra", action="append", default=[], help="an extra of pyproject.toml; may be repeated"
    )
    parser.add_argument("--copy", action="store_true", help="install a copy instead of a link to this folder")
    parser.add_argument("--dependencies-only", action="store_true", help="leave wingwatch itself out")
    options = parser.parse_args(arguments)
    try:
        set_up(options.venv.absolute(), options.extra, not options.copy, options.dependencies_only)
    except (SetupError, OSError) as error:
        print(f"wingwatch set-up: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("wingwatch set-up: stopped; run make again to go on", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
