"""An airspeed that reads in proportion wrong."""

from wingwatch.diagnosis.candidate import Candidate, Subject
from wingwatch.diagnosis.causes.sensor_scale import too_large

__all__ = ["candidates"]


def candidates(subject: Subject) -> list[Candidate]:
    """Always tried."""
    return [too_large("airspeed_error", "", "airspeed_true_m_s", "airspeed reads {0:.1%} too [much|little]")]
