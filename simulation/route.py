"""A route of waypoints, and how the autopilot follows it: straight legs, turns begun ahead of the waypoint.

Legs are followed by the L1 law (Park, Deyst and How, A New Nonlinear Guidance Logic for Trajectory Tracking, AIAA
2004-4900): a point L1 ahead on the leg is aimed at with the lateral acceleration 2 V^2 sin(eta) / L1, V over the ground
and eta the angle from the velocity to that point. Near the leg this is a second-order loop of natural frequency
sqrt(2) V / L1 and damping 1 / sqrt(2), in any wind, since it works on the velocity over the ground. L1 is chosen so
that this frequency is ``TRACK_RAD_S``. Navigation is taken as perfect.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import GRAVITY_M_S2, Aircraft, FlightCondition, TrimError
from wingwatch.kernels.decorators import helper
from wingwatch.simulation.layout import ELEVATOR_LIMIT, RUDDER_LIMIT, parameter_row
from wingwatch.simulation.trim import trim

__all__ = ["ROUTE_COLUMNS", "Route", "Waypoint", "check_route", "patrol", "route_bank", "route_rows"]

TRACK_RAD_S = 0.3
"""A fifth of the bank loop's bandwidth, so that the bank follows what the track wants."""
TURN_BANK_RAD = 0.35
"""Bank for which turns are planned; the rest up to the autopilot's limit of 0.5 is for wind."""
_STEEPEST_INTERCEPT = math.sin(math.pi / 4.0)
_MOST_RADII_AHEAD = 2.0
_NEAR_M = 1e-6

ROUTE_COLUMNS = 8
"""First row: number of legs, leg after the last (-1: stay on the last). Then a row a leg: where it starts (north,
east), its direction (north, east), its length, how far before its end the next begins, altitude, airspeed."""
(_NORTH, _EAST, _ALONG_NORTH, _ALONG_EAST, _LENGTH, _BEFORE, _ALTITUDE, _AIRSPEED) = range(ROUTE_COLUMNS)


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A place to fly to, and how.

    Attributes:
        north_m: from where the flight starts.
        east_m: from where the flight starts.
        altitude_m: held on the leg that leads there, once reached.
        airspeed_true_m_s: held on the leg that leads there, once reached.

    Raises:
        ValueError: a value that is not finite, or an airspeed that is not positive.
    """

    north_m: float
    east_m: float
    altitude_m: float
    airspeed_true_m_s: float

    def __post_init__(self) -> None:
        values = (self.north_m, self.east_m, self.altitude_m, self.airspeed_true_m_s)
        if not (all(math.isfinite(v) for v in values) and self.airspeed_true_m_s > 0.0):
            raise ValueError(
                f"waypoint {values}; give north, east, altitude (m) and a positive airspeed (m/s), all finite"
            )


@dataclass(frozen=True, slots=True)
class Route:
    """Waypoints in the order in which they are flown, straight from one to the next, the first from the start.

    Attributes:
        waypoints: at least one, for a patrol two; each away from the one before.
        loops: from the last to the first and so on for ever (a patrol); else the flight goes on along the last leg, at
            its altitude and airspeed.

    Raises:
        ValueError: too few waypoints, or two at one place.
    """

    waypoints: tuple[Waypoint, ...]
    loops: bool = True

    def __post_init__(self) -> None:
        least = 2 if self.loops else 1
        if len(self.waypoints) < least:
            raise ValueError(f"a route has {len(self.waypoints)} waypoints; give at least {least}")
        for a, b in pairwise((*self.waypoints, *self.waypoints[: int(self.loops)])):
            if math.hypot(b.north_m - a.north_m, b.east_m - a.east_m) < _NEAR_M:
                raise ValueError(
                    f"a route goes from waypoint ({a.north_m:g}, {a.east_m:g}) m to the same place; leave one out"
                )
        first = self.waypoints[0]
        if not self.loops and len(self.waypoints) == 1 and math.hypot(first.north_m, first.east_m) < _NEAR_M:
            raise ValueError("a route leads from the start to the start; give a waypoint elsewhere")


def turn_radius_m(airspeed_true_m_s: float, bank_rad: float = TURN_BANK_RAD) -> float:
    """Radius of a level turn in still air, V^2 / (g tan(bank))."""
    return airspeed_true_m_s**2 / (GRAVITY_M_S2 * math.tan(bank_rad))


def route_rows(route: Route | None) -> NDArray[np.float64]:
    """A route for the kernel, shape (1 + legs, ROUTE_COLUMNS); no route is no leg.

    A leg ends R tan(turn / 2) before its waypoint, where an arc of the turn radius R touches both legs, but no more
    than two radii and half of either leg.
    """
    if route is None:
        return np.zeros((1, ROUTE_COLUMNS))
    places = [(0.0, 0.0), *((w.north_m, w.east_m) for w in route.waypoints)]
    ends = list(route.waypoints)
    if route.loops:
        places.append(places[1])
        ends.append(ends[0])
    after_last = 1.0 if route.loops else -1.0
    if math.hypot(*places[1]) < _NEAR_M:
        places, ends = places[1:], ends[1:]
        after_last = min(after_last, 0.0)
    out = np.zeros((1 + len(ends), ROUTE_COLUMNS))
    out[0, :2] = len(ends), after_last
    for row, (a, b), end in zip(out[1:], pairwise(places), ends, strict=True):
        length = math.hypot(b[0] - a[0], b[1] - a[1])
        along = ((b[0] - a[0]) / length, (b[1] - a[1]) / length)
        row[:] = *a, *along, length, 0.0, end.altitude_m, end.airspeed_true_m_s
    for i in range(len(ends)):
        following = i + 1 if i + 1 < len(ends) else int(after_last)
        if following >= 0:
            out[1 + i, _BEFORE] = _ahead_m(out[1 + i], out[1 + following])
    return out


def _ahead_m(leg: NDArray[np.float64], following: NDArray[np.float64]) -> float:
    """How far before the end of a leg the turn to the following begins."""
    cosine = float(leg[_ALONG_NORTH : _ALONG_EAST + 1] @ following[_ALONG_NORTH : _ALONG_EAST + 1])
    turn = math.acos(min(1.0, max(-1.0, cosine)))
    radius = turn_radius_m(float(max(leg[_AIRSPEED], following[_AIRSPEED])))
    half = 0.5 * float(min(leg[_LENGTH], following[_LENGTH]))
    return min(radius * math.tan(0.5 * turn), _MOST_RADII_AHEAD * radius, half)


@helper
def _towards(leg, across_m, north, east):  # type: ignore[no-untyped-def]
    """Bank in rad that the L1 law wants, at velocities over the ground and a position from the leg's start."""
    ground = math.sqrt(north * north + east * east)
    if ground == 0.0:
        return 0.0
    ahead = math.sqrt(2.0) * ground / TRACK_RAD_S
    sine = min(_STEEPEST_INTERCEPT, max(-_STEEPEST_INTERCEPT, -across_m / ahead))
    cosine = math.sqrt(1.0 - sine * sine)
    by_along = (north * leg[_ALONG_NORTH] + east * leg[_ALONG_EAST]) / ground
    by_across = (east * leg[_ALONG_NORTH] - north * leg[_ALONG_EAST]) / ground
    turn = by_along * sine - by_across * cosine
    if by_along * cosine + by_across * sine < 0.0:  # flying away from it: turn as hard as allowed
        turn = 1.0 if turn >= 0.0 else -1.0
    return math.atan(2.0 * ground * ground / ahead * turn / GRAVITY_M_S2)


@helper
def route_bank(route, leg, north_m, east_m, north, east):  # type: ignore[no-untyped-def]
    """Bank in rad towards a leg of a route, and the leg that is flown by then.

    Args:
        route: of ``route_rows``, with a leg.
        leg: number of the leg flown so far.
        north_m: position.
        east_m: position.
        north: velocity over the ground, m/s.
        east: velocity over the ground, m/s.
    """
    row = route[1 + leg]
    from_north, from_east = north_m - row[_NORTH], east_m - row[_EAST]
    along_m = from_north * row[_ALONG_NORTH] + from_east * row[_ALONG_EAST]
    if along_m >= row[_LENGTH] - row[_BEFORE]:
        following = leg + 1 if leg + 1 < int(route[0, 0]) else int(route[0, 1])
        if following >= 0:
            leg = following
            row = route[1 + leg]
            from_north, from_east = north_m - row[_NORTH], east_m - row[_EAST]
    across_m = from_east * row[_ALONG_NORTH] - from_north * row[_ALONG_EAST]
    return _towards(row, across_m, north, east), leg


def check_route(aircraft: Aircraft, route: Route) -> None:
    """Refuse a route that the aircraft cannot hold level at each of its waypoints.

    Raises:
        AircraftDataError: the file lacks what a trim needs.
        TrimError: no level flight at a waypoint's airspeed and altitude.
    """
    for waypoint in dict.fromkeys((w.airspeed_true_m_s, w.altitude_m) for w in route.waypoints):
        trim(aircraft, FlightCondition(*waypoint))


_LEG_S, _CLIMB_RAD, _HIGHEST_CLIMB_M = 40.0, 0.05, 100.0
_FASTER: tuple[float, ...] = (1.15, 1.1, 1.05, 1.0)
_SLOWER: tuple[float, ...] = (0.9, 0.95, 1.0)
_SPARE_THROTTLE, _SHARE_OF_TRAVEL = 0.1, 0.5
"""Throttle left on either side, and share of the surfaces' travel that a trim may use, on a patrol's legs."""


def patrol(aircraft: Aircraft, condition: FlightCondition) -> Route:
    """A racetrack round the start that exercises the aircraft: turns, a climb, a descent, faster and slower legs.

    Two legs take 40 s or more, the two between them are four turn radii long. Up to 15 % faster and 10 % slower than
    the condition, up to 100 m higher, as far as the envelope and trim allow.

    Raises:
        AircraftDataError, TrimError: as ``simulation.trim`` at the condition.
    """
    speed, altitude = condition.airspeed_true_m_s, condition.altitude_m
    trim(aircraft, condition)
    top = altitude + min(_HIGHEST_CLIMB_M, _CLIMB_RAD * _LEG_S * speed)
    if aircraft.envelope is not None:
        top = min(top, max(altitude, aircraft.envelope.altitude_m[1]))
    fast = _first_flyable(aircraft, [speed * ratio for ratio in _FASTER], top, speed)
    slow = _first_flyable(aircraft, [speed * ratio for ratio in _SLOWER], altitude, speed)
    width = 4.0 * turn_radius_m(fast)
    length = max(_LEG_S * speed, width)
    return Route((
        Waypoint(length, 0.0, altitude, speed),
        Waypoint(length, width, top, speed),
        Waypoint(0.0, width, top, fast),
        Waypoint(0.0, 0.0, altitude, slow),
    ))  # fmt: skip


def _first_flyable(
    aircraft: Aircraft, airspeeds: Sequence[float], altitude_m: float, otherwise: float
) -> float:
    """The first airspeed that is inside the envelope and leaves throttle and travel to control with."""
    low, high = (0.0, math.inf) if aircraft.envelope is None else aircraft.envelope.airspeed_true_m_s
    limits = parameter_row(aircraft)[ELEVATOR_LIMIT : RUDDER_LIMIT + 1]
    for airspeed in airspeeds:
        if not low <= airspeed <= high:
            continue
        try:
            point = trim(aircraft, FlightCondition(airspeed, altitude_m))
        except TrimError:
            continue
        spare = np.all(np.abs(point.surfaces_rad) <= _SHARE_OF_TRAVEL * limits)
        if spare and _SPARE_THROTTLE <= point.throttle <= 1.0 - _SPARE_THROTTLE:
            return airspeed
    return otherwise
