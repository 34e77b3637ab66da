"""The objects of the baseline as a person reads them."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

__all__ = ["many", "print_history", "print_list", "print_show", "utc"]

_WHOLE = 4
"""Entries of a structure that are printed with all their derivatives; more are a line each."""


def print_list(console: Console, result: Mapping[str, Any]) -> None:
    """Aircraft, then vehicles."""
    if not result["aircraft"] and not result["vehicles"]:
        console.print("the database has no expectations, and no vehicle has taught anything")
    if result["aircraft"]:
        table = _table(
            "expectations", "aircraft", "configuration", "structure", "entries", "superseded", "newest"
        )
        for kind in result["aircraft"]:
            for name, one in kind["structures"].items():
                counts = ", ".join(f"{number} {provenance}" for provenance, number in one["entries"].items())
                newest = "-" if one["newest_at_s"] is None else utc(one["newest_at_s"])
                table.add_row(
                    escape(kind["aircraft"]), escape(kind["configuration"]), name, counts or "none that counts",
                    str(one["superseded"]), newest,
                )  # fmt: skip
        console.print(table)
    if result["vehicles"]:
        table = _table(
            "taught by flights", "vehicle", "aircraft", "structure", "blocks", "flown", "cells", "updated"
        )
        for owner in result["vehicles"]:
            for name, one in owner["structures"].items():
                of = f"{owner['aircraft']} ({owner['configuration']})"
                table.add_row(
                    f"{owner['fleet']}/{owner['vehicle']}", escape(of),
                    name, str(one["blocks"]), f"{one['seconds']:.0f} s", str(one["cells"]), utc(one["updated_at_s"]),
                )  # fmt: skip
        console.print(table)


def print_show(console: Console, result: Mapping[str, Any]) -> None:
    """Entries, side by side at the condition, cells."""
    _print_head(console, result)
    _print_entries(console, result)
    if result["at"] is not None:
        _print_sides(console, result)
    for name, versions in result.get("references", {}).items():
        console.print(f"{name}, taught by {result['fleet']}/{result['vehicle']}: {escape(_taught(versions))}")
    if result.get("cells"):
        table = _table(
            "cells of the envelope", "structure", "airspeed, m/s", "altitude, m", "blocks", "flown", "age"
        )
        for cell in result["cells"]:
            (low, high), (below, above) = cell["airspeed_true_m_s"], cell["altitude_m"]
            table.add_row(
                cell["structure"], f"{low:.1f} to {high:.1f}", f"{below:.0f} to {above:.0f}", str(cell["blocks"]),
                f"{cell['seconds']:.0f} s", _age(cell["age_s"]),
            )  # fmt: skip
        console.print(table)


def print_history(console: Console, result: Mapping[str, Any]) -> None:
    """Entries with what superseded them, versions, and changes."""
    _print_head(console, result)
    _print_entries(console, result)
    for name, versions in result.get("references", {}).items():
        console.print(f"{name}, taught by {result['fleet']}/{result['vehicle']}: {escape(_taught(versions))}")
    for change in result["changes"]:
        by = f" by {change['who']}" if change["who"] else ""
        of = "" if change["vehicle"] is None else f" of {change['fleet']}/{change['vehicle']}"
        console.print(
            escape(
                f"change {change['id']}, {utc(change['at_s'])}{by}: {change['action']}{of}: {change['text']}"
            )
        )


def utc(at_s: float) -> str:
    """A date for a person."""
    return datetime.fromtimestamp(at_s, UTC).strftime("%Y-%m-%d %H:%M UTC")


def _print_head(console: Console, result: Mapping[str, Any]) -> None:
    console.print(f"[bold]{escape(result['aircraft'])}[/] in configuration {escape(result['configuration'])}")


def _print_entries(console: Console, result: Mapping[str, Any]) -> None:
    for name, entries in result["structures"].items():
        if not entries:
            console.print(f"{name}: the database has no entries; the aircraft file counts")
        elif len(entries) > _WHOLE:
            console.print(_lines(name, entries))
        else:
            for entry in entries:
                console.print(_whole(name, entry))


def _whole(name: str, entry: Mapping[str, Any]) -> Table:
    at = entry["condition"]
    title = (
        f"{name} at {at['airspeed_true_m_s']:.4g} m/s, {at['altitude_m']:.4g} m: {entry['provenance']}, "
        f"entry {entry['id']} of {utc(entry['created_at_s'])}{_until(entry)}"
    )
    table = Table(title=title, title_justify="left", title_style="bold", caption=escape(entry["source"]))
    for column in ("derivative", "unit", "expected"):
        table.add_column(column, justify="right" if column == "expected" else "left")
    for symbol, row in entry["derivatives"].items():
        table.add_row(row.get("name", symbol), row["unit"], _number(row))
    return table


def _lines(name: str, entries: Sequence[Mapping[str, Any]]) -> Table:
    table = _table(name, "entry", "airspeed, m/s", "altitude, m", "provenance", "of", "source")
    for entry in entries:
        at = entry["condition"]
        table.add_row(
            f"{entry['id']}{_until(entry)}", f"{at['airspeed_true_m_s']:.4g}", f"{at['altitude_m']:.0f}",
            entry["provenance"], utc(entry["created_at_s"]), escape(entry["source"]),
        )  # fmt: skip
    return table


def _print_sides(console: Console, result: Mapping[str, Any]) -> None:
    at = result["at"]["condition"]
    for name, side in result["at"]["structures"].items():
        flown = any(row["flights"] is not None for row in side["derivatives"].values())
        if side["stored"] is None and not flown and "reason" in side["a_priori"]:
            console.print(f"{name}: {escape(side['a_priori']['reason'])}")
            continue
        title = f"{name} at {at['airspeed_true_m_s']:.4g} m/s, {at['altitude_m']:.4g} m"
        table = _table(
            title, "derivative", "unit", "aircraft file", "database", "flights", "expected", "joint errors"
        )
        for symbol, row in side["derivatives"].items():
            columns = (_number(row[key]) for key in ("a_priori", "stored", "flights", "expected"))
            z = "-" if row["z"] is None else f"{row['z']:+.1f}"
            table.add_row(row.get("name", symbol), row["unit"], *columns, z)
        console.print(table)
        if (distance := side["distance"]) is not None:
            console.print(
                f"  expectation and flights: chi-square {distance['squared']:.1f} of {distance['freedom']} directions, "
                f"probability {distance['probability']:.2g}",
                style="dim",
            )


def _taught(versions: Sequence[Mapping[str, Any]]) -> str:
    return "; ".join(map(_version, versions)) or "nothing yet"


def _version(one: Mapping[str, Any]) -> str:
    gone = "" if one["withdrawn_by"] is None else f", taken back by change {one['withdrawn_by']}"
    return (
        f"{one['blocks']} blocks, {one['seconds']:.0f} s ({utc(one['updated_at_s'])}, version {one['id']}{gone}: "
        f"{one['source']})"
    )


def _until(entry: Mapping[str, Any]) -> str:
    later = entry["superseded_by"]
    if later is None:
        return ""
    return ", taken back" if later <= entry["id"] else f", superseded by {later}"


def _number(row: Mapping[str, Any] | None) -> str:
    return "-" if row is None else f"{row['value']:.4g} ± {row['standard_error']:.2g}"


def _age(age_s: float) -> str:
    days = age_s / 86_400.0
    return f"{days:.1f} days" if days >= 1.0 else f"{24.0 * days:.1f} h"


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", title_style="bold")
    right = {"blocks", "flown", "superseded", "joint errors", "age", "cells"}
    for column in columns:
        table.add_column(column, justify="right" if column in right else "left")
    return table


def many(number: int, what: str) -> str:
    """A number of things."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
