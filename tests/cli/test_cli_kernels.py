"""Kernels compiled by processes of their own: their order, what is said of them, and what becomes of faults."""

import fcntl
import importlib.util
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from wingwatch.aircraft import library_names, load_aircraft
from wingwatch.api import KernelState, KernelsView
from wingwatch.cli import kernels_command
from wingwatch.cli.main import main
from wingwatch.estimators.ekf import recursion, window
from wingwatch.estimators.ekf.state import gust_states
from wingwatch.monitor import VehicleMonitor
from wingwatch.service import kernel_worker, kernels
from wingwatch.service.kernel_steps import AFTER_DEMO, AT_FIRST_USE, DEMO, EVERY, LIVE, STEPS, KernelStep
from wingwatch.service.kernels import KernelCompiler, KernelError, only_load
from wingwatch.telemetry import REQUIRED_CHANNELS

PATIENCE_S = 60.0

KERNEL = """
from numba import njit

@njit(cache=True)
def twice(x):
    return 2.0 * x
"""

WORKER = """
import json, os, sys, time
from pathlib import Path

folder = Path(sys.argv[1])
for line in sys.stdin:
    name = line.strip()
    with (folder / "asked").open("a") as file:
        file.write(f"{os.getpid()} {name}\\n")
    answer = folder / f"answer {name.removeprefix('later ')}"
    while not answer.exists():
        time.sleep(0.01)
    text = answer.read_text()
    if text == "die":
        sys.exit("the cat sat on the keyboard")
    if text == "be killed":
        os.kill(os.getpid(), 9)
    print(json.dumps({"problem": text or None}), flush=True)
"""


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


class Bench:
    """Invented steps, and processes that answer when the test lets them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.now_s = 0.0
        (folder / "worker.py").write_text(WORKER)
        (folder / "kernel.py").write_text(KERNEL)
        place = importlib.util.spec_from_file_location("kernel", folder / "kernel.py")
        assert place is not None
        assert place.loader is not None
        self.module: ModuleType = importlib.util.module_from_spec(place)
        place.loader.exec_module(self.module)

    def compiler(self, *later: str, processes: int = 2) -> KernelCompiler:
        command = (sys.executable, str(self.folder / "worker.py"), str(self.folder))
        return KernelCompiler(("wings", "tail", "whole"), later, processes, lambda: self.now_s, command)

    def answer(self, name: str, text: str = "") -> None:
        """Written at once: a process that sees the file sees all of it."""
        part = self.folder / "part"
        part.write_text(text)
        part.rename(self.folder / f"answer {name}")

    @property
    def asked(self) -> list[str]:
        """Steps that processes were asked for, in order."""
        file = self.folder / "asked"
        return [line.split(None, 1)[1] for line in file.read_text().splitlines()] if file.exists() else []

    @property
    def processes(self) -> set[int]:
        """Those that were asked for a step."""
        return {int(line.split()[0]) for line in (self.folder / "asked").read_text().splitlines()}


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    bench = Bench(tmp_path)
    steps = {
        "wings": KernelStep("the wings", 10.0, lambda: None),
        "tail": KernelStep("the tail", 20.0, lambda: None),
        "whole": KernelStep("the whole", 5.0, lambda: bench.module.twice(3.0), after=("wings", "tail")),
        "paint": KernelStep("the paint", 7.0, lambda: None),
        "wax": KernelStep("the wax", 7.0, lambda: None, after=("paint",)),
    }
    monkeypatch.setattr(kernels, "STEPS", steps)
    return bench


class Preparing:
    """``prepare`` in a thread, as the ingest has it."""

    def __init__(self, compiler: KernelCompiler) -> None:
        self.compiler = compiler
        self.result: bool | KernelError | None = None
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        try:
            self.result = self.compiler.prepare()
        except KernelError as error:
            self.result = error

    def end(self) -> bool | KernelError | None:
        self._thread.join(PATIENCE_S)
        assert not self._thread.is_alive()
        return self.result

    @property
    def view(self) -> KernelsView:
        view = self.compiler.view()
        assert view is not None
        return view


@pytest.fixture
def preparing(bench: Bench) -> Iterator[Callable[..., Preparing]]:
    begun: list[Preparing] = []

    def begin(*later: str, processes: int = 2) -> Preparing:
        begun.append(Preparing(bench.compiler(*later, processes=processes)))
        return begun[-1]

    yield begin
    for each in begun:
        each.compiler.stop()
        each.end()


def test_kernels_that_are_there_start_no_process(bench: Bench) -> None:
    bench.module.twice(1.0)
    compiler = bench.compiler("paint")
    assert compiler.prepare()
    assert compiler.view() is None
    assert bench.asked == []


def test_only_load_leaves_where_a_kernel_would_have_to_be_compiled(bench: Bench) -> None:
    with only_load() as missing:
        bench.module.twice(1.0)
    assert missing == ["twice"]
    assert bench.module.twice(1.0) == 2.0  # what was refused harms nothing later
    with only_load() as missing:
        assert bench.module.twice(2.0) == 4.0
    assert missing == []


def test_two_processes_share_the_steps_and_each_waits_for_what_it_needs(
    bench: Bench, preparing: Callable[..., Preparing]
) -> None:
    run = preparing()
    until(lambda: sorted(bench.asked) == ["tail", "wings"])
    assert run.view.text == (
        "The numerical kernels are being compiled, which this machine needs once: the wings and the tail now, 0 of 3 "
        "parts done after 0 s, about 25 s to go; samples that arrive meanwhile wait."
    )
    assert [part.state for part in run.view.parts] == [KernelState.COMPILING] * 2 + [KernelState.WAITING]
    bench.now_s = 20.0
    bench.answer("wings")
    until(lambda: run.view.parts[0].state is KernelState.COMPILED)
    assert run.view.remaining_s == pytest.approx(
        30.0
    )  # a machine half as fast: 20 s of the tail, 10 of the whole
    bench.answer("tail")
    until(lambda: bench.asked[2:] == ["whole"])
    bench.answer("whole")
    assert run.end() is True
    assert run.compiler.view() is None
    assert len(bench.processes) == 2


def test_what_can_wait_is_compiled_after_the_first_sample_could_be_taken_in(
    bench: Bench, preparing: Callable[..., Preparing]
) -> None:
    for name in ("wings", "tail", "whole"):
        bench.answer(name)
    run = preparing("paint", "wax", processes=1)
    assert run.end() is True
    until(lambda: bench.asked[3:] == ["later paint"])
    assert "the paint now, 0 of 2 parts done" in run.view.text
    assert run.view.text.startswith("Samples are taken in")
    assert [part.first for part in run.view.parts] == [True] * 3 + [False] * 2
    bench.answer("paint")
    bench.answer("wax")
    assert run.compiler.wait(PATIENCE_S)
    assert run.compiler.view() is None


def test_a_fault_in_what_is_needed_first_is_one_sentence(
    bench: Bench, preparing: Callable[..., Preparing]
) -> None:
    run = preparing("paint", processes=1)
    bench.answer("wings", "TypingError: no wings")
    error = run.end()
    assert isinstance(error, KernelError)
    assert str(error) == "The kernels of the wings cannot be compiled: TypingError: no wings"
    assert run.view.text == f"{error}."
    assert bench.asked == ["wings"]


def test_a_fault_in_what_can_wait_ends_nothing_else(
    bench: Bench, preparing: Callable[..., Preparing]
) -> None:
    for name in ("wings", "tail", "whole", "wax"):
        bench.answer(name)
    bench.answer("paint", "it is dry")
    run = preparing("paint", "wax")
    assert run.end() is True
    assert run.compiler.wait(PATIENCE_S)
    assert run.compiler.problems == ["The kernels of the paint cannot be compiled: it is dry"]
    assert run.view.text == "The kernels of the paint cannot be compiled: it is dry."
    assert run.view.parts[-1].state is KernelState.COMPILED


@pytest.mark.parametrize(
    ("how", "sentence"),
    [
        ("die", "its process ended with code 1: the cat sat on the keyboard"),
        ("be killed", "its process was ended; the machine may be out of memory"),
    ],
)
def test_a_process_that_dies_says_why(
    bench: Bench, preparing: Callable[..., Preparing], how: str, sentence: str
) -> None:
    for name in ("wings", "tail", "whole", "wax"):
        bench.answer(name)
    bench.answer("paint", how)
    run = preparing("paint", "wax", processes=1)
    assert run.end() is True
    assert run.compiler.wait(PATIENCE_S)
    assert run.compiler.problems == [f"The kernels of the paint cannot be compiled: {sentence}"]
    assert bench.asked[-1] == "later wax"  # by another process


def test_an_end_is_at_once_and_leaves_no_process(bench: Bench, preparing: Callable[..., Preparing]) -> None:
    run = preparing()
    until(lambda: len(bench.asked) == 2)
    began = time.monotonic()
    run.compiler.stop()
    assert run.end() is False
    assert run.compiler.problems == []
    until(lambda: not any(Path(f"/proc/{number}").exists() for number in bench.processes))
    assert time.monotonic() - began < 3.0


def test_every_step_comes_after_those_that_it_needs() -> None:
    for order in (LIVE, DEMO, (*LIVE, *AT_FIRST_USE), (*DEMO, *AFTER_DEMO), EVERY):
        for place, name in enumerate(order):
            assert set(STEPS[name].after) <= set(order[:place])
    assert set(DEMO) | set(AFTER_DEMO) == set(LIVE) | set(AT_FIRST_USE) == set(EVERY) == set(STEPS)


@pytest.mark.slow
def test_neither_a_first_sample_nor_a_first_change_has_the_filter_compiled_under_it() -> None:
    """An aircraft that states no span has a filter without gusts; its kernels held everybody up for eleven seconds."""
    for step in ("filter", "calm-filter"):
        STEPS[step].run()
    there = {tuple(len(part) for part in signature[0]) for signature in recursion._update_all.signatures}
    assert window.set_checkpoint.by_itself.signatures  # what a reset by a change calls
    assert window.empty_window.by_itself.signatures  # what quiet flight calls
    present = (*REQUIRED_CHANNELS, "elevator_rad", "aileron_rad", "rudder_rad", "angle_of_attack_rad",
               "sideslip_rad", "airspeed_true_m_s", "altitude_m", "air_density_kg_m3")  # fmt: skip
    needed = set()
    for name in library_names():
        whole = load_aircraft(name)
        for aircraft in (whole, whole.model_copy(update={"geometry": None})):
            monitor = VehicleMonitor(aircraft, "f", "v", present, {}, new_id=lambda: "1")
            sizes = [pair.ekf.model.sizes for pair in monitor.chain.supervisor.pairs.values()]
            needed |= {(one.states, one.inputs, one.gusts) for one in sizes}
    assert {(2, 1, 0), (2, 1, gust_states(2))} < needed
    assert needed <= there


def test_the_command_compiles_everything_and_says_what_it_cannot(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bench.answer("wings")
    bench.answer("tail", "no tail")
    monkeypatch.setattr(kernels_command, "KernelCompiler", lambda *_: bench.compiler())
    assert main(["kernels"]) == 2
    captured = capsys.readouterr()
    assert captured.err == "wingwatch: The kernels of the tail cannot be compiled: no tail\n"
    assert captured.out.splitlines()[-1].startswith("[kernels] ended after")


# -- the process itself ------------------------------------------------------------------------


def test_a_full_disk_is_told_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    def fill() -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(kernel_worker, "STEPS", {"fill": KernelStep("full", 1.0, fill)})
    assert kernel_worker.compile_step("fill") == (
        "what is compiled cannot be kept (no space left on device); free some hundred megabytes, then start again"
    )


def test_the_process_answers_a_step_and_ends_with_who_started_it() -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "wingwatch.service.kernel_worker"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write("later nonsense\n")
        process.stdin.flush()
        assert json.loads(process.stdout.readline()) == {"problem": "KeyError: 'nonsense'"}
        assert os.getpriority(os.PRIO_PROCESS, process.pid) == 19
        process.stdin.close()
        assert process.wait(PATIENCE_S) == 0


def test_one_process_at_a_time_writes_into_a_folder_of_the_cache(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    index: Any = importlib.import_module("numba.core.caching").IndexDataCacheFile
    plain, held = index.save, []

    def save(self: Any, key: object, data: object) -> None:
        folder = os.open(self._cache_path, os.O_RDONLY)
        with pytest.raises(BlockingIOError):
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.close(folder)
        held.append(folder)
        plain(self, key, data)

    monkeypatch.setattr(index, "save", save)
    with kernel_worker.one_writer():
        bench.module.twice(1.0)
    assert len(held) == 1
    assert index.save is save
