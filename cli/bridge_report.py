"""What a bridge says of its link and its vehicles: as an object, and as sentences."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

from wingwatch.cli.usable_channels import mode_sentence, usable
from wingwatch.telemetry.mavlink import LinkReceiver, LinkSystem

__all__ = ["bridge_object", "bridge_sentences"]


_SILENT_S = 5.0


def bridge_object(
    receiver: LinkReceiver, messages: Mapping[str, int], began_s: float, now_s: float, interruptions: int = 0
) -> dict[str, Any]:
    """Counters of all so far.

    Args:
        receiver: of the link.
        messages: published, by vehicle.
        began_s: when the link was opened, on the receiver's clock.
        now_s: on the same clock.
        interruptions: how often the link was broken.
    """
    return {
        "seconds": now_s - began_s,
        "link": receiver.counts() | {"interruptions": interruptions},
        "not_heard": list(receiver.waiting()),
        "not_named": {str(number): packets for number, packets in receiver.others.items()},
        "vehicles": [
            _vehicle(system, messages.get(system.vehicle.name, 0)) | {"silent_s": now_s - system.heard_s}
            for _, system in sorted(receiver.systems.items())
        ],
    }


def _vehicle(system: LinkSystem, messages: int) -> dict[str, Any]:
    vehicle, sequences = system.vehicle, system.sequences.values()
    plan = vehicle.plan
    offset_s, true_s = vehicle.clock.offset_s, vehicle.clock.true_offset_s
    known = isfinite(true_s)
    channels = () if plan is None else tuple(plan.channels)
    return {
        "vehicle": vehicle.name,
        "system": system.number,
        "autopilot": vehicle.heartbeat.autopilot or None,
        "published": not vehicle.is_multicopter,
        "samples": vehicle.counts.samples,
        "messages": messages,
        "sample_rate_hz": None if plan is None else plan.table_hz,
        "clock": None if plan is None else plan.clock,
        "rates_hz": vehicle.rates_hz(),
        "sources": {} if plan is None else {n: one.entry.source for n, one in plan.channels.items()},
        "packets_lost": sum(one.lost for one in sequences),
        "packets_repeated": sum(one.repeated for one in sequences),
        "packets_late": sum(one.late for one in sequences),
        **vehicle.dropped(),
        "restarts": vehicle.clock.restarts,
        "clock_jumps": vehicle.clock.jumps,
        "clock_offset_s": true_s if known else offset_s if isfinite(offset_s) else None,
        "clock_offset_by": "timesync" if known else "smallest delay" if isfinite(offset_s) else None,
        "link_delay_s": offset_s - true_s if known else None,
        "values_unbridged": dict(vehicle.counts.unbridged),
        **usable({"time_s", *channels}),
        "notes": [] if plan is None else list(plan.notes),
    }


def bridge_sentences(report: Mapping[str, Any]) -> list[str]:
    """The same for a person."""
    link = report["link"]
    lines = [
        f"{report['seconds']:.0f} s: {link.get('packets', 0)} packets, {link.get('packets_damaged', 0)} damaged, "
        f"{link.get('bytes_between', 0)} bytes of none"
    ]
    if report["not_heard"]:
        lines.append(f"nothing received yet from: {', '.join(report['not_heard'])}")
    if report["not_named"]:
        lines.append(f"received without a name: system {', '.join(report['not_named'])}")
    for one in report["vehicles"]:
        lines += _vehicle_sentences(one)
    return lines


def _vehicle_sentences(one: Mapping[str, Any]) -> list[str]:
    name = f"{one['vehicle']} (system {one['system']})"
    if not one["published"]:
        return [f"{name}: a multicopter, not published"]
    if one["sample_rate_hz"] is None:
        return [f"{name}: no samples yet: neither angular rates nor attitude have come for long enough"]
    lost = (
        f"lost {one['packets_lost']}, repeated {one['packets_repeated']}, late {one['packets_late']} packets; "
        f"{one['restarts']} restarts"
    )
    clock = ""
    if one["clock_offset_s"] is not None:
        clock = f"; its clock is {one['clock_offset_s']:.3f} s behind ours ({one['clock_offset_by']})"
    rates: dict[str, list[str]] = {}
    for channel, rate in one["rates_hz"].items():
        rates.setdefault(f"{rate:.3g}", []).append(channel)
    silent = f"{name}: nothing has come for {one['silent_s']:.0f} s"
    lines = [silent] if one["silent_s"] > _SILENT_S else []
    lines += [f"{name}: {one['samples']} samples at {one['sample_rate_hz']:.3g} Hz; {lost}{clock}"]
    lines += [f"{name}: {hz} Hz: {', '.join(channels)}" for hz, channels in rates.items()]
    if one["missing"]:
        lines.append(f"{name}: missing: {', '.join(one['missing'])}")
    lacking = [mode_sentence(mode, facts) for mode, facts in one["modes"].items() if facts["missing"]]
    return lines + [f"{name}: {sentence}" for sentence in lacking]
