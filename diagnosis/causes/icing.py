"""Ice by the published Twin Otter factors (``aircraft.ICING_FACTORS``): all coefficients with one severity."""

from collections.abc import Mapping

from wingwatch.aircraft import ICING_FACTORS
from wingwatch.diagnosis.candidate import Candidate, FreeParameter, Subject, scale
from wingwatch.diagnosis.coefficients import with_coefficients

__all__ = ["candidates"]

_PUBLISHED = {
    "CL_alpha": "CZalpha", "CL_q": "CZq", "CL_elevator": "CZde", "CD_min": "CX0",
    "Cm_alpha": "Cmalpha", "Cm_q": "Cmq", "Cm_elevator": "Cmde",
    "CY_beta": "CYbeta", "CY_rudder": "CYdr", "Cl_beta": "Clbeta", "Cl_p": "Clp", "Cl_aileron": "Clda",
    "Cl_rudder": "Cldr", "Cn_beta": "Cnbeta", "Cn_r": "Cnr", "Cn_rudder": "Cndr",
}  # fmt: skip
_SEVERITY = FreeParameter("severity", "", 0.01, 0.15, 0.01, 0.0, 0.6)


def candidates(subject: Subject) -> list[Candidate]:
    """Ice everywhere, on the wing, on the tail."""
    found = []
    for kind, published in ICING_FACTORS.items():
        factors = {ours: published[theirs] for ours, theirs in _PUBLISHED.items() if published[theirs] != 0.0}
        found.append(_iced(kind, factors))
    return found


def _iced(kind: str, factors: Mapping[str, float]) -> Candidate:
    return Candidate(
        "icing", "" if kind == "all" else kind, (_SEVERITY,), lambda model, v: scale(model, factors, v[0]),
        f"coefficients have changed together as ice ({kind}) of severity {{0:.3f}} changes them",
        lambda aircraft, v: with_coefficients(aircraft, factors, v[0]), 2.0 if kind == "all" else 1.0,
    )  # fmt: skip
