"""Less thrust than the throttle gives in the simulation."""

from wingwatch.diagnosis.candidate import Candidate, FreeParameter, Subject, scale

__all__ = ["candidates"]

_LOST = FreeParameter("fraction_lost", "", 0.02, 0.3, 0.03, -2.0, 1.0)


def candidates(subject: Subject) -> list[Candidate]:
    """Where thrust is simulated."""
    if not subject.throttle_known:
        return []
    return [
        Candidate(
            "thrust_loss", "", (_LOST,), lambda model, v: scale(model, {"thrust_share": -1.0}, v[0]),
            "thrust is {0:.0%} [less|more] than the throttle gives in the simulation", odds=2.0,
        )
    ]  # fmt: skip
