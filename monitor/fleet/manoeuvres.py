"""Verdicts on the manoeuvres of a live fleet's vehicles; to be used with the fleet's lock held."""

from collections.abc import Sequence

from wingwatch.monitor.fleet.context import FleetContext
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.fleet.member.states import Watched
from wingwatch.monitor.fleet.roster import VehicleKey
from wingwatch.monitor.vehicle.manoeuvre_verdict import verdict
from wingwatch.monitor.vehicle.manoeuvre_watch import FlownManoeuvre

__all__ = ["judge_manoeuvres"]


def judge_manoeuvres(
    context: FleetContext,
    key: VehicleKey,
    known: KnownVehicle,
    watch: Watched,
    flown: Sequence[FlownManoeuvre],
) -> None:
    """Keep the verdicts on manoeuvres that have just ended, and tell listeners of events."""
    for one in flown:
        view = verdict(watch.monitor, one, known.number_manoeuvre())
        watch.note_manoeuvre(view)
        context.event(
            "manoeuvre",
            {
                "fleet": key[0], "vehicle": key[1], "number": view.number, "begin_s": view.begin_s,
                "end_s": view.end_s, "good": view.good, "text": view.text,
            },
        )  # fmt: skip
