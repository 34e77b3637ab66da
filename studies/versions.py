"""Versions of what decides a row: the code, and the monitor's settings."""

import hashlib
from functools import lru_cache
from pathlib import Path

import wingwatch
from wingwatch.monitor import JudgeConfig

__all__ = ["code_version", "settings_version"]

_DECIDING = ("aircraft", "baselines", "estimators", "monitor", "simulation", "studies", "telemetry")
"""Packages whose code a row follows from."""
_DIGITS = 8


@lru_cache(maxsize=1)
def code_version() -> str:
    """The program's version, and a digest of the sources that a row follows from."""
    root = Path(wingwatch.__file__).parent
    digest = hashlib.sha256()
    for package in _DECIDING:
        folder = root / package
        for source in sorted(folder.rglob("*.py")):
            digest.update(str(source.relative_to(root)).encode() + b"\0" + source.read_bytes())
    return f"{wingwatch.__version__}+{digest.hexdigest()[:_DIGITS]}"


@lru_cache(maxsize=1)
def settings_version() -> str:
    """A digest of the monitor's settings."""
    return hashlib.sha256(repr(JudgeConfig()).encode()).hexdigest()[:_DIGITS]
