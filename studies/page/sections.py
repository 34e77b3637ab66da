"""The sections of a study's report: what each says in words and tables, and where its pictures stand."""

import math
from collections.abc import Iterable, Sequence
from html import escape
from typing import TypeVar

from wingwatch.pages.document import Pictures
from wingwatch.pages.markup import items, paragraph, section, table
from wingwatch.pages.texts import number
from wingwatch.studies.calibration import IMPROBABLE
from wingwatch.studies.detection import Delays, Detection
from wingwatch.studies.operator_answer import Answer
from wingwatch.studies.page import captions
from wingwatch.studies.page.faults import fault_section
from wingwatch.studies.page.figures import (
    answer_figure,
    confusion_figure,
    delay_figure,
    detection_figure,
    exceedance_figure,
    operating_figure,
    rate_figure,
    scatter_figure,
    size_figure,
    threshold_figure,
)
from wingwatch.studies.page.texts import (
    effect_text,
    group_text,
    interval_text,
    per_100_h_text,
    percent_text,
    reason_text,
    size_flown_text,
    size_text,
)
from wingwatch.studies.summary import Summary
from wingwatch.studies.worst_flights import WorstFlight

__all__ = ["sections"]

_PICTURED = ("turbulence", "excitation", "aircraft", "target")
_MOST_ALARMS = 300
_Grouped = TypeVar("_Grouped", Detection, Delays)
_KINDS = {
    "missed": "Missed although the most information had arrived",
    "late": "Said latest, beside the bound",
    "misnamed": "Named wrongly with the highest probability",
    "missized": "Size furthest from the truth in stated standard errors",
}


def sections(summary: Summary, pictures: Pictures) -> str:
    """All sections below the answer, in their order."""
    return "".join(
        [
            fault_section(summary, pictures),
            _answers(summary, pictures),
            _detection(summary, pictures),
            _delays(summary, pictures),
            _false_alarms(summary, pictures),
            _operating(summary, pictures),
            _sizes(summary, pictures),
            _confusion(summary, pictures),
            _worst(summary),
            _calibration(summary, pictures),
            _failed(summary),
        ]
    )


def _answers(s: Summary, pictures: Pictures) -> str:
    parts = [
        _title("Threshold for one false alarm in 100 h"),
        table(
            ("air", "healthy hours", "false alarms of the airframe per 100 h at the monitor's own threshold",
             "own threshold", "vouched for", "estimate"),
            [
                (group_text("turbulence" if t.group else "", t.group), number(t.hours), per_100_h_text(t.own_per_hour),
                 *(number(x) for x in (t.own, t.vouched, t.estimate)))
                for t in s.thresholds
            ],
        ),
        paragraph(captions.threshold_text(s), "legend"),
    ]  # fmt: skip
    for effect in _effects(s):
        rows = [a for a in s.answers if a.effect == effect]
        single = [a for a in rows if sum(map(bool, (a.aircraft, a.turbulence, a.excitation))) <= 1]
        picture = answer_figure(
            f"answer-{escape(effect)}", single, [captions.condition_text(a) for a in single]
        )
        parts += [
            _title(captions.answer_title(effect)),
            pictures.place(picture, captions.answer_caption(single)),
        ]
        parts += [paragraph(captions.excitation_text(rows)), _answer_table(single)]
        parts.append(_folded(_by_excitation(rows), "Each aircraft in each air by excitation"))
    if s.answers:
        parts.append(paragraph(captions.ANSWER_LEGEND, "legend"))
    return section("answer", "What an operator can count on", *parts) if s.thresholds or s.answers else ""


def _answer_table(rows: Sequence[Answer]) -> str:
    with_threshold = any(not math.isnan(a.threshold) for a in rows)
    head = ["flights", "how many", "size at the monitor's own threshold"]
    head += ["threshold for one in 100 h", "size there"] if with_threshold else []
    head += ["of the largest tenth, seen in time"]
    body = []
    for a in rows:
        cells = [captions.condition_text(a), str(a.flights), size_text(a)]
        cells += [number(a.threshold), size_text(a, there=True)] if with_threshold else []
        body.append([*cells, f"{100.0 * a.seen:.0f} %"])
    return table(head, body)


def _by_excitation(rows: Sequence[Answer]) -> str:
    """Each aircraft in each air by excitation, at the monitor's own threshold."""
    cells = {(a.aircraft, a.turbulence, a.excitation): a for a in rows if a.turbulence and a.excitation}
    excitations = list(dict.fromkeys(key[2] for key in cells))
    places = list(dict.fromkeys((key[0], key[1]) for key in cells))
    if len(excitations) < 2:
        return ""
    body = []
    for aircraft, air in sorted(places, key=lambda p: (p[0], 0)):
        name = f"{aircraft or 'all aircraft'}, {group_text('turbulence', air)}"
        found = [cells.get((aircraft, air, e)) for e in excitations]
        body.append([name, *("" if a is None else f"{size_text(a)}, {a.flights} flights" for a in found)])
    return table(["aircraft and air", *(group_text("excitation", e) for e in excitations)], body)


def _detection(s: Summary, pictures: Pictures) -> str:
    if not s.detection:
        return ""
    parts = []
    for effect in _effects(s):
        mine = [d for d in s.detection if d.effect == effect]
        drawn = [
            pictures.place(
                detection_figure(f"detection-{escape(effect)}-{by or 'all'}", group),
                captions.detection_caption(group),
            )
            for by, group in _pictured(mine)
        ]
        parts += [_title(effect_text(effect)), _grid(drawn), _folded(_detection_table(mine))]
    return section(
        "detection", "Probability of detection", *parts, paragraph(captions.DETECTION_LEGEND, "legend")
    )


def _detection_table(found: Sequence[Detection]) -> str:
    head = (
        "flights",
        "how many",
        "detected",
        "within 30 s",
        "size at 50 %",
        "size at 95 %",
        "information, median",
    )
    rows = []
    for d in found:
        largest = max((c.largest for c in d.classes), default=math.nan)
        at = [size_flown_text(x, largest) for x in (d.size_50, d.size_95)]
        fit = " (the curve does not fit)" if d.fit_probability < captions.BAD_FIT else ""
        words = (group_text(d.by, d.group), str(d.flights), percent_text(d.detected), percent_text(d.within))
        rows.append((*words, at[0], at[1] + fit, number(d.median_information)))
    return table(head, rows)


def _delays(s: Summary, pictures: Pictures) -> str:
    if not s.delays:
        return ""
    parts = []
    for effect in _effects(s):
        mine = [d for d in s.delays if d.effect == effect]
        drawn = [
            pictures.place(
                delay_figure(f"delay-{escape(effect)}-{by or 'all'}", group), captions.delay_caption(group)
            )
            for by, group in _pictured(mine)
        ]
        parts += [_title(effect_text(effect)), _grid(drawn), _folded(_delay_table(mine))]
    return section("delays", "Delay", *parts, paragraph(captions.delay_legend(s), "legend"))


def _delay_table(found: Sequence[Delays]) -> str:
    head = ("flights", "how many", "a quarter noticed, s", "half, s", "95 %, s", "bound: half, s", "bound: 95 %, s",
            "delay over bound, median")  # fmt: skip
    rows = [
        (group_text(d.by, d.group), str(d.flights), *(_seconds(d, f) for f in ("0.25", "0.5", "0.95")),
         *(_bound(d.bound_s[f]) for f in ("0.5", "0.95")), interval_text(d.over_bound))
        for d in found
    ]  # fmt: skip
    return table(head, rows)


def _seconds(d: Delays, fraction: str) -> str:
    found = d.seconds[fraction]
    return "not by the end" if math.isinf(found.value) else interval_text(found)


def _bound(value: float) -> str:
    return "no information" if math.isinf(value) else number(value, 2)


def _false_alarms(s: Summary, pictures: Pictures) -> str:
    rows = [
        (
            group_text(r.by, r.group),
            str(r.flights),
            number(r.hours),
            str(r.alarms),
            per_100_h_text(r.per_hour),
            number(100.0 * r.at_most_per_hour, 2),
        )
        for r in s.false_alarm_rates
    ]
    listing = "".join(
        _details(
            f"seed {a.seed}, {a.time_s:.0f} s: {effect_text(a.cause)}{f' of {a.channel}' if a.channel else ''}; "
            f"{a.aircraft}, "
            f"{group_text('turbulence', a.turbulence)}, {group_text('excitation', a.excitation)}, "
            f"{group_text('route', a.route)}"
            + (f", {group_text('sensor fault', a.sensor_fault)}" if a.sensor_fault else "")
            + f"; evidence {number(a.evidence)}"
            + (f"; {why}" if (why := reason_text(a.reason)) else ""),
            a.command,
        )
        for a in s.false_alarms[:_MOST_ALARMS]
    )
    more = len(s.false_alarms) - _MOST_ALARMS
    return section(
        "false-alarms",
        "False alarms",
        pictures.place(rate_figure("rates", s.false_alarm_rates), captions.rate_caption(s.false_alarm_rates)),
        table(("flights", "how many", "healthy hours", "false alarms", "per 100 h", "at most (95 %)"), rows),
        paragraph(captions.RATE_LEGEND, "legend"),
        _title("Every false alarm") + listing if listing else "",
        paragraph(f"and {more} more, which the JSON lists", "legend") if more > 0 else "",
    )


def _operating(s: Summary, pictures: Pictures) -> str:
    if not s.operating_curves:
        return ""
    everything = s.operating_curves[0]
    rows = [
        (group_text(c.by, c.group), number(c.hours), str(c.faulty_flights), number(c.own_threshold),
         percent_text(c.own_detected), per_100_h_text(c.own_per_hour))
        for c in s.operating_curves
    ]  # fmt: skip
    return section(
        "operating",
        "Operating curve",
        pictures.place(threshold_figure("threshold", everything), captions.threshold_caption(everything)),
        pictures.place(operating_figure("operating-curve", s.operating_curves), captions.OPERATING_CAPTION),
        table(
            (
                "flights",
                "healthy hours",
                "faulty flights",
                "own threshold",
                "detected",
                "false alarms per 100 h",
            ),
            rows,
        ),
    )


def _sizes(s: Summary, pictures: Pictures) -> str:
    if not s.sizes:
        return ""
    drawn = [
        pictures.place(size_figure(f"size-{escape(z.effect)}", z), captions.size_caption(z))
        for z in s.sizes
        if not z.by
    ]
    rows = [
        (effect_text(z.effect), group_text(z.by, z.group), str(z.flights), percent_text(z.covered),
         number(z.median_error, 2), number(z.rms_error, 2), number(z.scatter, 2))
        for z in s.sizes
    ]  # fmt: skip
    head = ("effect", "flights", "how many", "truth in the stated 95 % interval", "median error", "rms error",
            "rms error over stated")  # fmt: skip
    return section("sizes", "Estimated against true size", _grid(drawn), _folded(table(head, rows)))


def _confusion(s: Summary, pictures: Pictures) -> str:
    if not s.confusion:
        return ""
    said = list(dict.fromkeys(cause for row in s.confusion for cause in row.said))
    said = [c for c in said if c not in ("unknown", "nothing")] + ["unknown", "nothing"]
    rows = [
        ("healthy" if c.effect == "nothing" else effect_text(c.effect), str(c.flights),
         *(str(c.said.get(cause, 0)) for cause in said), percent_text(c.named))
        for c in s.confusion
    ]  # fmt: skip
    return section(
        "naming",
        "What was said of which effect",
        pictures.place(confusion_figure("confusion", s.confusion), captions.confusion_caption(s.confusion)),
        table(("true", "flights", *map(effect_text, said), "right"), rows),
        paragraph(
            "What was said: by the first alert after the onset that names a cause, as it stood last. Right: of the "
            "flights of which something was said, those whose cause and part it names; of healthy ones, those of "
            "which nothing was said.",
            "legend",
        ),
    )


def _worst(s: Summary) -> str:
    if not s.worst and not s.misses:
        return ""
    parts = [items(captions.miss_texts(s.misses))]
    for kind, title in _KINDS.items():
        found = [w for w in s.worst if w.kind == kind]
        if found:
            parts += [_title(title), *(_flight(w) for w in found)]
    return section("worst", "Where it failed, and why", *parts)


def _flight(w: WorstFlight) -> str:
    return _details(f"seed {w.seed}: {w.effect}; {w.condition}: {w.why}", w.command)


def _calibration(s: Summary, pictures: Pictures) -> str:
    parts = []
    if s.block_scatter:
        parts += [
            pictures.place(scatter_figure("scatter", s.block_scatter), captions.scatter_caption(s.block_scatter)),
            _folded(table(
                ("structure", "flights", "how many", "blocks", "chi-square per degree of freedom",
                 f"blocks of a probability below {100.0 * IMPROBABLE:g} %, in %"),
                [
                    (x.structure.replace("_", " "), group_text(x.by, x.group), str(x.flights), str(x.blocks),
                     interval_text(x.ratio), interval_text(x.improbable, factor=100.0))
                    for x in s.block_scatter
                ],
            )),
        ]  # fmt: skip
    if s.bayes_factors:
        by_air = [e for e in s.bayes_factors if e.by in ("", "turbulence")]
        factors = s.bayes_factors[0].factor
        parts += [
            pictures.place(exceedance_figure("bayes", by_air), captions.exceedance_caption(s.bayes_factors)),
            _folded(table(
                ("healthy flights", "how many", *(f"> {c:g} (at most {100.0 / c:.2g} %)" for c in factors)),
                [
                    (group_text(e.by, e.group), str(e.flights),
                     *(f"{100.0 * f:.2g} % ({100.0 * lo:.2g} to {100.0 * hi:.2g})"
                       for f, lo, hi in zip(e.fraction, e.low, e.high, strict=True)))
                    for e in s.bayes_factors
                ],
            )),
        ]  # fmt: skip
    return section("calibration", "Calibration on healthy time", *parts) if parts else ""


def _failed(s: Summary) -> str:
    if not s.failed:
        return ""
    rows = "".join(_details(f"seed {f.seed}: {f.reason}", f.command) for f in s.failed)
    return section(
        "failed",
        "Flights that could not be flown",
        paragraph(f"{s.flown.failed} of {s.flown.flights}."),
        rows,
    )


def _effects(s: Summary) -> list[str]:
    """Icing first, then by the alphabet."""
    return sorted({d.effect for d in s.detection}, key=lambda effect: (effect != "icing", effect))


def _pictured(found: Sequence[_Grouped]) -> list[tuple[str, list[_Grouped]]]:
    """Groups that have a picture; all flights have one only where they do not differ in anything pictured."""
    by = {b: [d for d in found if d.by == b] for b in _PICTURED}
    drawn = [(b, groups) for b, groups in by.items() if groups]
    return drawn or [("", [d for d in found if not d.by])]


def _grid(drawn: Iterable[str]) -> str:
    return f'<div class="grid">{"".join(drawn)}</div>'


def _title(text: str) -> str:
    return f"<h3>{escape(text)}</h3>"


def _folded(content: str, title: str = "Figures of all groups") -> str:
    """A long table, which opens on a click."""
    return f"<details><summary>{escape(title)}</summary>{content}</details>" if content else ""


def _details(text: str, command: str) -> str:
    """A line that opens on a click and shows the command that reproduces the flight."""
    return f"<details><summary>{escape(text)}</summary><code>{escape(command)}</code></details>"
