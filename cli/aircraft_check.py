"""What `wingwatch aircraft check` found, for a machine and for a person."""

import math
from typing import Any

from rich.console import Console
from rich.markup import escape

from wingwatch.aircraft import Aircraft, FileCheck

__all__ = ["check_object", "say_check"]


def check_object(aircraft: Aircraft, found: FileCheck) -> dict[str, Any]:
    """Findings as the machine result has them; what is not finite is null."""
    rows = [
        {
            "check": f.check,
            "key": f.key,
            "value": _finite(f.value),
            "unit": f.unit,
            "low": _finite(f.low),
            "high": _finite(f.high),
            "standing": f.standing,
            "text": f.text,
        }
        for f in found.findings
    ]
    return {
        "aircraft": aircraft.name,
        "usable": found.usable,
        "findings": rows,
        "not_checked": list(found.not_checked),
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def say_check(console: Console, aircraft: Aircraft, found: FileCheck) -> None:
    """One line a finding, or that there is none."""
    for one in found.findings:
        console.print(escape(f"{one.standing}: {one.text}"), soft_wrap=True)
    for text in found.not_checked:
        console.print(escape(f"not checked: {text}"), soft_wrap=True)
    if not found.findings:
        console.print(escape(f"{aircraft.name}: nothing implausible"))
