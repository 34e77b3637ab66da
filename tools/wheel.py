"""Builds the wheel that starts at once: with the kernels, compiled for a fixed set of processor features.

    make wheel

The plain wheel is built and unpacked, its kernels are compiled, and the wheel is built once more with what numba's
cache then holds. It is for this Python version and this kind of system, and asks for the versions of numba and llvmlite
that compiled it. What becomes of it elsewhere: wingwatch/cli/kernel_wheel.py.
"""

import os
import platform
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

from hatch_build import ARCHIVE

from wingwatch.service.kernel_wheel import pack_kernels

ROOT = Path(__file__).parents[1]

CPU = "x86-64-v3"
"""As LLVM and the x86-64 psABI name it: Intel since Haswell (2013), AMD since Excavator (2015)."""
FEATURES = (
    "avx", "avx2", "bmi", "bmi2", "cmov", "cx16", "cx8", "f16c", "fma", "fxsr", "lzcnt", "mmx", "movbe", "popcnt",
    "sahf", "sse", "sse2", "sse3", "sse4.1", "sse4.2", "ssse3", "xsave",
)  # fmt: skip
"""What the psABI asks of that level, by LLVM's names (LAHF-SAHF is ``sahf``; OSXSAVE is ``xsave`` that may be used)."""


def main() -> int:
    """The command; 0 where the wheel stands in dist/."""
    if platform.machine() != "x86_64":
        print(
            f"wingwatch wheel: no set of features is fixed for {platform.machine()}, only for x86_64; "
            "build the plain wheel with '.venv/bin/python -m hatchling build -t wheel'",
            file=sys.stderr,
        )
        return 2
    try:
        with tempfile.TemporaryDirectory() as folder:
            wheel = build(Path(folder))
    except subprocess.CalledProcessError as error:
        print(f"wingwatch wheel: '{' '.join(error.cmd)}' ended with code {error.returncode}", file=sys.stderr)
        return 2
    print(f"{wheel.relative_to(ROOT)} ({wheel.stat().st_size / 1e6:.1f} MB)")
    return 0


def build(folder: Path) -> Path:
    """Build the wheel with a folder for what comes before; its path.

    Raises:
        subprocess.CalledProcessError: a step failed, and has said why.
    """
    print("[wheel] the plain wheel", flush=True)
    plain = hatchling(folder / "plain", {})
    package = folder / "installed"
    with zipfile.ZipFile(plain) as packed:
        packed.extractall(package)
    print(f"[wheel] its kernels, compiled for {CPU}", flush=True)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    environment |= {
        "PYTHONPATH": str(package),
        "OPENBLAS_NUM_THREADS": "1",
        "NUMBA_CPU_NAME": CPU,
        "NUMBA_CPU_FEATURES": "",  # none but those of the name
        "NUMBA_DISABLE_INTEL_SVML": "1",  # a library that another machine need not have
    }
    subprocess.run(
        [sys.executable, "-m", "wingwatch.cli.main", "kernels"], cwd=folder, env=environment, check=True
    )
    archive = folder / "compiled.zip"
    pack_kernels(package / "wingwatch", archive, CPU, FEATURES)
    print("[wheel] the wheel with them", flush=True)
    switched_on = {ARCHIVE: str(archive), "HATCH_BUILD_HOOK_ENABLE_CUSTOM": "true"}
    return hatchling(ROOT / "dist", switched_on)


def hatchling(target: Path, environment: Mapping[str, str]) -> Path:
    """Build a wheel into a folder, with these variables besides; its path."""
    before = {file: file.stat().st_mtime_ns for file in target.glob("*.whl")}
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(target)]
    subprocess.run(
        command, cwd=ROOT, env={**os.environ, **environment}, check=True, stdout=subprocess.DEVNULL
    )
    (built,) = (file for file in target.glob("*.whl") if before.get(file) != file.stat().st_mtime_ns)
    return built


if __name__ == "__main__":
    sys.exit(main())
