"""Flights whose channels contradict each other are refused before anything is estimated from them."""

from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.markup import escape

from wingwatch.aircraft import Aircraft
from wingwatch.operations.faults import CommandError
from wingwatch.telemetry import Cleaner, FlightTable
from wingwatch.telemetry.plausibility import Finding, Verdict, check_flight

__all__ = ["ACCEPT", "checked", "findings_of", "for_json", "show_doubts"]

ACCEPT = "--accept-implausible"


def findings_of(flight: FlightTable, aircraft: Aircraft) -> tuple[Finding, ...]:
    """What the channels of a flight say of one another."""
    return check_flight(Cleaner().clean(flight.block).block, flight.kinds, aircraft, flight.entries)


def checked(flight: FlightTable, aircraft: Aircraft, accepted: bool | None) -> tuple[Finding, ...]:
    """The findings of a flight that can be estimated from.

    Args:
        flight: as loaded.
        aircraft: that flew it.
        accepted: whether the user goes on nevertheless; None where that cannot be asked for.

    Raises:
        CommandError: channels contradict each other; one sentence with the lines to write.
    """
    findings = findings_of(flight, aircraft)
    refused = [one.sentence for one in findings if one.standing is Verdict.REFUSAL]
    if refused and not accepted:
        way_on = "" if accepted is None else f" (or go on nevertheless with {ACCEPT})"
        raise CommandError(f"{flight.source}: {'; '.join(refused)}{way_on}")
    return findings


def show_doubts(console: Console, findings: Sequence[Finding]) -> None:
    """One line for each channel that is doubtful, or was accepted although it contradicts others."""
    for one in findings:
        if one.standing is not Verdict.RIGHT:
            console.print(f"[bold]{one.standing}[/]: {escape(one.sentence)}", soft_wrap=True)


def for_json(findings: Sequence[Finding]) -> list[dict[str, Any]]:
    """Every finding, for JSON."""
    return [one.to_dict() for one in findings]
