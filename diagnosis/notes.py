"""What a diagnosis says beside its figures: what is left, what could not be answered, and doubts about the file."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.diagnosis.candidate import Candidate, Subject
from wingwatch.diagnosis.evidence import MATTERS
from wingwatch.diagnosis.linear_aircraft import entry_near
from wingwatch.diagnosis.measured import OUTPUTS
from wingwatch.diagnosis.result import Gain, Misfit, MissingTerm
from wingwatch.diagnosis.search import Search
from wingwatch.diagnosis.steady_angle import steady_angle_rad, unstated
from wingwatch.diagnosis.subject import states_at_rest
from wingwatch.diagnosis.summary import display
from wingwatch.pages.texts import listed, percent

__all__ = ["another_aircraft", "note_on_silence", "notes_of", "rest_in_words"]

Array = NDArray[np.float64]


def rest_in_words(found: Search, terms: Sequence[MissingTerm], unexplained: float) -> str:
    """What would follow what is left best."""
    if terms:
        each = [
            f"{t.coefficient} changes by {t.value:.3g} +- {t.standard_error:.1g} times {t.signal}"
            for t in terms
        ]
        return f"the rest follows a term that the simulation lacks: {', or '.join(each)}"
    if unexplained == 0.0 or not found.rest:
        return ""
    best = found.rest[0]
    if best.evidence <= 0.0:
        return "none of the causes that were tried explains the rest"
    return f"{best.candidate.label} explains the rest best, but not beyond doubt"


def _last(found: Search) -> tuple[tuple[Candidate, ...], tuple[Array, ...]]:
    """Causes of the last model and their values."""
    return found.last.point.causes, found.last.point.values


def _rest_note(subject: Subject) -> str:
    """Which axis is left out, and by which channels."""
    still = [OUTPUTS[k] for k in (1, 2, 3, 7, 8) if k not in subject.flight.compared]
    axis, other = ("longitudinal", "lateral") if "pitch_rate_rad_s" in still else ("lateral", "longitudinal")
    return f"{listed(still)} never change: the {axis} motion rests, and only the {other} one is diagnosed"


def _steady_note(subject: Subject) -> list[str]:
    """Where the condition's angle of attack is from, if the file leaves it out."""
    entry = entry_near(subject.stated, subject.flight.airspeed_m_s)
    if entry is None or not unstated(entry):
        return []
    angle, source = steady_angle_rad(subject.flight)
    return [
        f"the aircraft file states no angle_of_attack_rad at {entry.airspeed_true_m_s:g} m/s: its derivatives are "
        f"taken to hold at {np.degrees(angle):.1f} degrees, the {source} of this flight"
    ]


def notes_of(subject: Subject, found: Search, gain: Gain | None, model: Aircraft | None) -> tuple[str, ...]:
    """What could not be answered."""
    notes = [_rest_note(subject)] if states_at_rest(subject.flight) else []
    if subject.stated.coefficients is None:
        notes.append(
            "the aircraft file states derivatives only: steady forces and moments are each window's own, and the "
            "forward accelerometer is taken as read; causes that show in them alone, such as a loss of thrust, cannot "
            "be found"
        )
        notes += _steady_note(subject)
    elif not subject.throttle_known:
        notes.append(
            "throttle or propulsion is not known: steady forces and moments are each window's own, and causes that "
            "show in them alone cannot be found"
        )
    absent = [OUTPUTS[k] for k in (9, 10) if k not in subject.flight.compared]
    if absent:
        notes.append(
            f"no {' and no '.join(absent)}: gusts are distinguished from motion by the accelerometers alone"
        )
    gusts = found.last.point.noise.gusts[1:3]
    if float(gusts.max()) > 0.3:
        notes.append(
            f"the air was rough: {gusts[0]:.1f} m/s across and {gusts[1]:.1f} m/s vertically, root mean square"
        )
    if gain is not None and model is None:
        notes.append(f"no extended aircraft file: {_why_none(gain)}")
    minor = [
        c.sentence(v)
        for c, v, one in zip(*_last(found), found.found, strict=True)
        if not one.matters and any(abs(size) > p.least for size, p in zip(v, c.parameters, strict=True))
    ]
    if minor:
        notes.append(f"known, but too small to matter: {'; '.join(minor)}")
    return tuple(notes)


def _why_none(gain: Gain) -> str:
    """Why no extended file is offered where causes were found."""
    worse = [display(name).name for name, change in gain.change.items() if change.low > MATTERS]
    if worse:
        return f"on {gain.source} {listed(worse)} would be surely worse by more than {percent(MATTERS)}"
    if not gain.pays:
        return f"on {gain.source} no channel is surely better"
    return "the file has no entry for the cause found"


def note_on_silence(symbols: Sequence[str]) -> tuple[str, ...]:
    """A note on derivatives that this flight does not judge."""
    if not symbols:
        return ()
    return (
        f"this flight does not determine {', '.join(symbols)}: an error of a third would not be beyond doubt",
    )


def another_aircraft(subject: Subject, after: Mapping[str, Misfit]) -> str:
    """Why the file may be of another aircraft: another airspeed, or rates that even the mended simulation misses."""
    why, speed = [], subject.flight.airspeed_m_s
    stated = subject.stated.envelope
    low, high = stated.airspeed_true_m_s if stated is not None else (0.0, np.inf)
    if not low <= speed <= high:
        why.append(
            f"the flight's mean airspeed of {speed:.1f} m/s is not in the {low:g} to {high:g} m/s that it states"
        )
    rates = [
        after[name].r_squared for name in OUTPUTS[1:4] if name in after and after[name].noise_fraction < 0.9
    ]
    if len(rates) >= 2 and np.median(rates) <= 0.0:
        why.append("even mended, the simulation does not follow the rates")
    return " and ".join(why)
