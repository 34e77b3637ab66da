"""`wingwatch aircraft new`: an aircraft file from what people have, written and checked."""

import argparse
import re
from typing import Any

from rich.markup import escape

from wingwatch.aircraft import aircraft_toml, check_file
from wingwatch.cli.aircraft_check import check_object, say_check
from wingwatch.cli.aircraft_sources import made_aircraft
from wingwatch.operations.faults import CommandError
from wingwatch.operations.output_files import check_output
from wingwatch.operations.progress import page, write_json
from wingwatch.pages.whole_file import write_whole

__all__ = ["new_aircraft"]

_NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,62}")


def new_aircraft(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    if not _NAME.fullmatch(arguments.name):
        raise CommandError(
            f"the name {arguments.name!r} is not allowed: give a to z, digits, - and _, starting with a letter or digit"
        )
    check_output("--out", arguments.out, (".toml",))
    source = made_aircraft(arguments)
    made, notes = source.aircraft, list(source.notes)
    found = check_file(made)
    if not found.usable:
        raise CommandError(next(f.text for f in found.findings if f.standing == "refusal"))
    write_whole(arguments.out, aircraft_toml(made, _comment(arguments, notes)))
    result: dict[str, Any] = check_object(made, found)
    result |= {"file": str(arguments.out), "basis": source.basis, "notes": notes}
    if arguments.json:
        write_json(result)
        return 0
    console = page()
    console.print(escape(f"{arguments.out}  {made.name}: {source.basis}"), soft_wrap=True)
    for note in notes:
        console.print(escape(f"note: {note}"), soft_wrap=True)
    say_check(console, made, found)
    return 0


def _comment(arguments: argparse.Namespace, notes: list[str]) -> str:
    head = f"Written by `wingwatch aircraft new {arguments.name}`; `wingwatch aircraft check` says what is implausible."
    return "\n".join([head, *notes])
