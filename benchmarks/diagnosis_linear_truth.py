"""Whether a hidden effect of JSBSim's aircraft is what the file with that cause says: derivatives of both.

    .venv/bin/python benchmarks/diagnosis_linear_truth.py SEED [...]

For cases of the diagnosis benchmark (``--source jsbsim``) with a file of derivatives and a hidden mass or centre of
gravity: the file's derivatives with the cause at its hidden size, those of JSBSim linearised with the effect at its own
trim, and those without it. Where the first two differ, an exact method would not find the hidden size.
"""

import math
import sys

import numpy as np
from diagnosis_cases import draw
from diagnosis_from_jsbsim import NAMES, subject_with
from saving import run_benchmark

from wingwatch.aircraft import FlightCondition
from wingwatch.diagnosis.causes import candidates
from wingwatch.diagnosis.linear_aircraft import concise
from wingwatch.diagnosis.subject import subject_of

_EFFECTS = ("mass_inertia", "cg_shift")
_WINDOW_S = 8.0


def compared(seed: int) -> list[str]:
    """Lines of one case.

    Raises:
        ValueError: a case of another kind.
    """
    case = draw("jsbsim", seed)
    hidden = case.effects[0]
    if hidden.name not in _EFFECTS or case.aircraft.coefficients is not None:
        raise ValueError(
            f"seed {seed} hides {hidden.label}, or its file states coefficients; give another seed"
        )
    name, here = next(n for n in NAMES if n.lower() == case.aircraft.name), case.aircraft.conditions[0]
    condition = FlightCondition(here.airspeed_true_m_s, here.altitude_m)
    (before, alpha), (after, new_alpha) = (
        subject_with(name, condition, effects).truth_at(here.airspeed_true_m_s) for effects in ((), (hidden,))
    )
    subject = subject_of(case.flight, case.aircraft, case.kinds, _WINDOW_S)
    model = subject.model.copy()
    next(c for c in candidates(subject) if c.label == hidden.label).change(model, np.array([hidden.size]))
    symbols = tuple(symbol for symbol in here.derivatives if abs(after[symbol]) > 1e-9)
    density = float(np.nanmean(subject.flight.density_kg_m3))
    at = FlightCondition(here.airspeed_true_m_s, here.altitude_m, density, angle_of_attack_rad=new_alpha)
    said = concise(model.row, at, symbols)
    lines = [
        f"{seed} {name} {hidden.label} {hidden.size:g}, angle of attack {math.degrees(alpha):.2f} deg, with the effect "
        f"{math.degrees(new_alpha):.2f} deg"
    ]
    lines += [
        f"  {symbol:8}{before[symbol]:12.5g}{after[symbol]:12.5g}, by the file with the cause {value:12.5g} "
        f"({100.0 * (value / after[symbol] - 1.0):+.1f} %)"
        for symbol, value in zip(symbols, said, strict=True)
    ]
    return lines


def main() -> None:
    for argument in sys.argv[1:]:
        print("\n".join(compared(int(argument))))


if __name__ == "__main__":
    run_benchmark(main)
