"""Settings of the service: from a TOML file, overridden by flags."""

import argparse
import hashlib
import os
import re
import tomllib
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Self, get_args
from urllib.parse import urlsplit

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from wingwatch.baselines import Retention
from wingwatch.operations.faults import CommandError
from wingwatch.service.link_settings import LinkTable
from wingwatch.service.logs import LogFormat
from wingwatch.service.notify_settings import NotifyTable
from wingwatch.service.recorder import RecordingLimits

__all__ = [
    "DATABASE_VARIABLE",
    "MOST_WORKERS",
    "HistoryTable",
    "RecordingTable",
    "ServeSettings",
    "file_settings",
    "serve_settings",
]

DATABASE_VARIABLE = "WINGWATCH_DATABASE_URL"
"""Environment variable; empty counts as not set. It goes before the file's ``database``."""

MOST_WORKERS = 64
"""Processes of one ``wingwatch serve``."""

_MOST_BYTES = 100_000
_FLAGS = (
    "host", "port", "listen", "connect", "name", "certificate", "private_key", "require_token", "data", "aircraft",
    "log_format", "excite", "diagnose_alerts", "record", "studies", "documents", "workers", "worker_name", "capacity",
)  # fmt: skip
_SECRET = re.compile(r"(^|\.)(url|secret)[a-z_]*$")
_PATHS = ("data", "certificate", "private_key", "record", "studies", "documents")


def built_documents() -> Path | None:
    """The documents' site that ``make docs`` has built in this checkout; None where there is none."""
    checkout = Path(__file__).resolve().parents[1]
    site = checkout / "dist" / "site"
    return site if (checkout / "mkdocs.yml").is_file() and (site / "index.html").is_file() else None


class HistoryTable(BaseModel):
    """How long the history of derivatives is kept.

    Attributes:
        full_rate_hours: as it came.
        interval_s: of what is older, one instant of each interval stays.
        keep_days: flights that ended longer ago go.
        most_rows: where there are more estimates, the flights that ended first go.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    full_rate_hours: Annotated[float, Field(gt=0.0, le=1e6)] = 24.0
    interval_s: Annotated[float, Field(gt=0.0, le=1e6)] = 10.0
    keep_days: Annotated[float, Field(gt=0.0, le=1e5)] = 90.0
    most_rows: Annotated[int, Field(strict=True, ge=1000)] = 20_000_000

    @property
    def retention(self) -> Retention:
        """In seconds."""
        return Retention(
            3600.0 * self.full_rate_hours, self.interval_s, 86_400.0 * self.keep_days, self.most_rows
        )


class RecordingTable(BaseModel):
    """How much of recordings is kept.

    Attributes:
        file_mb, file_minutes: a file ends at this size or age.
        most_gb: of all files in the folder; the oldest are removed.
        keep_days: files that ended longer ago are removed.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    file_mb: Annotated[float, Field(ge=1.0, le=1e5)] = 256.0
    file_minutes: Annotated[float, Field(ge=0.1, le=1e5)] = 60.0
    most_gb: Annotated[float, Field(ge=0.001, le=1e6)] = 20.0
    keep_days: Annotated[float, Field(gt=0.0, le=1e5)] = 30.0

    @property
    def limits(self) -> RecordingLimits:
        """In bytes and seconds."""
        return RecordingLimits(
            1e6 * self.file_mb, 60.0 * self.file_minutes, 1e9 * self.most_gb, 86_400.0 * self.keep_days
        )


class ServeSettings(BaseModel):
    """What a service needs to start.

    Attributes:
        host, port: where HTTP is served; port 0 takes a free one.
        listen: Zenoh endpoints to listen on; where neither ``listen`` nor ``connect`` is given, loopback.
        connect: Zenoh routers to connect to.
        name: host names under which others reach HTTP, beside addresses and ``localhost``.
        certificate, private_key: PEM files; with them HTTPS is served.
        require_token: whether tokens are asked for on loopback too; beyond it they always are.
        data: folder of the SQLite database and of the tokens.
        database: URL or path that replaces the one in ``data``.
        aircraft: files beside the library.
        stale_s: silence after which a vehicle is stale.
        zenoh: certificates, user and access rules of Zenoh's links.
        log_format: of what is written to standard error.
        history: how long the history of derivatives is kept.
        notify: on which channels alerts are said to people.
        excite: whether inputs that would help are proposed; excite_minutes: least time between two for a vehicle.
        diagnose_alerts: whether alerts of the airframe or of unclear cause are diagnosed.
        studies: folder of the reports of finished studies that are shown; none are without.
        record: folder of recordings (MCAP); none are made without. recording: how much of them is kept.
        documents: folder of the documents' site, served at ``/help``; that of this checkout where one was built.
        workers: processes that watch vehicles; with one the service watches them itself, 0 is one less than the
            machine has processors.
        worker_name: begin of this worker's name. capacity: what it takes beside others.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    host: Annotated[str, Field(min_length=1, max_length=253)] = "127.0.0.1"
    port: Annotated[int, Field(strict=True, ge=0, le=65_535)] = 8000
    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()
    name: tuple[str, ...] = ()
    certificate: Path | None = None
    private_key: Path | None = None
    require_token: Annotated[bool, Field(strict=True)] = False
    data: Path = Path("data")
    database: str | None = None
    aircraft: tuple[Path, ...] = ()
    stale_s: Annotated[float, Field(gt=0.0, le=3600.0)] = 5.0
    log_format: LogFormat = "text"
    zenoh: LinkTable = LinkTable()
    history: HistoryTable = HistoryTable()
    notify: NotifyTable = NotifyTable()
    excite: Annotated[bool, Field(strict=True)] = False
    excite_minutes: Annotated[float, Field(ge=1.0, le=1440.0)] = 5.0
    diagnose_alerts: Annotated[bool, Field(strict=True)] = True
    record: Path | None = None
    studies: Path | None = None
    recording: RecordingTable = RecordingTable()
    documents: Path | None = Field(default_factory=built_documents)
    workers: Annotated[int, Field(strict=True, ge=0, le=MOST_WORKERS)] = 1
    worker_name: Annotated[str, Field(min_length=1, max_length=54)] | None = None
    capacity: Annotated[float, Field(ge=0.001, le=1000.0)] = 1.0

    @field_validator("listen", "connect", "aircraft", "name", mode="before")
    @classmethod
    def _one_or_several(cls, value: Any) -> Any:
        return (value,) if isinstance(value, str) else value

    @model_validator(mode="after")
    def _both_or_none(self) -> Self:
        if (self.certificate is None) != (self.private_key is None):
            raise CommandError("HTTPS takes both --certificate and --private-key; give the other one too")
        return self

    @model_validator(mode="after")
    def _documents_are_there(self) -> Self:
        if self.documents is not None and not (self.documents / "index.html").is_file():
            raise CommandError(
                f"--documents {self.documents}: there is no index.html; `make docs` builds the documents into dist/site"
            )
        return self

    @property
    def where(self) -> str:
        """Path or URL of the database."""
        return self.database or str(self.data / "wingwatch.db")

    @property
    def checkpoints(self) -> Path:
        """Folder of the vehicles' states: beside an SQLite file, else in ``data``, one a database."""
        if "://" in self.where:
            return self.data / _folder_of(self.where)
        return Path(f"{self.where}.checkpoints")

    @property
    def worker_count(self) -> int:
        """Processes that watch vehicles; 1: this one."""
        return self.workers or max(1, len(os.sched_getaffinity(0)) - 1)

    @property
    def outboxes(self) -> Path:
        """Folder of what channels have still to say."""
        return self.data / "notifications"


def _folder_of(url: str) -> str:
    """A name for what belongs to a database of that URL, whoever logs in there."""
    parts = urlsplit(url)
    place = f"{parts.hostname}:{parts.port}{parts.path}"
    return f"checkpoints-{hashlib.sha256(place.encode()).hexdigest()[:12]}"


def serve_settings(arguments: argparse.Namespace, environment: Mapping[str, str]) -> ServeSettings:
    """The settings of ``wingwatch serve``: defaults, then file, then environment, then flags.

    Paths in the file count from the file's folder.

    Raises:
        CommandError: a file that cannot be read, a key that is not known, a value that is not allowed.
    """
    given = {
        name: getattr(arguments, name, None) for name in _FLAGS
    }  # a worker or a gateway has some of them
    flags = {
        name: tuple(one) if isinstance(one, list) else one for name, one in given.items() if one is not None
    }
    return file_settings(arguments.config, environment, flags)


def file_settings(
    path: Path | None, environment: Mapping[str, str], flags: Mapping[str, Any] = MappingProxyType({})
) -> ServeSettings:
    """The same for a command that takes the service's file and has no flags of its own.

    Raises:
        CommandError: as ``serve_settings``.
    """
    values = {} if path is None else _read(path)
    if environment.get(DATABASE_VARIABLE):
        values["database"] = environment[DATABASE_VARIABLE]
    values |= flags
    try:
        settings = ServeSettings.model_validate(values)
    except ValidationError as error:
        raise CommandError(_sentence(error, path)) from None
    if path is None:
        return settings
    tables = {"zenoh": settings.zenoh.beside(path.parent), "notify": settings.notify.beside(path.parent)}
    return settings.model_copy(update=tables)


def _read(path: Path) -> dict[str, Any]:
    try:
        raw = path.read_bytes()[: _MOST_BYTES + 1]
        values = tomllib.loads(raw.decode("utf-8"))
    except OSError as error:
        reason = (error.strerror or "unreadable").lower()
        raise CommandError(f"--config {path}: {reason}; give an existing file") from None
    except UnicodeDecodeError:
        raise CommandError(f"--config {path}: not UTF-8 text; save it as UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        raise CommandError(f"--config {path}: not valid TOML: {error}") from None
    values |= {key: path.parent / values[key] for key in _PATHS if isinstance(values.get(key), str)}
    files = values.get("aircraft")
    if isinstance(files, str | list):
        names = [files] if isinstance(files, str) else files
        values["aircraft"] = [path.parent / n if isinstance(n, str) else n for n in names]
    return values


def _sentence(error: ValidationError, path: Path | None) -> str:
    first = error.errors(include_url=False)[0]
    key = ".".join(str(part) for part in first["loc"])
    where = "" if path is None else f"--config {path}: "
    if first["type"] == "extra_forbidden":
        return f"{where}{key} is no setting; known are {', '.join(_known(first['loc'][:-1]))}"
    message = first["msg"].removeprefix("Input should be ").removeprefix("a ")
    given = "not shown, for it may be a secret" if _SECRET.search(key) else repr(first["input"])
    return f"{where}{key} is {given}; allowed is {message[0].lower()}{message[1:]}"


def _known(table: Sequence[int | str]) -> Collection[str]:
    """The settings of a table, by its place in the file."""
    model: type[BaseModel] = ServeSettings
    for name in table:
        if isinstance(name, str) and name in model.model_fields:
            kind = model.model_fields[name].annotation
            inner = next(iter(get_args(kind)), kind)
            model = inner if isinstance(inner, type) and issubclass(inner, BaseModel) else model
    return model.model_fields
