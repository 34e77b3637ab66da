"""Cases drawn, diagnosed and judged, in one process or several."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from time import perf_counter

from diagnosis_cases import FIXED, Case, Effects, Source, draw
from diagnosis_score import Verdict, judged, refused

import wingwatch.diagnosis
from wingwatch.diagnosis import Diagnosis

__all__ = ["Finder", "Task", "ask", "run"]

Finder = Callable[[Case], Diagnosis]


@dataclass(frozen=True, slots=True)
class Task:
    """A case to be drawn where it is diagnosed: a fixed one by its name, else by source, seed and effects."""

    source: Source = "simulation"
    seed: int = 0
    effects: Effects = "one"
    fixed: str = ""

    def case(self) -> Case:
        """The case."""
        return FIXED[self.fixed]() if self.fixed else draw(self.source, self.seed, self.effects)


def ask(case: Case) -> Diagnosis:
    """The product's own finder.

    Raises:
        ValueError: a flight that it refuses.
        RuntimeError: the package has none.
    """
    diagnose = vars(wingwatch.diagnosis).get("diagnose")
    if diagnose is None:
        raise RuntimeError("wingwatch.diagnosis has no function diagnose; hand a finder to run()")
    found: Diagnosis = diagnose(case.flight, case.aircraft, kinds=case.kinds, validate=case.held_out)
    return found


def run(tasks: Sequence[Task], finder: Finder = ask, workers: int = 1) -> Iterator[Verdict]:
    """Verdicts in the order of the tasks, as they come.

    Args:
        tasks: what to diagnose.
        finder: a function of a module, so that other processes can call it.
        workers: processes; 1 runs here.
    """
    answer = partial(_answer, finder=finder)
    with ExitStack() as stack:
        if workers <= 1:
            yield from map(answer, tasks)
            return
        pool = stack.enter_context(ProcessPoolExecutor(workers, mp_context=get_context("spawn")))
        yield from pool.map(answer, tasks)


def _answer(task: Task, finder: Finder) -> Verdict:
    case = task.case()
    start = perf_counter()
    try:
        found = finder(case)
    except ValueError as error:
        return refused(case, str(error), perf_counter() - start)
    except Exception as error:
        error.add_note(f"while {task} was diagnosed")
        raise
    return judged(case, found, perf_counter() - start)
