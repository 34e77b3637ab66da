"""Verdicts on the diagnosis in words and tables."""

import math
from collections.abc import Sequence
from dataclasses import asdict

from diagnosis_score import Figures, Verdict, confusion, figures
from scipy.stats import beta

__all__ = ["counted", "of_cases", "plain", "report", "sentence"]

HEADER = (
    f"{'source':12}{'one':>6}{'two':>5}{'well':>6}{'refused':>9}{'named %':>9}{'first %':>9}{'alone %':>9}"
    f"{'in 95 %':>9}{'quiet %':>9}{'both %':>8}{'gain':>7}{'rms %':>7}{'s':>7}"
)


def line(f: Figures) -> str:
    """One row of the table."""

    def cell(value: float | None, width: int, digits: int = 0) -> str:
        return f"{'-':>{width}}" if value is None else f"{value:{width}.{digits}f}"

    return (
        f"{f.source:12}{f.one:6}{f.two:5}{f.healthy:6}{f.refused:9}{cell(f.named, 9)}{cell(f.first, 9)}"
        f"{cell(f.alone, 9)}{cell(f.inside, 9)}{cell(f.quiet, 9)}{cell(f.both, 8)}{cell(f.gain, 7, 2)}"
        f"{cell(f.held_out, 7)}{cell(f.seconds, 7, 1)}"
    )


def counted(verdicts: Sequence[Verdict]) -> list[str]:
    """Each figure as a count with its 95 % interval (Clopper and Pearson), for as many as there are cases."""
    heard = [v for v in verdicts if not v.refusal]
    one = [v for v in heard if len(v.hidden) == 1]
    answers = {
        "right cause first or in its set": [all(v.named) for v in one],
        "first": [v.first for v in one],
        "first and alone": [v.alone for v in one],
        "sizes inside": [v.inside for v in heard if v.inside is not None],
        "healthy ones quiet": [not v.said for v in heard if not v.hidden],
        "both of two named": [all(v.named) for v in heard if len(v.hidden) == 2],
        "nine tenths of the gain reached": [v.reached >= 0.9 for v in one if math.isfinite(v.reached)],
    }
    return [f"{what} {of_cases(sum(yes), len(yes))}" for what, yes in answers.items() if yes]


def of_cases(yes: int, cases: int) -> str:
    """A count with its 95 % interval (Clopper and Pearson)."""
    low = float(beta.ppf(0.025, yes, cases - yes + 1)) if yes > 0 else 0.0
    high = float(beta.ppf(0.975, yes + 1, cases - yes)) if yes < cases else 1.0
    return f"{yes} of {cases} ({100.0 * low:.0f} to {100.0 * high:.0f} %)"


def sentence(v: Verdict) -> str:
    """One case in words: which, what was hidden, what was said."""
    which = v.case or f"{v.source} {v.seed}"
    hidden = ", ".join(f"{label} {size:g}" for label, size in zip(v.hidden, v.sizes, strict=True))
    said = v.refusal or ", ".join(v.said) or "nothing"
    beside = f" (or {', '.join(v.inseparable_from)})" if v.inseparable_from else ""
    size = "" if v.inside is None else f"; size {v.size:.3g} ± {v.size_error:.2g}"
    return (
        f"{which:22}{v.aircraft:16}{v.turbulence:10}{v.signal_to_noise:6.0f}  {hidden or 'nothing':48} "
        f"said: {said}{beside}{size}"
    )


def report(verdicts: Sequence[Verdict]) -> list[str]:
    """Table, confusion, refusals and misses, line by line."""
    sources = list(dict.fromkeys(v.source for v in verdicts))
    lines = [HEADER, *(line(figures(s, [v for v in verdicts if v.source == s])) for s in sources)]
    if len(sources) > 1:
        lines.append(line(figures("all", verdicts)))
    lines += ["", "counts, with 95 % intervals"]
    lines += [f"  {s}: {'; '.join(counted([v for v in verdicts if v.source == s]))}" for s in sources]
    for s in sources:
        lines += ["", f"{s}, hidden: first cause, how often"]
        lines += [
            f"  {hidden:26}" + ", ".join(f"{said} {n}" for said, n in counts.most_common())
            for hidden, counts in confusion([v for v in verdicts if v.source == s]).items()
        ]
    for title, some in (
        ("refused", [v for v in verdicts if v.refusal]),
        ("missed", [v for v in verdicts if v.missed]),
        ("size outside its interval", [v for v in verdicts if v.inside is False]),
    ):
        lines += ["", f"{title}: {len(some)}", *(f"  {sentence(v)}" for v in some)]
    return lines


def plain(v: Verdict) -> dict[str, object]:
    """A verdict as JSON has it: null for what is not a number."""
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in asdict(v).items()
    }
