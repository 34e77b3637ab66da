"""`wingwatch notify test`: one notice, marked as a test, through each channel of a service's settings."""

import argparse
import os
import time
from typing import Any

from wingwatch.notifications import NotDeliveredError, RefusedError, trial_notice
from wingwatch.operations.faults import CommandError
from wingwatch.operations.progress import write_json
from wingwatch.service.notify_settings import ChannelPlan, channel_plans
from wingwatch.service.settings import file_settings

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command; 2 where a channel has not delivered."""
    settings = file_settings(arguments.config, os.environ)
    if not settings.notify.channels:
        raise CommandError(
            f"--config {arguments.config}: it has no [[notify.webhook]], [[notify.apprise]] or [[notify.statustext]]; "
            "add one"
        )
    plans = channel_plans(settings.notify, os.environ, f"http://{settings.host}:{settings.port}")
    try:
        results = [_tried(plan) for plan in _chosen(plans, arguments.channel)]
    finally:
        for plan in plans:
            plan.channel.close()
    if arguments.json:
        write_json({"channels": results})
    else:
        for one in results:
            said = "delivered" if one["delivered"] else f"not delivered: {one['problem']}"
            print(f"{one['channel']} ({one['place']}): {said}")
    return 0 if all(one["delivered"] for one in results) else 2


def _chosen(plans: list[ChannelPlan], channel: str | None) -> list[ChannelPlan]:
    """All, or the one of that name or number, counted from 1."""
    if channel is None:
        return plans
    for number, plan in enumerate(plans, 1):
        if channel in (plan.name, str(number)):
            return [plan]
    names = ", ".join(plan.name for plan in plans)
    raise CommandError(f"--channel is {channel!r}; there are {names} (or 1 to {len(plans)})")


def _tried(plan: ChannelPlan) -> dict[str, Any]:
    problem = None
    try:
        plan.channel.send(trial_notice(time.time()))
    except (NotDeliveredError, RefusedError) as error:
        problem = str(error)
    except Exception as error:  # what a library raises may quote the address
        problem = f"it failed with {type(error).__name__}"
    return {
        "channel": plan.name,
        "place": plan.channel.place,
        "delivered": problem is None,
        "problem": problem,
    }
