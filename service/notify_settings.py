"""The table ``[notify]`` of a service's settings, and the channels that it asks for. Off where the table is empty."""

import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from wingwatch.notifications import (
    ALL_STEPS,
    AppriseChannel,
    Channel,
    ChannelError,
    Patience,
    Selection,
    StatustextChannel,
    StatustextSettings,
    Step,
    WebhookChannel,
    WebhookSettings,
)
from wingwatch.operations.faults import CommandError

__all__ = ["AppriseTable", "ChannelPlan", "NotifyTable", "StatustextTable", "WebhookTable", "channel_plans"]

_MOST_SECRET = 4096
_SHORT_STEPS = (Step.RAISED, Step.LEVEL, Step.CAUSE, Step.CLEARED)
_MESSAGE_STEPS = (Step.RAISED, Step.LEVEL, Step.CAUSE, Step.DIAGNOSED, Step.CLEARED)

_Name = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,30}$")]
_Variable = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,200}$")]
_SystemId = Annotated[int, Field(strict=True, ge=1, le=255)]


class _ChannelTable(BaseModel):
    """What every channel may be asked.

    Attributes:
        name: in log, health and file; ``webhook1`` and so on where none is given.
        least_level: alerts below it are not spoken of.
        fleets, vehicles: that it is about; all where empty.
        steps: that are said.
        keep_hours: after which a notice that could not be delivered is given up.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: _Name | None = None
    least_level: Literal["watch", "warning", "critical"] = "watch"
    fleets: tuple[str, ...] = ()
    vehicles: tuple[str, ...] = ()
    steps: Annotated[tuple[Step, ...], Field(min_length=1)] = ALL_STEPS
    keep_hours: Annotated[float, Field(gt=0.0, le=720.0)] = 24.0


class _AddressTable(_ChannelTable):
    """A channel whose address may be a secret: stated, or in an environment variable, or in a file."""

    url: Annotated[str | None, Field(min_length=1, max_length=_MOST_SECRET, repr=False)] = None
    url_env: _Variable | None = None
    url_file: Path | None = None

    @model_validator(mode="after")
    def _one_address(self) -> Self:
        if sum(one is not None for one in (self.url, self.url_env, self.url_file)) != 1:
            raise CommandError(
                "a channel of [notify] takes one of url, url_env and url_file; give exactly one"
            )
        return self


class WebhookTable(_AddressTable):
    """``[[notify.webhook]]``; see ``WebhookSettings``. The signing secret is never in the settings themselves."""

    secret_env: _Variable | None = None
    secret_file: Path | None = None
    authority: Path | None = None
    timeout_s: Annotated[float, Field(gt=0.0, le=60.0)] = 10.0

    @model_validator(mode="after")
    def _one_secret(self) -> Self:
        if self.secret_env is not None and self.secret_file is not None:
            raise CommandError("a webhook takes secret_env or secret_file; leave one out")
        return self


class AppriseTable(_AddressTable):
    """``[[notify.apprise]]``."""

    steps: Annotated[tuple[Step, ...], Field(min_length=1)] = _MESSAGE_STEPS


class StatustextTable(_ChannelTable):
    """``[[notify.statustext]]``; see ``StatustextSettings``."""

    steps: Annotated[tuple[Step, ...], Field(min_length=1)] = _SHORT_STEPS
    connect: Annotated[str, Field(max_length=300)] = "udpout:127.0.0.1:14550"
    systems: Mapping[str, _SystemId] = Field(default_factory=dict)
    system: _SystemId = 1
    component: _SystemId = 191


class NotifyTable(BaseModel):
    """The table ``[notify]``.

    Attributes:
        external_url: where people find the status page; the service's own address where it is not said.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    external_url: Annotated[str, Field(pattern=r"^https?://[^\s]+$", max_length=500)] | None = None
    webhook: tuple[WebhookTable, ...] = ()
    apprise: tuple[AppriseTable, ...] = ()
    statustext: tuple[StatustextTable, ...] = ()

    def beside(self, folder: Path) -> "NotifyTable":
        """With paths that count from a folder."""
        kinds = {
            kind: tuple(_beside(one, folder) for one in tables) for kind, tables in self._tables().items()
        }
        return self.model_copy(update=kinds)

    @property
    def channels(self) -> Sequence[tuple[str, _ChannelTable]]:
        """Kind and table of all channels, in the order of the help: webhooks, apprise, STATUSTEXT."""
        return [(kind, one) for kind, tables in self._tables().items() for one in tables]

    def _tables(self) -> dict[str, tuple[Any, ...]]:
        return {"webhook": self.webhook, "apprise": self.apprise, "statustext": self.statustext}


@dataclass(frozen=True, slots=True)
class ChannelPlan:
    """A channel that is set up, and how it is to be used.

    Attributes:
        kind: ``webhook``, ``apprise`` or ``statustext``.
        name: for log and health; file: of what it has still to say, without folder.
    """

    kind: str
    name: str
    file: str
    channel: Channel
    selection: Selection
    patience: Patience

    @property
    def says_aircraft(self) -> bool:
        """Whether its notices name the vehicle's aircraft, which takes a look at the fleet."""
        return self.kind != "statustext"


def channel_plans(table: NotifyTable, environment: Mapping[str, str], external_url: str) -> list[ChannelPlan]:
    """Set up all channels.

    Args:
        external_url: of the status page, where the table states none.

    Raises:
        CommandError: a secret that is not there, an address that cannot be used, a library that is missing.
    """
    plans: list[ChannelPlan] = []
    try:
        for kind, one in table.channels:
            number = sum(plan.kind == kind for plan in plans) + 1
            try:
                plans.append(_plan(kind, number, one, plans, environment, table.external_url or external_url))
            except (ChannelError, CommandError) as error:
                raise CommandError(f"[[notify.{kind}]] number {number}: {error}") from None
    except CommandError:
        for plan in plans:
            plan.channel.close()
        raise
    return plans


def _plan(
    kind: str, number: int, table: _ChannelTable, earlier: Sequence[ChannelPlan], environment: Mapping[str, str],
    external_url: str,
) -> ChannelPlan:  # fmt: skip
    name = table.name or f"{kind}{number}"
    if name in {plan.name for plan in earlier}:
        raise CommandError(f"the name {name!r} is taken; give another")
    channel, leads_to = _set_up(table, name, environment, external_url)
    # The order in the file may change, and then a channel goes on with what it had to say: its file is called by its
    # name, else by where it leads.
    file = f"{kind}-{table.name or hashlib.sha256(leads_to.encode()).hexdigest()[:8]}"
    file += f"-{number}" if f"{file}.json" in {plan.file for plan in earlier} else ""
    selection = Selection(table.least_level, table.fleets, table.vehicles, table.steps)
    patience = Patience(keep_s=3600.0 * table.keep_hours)
    return ChannelPlan(kind, name, f"{file}.json", channel, selection, patience)


def _set_up(
    table: _ChannelTable, name: str, environment: Mapping[str, str], external_url: str
) -> tuple[Channel, str]:
    """A channel, and what tells it from others."""
    if isinstance(table, WebhookTable):
        url = _address(table, environment)
        secret = _secret("secret", None, table.secret_env, table.secret_file, environment)
        settings = WebhookSettings(
            url, secret.encode(), name, external_url.rstrip("/"), table.authority, table.timeout_s
        )
        return WebhookChannel(settings), url
    if isinstance(table, AppriseTable):
        url = _address(table, environment)
        return AppriseChannel(url), url
    assert isinstance(table, StatustextTable)
    return StatustextChannel(
        StatustextSettings(table.connect, table.systems, table.system, table.component)
    ), table.connect


def _address(table: _AddressTable, environment: Mapping[str, str]) -> str:
    return _secret("url", table.url, table.url_env, table.url_file, environment)


def _secret(
    what: str, stated: str | None, variable: str | None, file: Path | None, environment: Mapping[str, str]
) -> str:  # fmt: skip
    """A value that is stated, or in an environment variable, or in a file; empty where it is in none."""
    if variable is not None:
        if not environment.get(variable):
            raise CommandError(f"the environment variable {variable} of {what}_env is not set; set it")
        return environment[variable].strip()
    if file is None:
        return stated or ""
    try:
        with file.open("rb") as opened:
            content = opened.read(_MOST_SECRET + 1).decode()
    except OSError as error:
        reason = (error.strerror or os.strerror(error.errno or 0)).lower()
        raise CommandError(f"{what}_file {file}: {reason}; correct the path or its permissions") from None
    except UnicodeDecodeError:
        raise CommandError(f"{what}_file {file}: not UTF-8 text; write the {what} into it as text") from None
    if not content.strip() or len(content) > _MOST_SECRET:
        raise CommandError(
            f"{what}_file {file}: empty or above {_MOST_SECRET} characters; write one {what} into it"
        )
    return content.strip()


def _beside(table: _ChannelTable, folder: Path) -> _ChannelTable:
    paths = {key: folder / path for key, path in table if isinstance(path, Path)}
    return table.model_copy(update=paths)
