"""How much of what the true model gains on the second flight the diagnosed one gains.

    .venv/bin/python benchmarks/diagnosis.py --source jsbsim --cases 20 --first-seed N --json > draw.json
    .venv/bin/python benchmarks/diagnosis_true_gain.py draw.json [...]

The true model is the stated one with the hidden effect at its hidden size. Where the first cause is the hidden one,
said alone and with one parameter, the second flight is flown open loop through still air by the stated model, by the
one found and by the true one. With S the sum of squared residuals of the channel in which the true model takes away
most of it, over the noise of its sensor and the gusts, the figure is

    (S_stated - S_found) / (S_stated - S_true).

``reached`` of ``benchmarks/diagnosis.py`` compares with what noise would leave, as the finder knows noise; in gusts no
model reaches that.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from diagnosis_cases import Case, draw
from diagnosis_report import of_cases
from diagnosis_score import same
from saving import run_benchmark
from threadpoolctl import threadpool_limits

from wingwatch.diagnosis.causes import candidates
from wingwatch.diagnosis.fit import own_fitted
from wingwatch.diagnosis.measured import OUTPUTS
from wingwatch.diagnosis.misfit import noise_variance, replayed
from wingwatch.diagnosis.noise import first_noise, likeliest_level
from wingwatch.diagnosis.problem import RunsAwayError, prepare
from wingwatch.diagnosis.subject import subject_of

_WINDOW_S = 8.0
ENOUGH = 0.9


def reached(case: Case, size: float) -> tuple[str, float] | None:
    """Channel, and the part that a size found reaches; None where the effect has several parameters."""
    hidden = case.effects[0]
    subject = subject_of(case.held_out, case.aircraft, case.kinds, _WINDOW_S)
    cause = next((c for c in candidates(subject) if same(c.label, hidden.label)), None)
    if cause is None or len(cause.parameters) > 1:
        return None
    parameter = cause.parameters[0]
    problem, point = prepare(subject, first_noise(subject))
    point = own_fitted(problem, likeliest_level(problem, point))
    sizes = [1.0 / s if parameter.inverse else s for s in (size, hidden.size)]
    points = [point, *(replace(point, causes=(cause,), values=(np.array([s]),)) for s in sizes)]
    noise, flown = noise_variance(problem, points[2]), [replayed(problem, at) for at in points]
    best, taken = ("", float("nan")), 0.0
    for k in problem.compared:
        stated, found, true = (sum(float(((a - b) ** 2).sum()) for a, b in f.pairs(k)) for f in flown)
        if (stated - true) / noise[k] > taken:
            best, taken = (OUTPUTS[k], (stated - found) / (stated - true)), (stated - true) / noise[k]
    return best


def main() -> int:
    enough: dict[str, list[bool]] = {}
    for line in (line for name in sys.argv[1:] for line in Path(name).read_text().splitlines()):
        verdict = json.loads(line)
        if not verdict["alone"] or len(verdict["hidden"]) != 1 or verdict["size"] is None:
            continue
        try:
            with threadpool_limits(1):
                said = reached(draw(verdict["source"], verdict["seed"]), verdict["size"])
        except RunsAwayError:
            said = None
        if said is not None:
            channel, part = said
            print(
                f"{verdict['source']:12}{verdict['seed']:8}  {verdict['hidden'][0]:36}{channel:26}{part:7.3f}",
                flush=True,
            )
            enough.setdefault(verdict["source"], []).append(part >= ENOUGH)
    for source, answers in enough.items():
        print(f"{source}: {ENOUGH:g} of what the true model gains in {of_cases(sum(answers), len(answers))}")
    return 0


if __name__ == "__main__":
    run_benchmark(main)
