"""`wingwatch access`: Zenoh's access rules for a fleet."""

import argparse
import json

from wingwatch.operations.faults import say
from wingwatch.operations.progress import write_json
from wingwatch.telemetry import access_rules, vehicle_subject

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    vehicles = [_owner(name) for name in arguments.vehicles]
    several = {"workers": arguments.worker, "gateways": arguments.gateway}
    rules = access_rules(vehicles, arguments.service, arguments.reader, arguments.by, **several)
    text = json.dumps(rules, indent=1) + "\n"
    if arguments.out is not None:
        arguments.out.write_text(text, encoding="utf-8")
    names = [vehicle_subject(*owner) for owner in vehicles]
    if arguments.json:
        others = {"service": arguments.service, "readers": arguments.reader, **several}
        write_json({"vehicles": names, **others, **rules})
    elif arguments.out is None:
        print(text, end="")
    else:
        what = "common names of certificates" if arguments.by == "certificate" else "users"
        everyone = [*names, arguments.service, *arguments.worker, *arguments.gateway, *arguments.reader]
        say(f"{what}: {', '.join(everyone)}")
    return 0


def _owner(name: str) -> tuple[str, str]:
    """Fleet and vehicle of ``VEHICLE`` or ``FLEET.VEHICLE``."""
    fleet, dot, vehicle = name.partition(".")
    return (fleet, vehicle) if dot else ("default", fleet)
