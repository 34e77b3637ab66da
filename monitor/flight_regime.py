"""Which samples derivatives can describe: those of an aircraft that flies, with the air along its wing.

On the ground and beyond the stall estimation waits. What follows a stall within ``MAX_GAP_S`` waits as well: the flow
comes back meanwhile, and so long a gap ends the estimators' running block, which must not reach across a stall.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.telemetry import CHANNEL_INDEX, MAX_GAP_S, SampleBlock

__all__ = ["FlightRegime", "RegimeState"]

LEAST_AIRSPEED_M_S = 1.0
"""Slower is not flying: at rest an airspeed sensor reads noise about zero, of either sign."""

MOST_INCIDENCE_RAD = math.radians(45.0)
"""Beyond this angle of attack or sideslip no wing and no fin has attached flow, whatever the aircraft."""

_TIME, _AIRSPEED, _ALPHA, _BETA = (
    CHANNEL_INDEX[name] for name in ("time_s", "airspeed_true_m_s", "angle_of_attack_rad", "sideslip_rad")
)


@dataclass(slots=True)
class RegimeState:
    """What is remembered of one vehicle.

    Attributes:
        too_slow, stalled: samples left out so far, on the ground and in stalls.
        waits: why estimation waits as of the last sample; empty where it does not.
        stalled_s: stamp of the last sample beyond the stall.
    """

    too_slow: int = 0
    stalled: int = 0
    waits: str = ""
    stalled_s: float = -math.inf


class FlightRegime:
    """Passes the samples on that can be estimated from, and counts the others.

    Args:
        aircraft: its file; the stall angle of its coefficients counts for either sign, ``MOST_INCIDENCE_RAD`` where it
            states none.
    """

    def __init__(self, aircraft: Aircraft) -> None:
        stall = aircraft.coefficients.stall if aircraft.coefficients else None
        self.stall_rad = min(stall.angle_rad, MOST_INCIDENCE_RAD) if stall else MOST_INCIDENCE_RAD

    def select(self, state: RegimeState, block: SampleBlock) -> SampleBlock:
        """The samples of attached flight; a vane that is not there or reads nothing shows no stall.

        Args:
            state: advanced in place.
            block: clean samples in the order of time.
        """
        if not len(block):
            return block
        if _is_attached(np.ascontiguousarray(block.values), self.stall_rad, state.stalled_s):
            state.waits = ""
            return block
        flying = block.column("airspeed_true_m_s") >= LEAST_AIRSPEED_M_S
        detached = self._detached(state, block) & flying
        state.too_slow += int(np.count_nonzero(~flying))
        state.stalled += int(np.count_nonzero(detached))
        state.waits = ""
        if not flying[-1]:
            state.waits = f"the airspeed is below {LEAST_AIRSPEED_M_S:g} m/s: estimation waits"
        elif detached[-1]:
            state.waits = (
                f"the angle of attack is beyond {math.degrees(self.stall_rad):.3g} degrees, or the sideslip beyond "
                f"{math.degrees(MOST_INCIDENCE_RAD):.3g}: the flow is separated and estimation waits"
            )
        used = flying & ~detached
        return block if used.all() else SampleBlock(block.values[used])

    def _detached(self, state: RegimeState, block: SampleBlock) -> NDArray[np.bool_]:
        """Samples beyond the stall, and those that follow one within ``MAX_GAP_S``."""
        time_s = block.column("time_s")
        beyond = (np.abs(block.column("angle_of_attack_rad")) > self.stall_rad) | (
            np.abs(block.column("sideslip_rad")) > MOST_INCIDENCE_RAD
        )
        last = np.maximum.accumulate(np.where(beyond, np.arange(time_s.size), -1))
        since_s = time_s - np.where(last >= 0, time_s[last], state.stalled_s)
        # stamps before that of the stall are those of another clock
        state.stalled_s = float(time_s[-1] - since_s[-1]) if since_s[-1] >= 0.0 else -math.inf
        return np.asarray((since_s >= 0.0) & (since_s <= MAX_GAP_S))


@njit(cache=True)
def _is_attached(values, stall_rad, stalled_s):  # type: ignore[no-untyped-def]
    """Whether all rows (samples, channels) are of attached flight, the last stall longer ago than ``MAX_GAP_S``."""
    for row in values:
        if not (row[_AIRSPEED] >= LEAST_AIRSPEED_M_S and row[_TIME] - stalled_s > MAX_GAP_S):
            return False
        if abs(row[_ALPHA]) > stall_rad or abs(row[_BETA]) > MOST_INCIDENCE_RAD:
            return False
    return True
