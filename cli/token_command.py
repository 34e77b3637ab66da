"""`wingwatch token`: REST tokens are made, listed and withdrawn."""

import argparse

from rich.console import Console
from rich.table import Table

from wingwatch.api.access import TokenScope
from wingwatch.operations.faults import say
from wingwatch.operations.progress import write_json
from wingwatch.service.tokens import TokenFile

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    file = TokenFile(arguments.data)
    actions = {"create": _create, "list": _list, "revoke": _revoke}
    actions[arguments.action](file, arguments)
    return 0


def _create(file: TokenFile, arguments: argparse.Namespace) -> None:
    token = file.create(arguments.name, TokenScope(arguments.scope))
    if arguments.json:
        write_json({"name": arguments.name, "scope": arguments.scope, "token": token})
    else:
        print(token)
        say("this is the only time that the token is shown; keep it where only its owner reads it")


def _list(file: TokenFile, arguments: argparse.Namespace) -> None:
    entries = file.entries()
    if arguments.json:
        write_json({"tokens": [entry.model_dump(mode="json", exclude={"sha256"}) for entry in entries]})
        return
    table = Table("name", "scope", "created at", box=None)
    for entry in entries:
        table.add_row(entry.name, str(entry.scope), entry.created_at)
    Console().print(table if entries else f"There is no token in {file.path}.")


def _revoke(file: TokenFile, arguments: argparse.Namespace) -> None:
    file.revoke(arguments.name)
    if arguments.json:
        write_json({"name": arguments.name})
    else:
        say(f"token {arguments.name!r} is withdrawn")
