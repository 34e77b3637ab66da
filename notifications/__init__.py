"""Notifications: what the database has committed of alerts, said to people by webhook, apprise and MAVLink.

A ``Dispatcher`` a channel turns versions of alerts into notices, each step of an alert once, keeps what has still to be
said in an ``Outbox`` over restarts, and delivers it in order. Why it is done so: ``docs/decisions/0094-alerts-out.md``.
"""

from wingwatch.notifications.apprise_channel import AppriseChannel
from wingwatch.notifications.channel import Channel, ChannelError, NotDeliveredError, RefusedError
from wingwatch.notifications.dispatcher import Clocks, Dispatcher, Patience, Selection
from wingwatch.notifications.notice import ALL_STEPS, Notice, Step, trial_notice
from wingwatch.notifications.outbox import Outbox
from wingwatch.notifications.statustext import StatustextChannel, StatustextSettings
from wingwatch.notifications.webhook import WebhookChannel, WebhookSettings

__all__ = [
    "Notice",
    "Step",
    "ALL_STEPS",
    "trial_notice",
    "Channel",
    "ChannelError",
    "NotDeliveredError",
    "RefusedError",
    "WebhookChannel",
    "WebhookSettings",
    "AppriseChannel",
    "StatustextChannel",
    "StatustextSettings",
    "Outbox",
    "Dispatcher",
    "Selection",
    "Patience",
    "Clocks",
]
