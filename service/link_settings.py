"""Zenoh's certificates, user and rules: from the service's settings file, or a command's flags."""

import argparse
from collections.abc import Mapping
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from wingwatch.telemetry import LinkSecurity

__all__ = ["PASSWORD_VARIABLE", "LinkTable", "link_security", "security_of"]

PASSWORD_VARIABLE = "WINGWATCH_ZENOH_PASSWORD"
"""Environment variable; a password stands in no file of settings and on no command line."""


class LinkTable(BaseModel):
    """The table ``[zenoh]`` of a service's settings; see ``LinkSecurity``."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    authority: Path | None = None
    certificate: Path | None = None
    private_key: Path | None = None
    user: str | None = Field(default=None, min_length=1, max_length=200)
    users: Path | None = None
    access: Path | None = None

    def beside(self, folder: Path) -> "LinkTable":
        """With paths that count from a folder."""
        paths = {key: folder / path for key, path in self if isinstance(path, Path)}
        return self.model_copy(update=paths)


def link_security(table: LinkTable, environment: Mapping[str, str]) -> LinkSecurity | None:
    """What protects the service's links; None where nothing is said."""
    given = table.model_dump()
    if not any(value is not None for value in given.values()):
        return None
    return LinkSecurity(**given, password=environment.get(PASSWORD_VARIABLE) or None)


def security_of(arguments: argparse.Namespace, environment: Mapping[str, str]) -> LinkSecurity | None:
    """What protects the link of a command with ``--authority --certificate --private-key --user``."""
    names = ("authority", "certificate", "private_key", "user")
    return link_security(LinkTable(**{name: getattr(arguments, name) for name in names}), environment)
