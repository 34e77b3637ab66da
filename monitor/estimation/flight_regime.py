"""Which samples can be watched: those of an aircraft that flies, with the air along its wing.

On the ground and beyond the stall estimation waits, nothing is learned and no alert is raised. What follows a stall
within ``MAX_GAP_S`` waits as well: the flow comes back meanwhile, and so long a gap ends the estimators' running block,
which must not reach across a stall.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.kernels.decorators import compiled
from wingwatch.telemetry import CHANNEL_INDEX, MAX_GAP_S, SampleBlock

__all__ = ["FlightRegime", "RegimeState", "least_stall_speed_m_s"]

LEAST_AIRSPEED_M_S = 1.0
"""Slower is not flying: at rest an airspeed sensor reads noise about zero, of either sign."""

LANDED, LIFTED_OFF = 0.5, 0.8
"""Of the stall speed. Slower than the first the wing carries at most a quarter of the weight: such an aircraft stands,
taxies or rolls. It flies again from the second on, at which an aircraft that has left the ground is always: lift-off is
above the stall speed, and a file whose largest lift is a third too small states a stall speed a seventh too high."""

BRAKES_M_S2 = 9.81
"""No wheel slows an aircraft down faster; an airspeed that falls faster from flight to the ground is wrong."""

MOST_ATTACHED_RAD = math.radians(20.0)
"""Of a file that states no stall angle: beyond it no plain wing's lift still rises, so its stall speed is no lower."""

MOST_INCIDENCE_RAD = math.radians(45.0)
"""Beyond this angle of attack or sideslip no wing and no fin has attached flow, whatever the aircraft."""

_NO_AIRSPEED = (
    f"the airspeed is below {LEAST_AIRSPEED_M_S:g} m/s in flight: it is wrong, and estimation waits for it"
)
_SEA_LEVEL_KG_M3, _GRAVITY_M_S2 = 1.225, 9.81
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
        landed: whether the last sample was of the ground; so it is before the first one.
        flew_s: stamp of the last sample at ``LIFTED_OFF`` of the stall speed or more.
        fell: whether the airspeed has fallen since faster than any brake, so that it says nothing of the ground.
    """

    too_slow: int = 0
    stalled: int = 0
    waits: str = ""
    stalled_s: float = -math.inf
    landed: bool = True
    flew_s: float = -math.inf
    fell: bool = False


def least_stall_speed_m_s(aircraft: Aircraft) -> float | None:
    """The lowest true airspeed at which the wing carries the weight: at sea level, by the straight lift line.

    None where the file states no coefficients, mass or wing area.
    """
    coefficients, mass_kg = aircraft.coefficients, aircraft.mass.mass_kg if aircraft.mass else None
    area_m2 = aircraft.geometry.wing_area_m2 if aircraft.geometry else None
    if coefficients is None or mass_kg is None or area_m2 is None:
        return None
    stall = coefficients.stall
    angle = min(stall.angle_rad, MOST_ATTACHED_RAD) if stall else MOST_ATTACHED_RAD
    lift = coefficients.CL.zero + coefficients.CL.alpha * angle
    if lift <= 0.0:
        return None
    return math.sqrt(2.0 * mass_kg * _GRAVITY_M_S2 / (_SEA_LEVEL_KG_M3 * area_m2 * lift))


class FlightRegime:
    """Passes the samples on that can be estimated from, and counts the others.

    Args:
        aircraft: its file; the stall angle of its coefficients counts for either sign, ``MOST_INCIDENCE_RAD`` where it
            states none.

    Attributes:
        stall_m_s: the lowest airspeed at which it flies; None where the file does not tell.
    """

    def __init__(self, aircraft: Aircraft) -> None:
        stall = aircraft.coefficients.stall if aircraft.coefficients else None
        self.stall_rad = min(stall.angle_rad, MOST_INCIDENCE_RAD) if stall else MOST_INCIDENCE_RAD
        self.stall_m_s = least_stall_speed_m_s(aircraft)
        self._landed_m_s = max(LEAST_AIRSPEED_M_S, LANDED * (self.stall_m_s or 0.0))
        self._lifted_off_m_s = max(LEAST_AIRSPEED_M_S, LIFTED_OFF * (self.stall_m_s or 0.0))

    def select(self, state: RegimeState, block: SampleBlock) -> SampleBlock:
        """The samples of attached flight; a vane that is not there or reads nothing shows no stall.

        Args:
            state: advanced in place.
            block: clean samples in the order of time.
        """
        if not len(block):
            return block
        least_m_s = self._lifted_off_m_s if state.landed or state.fell else self._landed_m_s
        if _is_attached(np.ascontiguousarray(block.values), self.stall_rad, state.stalled_s, least_m_s):
            state.waits, state.landed, state.fell = "", False, False
            fast = np.flatnonzero(block.values[:, _AIRSPEED] >= self._lifted_off_m_s)
            state.flew_s = float(block.values[fast[-1], _TIME]) if fast.size else state.flew_s
            return block
        flying = self._flying(state, block)
        detached = self._detached(state, block) & flying
        state.too_slow += int(np.count_nonzero(~flying))
        state.stalled += int(np.count_nonzero(detached))
        state.waits = ""
        if not flying[-1]:
            state.waits = self._ground_text if state.landed else _NO_AIRSPEED
        elif detached[-1]:
            state.waits = (
                f"the angle of attack is beyond {math.degrees(self.stall_rad):.3g} degrees, or the sideslip beyond "
                f"{math.degrees(MOST_INCIDENCE_RAD):.3g}: the flow is separated and estimation waits"
            )
        used = flying & ~detached
        return block if used.all() else SampleBlock(block.values[used])

    @property
    def _ground_text(self) -> str:
        if self.stall_m_s is None:
            return f"the airspeed is below {LEAST_AIRSPEED_M_S:g} m/s: estimation waits"
        return (
            f"on the ground: the airspeed has been below {self._landed_m_s:.3g} m/s and not above "
            f"{self._lifted_off_m_s:.3g} since (the stall speed is {self.stall_m_s:.3g}); estimation and alerts wait"
        )

    def _flying(self, state: RegimeState, block: SampleBlock) -> NDArray[np.bool_]:
        """Which samples are of flight, by the airspeed, with a hysteresis.

        An airspeed that is too low is wrong where it has fallen faster than any brake, or beside a velocity over the
        ground that no aircraft rolls at. Who flies with it is watched: it contradicts other channels.
        """
        airspeed = block.column("airspeed_true_m_s")
        over_ground = np.hypot(block.column("velocity_north_m_s"), block.column("velocity_east_m_s"))
        contradicted = over_ground >= (self.stall_m_s or math.inf)
        brakes_s = (self._lifted_off_m_s - self._landed_m_s) / BRAKES_M_S2
        limits = self._landed_m_s, self._lifted_off_m_s, brakes_s
        before = state.landed, state.flew_s, state.fell
        landed, *after = _landed(block.column("time_s"), airspeed, contradicted, limits, before)
        state.landed, state.flew_s, state.fell = bool(landed[-1]), float(after[0]), bool(after[1])
        return np.asarray(~landed & (airspeed >= LEAST_AIRSPEED_M_S))

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


@compiled()
def _landed(time_s, airspeed, contradicted, limits, before):  # type: ignore[no-untyped-def]
    """Which samples are of the ground (n,), and ``flew_s`` and ``fell`` after them.

    Args:
        limits: airspeeds that reach the ground and leave it, and the least time from the one to the other.
        before: ``landed``, ``flew_s`` and ``fell``.
    """
    landed_m_s, lifted_off_m_s, brakes_s = limits
    landed, flew_s, fell = before
    found = np.empty(len(airspeed), dtype=np.bool_)
    for i in range(len(airspeed)):
        if airspeed[i] >= lifted_off_m_s:
            landed, flew_s, fell = False, time_s[i], False
        elif contradicted[i]:
            landed = False
        elif not airspeed[i] >= landed_m_s and not landed and not fell:
            fell = 0.0 <= time_s[i] - flew_s < brakes_s
            landed = not fell
        found[i] = landed
    return found, flew_s, fell


@compiled()
def _is_attached(values, stall_rad, stalled_s, least_m_s):  # type: ignore[no-untyped-def]
    """Whether all rows (samples, channels) are of attached flight at that airspeed or more, the last stall longer ago
    than ``MAX_GAP_S``."""
    for row in values:
        if not (row[_AIRSPEED] >= least_m_s and row[_TIME] - stalled_s > MAX_GAP_S):
            return False
        if abs(row[_ALPHA]) > stall_rad or abs(row[_BETA]) > MOST_INCIDENCE_RAD:
            return False
    return True
