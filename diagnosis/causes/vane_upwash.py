"""A vane that turns further than the flow far ahead does."""

from wingwatch.diagnosis.candidate import Candidate, Subject
from wingwatch.diagnosis.causes.sensor_scale import too_large
from wingwatch.diagnosis.summary import display

__all__ = ["candidates"]


def candidates(subject: Subject) -> list[Candidate]:
    """Each vane that is measured."""
    return [
        too_large(
            "vane_upwash",
            name.removesuffix("_rad"),
            name,
            f"the vane of {display(name).name} turns {{0:.1%}} too [far|little]",
        )
        for name in ("angle_of_attack_rad", "sideslip_rad")
        if subject.measures(name)
    ]
