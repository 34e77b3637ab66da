"""How the simulation's kernels are compiled."""

from typing import Any

from numba import njit

__all__ = ["kernel"]

_OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True}
kernel: Any = njit(**_OPTIONS)
"""Decorator of a kernel; nobody takes its address, and code for that took a fifth of a small kernel's compilation."""
