"""How a Zenoh link is protected: certificates, user and password, and who may write what."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

__all__ = ["LinkSecurity", "LinkSecurityError"]

_MOST_BYTES = 10_000_000


class LinkSecurityError(ValueError):
    """Settings that do not protect what they seem to, or files that cannot be used; one sentence."""


@dataclass(frozen=True, slots=True)
class LinkSecurity:
    """Of one process; endpoints must then begin with ``tls/`` or ``quic/``.

    With both an authority and a certificate, both sides of a link show certificates (mutual TLS). With an authority
    alone a client checks whom it talks to, and shows user and password. With a certificate alone a listener shows it,
    and checks user and password by ``users``.

    Attributes:
        authority: certificates that others are checked by (PEM).
        certificate, private_key: one's own (PEM).
        user, password: shown to whom one connects to.
        users: file of ``user:password`` lines that those who connect are checked by.
        access: rules by ``wingwatch access``, kept by whoever listens.
    """

    authority: Path | None = None
    certificate: Path | None = None
    private_key: Path | None = None
    user: str | None = None
    password: str | None = field(default=None, repr=False)
    users: Path | None = None
    access: Path | None = None

    def config(self, listens: bool) -> dict[str, Any]:
        """Entries of Zenoh's configuration.

        Args:
            listens: whether others connect to this process.

        Raises:
            LinkSecurityError: half a pair, a file that cannot be used, or what has no effect here.
        """
        self._check_pairs(listens)
        values: dict[str, Any] = {"transport/link/tls/close_link_on_expiration": True}
        if self.authority is not None:
            values["transport/link/tls/root_ca_certificate"] = _readable(self.authority)
        if self.certificate is not None and self.private_key is not None:
            for side in ("listen", "connect"):
                values[f"transport/link/tls/{side}_certificate"] = _readable(self.certificate)
                values[f"transport/link/tls/{side}_private_key"] = _readable(self.private_key)
        mutual = self.authority is not None and self.certificate is not None
        values["transport/link/tls/enable_mtls"] = mutual
        if self.user is not None:
            values["transport/auth/usrpwd/user"] = self.user
            values["transport/auth/usrpwd/password"] = self.password
        if self.users is not None:
            values["transport/auth/usrpwd/dictionary_file"] = _readable(self.users)
        if self.access is not None:
            values["access_control"] = _rules(self.access)
        return values

    def _check_pairs(self, listens: bool) -> None:
        if (self.certificate is None) != (self.private_key is None):
            raise LinkSecurityError("Zenoh needs a certificate and its private key; give the other one too")
        if (self.user is None) != (self.password is None):
            raise LinkSecurityError("Zenoh needs a user and a password; give the other one too")
        if listens and self.certificate is None:
            raise LinkSecurityError("a listener with TLS needs a certificate and its private key; give both")
        if not listens and (self.access is not None or self.users is not None):
            raise LinkSecurityError(
                "access rules and users belong to the listener; give them to the router, not to its client"
            )


def _readable(path: Path) -> str:
    try:
        path.open("rb").close()
    except OSError as error:
        reason = (error.strerror or "unreadable").lower()
        raise LinkSecurityError(f"{path}: {reason}; correct the path or its permissions") from None
    return str(path.resolve())


def _rules(path: Path) -> Any:
    _readable(path)
    try:
        rules = json.loads(path.read_bytes()[:_MOST_BYTES])["access_control"]
    except (ValueError, KeyError, TypeError):
        raise LinkSecurityError(
            f"{path} holds no access rules; make it with `wingwatch access --out {path.name}`"
        ) from None
    if not (isinstance(rules, dict) and rules.get("enabled") and rules.get("default_permission") == "deny"):
        raise LinkSecurityError(
            f"the access rules of {path} do not deny what they do not name; make them anew"
        )
    return rules
