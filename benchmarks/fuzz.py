"""A fuzzer that knows both formats against the live fleet: time, memory, faults, counts, and other vehicles.

Sound vehicles fly simulated flights; between their messages come those of ``fuzz_messages``, in the names of other
vehicles, of invented ones, and under keys that are none. The same flights are flown once more without the fuzzer: the
derivatives must be the same to the bit. Messages go through the key's check and ``FleetMonitor.receive_all``, most
alone and some as many at once as the service gathers. Times are of the thread that takes messages in.

Run: python benchmarks/fuzz.py [--messages 1000000] [--seed 0] [--minutes M]
"""

import argparse
import asyncio
import gc
import itertools
import random
import resource
import sys
import time
import traceback
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import numpy as np
from fuzz_messages import Fuzzer, Sent, Victim
from saving import run_benchmark

from wingwatch.aircraft import Aircraft, library_names, load_aircraft
from wingwatch.api import create_app, encode_json
from wingwatch.monitor import (
    Checkpoint,
    FleetMonitor,
    FleetPorts,
    FleetSettings,
    SavedVehicle,
    decode_checkpoint,
    encode_checkpoint,
)
from wingwatch.monitor.ports import News
from wingwatch.simulation import FleetSimulation, Scenario, doublet_schedule
from wingwatch.telemetry import (
    JSON,
    PROTOBUF,
    AircraftMessage,
    InboundMessage,
    SampleBlock,
    encode_aircraft,
    encode_sensors,
    vehicle_key,
)
from wingwatch.telemetry.keys import KeyNameError, parse_key

SOUND, VICTIMS, SAMPLES = 3, 6, 10
PLACES = 500  # vehicles that the fleet remembers: invented names soon take them all
RATE_HZ, GATHERED = 50.0, 16
LIMIT_S = 0.05
SILENCE_S = 0.2
"""After it a victim's name is free for the publisher that was started again: about a hundred messages."""
MOST_SHOWN = 10
READINGS = 50
"""Of the resident memory."""
CONVENTIONS = ("concise", "dimensional", "british", "american")
EVERY_TICK, EVERY_CHECKPOINT, EVERY_NEWS = 1000, 500, 500
LAGGING = "lagging"
"""The Aerosonde whose file states delays, so that rows wait for later ones."""


def find(name: str) -> Aircraft:
    """The library, and one aircraft whose sensors lag."""
    if name == LAGGING:
        aerosonde = load_aircraft("aerosonde")
        delays = {"specific_force_z_m_s2": 0.06, "angle_of_attack_rad": 0.04}
        sensors = aerosonde.sensors.model_copy(update={"delay_s": delays})
        return aerosonde.model_copy(update={"name": LAGGING, "sensors": sensors})
    if name not in library_names():
        raise ValueError(f"aircraft {name!r} is not known here")
    return load_aircraft(name)


class Times:
    """Times in classes of a tenth more than the one below each: as large after 10^6 messages as after ten."""

    def __init__(self) -> None:
        self._counts = np.zeros(200, dtype=np.int64)  # from 1 us to 190 s
        self.longest_s = 0.0
        self.over = 0

    def add(self, time_s: float) -> None:
        """One time."""
        number = int(np.log(max(time_s, 1e-6) / 1e-6) / np.log(1.1))
        self._counts[min(number, len(self._counts) - 1)] += 1
        self.longest_s = max(self.longest_s, time_s)
        self.over += time_s > LIMIT_S

    def __len__(self) -> int:
        return int(self._counts.sum())

    def quantile_s(self, part: float) -> float:
        """Upper end of the class in which the times of this part end."""
        if not len(self):
            return float("nan")
        number = int(np.searchsorted(np.cumsum(self._counts), part * len(self)))
        return min(1e-6 * 1.1 ** (number + 1), self.longest_s)


@dataclass(slots=True)
class Course:
    """What was measured; it does not grow with the messages.

    Attributes:
        alone_s: processor time of each call with one message, and of what it left to be done.
        gathered_s: the same of calls with several.
        wall_s: longest wall-clock time of a call.
        resident: resident memory along the run, bytes.
        kinds: messages by the fuzzer's change; bad_keys: refused before the monitor.
        escaped: the first exceptions that came out of the fleet; escapes: how many.
        slowest: processor time and change of the slowest message.
    """

    alone_s: Times = field(default_factory=Times)
    gathered_s: Times = field(default_factory=Times)
    wall_s: float = 0.0
    tick_s: float = 0.0
    resident: list[int] = field(default_factory=list)
    kinds: Counter[str] = field(default_factory=Counter)
    bad_keys: int = 0
    handed_over: int = 0
    escaped: list[str] = field(default_factory=list)
    escapes: int = 0
    slowest: dict[str, float] = field(default_factory=dict)

    def escape(self, error: Exception) -> None:
        """Count an exception, and keep where it came from while there are few."""
        self.escapes += 1
        if len(self.escaped) < MOST_SHOWN:
            self.escaped.append(_where(error))


class Outputs:
    """Keeps news of some vehicles to be made after the message that led to it, as the service's threads do."""

    def __init__(self) -> None:
        self.waiting: deque[Callable[[], News]] = deque(maxlen=100)

    def announce(self, fleet: str, vehicle: str, stream: str, news: Callable[[], News]) -> None:
        """Some news is there to be made."""
        self.waiting.append(news)

    def ask_aircraft(self, fleet: str, vehicle: str) -> None:
        """Nobody is there to be asked."""


class Checkpoints:
    """Encodes every so-manieth state and reads it again."""

    def __init__(self) -> None:
        self.kept = 0
        self.waiting: deque[SavedVehicle] = deque(maxlen=10)

    def load(self) -> Sequence[SavedVehicle]:
        """None: the fleet is new."""
        return ()

    def has_room(self) -> bool:
        """Whether another is taken."""
        return True

    def keep(self, saved: SavedVehicle, urgent: bool) -> None:
        """Take one over."""
        self.kept += 1
        self.waiting.append(saved)

    def count(self, what: str, text: str = "") -> None:
        """Nothing is counted here."""

    def check(self) -> None:
        """Encode one of those that wait."""
        if self.waiting:
            saved = self.waiting.pop()
            again = decode_checkpoint(encode_checkpoint(Checkpoint(0.0, saved))).saved
            if (again.fleet, again.vehicle) != (saved.fleet, saved.vehicle):
                raise AssertionError("a checkpoint came back as another vehicle's")
        self.waiting.clear()


def flights(seconds: float, seed: int) -> list[SampleBlock]:
    """Doublets in light turbulence, a flight a sound vehicle and two for the others."""
    aircraft = load_aircraft("aerosonde")
    manoeuvre = doublet_schedule(aircraft, Scenario(aircraft).condition)
    scenarios = [Scenario(aircraft, manoeuvres=(manoeuvre,), seed=seed + i) for i in range(SOUND)]
    values = FleetSimulation(scenarios, RATE_HZ).step(round(seconds * RATE_HZ))
    return [SampleBlock(values[i]) for i in range(SOUND)]


def sound_messages(flown: Sequence[SampleBlock]) -> list[Sent]:
    """All messages of the sound vehicles in their order."""
    announced = encode_aircraft(AircraftMessage(aircraft="aerosonde"))
    sent = [
        Sent(vehicle_key("default", f"sound-{i}", "aircraft"), announced, PROTOBUF, "sound")
        for i in range(len(flown))
    ]
    for number, k in enumerate(range(0, len(flown[0]) - SAMPLES + 1, SAMPLES)):
        for i, flight in enumerate(flown):
            encoding = (PROTOBUF, JSON)[i % 2]
            block = SampleBlock(flight.values[k : k + SAMPLES])
            payload = encode_sensors(number, block, encoding, flight.present)
            sent.append(Sent(vehicle_key("default", f"sound-{i}", "sensors"), payload, encoding, "sound"))
    return sent


def victims(flown: Sequence[SampleBlock]) -> list[Victim]:
    """Vehicles of several types, all of which fly the sound ones' flights."""
    types = itertools.cycle(("aerosonde", LAGGING, "aerosonde", "ultrastick25e"))
    return [
        Victim(f"victim-{i}", next(types), flown[i % len(flown)], stream=(None, 17)[i % 2])
        for i in range(VICTIMS)
    ]


def mixed(sound: Sequence[Sent], fuzzer: Fuzzer, messages: int) -> Iterator[Sent]:
    """As many messages of the fuzzer, the sound ones evenly between."""
    given = 0
    for k in range(messages):
        while given < len(sound) and given * messages <= k * len(sound):
            yield sound[given]
            given += 1
        yield fuzzer.message()
    yield from sound[given:]


def resident_bytes() -> int:
    """Memory of this process."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def inbound(sent: Sent, course: Course) -> InboundMessage | None:
    """A message as the subscriber hands it over; None under a key that is none."""
    course.kinds[sent.change] += 1
    try:
        key = parse_key(sent.key)
    except KeyNameError:
        course.bad_keys += 1
        return None
    course.handed_over += 1
    return InboundMessage(
        key.fleet, key.vehicle, key.leaf, sent.payload[:65_537], sent.encoding, time.monotonic()
    )


def hand_over(fleet: FleetMonitor, messages: Sequence[InboundMessage], change: str, course: Course) -> None:
    """One call, and those that take in what it left; each of them is timed."""
    waiting: Sequence[InboundMessage] = messages
    times = course.alone_s if len(messages) == 1 else course.gathered_s
    while True:
        begin_s, wall_s = time.thread_time(), time.perf_counter()
        try:
            fleet.receive_all(waiting)
        except Exception as error:
            course.escape(error)
        took_s = time.thread_time() - begin_s
        times.add(took_s)
        course.wall_s = max(course.wall_s, time.perf_counter() - wall_s)
        course.slowest[change] = max(course.slowest.get(change, 0.0), took_s)
        if not fleet.behind:
            return
        waiting = ()


def run(fleet: FleetMonitor, stream: Iterator[Sent], total: int, rng: random.Random, outputs: Outputs,
        checkpoints: Checkpoints, say: Callable[[str], None]) -> Course:  # fmt: skip
    """Everything handed over, with what the service does between."""
    course = Course()
    gathered: list[InboundMessage] = []
    wanted = 1
    for number, sent in enumerate(stream, 1):
        message = inbound(sent, course)
        if message is not None:
            gathered.append(message)
        if len(gathered) >= wanted:
            hand_over(fleet, gathered, sent.change if wanted == 1 else "gathered", course)
            gathered, wanted = [], rng.choice((1,) * 60 + (2, 8, GATHERED))
        _between(fleet, number, course, outputs, checkpoints)
        if number % max(total // READINGS, 1) == 0:
            course.resident.append(resident_bytes())
            say(f"{number} messages, {course.resident[-1] / 2**20:.0f} MB")
    if gathered:
        hand_over(fleet, gathered, "gathered", course)
    course.resident.append(resident_bytes())
    return course


def _between(
    fleet: FleetMonitor, number: int, course: Course, outputs: Outputs, checkpoints: Checkpoints
) -> None:
    """What others do: the tick, news, checkpoints."""
    try:
        if number % EVERY_TICK == 0:
            begin_s = time.thread_time()
            fleet.tick()
            course.tick_s = max(course.tick_s, time.thread_time() - begin_s)
        if number % EVERY_NEWS == 0 and outputs.waiting:
            encode_json(outputs.waiting.pop()())
            outputs.waiting.clear()
        if number % EVERY_CHECKPOINT == 0:
            checkpoints.check()
    except Exception as error:
        course.escape(error)


def _where(error: Exception) -> str:
    """An exception and the innermost places that it came from."""
    places = traceback.extract_tb(error.__traceback__)[-3:]
    return f"{type(error).__name__}: {error} ({', '.join(f'{Path(p.filename).name}:{p.lineno}' for p in places)})"


def misfit_of_counts(fleet: FleetMonitor, course: Course) -> str:
    """Empty where every message handed over is counted once, by what became of it."""
    intake = dict(fleet.intake)
    received = intake.pop("received")
    if received != course.handed_over or sum(intake.values()) != received:
        return f"{course.handed_over} handed over, {received} received, {sum(intake.values())} by what became of them"
    return ""


def asked(fleet: FleetMonitor) -> Counter[str]:
    """Answers of REST about everything, by status."""
    app = create_app(fleet, dict, None, "fuzz")
    paths = ["/v1/status", "/v1/vehicles", "/v1/alerts?limit=1000", "/health/live", "/openapi.json"]
    for name in (*(f"sound-{i}" for i in range(SOUND)), *(f"victim-{i}" for i in range(VICTIMS)), "x1"):
        paths.append(f"/v1/vehicles/{name}")
        paths += [f"/v1/vehicles/{name}/derivatives?convention={c}" for c in CONVENTIONS]
    found: Counter[str] = Counter()

    async def ask() -> None:
        transport = httpx.ASGITransport(app, raise_app_exceptions=False)
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1") as client:
            for path in paths:
                reply = await client.get(path)
                reply.json()
                found[f"{reply.status_code // 100}xx"] += 1
                if reply.status_code >= 500:
                    found[path] += 1

    asyncio.run(ask())
    return found


def derivatives(fleet: FleetMonitor) -> Mapping[str, bytes]:
    """Everything said of the sound vehicles' derivatives."""
    return {f"sound-{i}": encode_json(fleet.derivatives("default", f"sound-{i}")) for i in range(SOUND)}


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a run showed.

    Attributes:
        problems: what must not be, one sentence each.
    """

    course: Course
    intake: Mapping[str, int]
    faults: Mapping[str, int]
    answers: Counter[str]
    alerts: int
    problems: tuple[str, ...]


def fuzz(
    messages: int, seed: int, seconds: float, dear: float = 0.3, say: Callable[[str], None] = lambda _: None,
    until_s: float = float("inf"),
) -> Outcome:  # fmt: skip
    """The whole of it; see the module's text. It ends before the last message at ``until_s`` of the monotonic clock."""
    rng = random.Random(seed)
    flown = flights(seconds, seed)
    sound = sound_messages(flown)
    outputs, checkpoints = Outputs(), Checkpoints()
    ids = itertools.count(1)
    with ExitStack() as stack:
        preparing = stack.enter_context(ThreadPoolExecutor(1))
        fleet = FleetMonitor(
            find,
            time.monotonic,
            lambda: f"a{next(ids)}",
            FleetPorts(outputs=outputs, checkpoints=checkpoints),
            FleetSettings(max_vehicles=PLACES, stale_s=SILENCE_S),
        )
        fleet.prepare_with(preparing)
        warm_up(sound)
        gc.collect()
        gc.freeze()  # as the service does once its kernels are there
        stream = mixed(sound, Fuzzer(rng, victims(flown), dear), messages)
        stream = itertools.takewhile(lambda _: time.monotonic() < until_s, stream)
        course = run(fleet, stream, messages + len(sound), rng, outputs, checkpoints, say)
        finish(fleet)
    alone = FleetMonitor(find, time.monotonic, lambda: "alone")
    for sent in sound[: course.kinds["sound"]]:
        key = parse_key(sent.key)
        alone.receive(key.fleet, key.vehicle, key.leaf, sent.payload, sent.encoding)
    finish(alone)
    answers = asked(fleet)
    problems = [f"{course.escapes} exceptions came out, the first: {text}" for text in course.escaped]
    if misfit := misfit_of_counts(fleet, course):
        problems.append(f"the counts do not add up: {misfit}")
    if derivatives(fleet) != derivatives(alone):
        problems.append("the sound vehicles' derivatives are not those of a run without the fuzzer")
    if answers["5xx"]:
        problems.append(f"REST answered 5xx: {dict(answers)}")
    faults = {
        name: times for name, times in fleet.problems.items() if name in ("faults", "store", "checkpoint")
    }
    if faults:
        texts = sorted({f"{v.vehicle}: {v.reason}" for v in fleet.vehicles() if "faults" in v.counts})
        problems.append(f"the program failed: {faults}; {'; '.join(texts[:6])}")
    return Outcome(course, dict(fleet.intake), faults, answers, len(fleet.alerts()), tuple(problems))


def warm_up(sound: Sequence[Sent]) -> None:
    """Kernels are loaded at a machine's first samples; that is no message's time."""
    fleet = FleetMonitor(find, time.monotonic, lambda: "warm")
    for sent in sound[: 60 * SOUND]:
        key = parse_key(sent.key)
        fleet.receive(key.fleet, key.vehicle, key.leaf, sent.payload, sent.encoding)


def finish(fleet: FleetMonitor) -> None:
    """Take in what still waits, for at most a minute."""
    until_s = time.monotonic() + 60.0
    while time.monotonic() < until_s and (fleet.behind or fleet.held):
        fleet.receive_all(())
        fleet.tick()


def main() -> int:
    parser = argparse.ArgumentParser(description="A fuzzer that knows both formats against the live fleet.")
    parser.add_argument("--messages", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--flight", type=float, default=200.0, help="seconds that the sound vehicles fly")
    parser.add_argument(
        "--minutes", type=float, default=float("inf"), help="the run ends after so long at most"
    )
    chosen = parser.parse_args()
    begin_s = time.monotonic()
    outcome = fuzz(
        chosen.messages,
        chosen.seed,
        chosen.flight,
        say=lambda text: print(f"  {text}", file=sys.stderr),
        until_s=begin_s + 60.0 * chosen.minutes,
    )
    course, middle = outcome.course, len(outcome.course.resident) // 2
    print(f"{sum(course.kinds.values())} messages, seed {chosen.seed}, {time.monotonic() - begin_s:.0f} s")
    for name, times in (("alone", course.alone_s), (f"up to {GATHERED} at once", course.gathered_s)):
        print(
            f"  {name:<18}{len(times):>9} calls, processor ms: median {1000 * times.quantile_s(0.5):.3f}, "
            f"99.9 % {1000 * times.quantile_s(0.999):.1f}, longest {1000 * times.longest_s:.1f}; "
            f"over {1000 * LIMIT_S:.0f} ms: {times.over}"
        )
    print(
        f"  longest call by the wall clock {1000 * course.wall_s:.0f} ms, "
        f"longest tick {1000 * course.tick_s:.1f} ms of processor"
    )
    half, end = course.resident[middle] / 2**20, course.resident[-1] / 2**20
    print(f"  resident memory {half:.1f} MB half-way, {end:.1f} MB at the end ({end - half:+.1f} MB)")
    tenths = [f"{reading / 2**20:.0f}" for reading in course.resident[:: max(READINGS // 10, 1)]]
    print(f"  resident memory by tenths of the run, MB: {' '.join(tenths)}")
    became = ", ".join(f"{k} {n}" for k, n in sorted(outcome.intake.items()))
    print(f"  what became of them: bad_key {course.bad_keys}, {became}")
    print(f"  alerts of attacked vehicles {outcome.alerts}; REST {dict(outcome.answers)}")
    slowest = sorted(course.slowest.items(), key=lambda item: -item[1])[:6]
    print("  longest by change, ms: " + ", ".join(f"{k} {1000 * s:.1f}" for k, s in slowest))
    print("\n".join(f"  PROBLEM {text}" for text in outcome.problems) or "  no problem found")
    return 1 if outcome.problems else 0


if __name__ == "__main__":
    run_benchmark(main)
