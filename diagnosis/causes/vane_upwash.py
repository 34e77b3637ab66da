"""A vane that turns further than the flow far ahead does."""

from wingwatch.diagnosis.candidate import Candidate, Subject
from wingwatch.diagnosis.causes.sensor_scale import too_large

__all__ = ["candidates"]


def candidates(subject: Subject) -> list[Candidate]:
    """Each vane that is measured."""
    return [
        too_large(
            "vane_upwash", name.removesuffix("_rad"), name, f"the vane of {name} turns {{0:+.1%}} too far"
        )
        for name in ("angle_of_attack_rad", "sideslip_rad")
        if subject.measures(name)
    ]
