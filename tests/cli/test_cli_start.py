"""A service starts without what only files and reference computations need."""

import subprocess
import sys

UNUSED = ("filterpy", "scipy.stats", "scipy.signal", "scipy.optimize", "scipy.interpolate", "matplotlib")


def test_a_service_starts_without_what_it_has_no_use_for() -> None:
    """Two of four seconds of processor time went into these."""
    program = f"import sys, wingwatch.cli.serve_command; print(*(m for m in {UNUSED} if m in sys.modules))"
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert found.stdout.split() == []
