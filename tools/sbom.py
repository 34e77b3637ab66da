"""Writes what wingwatch is made of: a bill of materials (CycloneDX, JSON) and a list of licences.

Both are of the packages that the program itself needs and that are installed beside this Python, with those of the
extras that are named. cyclonedx-py reads them from the packages' own metadata; what leads to a package registry or
names a place of this machine is taken out, and it is checked that nothing of it is left.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Collection, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path
from typing import Any

from install import ROOT, SetupError, normalise, read_pins, select

BILL, LICENCES = "wingwatch.cdx.json", "licences.txt"
REGISTRIES = re.compile(r"[p]ypi\.org|[p]ythonhosted\.org|registry\.", re.IGNORECASE)
LONGEST_LICENCE = 60
UNKNOWN = "not stated"

Json = dict[str, Any]


class BillError(Exception):
    """A bill that cannot be made; its text is one sentence for the user."""


def runtime_names(extras: Sequence[str]) -> tuple[set[str], set[str]]:
    """Normalised names of the packages asked for directly, and of all that these lead to by constraints.txt.

    Raises:
        BillError: an extra that does not exist, or a package without a pin.
    """
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    names = list(project["dependencies"])
    for extra in extras:
        if extra not in project["optional-dependencies"]:
            raise BillError(f"there is no extra {extra!r} in pyproject.toml")
        names += project["optional-dependencies"][extra]
    try:
        pins = select(read_pins((ROOT / "constraints.txt").read_text()), names)
    except SetupError as error:
        raise BillError(str(error)) from error
    return {normalise(name) for name in names}, {pin.name for pin in pins}


def environment_bill() -> Json:
    """What is installed beside this Python, as cyclonedx-py says it.

    Raises:
        BillError: it fails; the sentence is its last line.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / BILL
        command = [sys.executable, "-m", "cyclonedx_py", "environment", "--output-reproducible", "--short-PURLs",
                   "--no-validate", "--pyproject", str(ROOT / "pyproject.toml"),
                   "--output-file", str(path), sys.executable]  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            last = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
            raise BillError(f"cyclonedx-py failed with '{last}': run make sbom, which installs it")
        bill: Json = json.loads(path.read_text())
    return bill


def select_components(bill: Json, direct: Collection[str], names: Collection[str], version: str) -> Json:
    """The bill with the named packages alone; what each needs is said as far as that is among them.

    Args:
        direct: those that wingwatch asks for itself.
        version: of wingwatch.

    Raises:
        BillError: a package is not installed.
    """
    chosen = {c["bom-ref"]: c for c in bill["components"] if normalise(c["name"]) in names}
    missing = sorted(set(names) - {normalise(component["name"]) for component in chosen.values()})
    if missing:
        raise BillError(f"not installed are {', '.join(missing)}: run make sbom, or name fewer extras")
    for component in chosen.values():
        component.pop("properties", None)  # extras of the whole environment
        if not component.get("licenses") and (stated := stated_licence(component["name"])):
            named = {"name": stated, "acknowledgement": "declared"}
            component["licenses"] = [{"license": named}]
    root = {**bill["metadata"]["component"], "version": version}
    needs = {one["ref"]: one.get("dependsOn", []) for one in bill["dependencies"] if one["ref"] in chosen}
    needs[root["bom-ref"]] = [ref for ref, c in chosen.items() if normalise(c["name"]) in direct]
    return {
        **bill,
        "metadata": {**bill["metadata"], "component": root},
        "components": list(chosen.values()),
        "dependencies": [
            {"ref": ref, "dependsOn": sorted(set(found) & chosen.keys())} for ref, found in sorted(needs.items())
        ],
    }  # fmt: skip


def stated_licence(package: str) -> str | None:
    """What an installed package says in one line of its metadata, which cyclonedx-py may not know as a licence."""
    try:
        stated = metadata(package).json.get("license")
    except PackageNotFoundError:
        return None
    fits = isinstance(stated, str) and "\n" not in stated and 0 < len(stated) <= LONGEST_LICENCE
    return str(stated) if fits else None


def without_places(part: Any, forbidden: re.Pattern[str]) -> Any:
    """A part of a bill without references, descriptions and the like in which ``forbidden`` is found."""
    if isinstance(part, dict):
        cleaned = {key: without_places(value, forbidden) for key, value in part.items()}
        return {key: value for key, value in cleaned.items() if value is not None}
    if isinstance(part, list):
        kept = [
            one for one in part if not (isinstance(one, dict) and forbidden.search(str(one.get("url", ""))))
        ]
        return [value for one in kept if (value := without_places(one, forbidden)) is not None]
    return None if isinstance(part, str) and forbidden.search(part) else part


def places() -> re.Pattern[str]:
    """What must not be named: registries, and folders of this machine."""
    folders = {str(ROOT), sys.prefix, sys.base_prefix, str(Path.home()), tempfile.gettempdir()} - {
        "/",
        "/usr",
    }
    return re.compile(
        "|".join([REGISTRIES.pattern, "file:", *map(re.escape, sorted(folders))]), re.IGNORECASE
    )


def licence(component: Mapping[str, Any]) -> str:
    """A package's licence: what it declares as an SPDX expression, else the shortest names."""
    found = [
        one.get("expression") or one["license"].get("id") or one["license"].get("name", "")
        for one in component.get("licenses", [])
    ]
    short = [name.rpartition(" :: ")[2] for name in found if name and len(name) <= LONGEST_LICENCE]
    expressions = [one["expression"] for one in component.get("licenses", []) if "expression" in one]
    return (expressions or [", ".join(dict.fromkeys(short))])[0] or UNKNOWN


def licence_list(bill: Mapping[str, Any]) -> str:
    """One line a package: name, version, licence."""
    rows = sorted((c["name"].lower(), c["name"], c["version"], licence(c)) for c in bill["components"])
    widths = [max((len(row[k]) for row in rows), default=0) for k in (1, 2)]
    return "".join(
        f"{name:{widths[0]}}  {version:{widths[1]}}  {terms}\n" for _, name, version, terms in rows
    )


def project_version() -> str:
    """Of wingwatch."""
    found = re.search(
        r'^__version__ = "(.+)"', (ROOT / "wingwatch" / "__init__.py").read_text(), re.MULTILINE
    )
    assert found is not None
    return found.group(1)


def make_bill(extras: Sequence[str]) -> Json:
    """The bill of the program with these extras.

    Raises:
        BillError: it cannot be made, or would name a registry or a place of this machine.
    """
    direct, names = runtime_names(extras)
    forbidden = places()
    bill: Json = without_places(
        select_components(environment_bill(), direct, names, project_version()), forbidden
    )
    if left := forbidden.search(json.dumps(bill)):
        raise BillError(f"the bill would name {left.group()}, which is no part of the program")
    check_form(bill)
    return bill


def check_form(bill: Json) -> None:
    """That the bill is as CycloneDX's schema wants it: as it is written, not as cyclonedx-py makes it of more packages.

    Raises:
        BillError: it is not.
    """
    from cyclonedx.schema import SchemaVersion  # installed beside cyclonedx-py, which has run by now
    from cyclonedx.validation.json import JsonStrictValidator

    version = SchemaVersion.from_version(bill["specVersion"])
    problem = JsonStrictValidator(version).validate_str(json.dumps(bill))
    if problem is not None:
        first = (str(problem).splitlines() or [""])[0][:300]
        raise BillError(f"the bill is not what CycloneDX {version.to_version()} asks for: {first}")


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; 0 when both files are written, else 2 and one sentence on standard error."""
    parser = argparse.ArgumentParser(description="Write the bill of materials and the licences of wingwatch.")
    parser.add_argument(
        "--out", type=Path, default=ROOT / "dist", help="folder for both files (default dist)"
    )
    parser.add_argument(
        "--extra", action="append", default=[], help="an extra of pyproject.toml; may be repeated"
    )
    options = parser.parse_args(arguments)
    try:
        bill = make_bill(options.extra)
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / BILL).write_text(json.dumps(bill, indent=2) + "\n")
        (options.out / LICENCES).write_text(licence_list(bill))
    except (BillError, OSError) as error:
        print(f"wingwatch sbom: {error}", file=sys.stderr)
        return 2
    print(f"[sbom] {len(bill['components'])} packages: {BILL} and {LICENCES} in {options.out.name}/")
    return 0


if __name__ == "__main__":
    sys.exit(main())
