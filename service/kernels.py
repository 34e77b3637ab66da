"""Has the numerical kernels compiled by processes of their own, and says how far that is.

numba keeps what it compiles, so a machine goes through this once. ``wingwatch kernels`` compiles all of them.
"""

import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from types import TracebackType
from typing import Any, Protocol, Self

from wingwatch.api import KernelPart, KernelState, KernelsView
from wingwatch.service.kernel_steps import STEPS
from wingwatch.service.kernel_worker import LATER

__all__ = ["KernelCompiler", "KernelError", "Preparation", "only_load"]

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_LOOK_S = 0.5
_STOP_S = 1.0


class KernelError(Exception):
    """Kernels that cannot be compiled; one sentence without a full stop."""


class Preparation(Protocol):
    """What has to be done before samples are taken in."""

    def prepare(self) -> bool:
        """Do it, and return when it is done; False where it was ended before.

        Raises:
            KernelError: it cannot be done; one sentence without a full stop.
        """
        ...

    def view(self) -> KernelsView | None:
        """How far it is; None where there is nothing to say."""
        ...

    def stop(self) -> None:
        """End it, and what goes on in the background afterwards."""
        ...


class KernelCompiler:
    """Compiles steps of ``STEPS`` side by side, one a processor.

    Args:
        first: steps that ``prepare`` waits for.
        later: steps that go on at the lowest priority after it, and only if ``first`` had to be compiled.
        processes: how many compile at a time; the processors that this process may use if not given.
        clock: monotonic seconds.
        command: starts the process of ``kernel_worker``.
    """

    def __init__(
        self,
        first: Sequence[str],
        later: Sequence[str] = (),
        processes: int | None = None,
        clock: Callable[[], float] = time.monotonic,
        command: Sequence[str] = (sys.executable, "-m", "wingwatch.service.kernel_worker"),
    ) -> None:
        self._first = tuple(first)
        self._order = (*first, *(name for name in later if name not in first))
        self._processes = processes or len(os.sched_getaffinity(0))
        self._clock = clock
        self._command = tuple(command)
        self._changed = threading.Condition()
        self._state = dict.fromkeys(self._order, KernelState.WAITING)
        self._began: dict[str, float] = {}
        self._took: dict[str, float] = {}
        self._problems: dict[str, str] = {}
        self._began_s: float | None = None
        self._loaded = False
        self._ending = False
        self._running: list[_Worker] = []
        self._threads: list[threading.Thread] = []

    def prepare(self) -> bool:
        """Load the kernels of ``first``, and have them compiled before where they are not there yet."""
        with only_load() as missing:
            self._load()
        if not missing:
            self._note_loaded()
            return True
        self.start()
        with self._changed:
            self._changed.wait_for(lambda: self._ending or self._failed or self._are_compiled(self._first))
        if self._ending:
            return False
        if self._failed is not None:
            raise KernelError(self._failed)
        self._load()
        self._note_loaded()
        return True

    def start(self) -> None:
        """Begin to compile; returns at once."""
        self._began_s = self._clock()
        for _ in range(self._processes):
            thread = threading.Thread(target=self._work, name="wingwatch-kernels", daemon=True)
            thread.start()
            self._threads.append(thread)

    def wait(self, timeout_s: float) -> bool:
        """Wait until every step has been tried, or one of the first has failed; whether that is so."""
        with self._changed:
            return self._changed.wait_for(lambda: self._is_over, timeout_s)

    def wait_for(self, name: str, timeout_s: float) -> bool:
        """Wait until a step's kernels are there to be loaded; whether they are."""
        with self._changed:
            return self._changed.wait_for(
                lambda: self._loaded or self._state[name] is KernelState.COMPILED, timeout_s
            )

    def stop(self) -> None:
        """End every process; what they are compiling is lost, what they have compiled is kept."""
        with self._changed:
            self._ending = True
            self._changed.notify_all()
            for worker in self._running:
                worker.end()
        for thread in self._threads:
            thread.join(_STOP_S)

    @property
    def problems(self) -> Sequence[str]:
        """Why steps failed, a sentence each."""
        with self._changed:
            return [self._sentence(name) for name in self._problems]

    def view(self) -> KernelsView | None:
        """How far the compilation is; None before it, after it, and where there was none to do."""
        with self._changed:
            began_s = self._began_s
            if began_s is None or (self._loaded and self._is_over and not self._problems):
                return None
            elapsed_s = self._clock() - began_s
            remaining_s = None if self._loaded or self._problems else self._remaining_s()
            parts = [KernelPart(STEPS[n].name, self._state[n], n in self._first) for n in self._order]
            return KernelsView(self._text(elapsed_s, remaining_s), parts, elapsed_s, remaining_s)

    # -- what is said ---------------------------------------------------------------------------

    def _text(self, elapsed_s: float, remaining_s: float | None) -> str:
        if self._problems:
            return " ".join(f"{self._sentence(name)}." for name in self._problems)
        names = self._first if not self._loaded else [n for n in self._order if n not in self._first]
        now = _listed([STEPS[n].name for n in names if self._state[n] is KernelState.COMPILING])
        done = sum(self._state[n] is KernelState.COMPILED for n in names)
        if self._loaded:
            what = "Samples are taken in; kernels that they do not need are still being compiled in the background"
            return f"{what}: {now or 'none'} now, {done} of {len(names)} parts done."
        if done == len(names):
            return f"The numerical kernels were compiled in {elapsed_s:.0f} s and are being loaded."
        left = "" if remaining_s is None else f", about {_rounded(remaining_s)} s to go"
        return (
            f"The numerical kernels are being compiled, which this machine needs once: {now or 'none'} now, "
            f"{done} of {len(names)} parts done after {elapsed_s:.0f} s{left}; samples that arrive meanwhile wait."
        )

    def _sentence(self, name: str) -> str:
        return f"The kernels of {STEPS[name].name} cannot be compiled: {self._problems[name]}"

    def _remaining_s(self) -> float:
        """Expected from how long the steps done so far took."""
        pace = 1.0
        if self._took:
            pace = sum(self._took.values()) / sum(STEPS[name].seconds for name in self._took)
        now_s = self._clock()
        left: dict[str, float] = {}
        until: dict[str, float] = {}
        for name in self._first:
            step = STEPS[name]
            spent_s = now_s - self._began.get(name, now_s)
            left[name] = 0.0 if self._is_settled(name) else max(pace * step.seconds - spent_s, 1.0)
            until[name] = left[name] + max((until.get(n, 0.0) for n in step.after), default=0.0)
        return max(sum(left.values()) / self._processes, *until.values())

    # -- what is done ---------------------------------------------------------------------------

    def _load(self) -> None:
        for name in self._first:
            STEPS[name].run()

    def _note_loaded(self) -> None:
        with self._changed:
            self._loaded = True
            self._changed.notify_all()

    @property
    def _failed(self) -> str | None:
        """Why what is needed first will not come; None while it may."""
        return next((self._sentence(n) for n in self._first if n in self._problems), None)

    @property
    def _is_over(self) -> bool:
        if self._ending or self._failed is not None:
            return True
        return all(self._is_settled(name) for name in self._order)

    def _is_settled(self, name: str) -> bool:
        return self._state[name] in (KernelState.COMPILED, KernelState.FAILED)

    def _are_compiled(self, names: Sequence[str]) -> bool:
        return all(self._state[name] is KernelState.COMPILED for name in names)

    def _work(self) -> None:
        """One process after another: one that has died takes no further step."""
        while (name := self._take()) is not None:
            with _Worker(self._command) as worker:
                with self._changed:
                    self._running.append(worker)
                    if self._ending:
                        worker.end()
                while name is not None:
                    asked = name if name in self._first else f"{LATER}{name}"
                    problem = worker.compile(asked)
                    self._note(name, problem)
                    name = None if worker.is_dead else self._take()
                with self._changed:
                    self._running.remove(worker)

    def _take(self) -> str | None:
        """The next step that can begin, when there is one; None where none is left."""
        with self._changed:
            while not self._ending and self._failed is None:
                waiting = [n for n in self._order if self._state[n] is KernelState.WAITING]
                if not waiting:
                    return None
                for name in waiting:
                    if all(self._is_settled(n) for n in STEPS[name].after if n in self._state):
                        self._state[name] = KernelState.COMPILING
                        self._began[name] = self._clock()
                        return name
                self._changed.wait()
            return None

    def _note(self, name: str, problem: str | None) -> None:
        with self._changed:
            self._took[name] = self._clock() - self._began[name]
            self._state[name] = KernelState.COMPILED if problem is None else KernelState.FAILED
            if problem is not None and not self._ending:
                self._problems[name] = problem
            self._changed.notify_all()


class _Worker:
    """One process of ``kernel_worker``; use it in a ``with`` statement."""

    def __init__(self, command: Sequence[str]) -> None:
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115 - closed on exit
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,  # its end tells the process that we are gone
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            env={**os.environ, **dict.fromkeys(_ONE_THREAD, "1")},
            start_new_session=True,  # Ctrl-C at the service's terminal is the service's
        )
        self.is_dead = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()  # it holds nothing but a temporary file of numba's
        self._process.communicate()
        self._errors.close()

    def compile(self, step: str) -> str | None:
        """Have a step compiled; None where all went well, else a sentence without a full stop."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(f"{step}\n")
            self._process.stdin.flush()
            answer: dict[str, Any] = json.loads(self._process.stdout.readline())
        except (OSError, ValueError):
            self.is_dead = True
            return self._death()
        problem: str | None = answer["problem"]
        return problem

    def end(self) -> None:
        """End the process at once."""
        self._process.kill()

    def _death(self) -> str:
        self._process.kill()
        code = self._process.wait()
        if code < 0:
            return "its process was ended; the machine may be out of memory"
        self._errors.seek(0)
        last = (self._errors.read().strip().splitlines() or ["it said nothing"])[-1]
        return f"its process ended with code {code}: {last[:300]}"


class _MissingError(Exception):
    """A kernel that is not in numba's cache."""


@contextmanager
def only_load() -> Iterator[list[str]]:
    """Leave the ``with`` block where this thread would have to compile a kernel, whose name then stands in the list."""
    event: Any = import_module("numba.core.event")
    here, missing = threading.get_ident(), []

    class Refusal(event.Listener):  # type: ignore[misc]
        def on_start(self, begun: Any) -> None:
            if threading.get_ident() == here:
                missing.append(begun.data["dispatcher"].py_func.__qualname__)
                raise _MissingError

        def on_end(self, ended: Any) -> None:
            """Nothing was begun."""

    refusal = Refusal()
    event.register("numba:compile", refusal)
    try:
        yield missing
    except _MissingError:
        pass
    finally:
        event.unregister("numba:compile", refusal)


def _listed(names: Sequence[str]) -> str:
    return " and ".join((", ".join(names[:-1]), names[-1]) if len(names) > 1 else names)


def _rounded(seconds: float) -> int:
    """To five seconds: it is no more than a guess."""
    return max(5, 5 * round(seconds / 5.0))
