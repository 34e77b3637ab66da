"""What a study's report says in sentences: the answer, and one sentence below each picture."""

import math
from collections.abc import Iterable, Sequence

from wingwatch.pages.texts import listed, number
from wingwatch.studies.calibration import IMPROBABLE, Exceedance, Scatter
from wingwatch.studies.detection import Delays, Detection
from wingwatch.studies.false_alarms import OperatingCurve, Rate
from wingwatch.studies.naming import Confusion, Sizes
from wingwatch.studies.operator_answer import Answer, Threshold
from wingwatch.studies.page.faults import fault_sentences
from wingwatch.studies.page.texts import (
    effect_text,
    group_text,
    interval_text,
    per_100_h_text,
    percent_text,
    size_axis,
    size_text,
)
from wingwatch.studies.summary import Summary
from wingwatch.studies.worst_flights import Misses

__all__ = [
    "ANSWER_LEGEND",
    "BAD_FIT",
    "DETECTION_LEGEND",
    "OPERATING_CAPTION",
    "RATE_LEGEND",
    "about",
    "answer_caption",
    "answer_title",
    "condition_text",
    "confusion_caption",
    "delay_caption",
    "delay_legend",
    "detection_caption",
    "exceedance_caption",
    "excitation_text",
    "headline",
    "honesty",
    "miss_texts",
    "rate_caption",
    "scatter_caption",
    "size_caption",
    "threshold_caption",
    "threshold_text",
]

_MOST_NAMED = 5
BAD_FIT = 0.01
"""Below this probability a curve is called one that does not fit."""

ANSWER_LEGEND = (
    "Size that is noticed with 95 % probability within 30 s of its onset, with its 95 % interval; not "
    "known: the flights do not suffice to say. None up to a size: no flown size was. A size there is 'at "
    "least' or 'at most' the one given, because the study has delays at the monitor's own threshold only."
)
DETECTION_LEGEND = (
    "Curves: logistic in the logarithm of size, with their 95 % band; points: flights of neighbouring sizes "
    "with Wilson's 95 % interval; dashed: 95 %. Detected: an alert of any cause after the onset and before "
    "the flight's end. Information: log likelihood ratio of the true change on the data that had arrived."
)
RATE_LEGEND = (
    "Alarms in healthy time: whole healthy flights, and faulty ones before the onset. Intervals are exact "
    "(Poisson, 95 %); at most: the upper limit alone, which holds at 95 %. Under a sensor fault the aircraft is well: "
    "an alarm is one that calls the fault icing or damage, and flights count until it comes."
)
OPERATING_CAPTION = (
    "Lines: what the evidence alone would give as the threshold moves; markers: the monitor as it is, which "
    "also asks for a clear and confirmed cause (a triangle: no false alarm yet, drawn at the upper limit). "
    "Alerts about a sensor, a surface or thrust do not go by this threshold and are not in it."
)


def headline(s: Summary) -> tuple[str, str]:
    """The answer in a sentence, and what it costs in false alarms."""
    overall = [a for a in s.answers if not (a.aircraft or a.turbulence or a.excitation)]
    if not overall:
        said, *more = [*fault_sentences(s), _false_alarm_text(s)]
        return said, " ".join(more)
    overall.sort(key=lambda a: (a.effect != "icing", -a.flights))
    first = overall[0]
    if first.size.value <= first.largest and first.size.low > 0.0:
        size = size_text(first)
        answer = (
            f"{_capital(effect_text(first.effect))} is noticed with 95 % probability within 30 s from a "
            f"{size_axis(first.effect).split(' (')[0]} of {size} on, over all conditions flown."
        )
    else:
        known = "is" if first.size.low >= first.largest else "is surely"
        answer = (
            f"Over all conditions flown, {effect_text(first.effect)} of no size up to "
            f"{number(first.largest, 2)} {known} noticed with 95 % probability within 30 s; of the largest "
            f"tenth {100.0 * first.seen:.0f} % were."
        )
    best = _best(s.answers, first.effect)
    return answer, f"{best} {_false_alarm_text(s)} {_threshold_sentence(s, first)}".strip()


def _threshold_sentence(s: Summary, answer: Answer) -> str:
    """What to configure for one false alarm in 100 h, and what it costs; over all air."""
    if not s.thresholds:
        return ""
    over_all = s.thresholds[0]
    if math.isnan(over_all.vouched):
        return "These hours cannot vouch for one false alarm in 100 h at any threshold."
    if over_all.vouched <= over_all.own:
        return f"The monitor's own threshold of {number(over_all.own)} keeps to one false alarm in 100 h."
    return (
        f"For one false alarm in 100 h configure a threshold of {number(over_all.vouched)} in place of "
        f"{number(over_all.own)}; the size there: {size_text(answer, there=True)}."
    )


def _best(found: Sequence[Answer], effect: str) -> str:
    """The condition in which the smallest size is noticed."""
    cells = [a for a in found if a.effect == effect and a.turbulence and a.excitation and _certain(a)]
    if not cells:
        return ""
    a = min(cells, key=lambda a: a.size.high)
    return (
        f"Seen best: {a.aircraft or 'all aircraft'} with {group_text('turbulence', a.turbulence)} and "
        f"{group_text('excitation', a.excitation)}: from {size_text(a)} on."
    )


def _certain(a: Answer) -> bool:
    return a.size.value <= a.largest and a.size.high <= a.largest


def _false_alarm_text(s: Summary) -> str:
    rate = s.false_alarm_rates[0]
    if not rate.hours > 0.0:
        return "No healthy time was flown, so nothing is known of false alarms."
    alarms = (
        f"{rate.alarms} false alarm{'' if rate.alarms == 1 else 's'}" if rate.alarms else "No false alarm"
    )
    return f"{alarms} in {number(rate.hours)} h of healthy flight, a rate of {per_100_h_text(rate.per_hour)} in 100 h."


def about(s: Summary) -> str:
    """What was flown, in one line."""
    f = s.flown
    failed = f", {f.failed} not flown to the end" if f.failed else ""
    return (
        f"{f.flights} simulated flights{failed} of {listed(f.aircraft)}, {number(f.hours)} h, of which the "
        f"monitor could observe {100.0 * f.observed_fraction:.0f} %; study {listed(f.kinds)}; wingwatch "
        f"{listed(f.code_versions)}, settings {listed(f.settings_versions)}; {number(f.processor_h, 2)} h of "
        "processor time"
    )


def answer_title(effect: str) -> str:
    """Above the table of one effect."""
    return f"{_capital(effect_text(effect))}: smallest {size_axis(effect)} noticed with 95 % probability within 30 s"


def answer_caption(rows: Sequence[Answer]) -> str:
    """In how many conditions a size is known, and which is the smallest."""
    certain = [a for a in rows if _certain(a)]
    if not certain:
        return "In none of these groups is any flown size noticed so for certain; of an empty row nothing can be said."
    best = min(certain, key=lambda a: a.size.high)
    return (
        f"In {len(certain)} of {len(rows)} groups of flights a flown size is noticed so for certain, the "
        f"smallest with {condition_text(best)}: {size_text(best)}; of an empty row nothing can be said."
    )


def condition_text(a: Answer) -> str:
    """Aircraft, air and excitation of an answer."""
    named = [("aircraft", a.aircraft), ("turbulence", a.turbulence), ("excitation", a.excitation)]
    return listed(group_text(by, word) for by, word in named if word) or "all flights"


def threshold_text(s: Summary) -> str:
    """What the table of thresholds can say and what it cannot."""
    if not s.thresholds:
        return ""
    known = [t for t in s.thresholds if not math.isnan(t.vouched)]
    needed = s.thresholds[0].hours_needed
    legend = (
        " Vouched for: the smallest threshold whose rate of false alarms is at most one in 100 h at 95 % "
        f"confidence, which takes {needed:.0f} h without an alarm; estimate: the same of the rate itself, "
        "from 100 h on. Of thresholds under the monitor's own, only passages of the evidence are known, "
        "which are more than alarms."
    )
    if not known:
        hours = max(t.hours for t in s.thresholds)
        return (
            f"{number(hours)} healthy hours cannot vouch for one false alarm in 100 h at any threshold; "
            f"sizes are given at the monitor's own, with the false alarms that it had.{legend}"
        )
    return f"In {listed(map(_air, known))} the data vouch for a threshold.{legend}"


def _air(t: Threshold) -> str:
    return group_text("turbulence", t.group) if t.group else "all air together"


def excitation_text(rows: Sequence[Answer]) -> str:
    """What excitation buys, where the intervals say so."""
    plain = {a.excitation: a for a in rows if a.excitation and not a.aircraft and not a.turbulence}
    if len(plain) < 2:
        return ""
    idle = next((plain[e] for e in ("none", "autopilot") if e in plain), None)
    known = [a for a in plain.values() if _certain(a) and a is not idle]
    if not known:
        seen = listed(
            f"{100.0 * a.seen:.0f} % with {group_text('excitation', a.excitation)}" for a in plain.values()
        )
        return (
            "What excitation buys in size cannot be said: with none of them 95 % are noticed in time for "
            f"certain. Of the largest tenth of sizes are noticed in time {seen}."
        )
    best = min(known, key=lambda a: a.size.high)
    text = f"Best is {group_text('excitation', best.excitation)}, from {size_text(best)} on"
    if idle is None:
        return f"{text}."
    words = group_text("excitation", idle.excitation)
    if idle.size.low > best.size.high and idle.size.value <= idle.largest:
        return f"{text}; {words} needs {number(idle.size.value / best.size.value, 2)} times the size."
    if idle.size.value > idle.largest:
        return f"{text}; with {words} no size up to {number(idle.largest, 2)} is noticed so."
    return f"{text}; the difference to {words} ({size_text(idle)}) is not beyond doubt."


def detection_caption(groups: Sequence[Detection]) -> str:
    """Where most and where least is detected."""
    best, worst = max(groups, key=lambda d: d.detected.value), min(groups, key=lambda d: d.detected.value)
    doubt = [d for d in groups if d.fit_probability < BAD_FIT]
    unfit = listed(group_text(d.by, d.group) for d in doubt)
    fit = f" The curve does not fit {unfit}: trust the points." if doubt else ""
    if best is worst:
        return f"Of {best.flights} flights {percent_text(best.detected)} were detected.{fit}"
    return (
        f"Detected most with {group_text(best.by, best.group)}, {percent_text(best.detected)}, and least "
        f"with {group_text(worst.by, worst.group)}, {percent_text(worst.detected)}.{fit}"
    )


def delay_caption(groups: Sequence[Delays]) -> str:
    """How far the delays are from the bound."""
    known = [d for d in groups if math.isfinite(d.over_bound.value)]
    if not known:
        return "Dotted: the quickest detection that there can be; half of the flights were not noticed by their end."
    least = min(known, key=lambda d: d.over_bound.value)
    where = f" with {group_text(least.by, least.group)}" if least.by else ""
    return (
        "Dotted: the quickest detection that there can be with the information that arrived; the median "
        f"delay is nearest to it{where}, {number(least.over_bound.value, 2)} times the bound."
    )


def delay_legend(s: Summary) -> str:
    """What the bound is."""
    interval = s.false_alarm_interval_s / 3600.0
    return (
        "Flights without an alert count until their end (Kaplan and Meier). Bound: Lorden's, log(mean time "
        "between false alarms) over information rate, exact for information that arrives evenly, at each "
        f"flight's mean rate over the first 60 s and a mean time of {number(interval)} h, the lower 95 % "
        "limit of what was measured. It bounds the mean delay, not each flight's; the monitor decides once "
        "in 10 s."
    )


def rate_caption(rates: Sequence[Rate]) -> str:
    """The rate over all, and where it is highest beyond doubt."""
    overall = rates[0]
    high = [group_text(r.by, r.group) for r in rates[1:] if r.per_hour.low > overall.per_hour.high]
    where = f" Beyond doubt above it: {_first(high)}." if high else ""
    return (
        f"Over all {per_100_h_text(overall.per_hour)} in 100 h; dashed: one in 100 h; where hours are few, a "
        f"bar runs out of the picture.{where}"
    )


def threshold_caption(curve: OperatingCurve) -> str:
    """What the monitor's own threshold gives."""
    return (
        f"At its own threshold of {number(curve.own_threshold)} the monitor detects "
        f"{percent_text(curve.own_detected)} of the faulty flights with {per_100_h_text(curve.own_per_hour)} "
        "false alarms in 100 h. Alerts: at most, from what it said at its own threshold; below it, evidence "
        "without the other conditions of an alert."
    )


def size_caption(z: Sizes) -> str:
    """Coverage and bias."""
    covered = z.covered
    verdict = (
        "too narrow"
        if covered.high < 0.95
        else "too wide"
        if covered.low > 0.95
        else "as stated within its interval"
    )
    return (
        f"The stated 95 % interval holds the truth in {percent_text(covered)} of {z.flights} flights noticed "
        f"and rightly named: {verdict}. The median error is {number(z.median_error, 2)}; flights that were "
        "missed are not in it."
    )


def confusion_caption(found: Sequence[Confusion]) -> str:
    """Which effect is named best and which worst."""
    known = [c for c in found if not c.well and math.isfinite(c.named.value)]
    if not known:
        return "Rows: the truth; columns: what was said."
    best, worst = max(known, key=lambda c: c.named.value), min(known, key=lambda c: c.named.value)
    if best is worst:
        return f"Of what was said of {effect_text(best.effect)}, {percent_text(best.named)} is its name."
    return (
        f"Where something was said, {effect_text(best.effect)} is named rightly most often, "
        f"{percent_text(best.named)}, and {effect_text(worst.effect)} least, {percent_text(worst.named)}."
    )


def miss_texts(found: Iterable[Misses]) -> list[str]:
    """How many misses nobody could have avoided, and how far the others came."""
    return [
        f"{_capital(effect_text(m.effect))}: of {m.flights} missed flights, in "
        f"{percent_text(m.beyond_reach)} less information had arrived than the threshold asks for, so that a "
        f"miss is to be expected; in {percent_text(m.held_back)} the evidence passed the threshold, and no alert "
        "followed; in the others the information was there, and the evidence stayed below the threshold."
        for m in found
    ]


def scatter_caption(found: Sequence[Scatter]) -> str:
    """Strata whose stated errors are too small or too large beyond doubt."""
    small = [s for s in found if s.ratio.low > 1.0]
    large = [s for s in found if s.ratio.high < 1.0]
    parts = [
        f"beyond doubt {words} in {_first(list(dict.fromkeys(_stratum(s) for s in some)))}"
        for words, some in (("too small", small), ("too large", large))
        if some
    ]
    verdict = f"Stated errors are {'; '.join(parts)}." if parts else "No stratum departs from 1 beyond doubt."
    return f"Right of 1 the stated errors are too small, left of it too large. {verdict}"


def honesty(found: Sequence[Scatter]) -> str:
    """How many blocks lie farther from their expectation than their stated errors allow, by structure."""
    parts = [
        f"{interval_text(s.improbable, factor=100.0)} % of {s.blocks} blocks of the {s.structure.replace('_', ' ')}"
        for s in found
        if not s.by
    ]
    if not parts:
        return ""
    return f"Farther off than {100.0 * IMPROBABLE:g} % should be by their stated errors: {listed(parts)}."


def _stratum(s: Scatter) -> str:
    where = group_text(s.by, s.group)
    return f"{s.structure.replace('_', ' ')} ({where})" if s.by else s.structure.replace("_", " ")


def exceedance_caption(found: Sequence[Exceedance]) -> str:
    """Strata in which large Bayes factors come too often."""
    often = [group_text(e.by, e.group) for e in found if e.too_often]
    if often:
        return f"Above the dashed line large Bayes factors come too often: beyond doubt in {_first(often)}."
    return "Nowhere do large Bayes factors come more often than 1/c beyond doubt."


def _first(words: Sequence[str]) -> str:
    """The first few, and how many more."""
    more = len(words) - _MOST_NAMED
    return listed([*words[:_MOST_NAMED], f"{more} more"] if more > 0 else words)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
