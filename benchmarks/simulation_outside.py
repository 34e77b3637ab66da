"""The simulation beside what others say: JSBSim, the thesis's linearised Aerosonde, the published iced Twin Otter.

Run: python benchmarks/simulation_outside.py [jsbsim] [thesis] [twin-otter]
"""

import argparse
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from aerosonde_sets import CONDITION, THESIS, THESIS_MODES, derivatives_and_modes, variants
from jsbsim_file import peer_aircraft
from jsbsim_peer import Peer, PeerTrim
from numpy.typing import NDArray
from published_twin_otter import CLEAN, PublishedTwinOtter
from saving import run_benchmark

from wingwatch.aircraft import (
    DUTCH_ROLL,
    ICING_FACTORS,
    LATERAL,
    SHORT_PERIOD,
    Aircraft,
    ConstantThrust,
    Convention,
    FlightCondition,
    IcingKind,
    display_name,
    load_aircraft,
    natural_frequency_and_damping,
    state_matrix,
)
from wingwatch.simulation import FleetSimulation, Icing, Scenario, linearise, trim
from wingwatch.simulation.dynamics import euler_angles, fly_held
from wingwatch.simulation.layout import parameter_row
from wingwatch.simulation.prepared import working_row

PEERS: Mapping[str, FlightCondition] = {
    "pa28": FlightCondition(55.0, 1000.0),
    "x24b": FlightCondition(150.0, 1000.0),
}
"""pa28: tables by angle of attack, alphadot terms, forces off the centre of gravity. x24b: all but one term linear."""

MOTIONS = ("u", "v", "w", "p", "q", "r", "roll", "pitch")
RATE_HZ = 100.0
SECONDS = 20.0
PEER_RATE_HZ = 2000.0
"""JSBSim's response converges with the first power of its step; this leaves 0.3 %."""
JSBSIM_USUAL_HZ = 200.0
SIDESLIP_DRAG = "aero/coefficient/CDbeta"
"""Proportional to the size of the sideslip; our files have no such term."""
DOUBLET_RAD = math.radians(1.0)
_STEPS = 2
REFERENCE_SEVERITY = 0.0675


def doublets(seconds: float = SECONDS) -> NDArray[np.float64]:
    """Deflections beside trim, shape (n, 3): a doublet of 1 degree and twice 0.5 s on elevator at 1 s, aileron at 7 s,
    rudder at 13 s."""
    time = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    out = np.zeros((time.size, 3))
    for surface, start in enumerate((1.0, 7.0, 13.0)):
        out[:, surface] += DOUBLET_RAD * ((time >= start) & (time < start + 0.5))
        out[:, surface] -= DOUBLET_RAD * ((time >= start + 0.5) & (time < start + 1.0))
    return out


def fly(
    aircraft: Aircraft, condition: FlightCondition, surfaces_rad: NDArray[np.float64]
) -> NDArray[np.float64]:
    """``MOTIONS`` of the simulation's equations without autopilot, actuators or sensors, shape (n, 8): from trim,
    throttle held, deflections added to the trim and held over each period of ``RATE_HZ``."""
    point, row = trim(aircraft, condition), working_row(parameter_row(aircraft))
    state = point.state.copy()
    out = np.empty((len(surfaces_rad), len(MOTIONS)))
    for i, deflection in enumerate(surfaces_rad):
        out[i] = (*state[3:6], *state[10:13], *euler_angles(state)[:2])
        fly_held(
            row, state, point.surfaces_rad + deflection, point.throttle, 1.0 / (RATE_HZ * _STEPS), _STEPS
        )
    return out


@dataclass(frozen=True, slots=True)
class PeerComparison:
    """One bundled aircraft of JSBSim beside ours of the same coefficients.

    Attributes:
        trims: JSBSim's and ours: angle of attack and elevator in rad, thrust in N.
        derivatives: by symbol, JSBSim's and ours.
        responses: JSBSim's and ours, each of shape (n, 8).
    """

    trims: tuple[PeerTrim, PeerTrim]
    derivatives: Mapping[str, tuple[float, float]]
    responses: tuple[NDArray[np.float64], NDArray[np.float64]]

    @property
    def response_error(self) -> NDArray[np.float64]:
        """Largest difference of each motion from its start, over the motion's size in JSBSim, shape (8,)."""
        theirs, ours = (response - response[0] for response in self.responses)
        return np.asarray(np.abs(ours - theirs).max(axis=0) / np.ptp(theirs, axis=0))


def compare_peer(
    name: str, *, flat_earth: bool = True, without: Sequence[str] = (), rate_hz: float = PEER_RATE_HZ
) -> PeerComparison:
    """Trim, derivatives and response of one of ``PEERS``.

    Args:
        name: of the bundled aircraft, whose file is always made over the flat earth.
        flat_earth: over which JSBSim flies.
        without: aerodynamic terms that JSBSim leaves out.
        rate_hz: of JSBSim's integration.
    """
    condition = PEERS[name]
    flat = Peer(name)
    aircraft = peer_aircraft(flat, flat.trim(condition))
    peer = Peer(name, flat_earth=flat_earth, without=without, rate_hz=rate_hz)
    theirs, point = peer.trim(condition), trim(aircraft, condition)
    propulsion = aircraft.propulsion
    assert isinstance(propulsion, ConstantThrust)
    ours = PeerTrim(point.angle_of_attack_rad, point.elevator_rad, point.throttle * propulsion.thrust_max_n)
    measured = peer.concise(condition, theirs)
    simulated = linearise(aircraft, condition, SHORT_PERIOD) | linearise(aircraft, condition, LATERAL)
    inputs = doublets()
    return PeerComparison(
        (theirs, ours),
        {symbol: (measured[symbol], value) for symbol, value in simulated.items()},
        (peer.fly(condition, theirs, inputs, RATE_HZ), fly(aircraft, condition, inputs)),
    )


def percent(value: float, reference: float) -> float:
    """Difference in per cent; NaN beside nothing."""
    return 100.0 * (value / reference - 1.0) if abs(reference) > 1e-9 else math.nan


def print_peers() -> None:
    for name, condition in PEERS.items():
        print(
            f"\nJSBSim's {name} at {condition.airspeed_true_m_s:g} m/s, {condition.altitude_m:g} m; differences in %"
        )
        flat, round_one = (compare_peer(name, flat_earth=flat_earth) for flat_earth in (True, False))
        print(f"  {'':24}{'still flat earth':>36}{'round turning earth':>24}")
        print(f"  {'':24}{'JSBSim':>12}{'ours':>12}{'':>12}{'JSBSim':>12}")
        for label, read in _TRIM_ROWS:
            a, b, c = read(flat.trims[0]), read(flat.trims[1]), read(round_one.trims[0])
            print(f"  {label:24}{a:12.5f}{b:12.5f}{percent(b, a):+12.4f}{c:12.5f}{percent(b, c):+12.4f}")
        for symbol, (a, b) in flat.derivatives.items():
            c = round_one.derivatives[symbol][0]
            print(f"  {symbol:24}{a:12.5f}{b:12.5f}{percent(b, a):+12.4f}{c:12.5f}{percent(b, c):+12.4f}")
        print(
            f"  20 s of doublets, largest difference in % of the motion's size{'':>8}"
            + "".join(f"{m:>8}" for m in MOTIONS)
        )
        rows = {
            f"still flat earth, JSBSim at {PEER_RATE_HZ:g} Hz": flat,
            f"JSBSim at {JSBSIM_USUAL_HZ:g} Hz": compare_peer(name, rate_hz=JSBSIM_USUAL_HZ),
            "round turning earth": round_one,
        }
        if name == "pa28":
            rows["still flat earth, JSBSim without drag by sideslip"] = compare_peer(
                name, without=(SIDESLIP_DRAG,)
            )
        for label, comparison in rows.items():
            print(f"    {label:67}" + "".join(f"{100.0 * e:8.3f}" for e in comparison.response_error))

    print_minute()


def print_minute(vehicles: int = 200) -> None:
    """A minute of the first peer's level flight: JSBSim, and ours with autopilot, sensors and their noise."""
    name, condition = next(iter(PEERS.items()))
    peer = Peer(name, rate_hz=JSBSIM_USUAL_HZ)
    at = peer.trim(condition)
    aircraft = peer_aircraft(peer, at)
    scenario = Scenario(aircraft, condition.airspeed_true_m_s, condition.altitude_m)
    print(
        f"\na minute of {name} in level flight at {JSBSIM_USUAL_HZ:g} Hz, milliseconds a vehicle (best of three)"
    )
    theirs = min(peer.minute_s(condition, at, time.perf_counter) for _ in range(3))
    print(f"  JSBSim, equations alone {1e3 * theirs:8.2f}")
    for batch in (1, vehicles):
        fleet = FleetSimulation([scenario] * batch)
        fleet.step(1)
        spent = []
        for _ in range(3):
            start = time.perf_counter()
            fleet.step(60 * 50)
            spent.append((time.perf_counter() - start) / batch)
        print(f"  ours, batch of {batch:<9}{1e3 * min(spent):8.2f}")


_TRIM_ROWS: tuple[tuple[str, Callable[[PeerTrim], float]], ...] = (
    ("angle of attack, deg", lambda t: math.degrees(t.angle_of_attack_rad)),
    ("elevator, deg", lambda t: math.degrees(t.elevator_rad)),
    ("thrust, N", lambda t: t.thrust_n),
)


def print_thesis() -> None:
    print(
        "\nAerosonde at 25 m/s, 1000 m: each published set beside the thesis's linearised columns, difference in %"
    )
    print(
        f"{'':38}"
        + "".join(f"{s:>8}" for s in THESIS)
        + f"{'SP rad/s':>10}{'damping':>9}{'DR rad/s':>10}{'damping':>9}"
    )
    modes = [x for name in ("short period", "Dutch roll") for x in THESIS_MODES[name]]
    print(
        f"{'thesis':38}"
        + "".join(f"{v:8.3f}" for v in THESIS.values())
        + "".join(f"{x:9.4g} " for x in modes)
    )
    for label, aircraft in variants().items():
        values, found = derivatives_and_modes(aircraft)
        cells = "".join(f"{percent(values[s], v):+8.1f}" for s, v in THESIS.items())
        modes = [x for name in ("short period", "Dutch roll") for x in found[name]]
        print(f"{label:38}{cells}" + "".join(f"{x:9.4g} " for x in modes))
    for name in ("aerosonde-a", "aerosonde"):
        aircraft = load_aircraft(name)
        flown = linearise(aircraft, CONDITION, SHORT_PERIOD) | linearise(aircraft, CONDITION, DUTCH_ROLL)
        print(
            f"{'as flown: ' + name:38}" + "".join(f"{percent(flown[s], v):+8.1f}" for s, v in THESIS.items())
        )


@dataclass(frozen=True, slots=True)
class IceComparison:
    """One concise derivative of the Twin Otter: the published form and ours, clean and its change under ice in %.

    Attributes:
        factor_percent: what the published table says of the coefficient behind it.
        published: clean value of the published body-axis form.
        published_percent: its change.
        ours: clean value, as the simulation flies it.
        ours_percent: its change.
    """

    factor_percent: float
    published: float
    published_percent: float
    ours: float
    ours_percent: float


def compare_ice(kind: IcingKind = "all", severity: float = REFERENCE_SEVERITY) -> dict[str, IceComparison]:
    """Every derivative of short period and lateral motion at the library's cruise, level before and after."""
    aircraft = load_aircraft("twinotter")
    condition = cruise(aircraft)
    clean, iced = (PublishedTwinOtter(aircraft, s, kind).concise(condition) for s in (0.0, severity))
    out = {}
    for structure in (SHORT_PERIOD, LATERAL):
        ours = linearise(aircraft, condition, structure)
        ours_iced = linearise(aircraft, condition, structure, (Icing(severity, target=kind),))
        for symbol in structure.derivatives:
            name = display_name(symbol, Convention.AMERICAN).replace("_", "")
            out[symbol] = IceComparison(
                100.0 * severity * ICING_FACTORS[kind][name] if CLEAN[name] else 0.0, clean[symbol],
                percent(iced[symbol], clean[symbol]), ours[symbol], percent(ours_iced[symbol], ours[symbol]),
            )  # fmt: skip
    return out


def cruise(aircraft: Aircraft) -> FlightCondition:
    """The cruise point of an aircraft file that has an envelope."""
    assert aircraft.envelope is not None
    return aircraft.envelope.cruise


def twin_otter_modes() -> dict[str, dict[str, tuple[float, float]]]:
    """Natural frequency in rad/s and damping of short period and Dutch roll (with roll), by who says so."""
    aircraft = load_aircraft("twinotter")
    condition = cruise(aircraft)
    jsbsim = Peer("DHC6", mass=aircraft.need_mass("the comparison"))
    effects = (Icing(REFERENCE_SEVERITY),)
    sets = {
        "published form, clean": PublishedTwinOtter(aircraft).concise(condition),
        "ours, clean": linearise(aircraft, condition, SHORT_PERIOD) | linearise(aircraft, condition, LATERAL),
        "published form, iced": PublishedTwinOtter(aircraft, REFERENCE_SEVERITY).concise(condition),
        "ours, iced": linearise(aircraft, condition, SHORT_PERIOD, effects)
        | linearise(aircraft, condition, LATERAL, effects),
        "JSBSim's DHC-6, same mass": jsbsim.concise(condition, jsbsim.trim(condition)),
    }
    return {
        label: {s.name: natural_frequency_and_damping(s, state_matrix(s, d)) for s in (SHORT_PERIOD, LATERAL)}
        for label, d in sets.items()
    }


def print_twin_otter() -> None:
    condition = cruise(load_aircraft("twinotter"))
    at = f"{condition.airspeed_true_m_s:g} m/s, {condition.altitude_m:g} m"
    for kind in ICING_FACTORS:
        print(f"\nTwin Otter at {at}: ice {kind}, eta {REFERENCE_SEVERITY}; changes in %")
        print(f"  {'':8}{'published':>12}{'ours':>12}{'%':>9}{'factor':>10}{'published':>11}{'ours':>8}")
        for symbol, c in compare_ice(kind).items():
            print(
                f"  {symbol:8}{c.published:12.5f}{c.ours:12.5f}{percent(c.ours, c.published):+9.3f}"
                f"{c.factor_percent:+10.2f}{c.published_percent:+11.2f}{c.ours_percent:+8.2f}"
            )
    print(f"\n  {'rad/s, damping ratio':28}{'short period':>18}{'Dutch roll':>18}")
    for label, modes in twin_otter_modes().items():
        print(f"  {label:28}" + "".join(f"{w:10.3f} {d:7.3f}" for w, d in modes.values()))


PARTS = {"jsbsim": print_peers, "thesis": print_thesis, "twin-otter": print_twin_otter}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; all where none is named"
    )
    parts = parser.parse_args().parts or list(PARTS)
    if unknown := [part for part in parts if part not in PARTS]:
        parser.error(f"{unknown[0]!r} is no part; give some of {', '.join(PARTS)}")
    for part in parts:
        PARTS[part]()


if __name__ == "__main__":
    run_benchmark(main)
