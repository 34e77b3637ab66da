"""Notices as Alertmanager's webhook has them (JSON, version 4), so that whatever takes Alertmanager's takes ours.

Source: Prometheus' documentation, "Configuration", ``webhook_config``. Each notice is a group of one alert.
"""

import hashlib
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from wingwatch.notifications.notice import Notice, Step
from wingwatch.notifications.wording import described, summary

__all__ = ["alertmanager_document"]

_NOT_ENDED = "0001-01-01T00:00:00Z"
"""The zero of Go's time, by which Alertmanager says that there is none."""


def alertmanager_document(notice: Notice, receiver: str, external_url: str) -> dict[str, Any]:
    """The body of a webhook.

    Group and fingerprint follow from the alert's id alone: a receiver finds the same alert again though its level or
    cause has changed, which Alertmanager would make another alert of.

    Args:
        receiver: the channel's name.
        external_url: where people find the status page.
    """
    alert = notice.alert
    ended = Step.CLEARED in notice.steps
    labels, annotations = _labels(notice), _annotations(notice)
    group = {name: labels[name] for name in ("alertname", "fleet", "vehicle", "alert")}
    return {
        "version": "4",
        "groupKey": f'{{}}:{{alert="{alert["id"]}"}}',
        "truncatedAlerts": 0,
        "status": "resolved" if ended else "firing",
        "receiver": receiver,
        "groupLabels": group,
        "commonLabels": labels,
        "commonAnnotations": annotations,
        "externalURL": external_url,
        "alerts": [
            {
                "status": "resolved" if ended else "firing",
                "labels": labels,
                "annotations": annotations,
                "startsAt": _at(notice.raised_at_s),
                "endsAt": _at(notice.at_s) if ended else _NOT_ENDED,
                "generatorURL": f"{external_url}/v1/alerts/{alert['id']}",
                "fingerprint": hashlib.sha256(str(alert["id"]).encode()).hexdigest()[:16],
            }
        ],
    }


def _labels(notice: Notice) -> dict[str, str]:
    """What receivers route by; what is not known is left out, as Prometheus leaves out empty labels."""
    alert: Mapping[str, Any] = notice.alert
    labels = {
        "alertname": "WingwatchTest" if notice.test else f"Wingwatch{str(alert['kind']).capitalize()}",
        "alert": alert["id"], "fleet": alert["fleet"], "vehicle": alert["vehicle"], "aircraft": notice.aircraft,
        "cause": alert["cause"], "channel": alert["channel"], "severity": alert["level"],
    }  # fmt: skip
    return {name: str(value) for name, value in labels.items() if value}


def _annotations(notice: Notice) -> dict[str, str]:
    notes = "\n".join(notice.alert["notes"])
    annotations = {
        "summary": summary(notice),
        "description": described(notice),
        "steps": ", ".join(notice.steps),
        "state": str(notice.alert["state"]),
    }
    return annotations | ({"notes": notes} if notes else {})


def _at(seconds: float) -> str:
    """RFC 3339, to the millisecond."""
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
