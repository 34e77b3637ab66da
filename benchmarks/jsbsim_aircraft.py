"""Aircraft of others: JSBSim's bundled ones, flown by JSBSim with doublets, and what is said of them.

Each aircraft (``jsbsim_peer``: a constant force for the engine, no flight control system) flies a minute from its trim
in still air. Servos of 8 Hz move its surfaces, commanded by three doublets a surface and a loop that holds pitch
and bank. Its aircraft file has JSBSim's own linearised derivatives, each aerodynamic part 30 % off to either side,
and the Aerosonde file's sensor noise. Truth is JSBSim's linearisation at the airspeed that an estimate is reported at.

    .venv/bin/python benchmarks/jsbsim_aircraft.py [--aircraft c182 DHC6 ...] [--seeds 1] [--json]
        [--records noisy noise-free gaps constant quantised] [--whole]

Records: with the Aerosonde's sensor noise (``noisy``); none (``noise-free``); noisy with bursts of lost samples and
lost values (``gaps``); noisy with a sideslip that never moves (``constant``); rounded coarsely without noise
(``quantised``). Per aircraft, record and structure: share ``converged``; truth in the stated 95 % interval of these;
largest error over stated error of these; median and largest error of these over the natural size, percent; how many of
these are not finite; and what the linear model leaves of JSBSim's own accelerations in that flight (``misfit``; the
Twin Otter's rolling moment goes with the size of its sideslip, and no l_v describes it). The last lines are over all
aircraft with a misfit of at most 10 %.
"""

import argparse
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cache

import numpy as np
from jsbsim_peer import FT, SLUG, Peer
from numpy.typing import NDArray
from saving import run_benchmark
from simulated_flights import RATE_HZ, START_OFF, STRUCTURES, Z_95, flight_form, last_solution

from wingwatch.aircraft import (
    GRAVITY_M_S2,
    LATERAL,
    SHORT_PERIOD,
    Actuator,
    Actuators,
    Aircraft,
    ConditionEntry,
    DerivativeEntry,
    FlightCondition,
    Geometry,
    Mode,
    ModeStructure,
    Sensors,
    load_aircraft,
)
from wingwatch.estimators import (
    Estimate,
    InertiaCoupling,
    Outcome,
    flight_manoeuvres,
    in_form,
    offsets,
    output_error,
)
from wingwatch.telemetry import CHANNEL_INDEX, CHANNELS, SampleBlock, complete

Array = NDArray[np.float64]

AIRCRAFT: dict[str, FlightCondition] = {
    "c172r": FlightCondition(55.0, 1000.0),
    "c182": FlightCondition(60.0, 1000.0),
    "c310": FlightCondition(75.0, 1000.0),
    "pa28": FlightCondition(55.0, 1000.0),
    "dr1": FlightCondition(40.0, 500.0),
    "L17": FlightCondition(60.0, 1000.0),
    "SGS": FlightCondition(25.0, 1000.0),
    "DHC6": FlightCondition(75.0, 1500.0),
    "T37": FlightCondition(110.0, 2000.0),
    "F80C": FlightCondition(160.0, 3000.0),
    "A4": FlightCondition(170.0, 3000.0),
    "f15": FlightCondition(200.0, 3000.0),
    "B17": FlightCondition(90.0, 2000.0),
    "737": FlightCondition(180.0, 3000.0),
}
"""Bundled aircraft that ``jsbsim_peer`` can load and trim, and where they fly."""
SECONDS, PERIOD_S, FIRST_S, SPACING_S = 60.0, 20.0, 4.0, 5.5
AMPLITUDE_RAD = math.radians(2.0)
SERVO_HZ = 8.0
JSBSIM_HZ = 500.0
HOLD_PITCH, HOLD_BANK = 0.15, 0.2
"""Elevator and aileron per radian off the trim's pitch and bank."""
MEASURED = (
    "airspeed_true_m_s", "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s", "specific_force_x_m_s2",
    "specific_force_y_m_s2", "specific_force_z_m_s2", "roll_rad", "pitch_rad", "heading_rad", "altitude_m",
    "angle_of_attack_rad", "sideslip_rad", "air_density_kg_m3", "elevator_rad", "aileron_rad", "rudder_rad",
)  # fmt: skip
COMMANDS = [CHANNEL_INDEX[f"{surface}_command_rad"] for surface in ("elevator", "aileron", "rudder")]
NOISE = load_aircraft("aerosonde").sensors.noise_std
LINEAR = 0.1
"""Largest misfit of a flight that counts in the totals."""
STEPS = {"rad_s": 0.005, "rad": 0.002, "m_s2": 0.05, "m_s": 0.5, "m": 1.0}
"""What quantised channels are rounded to, by the unit that ends their name."""


class Subject:
    """One bundled aircraft at its trim, and its truth at airspeeds near it.

    Args:
        name: of the aircraft.
        condition: where it flies; that of ``AIRCRAFT`` where none is given.
        peer: the loaded aircraft; as bundled where none is given.
    """

    def __init__(self, name: str, condition: FlightCondition | None = None, peer: Peer | None = None) -> None:
        self.name, self.condition = name, condition or AIRCRAFT[name]
        self.peer = peer or Peer(name, rate_hz=JSBSIM_HZ, second_order=True)
        self.trim = self.peer.trim(self.condition)
        self.truth_at = cache(self._truth_at)

    def _truth_at(
        self, airspeed_m_s: float, altitude_m: float | None = None
    ) -> tuple[dict[str, float], float]:
        """Concise derivatives at an airspeed, and the angle of attack there, rad; not rounded, for y_r is the speed.

        At the altitude of the trim where none is given: ten metres of density are a thousandth of a derivative.
        """
        altitude_m = self.condition.altitude_m if altitude_m is None else altitude_m
        at = FlightCondition(airspeed_m_s, altitude_m)
        trim = self.peer.trim(at)
        return self.peer.concise(at, trim), trim.angle_of_attack_rad

    def truth(self, structure: ModeStructure, estimate: Estimate) -> Array:
        """Concise derivatives at an estimate's airspeed and altitude, with the angle of attack that it reports."""
        airspeed, altitude, _, alpha = estimate.condition
        table, trim_alpha = self.truth_at(airspeed, altitude)
        moved = offsets(structure, airspeed, alpha) - offsets(structure, airspeed, trim_alpha)
        return np.array([table[d] for d in structure.derivatives]) + moved

    def natural(self, structure: ModeStructure) -> Array:
        """Natural size of each derivative: its aerodynamic part, but a little where that is next to nothing.

        The least is 3 % of the row's largest control derivative and 0.05 for controls, a thousandth of the airspeed for
        rates in the force equation, 0.001 for the others.
        """
        table, alpha = self.truth_at(self.condition.airspeed_true_m_s)
        value = np.array([table[d] for d in structure.derivatives])
        size = np.abs(value - offsets(structure, self.condition.airspeed_true_m_s, alpha))
        rows = size.reshape(len(structure.equations), -1)
        states = len(structure.states)
        floor = np.full_like(rows, 1e-3)
        floor[:, states:] = np.maximum(0.03 * rows[:, states:].max(axis=1, keepdims=True), 0.05)
        floor[0, 1:states] = 1e-3 * self.condition.airspeed_true_m_s
        return np.asarray(np.maximum(rows, floor).ravel())

    def file(self, noisy: bool, seed: int) -> Aircraft:
        """An aircraft file that is off by chance."""
        entries, rng = {}, np.random.default_rng(seed)
        table, alpha = self.truth_at(self.condition.airspeed_true_m_s)
        for structure in STRUCTURES:
            off = START_OFF * self.natural(structure)
            side = rng.choice([-1.0, 1.0], off.size)
            for d, width, sign in zip(structure.derivatives, off, side, strict=True):
                entries[d] = DerivativeEntry(
                    value=table[d] + sign * float(width), standard_error=float(width)
                )
        c, servo = self.condition, Actuator(bandwidth_hz=SERVO_HZ)
        here = ConditionEntry(
            airspeed_true_m_s=c.airspeed_true_m_s, altitude_m=c.altitude_m, angle_of_attack_rad=alpha,
            provenance="a-priori", derivatives=entries,
        )  # fmt: skip
        return Aircraft(
            format=1,
            name=self.name.lower(),
            geometry=Geometry(
                wing_area_m2=self.peer["metrics/Sw-sqft"] * FT**2,
                span_m=self.peer["metrics/bw-ft"] * FT,
                mean_chord_m=self.peer["metrics/cbarw-ft"] * FT,
            ),
            mass=self.peer.mass,
            sensors=Sensors(noise_std=NOISE if noisy else {}),
            actuators=Actuators(elevator=servo, aileron=servo, rudder=servo),
            modes={s.name: Mode(band_hz=self.band_hz(s)) for s in STRUCTURES},
            conditions=(here,),
        )

    def frequency_rad_s(self, structure: ModeStructure) -> float:
        """Natural frequency of the short period or of the two-state Dutch roll."""
        d, _ = self.truth_at(self.condition.airspeed_true_m_s)
        if structure is SHORT_PERIOD:
            return math.sqrt(abs(d["z_w"] * d["m_q"] - d["z_q"] * d["m_w"]))
        return math.sqrt(abs(d["y_v"] * d["n_r"] - d["y_r"] * d["n_v"]))

    def band_hz(self, structure: ModeStructure) -> tuple[float, float]:
        """From a tenth of a hertz to well above the quickest of the structure's own motions."""
        quick = (
            abs(self.truth_at(self.condition.airspeed_true_m_s)[0]["l_p"]) if structure is LATERAL else 0.0
        )
        return 0.1, float(np.clip(max(self.frequency_rad_s(structure), quick) / math.pi, 1.0, 6.0))


def commands(subject: Subject) -> Array:
    """Doublets of elevator, aileron and rudder in turn, rad, (samples, 3)."""
    time_s = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    out = np.zeros((time_s.size, 3))
    for k, structure in enumerate((SHORT_PERIOD, LATERAL, LATERAL)):
        pulse = min(2.3 / subject.frequency_rad_s(structure), 1.5)
        since = np.mod(time_s - FIRST_S - k * SPACING_S, PERIOD_S)
        out[:, k] = AMPLITUDE_RAD * ((since < pulse) * 1.0 - ((since >= pulse) & (since < 2.0 * pulse)))
        out[time_s < FIRST_S, k] = 0.0
    return out


def fly(subject: Subject) -> tuple[Array, Array]:
    """One clean flight, (samples, channels), NaN in columns that are not measured; and its p, q and r's rates."""
    peer, trim = subject.peer, subject.trim
    speed, alpha = subject.condition.airspeed_true_m_s, trim.angle_of_attack_rad
    motion = [speed * math.cos(alpha), 0.0, speed * math.sin(alpha), 0.0, 0.0, 0.0]
    position = np.array([trim.elevator_rad, 0.0, 0.0])
    peer.start(motion, alpha, subject.condition.altitude_m, position.tolist(), trim.thrust_n)
    planned, steps = commands(subject), round(JSBSIM_HZ / RATE_HZ)
    level, toward = position.copy(), 1.0 - math.exp(-2.0 * math.pi * SERVO_HZ / JSBSIM_HZ)
    out, spin = np.full((len(planned), len(CHANNELS)), np.nan), np.empty((len(planned), 3))
    for k, doublet in enumerate(planned):
        peer.set_controls(position.tolist(), trim.thrust_n)
        peer.settle()
        _record(peer, position, k / RATE_HZ, out[k])
        spin[k] = peer.accelerations()[3:]
        command = doublet + level
        command[0] += HOLD_PITCH * (peer["attitude/theta-rad"] - alpha)
        command[1] += HOLD_BANK * peer["attitude/phi-rad"]
        out[k, COMMANDS] = command
        for _ in range(steps):
            # JSBSim integrates what it has evaluated, then evaluates the forces of the step's end.
            position = position + toward * (command - position)
            peer.set_controls(position.tolist(), trim.thrust_n)
            peer.fdm.run()
    return out, spin


def misfit(subject: Subject, structure: ModeStructure, clean: Array, spin: Array) -> float:
    """What the linear model leaves of the flight's clean accelerations: standard deviation over the whole's, the worst
    of the structure's equations. Accelerations are without the inertia coupling and divided by the dynamic pressure, as
    the estimators take them."""
    block, cruise = SampleBlock(clean), subject.condition.airspeed_true_m_s
    speed = block.column("airspeed_true_m_s")
    moved = {
        "w": speed * np.sin(block.column("angle_of_attack_rad")),
        "v": speed * np.sin(block.column("sideslip_rad")),
        "p": block.column("roll_rate_rad_s"),
        "q": block.column("pitch_rate_rad_s"),
        "r": block.column("yaw_rate_rad_s"),
        "eta": block.column("elevator_rad"),
        "xi": block.column("aileron_rad"),
        "zeta": block.column("rudder_rad"),
    }
    p, q, r = moved["p"], moved["q"], moved["r"]
    coupling, products = InertiaCoupling.of(subject.peer.mass), np.array([p * q, q * r, p * r, p**2 - r**2])
    whole = {
        "z": block.column("specific_force_z_m_s2"),
        "y": block.column("specific_force_y_m_s2"),
        **{
            row: rate - coupling.coefficients(by) @ products
            for row, by, rate in zip("lmn", "pqr", spin.T, strict=True)
        },
    }
    table, alpha = subject.truth_at(cruise)
    value = np.array([table[d] for d in structure.derivatives]) - offsets(structure, cruise, alpha)
    slower = [1.0 if name in structure.inputs else cruise / speed for name in structure.regressors]
    regressors = np.array([moved[name] * by for name, by in zip(structure.regressors, slower, strict=True)])
    left = []
    for row, part in zip(structure.equations, value.reshape(len(structure.equations), -1), strict=True):
        coefficient = whole[row] * (cruise / speed) ** 2
        left.append(float((coefficient - part @ regressors).std() / coefficient.std()))
    return max(left)


def _record(peer: Peer, surfaces: Array, time_s: float, row: Array) -> None:
    """State, forces and surfaces of JSBSim's present instant."""
    u, v, w = (peer[f"velocities/{axis}-fps"] * FT for axis in "uvw")
    p, q, r = (peer[f"velocities/{axis}-rad_sec"] for axis in "pqr")
    roll, pitch, heading = (peer[f"attitude/{name}-rad"] for name in ("phi", "theta", "psi"))
    rate = peer.accelerations()
    g = GRAVITY_M_S2
    forces = (
        rate[0] + g * math.sin(pitch) - r * v + q * w,
        rate[1] - g * math.cos(pitch) * math.sin(roll) - p * w + r * u,
        rate[2] - g * math.cos(pitch) * math.cos(roll) - q * u + p * v,
    )
    airspeed = math.sqrt(u * u + v * v + w * w)
    density = peer["atmosphere/rho-slugs_ft3"] * SLUG / FT**3
    values = (
        airspeed, p, q, r, *forces, roll, pitch, math.remainder(heading, 2.0 * math.pi), peer["position/h-sl-ft"] * FT,
        math.atan2(w, u), math.asin(v / airspeed), density, *surfaces,
    )  # fmt: skip
    row[CHANNEL_INDEX["time_s"]] = time_s
    for name, value in zip(MEASURED, values, strict=True):
        row[CHANNEL_INDEX[name]] = value


def noisy(clean: Array, rng: np.random.Generator) -> Array:
    """With the Aerosonde file's noise."""
    out = clean.copy()
    for name, std in NOISE.items():
        out[:, CHANNEL_INDEX[name]] += std * rng.standard_normal(len(out))
    return out


def with_gaps(clean: Array, rng: np.random.Generator) -> Array:
    """Noisy, a burst of 0.3 s lost every 5 s or so, and one value in fifty."""
    out = noisy(clean, rng)
    measured = [CHANNEL_INDEX[name] for name in MEASURED]
    lost = (
        np.convolve(rng.random(len(out)) < 1.0 / (5.0 * RATE_HZ), np.ones(round(0.3 * RATE_HZ)))[: len(out)]
        > 0.0
    )
    out[:, measured] = np.where(rng.random((len(out), len(measured))) < 0.02, np.nan, out[:, measured])
    out[:, measured] = np.where(lost[:, None], np.nan, out[:, measured])
    return out


def stuck(clean: Array, rng: np.random.Generator) -> Array:
    """Noisy, the sideslip at its first reading throughout."""
    out = noisy(clean, rng)
    out[:, CHANNEL_INDEX["sideslip_rad"]] = out[0, CHANNEL_INDEX["sideslip_rad"]]
    return out


def rounded(clean: Array, rng: np.random.Generator) -> Array:
    """Rounded to ``STEPS``, without noise; ``rng`` is not used."""
    out = clean.copy()
    for name in MEASURED:
        unit = next((u for u in ("rad_s", "m_s2", "m_s", "rad", "m") if name.endswith(f"_{u}")), None)
        if unit is not None:
            out[:, CHANNEL_INDEX[name]] = STEPS[unit] * np.round(out[:, CHANNEL_INDEX[name]] / STEPS[unit])
    return out


RECORDS: dict[str, Callable[[Array, np.random.Generator], Array]] = {
    "noisy": noisy,
    "noise-free": lambda clean, rng: clean.copy(),
    "gaps": with_gaps,
    "constant": stuck,
    "quantised": rounded,
}


@dataclass(frozen=True, slots=True)
class Reading:
    """One estimate beside its truth, (k,) each; error and stated error over the natural size."""

    score: Array
    relative: Array
    claimed: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Figures:
    """One estimator over one record or several; percent and stated errors, None without claims."""

    aircraft: str
    record: str
    structure: str
    estimator: str
    derivatives: int
    claimed: float
    covered_claims: float | None
    worst_score: float | None
    median_error: float | None
    worst_error: float | None
    not_finite: int
    misfit: float | None


def read(
    subject: Subject, record: str, clean: Array, seed: int, whole: bool
) -> dict[tuple[str, str], Reading]:
    """Estimates of both structures by both online estimators and, if ``whole``, by output error."""
    values = RECORDS[record](clean, np.random.default_rng([seed, 1]))
    block = complete(SampleBlock(values))
    file = subject.file(record not in ("noise-free", "quantised"), seed)
    modes, found = last_solution(file, block).modes, {}
    for structure in STRUCTURES:
        estimates: list[Estimate] = []
        if structure.name in modes:
            estimates += modes[structure.name].estimates
        if whole and (parts := flight_manoeuvres(structure, flight_form(file, subject.condition), [block])):
            estimates.append(in_form(*output_error(parts), structure)[0])
        for estimate in estimates:
            error = estimate.value - subject.truth(structure, estimate)
            found[structure.name, estimate.estimator] = Reading(
                np.abs(error) / estimate.standard_error,
                np.abs(error) / subject.natural(structure),
                np.array([o is Outcome.CONVERGED for o in estimate.outcomes]),
            )
    return found


def figures(
    aircraft: str, record: str, key: tuple[str, str], readings: Sequence[Reading], left: float | None = None
) -> Figures:
    """Figures of readings that belong together; ``left``: of their one flight, what ``misfit`` says."""
    score, relative, claimed = (
        np.concatenate([getattr(r, n) for r in readings]) for n in ("score", "relative", "claimed")
    )
    lost = ~np.isfinite(score)
    mine, errors = np.where(lost, np.inf, score)[claimed], np.where(lost, np.inf, relative)[claimed]
    some = mine.size > 0
    return Figures(
        aircraft,
        record,
        *key,
        score.size,
        100.0 * float(claimed.mean()),
        100.0 * float((mine <= Z_95).mean()) if some else None,
        float(mine.max()) if some else None,
        100.0 * float(np.median(errors)) if some else None,
        100.0 * float(errors.max()) if some else None,
        int((lost & claimed).sum()),
        None if left is None else 100.0 * left,
    )


HEADER = (
    f"{'aircraft':10}{'record':12}{'structure':14}{'estimator':11}{'of':>5}{'claims':>8}{'in 95 %':>9}{'worst z':>9}"
    f"{'error/size, %: median':>23}{'worst':>9}{'lost':>6}{'misfit %':>10}"
)


def line(f: Figures) -> str:
    """One row of the table."""

    def cell(value: float | None, width: int) -> str:
        return f"{'-':>{width}}" if value is None else f"{value:{width}.3g}"

    return (
        f"{f.aircraft:10}{f.record:12}{f.structure:14}{f.estimator:11}{f.derivatives:5}{f.claimed:8.0f}"
        f"{cell(f.covered_claims, 9)}{cell(f.worst_score, 9)}{cell(f.median_error, 23)}{cell(f.worst_error, 9)}"
        f"{f.not_finite:6}{cell(f.misfit, 10)}"
    )


def table(names: Sequence[str], records: Sequence[str], seeds: int, whole: bool, as_json: bool) -> None:
    """Fly, read and print."""
    everything: dict[tuple[str, tuple[str, str]], list[Reading]] = {}
    for name in names:
        subject = Subject(name)
        clean, spin = fly(subject)
        left = {s.name: misfit(subject, s, clean, spin) for s in STRUCTURES}
        for record in records:
            together: dict[tuple[str, str], list[Reading]] = {}
            for seed in range(seeds if record in ("noisy", "gaps", "constant") else 1):
                for key, reading in read(subject, record, clean, seed, whole).items():
                    together.setdefault(key, []).append(reading)
                    if left[key[0]] <= LINEAR:
                        everything.setdefault((record, key), []).append(reading)
            for key, readings in together.items():
                row = figures(name, record, key, readings, left[key[0]])
                print(json.dumps(asdict(row)) if as_json else line(row), flush=True)
    for (record, key), readings in everything.items():
        row = figures("all", record, key, readings)
        print(json.dumps(asdict(row)) if as_json else line(row))


def main() -> int:
    parser = argparse.ArgumentParser(description="What is said of JSBSim's bundled aircraft.")
    parser.add_argument("--aircraft", nargs="+", default=list(AIRCRAFT))
    parser.add_argument("--records", nargs="+", choices=list(RECORDS), default=list(RECORDS))
    parser.add_argument(
        "--seeds", type=int, default=1, help="of noise and file, an aircraft and record, at least 1"
    )
    parser.add_argument("--whole", action="store_true", help="output error on the whole flight as well")
    parser.add_argument("--json", action="store_true", help="one JSON object a line instead of the table")
    chosen = parser.parse_args()
    unknown = [name for name in chosen.aircraft if name not in AIRCRAFT]
    if unknown:
        parser.error(f"--aircraft {' '.join(unknown)}: give some of {', '.join(AIRCRAFT)}")
    if chosen.seeds < 1:
        parser.error(f"--seeds is {chosen.seeds}; give at least 1")
    if not chosen.json:
        print(
            f"flights of {SECONDS:g} s by JSBSim in still air, {chosen.seeds} seeds of noise and file\n{HEADER}"
        )
    table(chosen.aircraft, chosen.records, chosen.seeds, chosen.whole, chosen.json)
    return 0


if __name__ == "__main__":
    run_benchmark(main)
