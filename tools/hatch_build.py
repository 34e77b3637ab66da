"""What a wheel with compiled kernels has more than the plain one; ``tools/wheel.py`` switches this on.

The kernels' archive, the tag of the Python and the system that it is for, and the versions that it was built with.
"""

import json
import os
import sysconfig
import zipfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

ARCHIVE = "WINGWATCH_COMPILED"


class CompiledKernels(BuildHookInterface[Any]):
    """Hatchling finds it by its base class."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Before the wheel is written: what is added to it."""
        archive = Path(os.environ[ARCHIVE])
        with zipfile.ZipFile(archive) as packed:
            built = json.loads(packed.read("built.json"))
        python = f"cp{built['python'].replace('.', '')}"
        system = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["pure_python"] = False
        build_data["tag"] = f"{python}-{python}-{system}"
        build_data["force_include"][str(archive)] = "wingwatch/compiled.zip"
        build_data["dependencies"] += [f"{name}=={built[name]}" for name in ("llvmlite", "numba")]
