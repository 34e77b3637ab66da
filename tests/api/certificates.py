"""Certificates for tests: an authority of its own, and what it signs, by the command line of OpenSSL."""

import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

import pytest

__all__ = ["Authority", "Certificate", "needs_openssl"]

needs_openssl = pytest.mark.skipif(
    shutil.which("openssl") is None,
    reason="certificates are made by openssl, which this machine does not have: install the package openssl",
)


class Certificate(NamedTuple):
    """A certificate and its private key (PEM)."""

    certificate: Path
    private_key: Path


class Authority:
    """Signs certificates for this machine's loopback address, under any common name."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.certificate, self._key = folder / "authority.pem", folder / "authority.key"
        new = ("req", "-x509", "-nodes", "-days", "1", "-subj", "/CN=test authority", *_CURVE)
        _openssl(*new, "-keyout", self._key, "-out", self.certificate)

    def sign(self, name: str) -> Certificate:
        """A certificate whose common name is ``name``."""
        made = Certificate(self._folder / f"{name}.pem", self._folder / f"{name}.key")
        request, more = self._folder / f"{name}.csr", self._folder / f"{name}.cnf"
        more.write_text("subjectAltName = IP:127.0.0.1, DNS:localhost\n")
        _openssl(
            "req", "-nodes", "-subj", f"/CN={name}", *_CURVE, "-keyout", made.private_key, "-out", request
        )
        by = ("-CA", self.certificate, "-CAkey", self._key, "-CAcreateserial", "-days", "1", "-extfile", more)
        _openssl("x509", "-req", "-in", request, *by, "-out", made.certificate)
        return made


_CURVE = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1")


def _openssl(*arguments: object) -> None:
    subprocess.run(["openssl", *map(str, arguments)], check=True, capture_output=True, timeout=60)
