"""What is compiled is used again as long as nothing that went into it has changed, and not a call longer."""

import importlib.util
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from wingwatch.kernels.keeping import KernelCache, contents_of

CALLEE = """
import numpy as np
from wingwatch.kernels.decorators import helper

STEP = {step}
TABLE = ({first}, 2.0)

@helper
def grown(x):
    '''{words}'''
    return x + STEP + TABLE[0]
"""
CALLER = """
from wingwatch.kernels.decorators import whole
from wingwatch.trial_callee import grown

@whole
def twice(x):
    return 2.0 * grown(x)
"""

Load = Callable[..., ModuleType]


@pytest.fixture
def load(tmp_path: Path) -> Iterator[Load]:
    """Two modules of one folder, as they are after an update of the first."""

    def loaded(step: float | str = 1.0, first: float = 0.0, words: str = "Grown.") -> ModuleType:
        module = ModuleType("nothing")
        texts = {"callee": CALLEE.format(step=step, first=first, words=words), "caller": CALLER}
        for name, text in texts.items():
            file = tmp_path / f"trial_{name}.py"
            file.write_text(text)
            spec = importlib.util.spec_from_file_location(f"wingwatch.{file.stem}", file)
            assert spec is not None
            assert spec.loader is not None
            module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
            sys.dont_write_bytecode, before = (
                True,
                sys.dont_write_bytecode,
            )  # sources of one second and one length
            spec.loader.exec_module(module)
            sys.dont_write_bytecode = before
        return module

    yield loaded
    for name in ("callee", "caller"):
        sys.modules.pop(f"wingwatch.trial_{name}", None)


def test_what_a_kernel_calls_and_names_is_part_of_it(load: Load) -> None:
    first = contents_of(load().twice.py_func)
    assert contents_of(load(words="Said otherwise.").twice.py_func) == first
    assert contents_of(load(step=2.0).twice.py_func) != first
    numpys = [contents_of(load(step=f"np.int64({n})").twice.py_func) for n in (1, 2)]
    assert numpys[0] != numpys[1]
    assert contents_of(load(first=1.0).twice.py_func) != first


def test_after_an_update_of_a_callee_no_old_code_runs(load: Load) -> None:
    assert load().twice(1.0) == 4.0
    again = load().twice
    assert again(1.0) == 4.0
    assert sum(again.stats.cache_hits.values()) == 1
    updated = load(step=5.0).twice
    assert updated(1.0) == 12.0
    assert sum(updated.stats.cache_misses.values()) == 1


@pytest.mark.parametrize(
    "content", [b"", b"cut", b"\x80\x05\x8c\x060.68.1\x94.\x80\x05cwingwatch.gone\nClass\n."]
)
def test_a_file_that_cannot_be_read_is_compiled_anew(load: Load, tmp_path: Path, content: bytes) -> None:
    load().twice(1.0)
    (index,) = (tmp_path / "__pycache__").glob("*.nbi")
    index.write_bytes(content)
    again = load().twice
    assert again(1.0) == 4.0
    assert sum(again.stats.cache_misses.values()) == 1
    assert sum((load().twice(np.float64(1.0)), 0.0)) == 4.0


def test_forms_of_another_version_are_replaced(load: Load, tmp_path: Path) -> None:
    for step in (1.0, 2.0, 3.0):
        load(step=step).twice(1.0)
    kernel = load(step=3.0).twice
    assert isinstance(kernel._cache, KernelCache)
    assert len(list((tmp_path / "__pycache__").glob("*.nbc"))) <= 2


def test_a_cache_that_is_emptied_is_filled_again(load: Load) -> None:
    kernel = load().twice
    kernel(1.0)
    kernel._cache.flush()
    again = load().twice
    assert again(1.0) == 4.0
    assert sum(again.stats.cache_misses.values()) == 1


def test_every_process_has_the_same_digest() -> None:
    """Options are sets of words, whose order differs from process to process."""
    command = [
        sys.executable,
        "-c",
        "from wingwatch.estimators.fourier.memory import replace; from wingwatch.kernels.keeping import contents_of\n"
        "print(contents_of(replace.py_func).hex())",
    ]
    said = {
        subprocess.run(
            command, env={**os.environ, "PYTHONHASHSEED": seed}, capture_output=True, text=True, check=True
        ).stdout
        for seed in ("1", "2", "4", "5")
    }
    assert len(said) == 1
