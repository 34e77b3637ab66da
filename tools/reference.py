"""Writes the reference pages that follow from the code: options of all commands, operations of REST.

    make reference

The pages are kept in the repository, so that they can be read and linked to there; a test compares them with the code.
"""

import argparse
import contextlib
import io
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from wingwatch.cli.arguments import build_parser

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "reference"

Json = dict[str, Any]

_OPTIONS_HEAD = """\
# Options of the commands

Made from the code by `make reference`. What the commands do, with examples and what they print:
[commands](../commands.md). Every command has `--help`.
"""
_OPERATIONS_HEAD = """\
# Operations of REST

Made from the code by `make reference`. Examples, and what the fields mean: [REST](../rest.md). A running service has
the same, with all schemas, as OpenAPI at `/openapi.json`.

Every operation can also answer 4xx (the request cannot be answered) or 5xx (the service cannot answer now) with a
problem document (RFC 9457), whose `detail` says why. Where tokens are required, `GET` takes one of scope `read`, the
others one of scope `operate` ([security](../security.md)).
"""


def options_page() -> str:
    """Every command with its arguments, in Markdown."""
    parts = [_OPTIONS_HEAD]
    for name, parser in _commands(build_parser("")):
        parts.append(f"## `{name}`\n\n{_plain(parser.description or '')}\n")
        rows = [_row(action) for action in parser._actions if not _is_help(action)]
        if rows:
            parts.append("| argument | default | |\n|---|---|---|\n" + "\n".join(rows) + "\n")
    return "\n".join(parts)


def _commands(parser: argparse.ArgumentParser) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """The commands that do something, each by its full name."""
    groups = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    if not groups:
        yield parser.prog, parser
    for group in groups:
        for inner in group.choices.values():
            yield from _commands(inner)


def _is_help(action: argparse.Action) -> bool:
    return isinstance(action, argparse._HelpAction | argparse._VersionAction)


def _row(action: argparse.Action) -> str:
    """One argument as a row of a table."""
    value = _value(action)
    names = ", ".join(f"`{option}{value}`" for option in action.option_strings) or f"`{value.strip()}`"
    plain = action.default if isinstance(action.default, str | int | float | Path) else None
    default = "" if plain is None or isinstance(plain, bool) or plain == argparse.SUPPRESS else f"`{plain}`"
    formatter = argparse.HelpFormatter(prog="wingwatch", width=100_000, max_help_position=100)
    text = formatter._expand_help(action) if action.help else ""
    marks = [mark for mark, holds in (("required", bool(action.option_strings) and action.required),
                                      ("may be repeated", isinstance(action, argparse._AppendAction)))
             if holds and mark not in text]  # fmt: skip
    return f"| {_cell(names)} | {_cell(default)} | {_cell('; '.join(filter(None, (_plain(text), *marks))))} |"


def _value(action: argparse.Action) -> str:
    """What is written behind an option, with a blank before it."""
    if action.nargs == 0:
        return ""
    if isinstance(action.metavar, tuple):
        return " " + " ".join(action.metavar)
    choices = None if action.choices is None else "|".join(str(choice) for choice in action.choices)
    name = action.metavar or choices or action.dest.upper()
    return {"?": f" [{name}]", "*": f" [{name} ...]", "+": f" {name} [...]"}.get(
        str(action.nargs), f" {name}"
    )


def operations_page() -> str:
    """Every operation of REST with its parameters and answers, in Markdown."""
    description = _openapi()
    parts = [_OPERATIONS_HEAD]
    for path, operations in description["paths"].items():
        for method, operation in operations.items():
            parts.append(f"## `{method.upper()} {path}`\n\n{_plain(operation.get('summary', ''))}.\n")
            if text := operation.get("description", ""):
                parts.append(f"{_plain(text)}\n")
            if rows := [_parameter(one) for one in operation.get("parameters", ())]:
                parts.append("| parameter | in | type | |\n|---|---|---|---|\n" + "\n".join(rows) + "\n")
            if body := operation.get("requestBody"):
                parts.append(f"Body: {_contents(body)}.\n")
            rows = [
                _answer(status, one) for status, one in operation["responses"].items() if status.isdigit()
            ]
            parts.append("| status | answer |\n|---|---|\n" + "\n".join(rows) + "\n")
    return "\n".join(parts)


def _openapi() -> Json:
    """The description that a service gives of itself."""
    from wingwatch.api import create_app  # what it needs takes a second to load

    class Nothing:
        """A monitor that is never asked."""

    with contextlib.redirect_stdout(io.StringIO()):
        app = create_app(Nothing(), dict, None, "0", None)  # type: ignore[arg-type]
    return app.openapi()


def _parameter(one: Json) -> str:
    needed = " (required)" if one.get("required") and one["in"] != "path" else ""
    text = _plain(one.get("description", ""))
    return (
        f"| `{one['name']}`{needed} | {one['in']} | {_cell(_kind(one.get('schema', {})))} | {_cell(text)} |"
    )


def _kind(schema: Json) -> str:
    """A schema in a few words."""
    if "$ref" in schema:
        return f"`{schema['$ref'].rsplit('/', 1)[1]}`"
    if "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema["enum"])
    if "anyOf" in schema:
        kinds = (_kind(inner) for inner in schema["anyOf"] if inner.get("type") != "null")
        return " or ".join(dict.fromkeys(kinds))
    if schema.get("type") == "array":
        return f"list of {_kind(schema.get('items', {}))}"
    words = {"minimum": "from", "maximum": "to", "maxLength": "at most characters:", "default": "default"}
    limits = [f"{word} `{schema[key]}`" for key, word in words.items() if schema.get(key) is not None]
    return " ".join([str(schema.get("format") or schema.get("type", "any")), *limits])


def _answer(status: str, one: Json) -> str:
    contents = _contents(one)
    text = _plain(one.get("description", ""))
    return f"| {status} | {_cell(text)}{': ' + _cell(contents) if contents else ''} |"


def _contents(one: Json) -> str:
    kinds = ((media, _kind(inner.get("schema", {}))) for media, inner in one.get("content", {}).items())
    return ", ".join(
        f"`{media}` {'' if kind in ('any', 'string') else kind}".strip() for media, kind in kinds
    )


def _plain(text: str) -> str:
    """Text of a docstring or a help on one line, its code marked as Markdown does."""
    return re.sub(r"\s+", " ", text.replace("``", "`")).strip().rstrip(".")


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


PAGES = {"options.md": options_page, "operations.md": operations_page}


def main() -> int:
    """Write both pages."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, page in PAGES.items():
        (FOLDER / name).write_text(page(), encoding="utf-8")
        print(FOLDER / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
