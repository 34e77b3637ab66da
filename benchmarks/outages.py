"""A database that is stopped, frozen, restarted, locked or out of space, while three vehicles fly in real time.

The service runs in a process of its own as ``wingwatch serve`` runs it. For as long as an outage lasts alerts are
raised and acted on. Of each case it is said how long messages were inside the service, from their arrival to the state
that rests on them, during the outage and for as long before it; after how long the service said what is wrong, and
after the outage's end that all is well; and whether the database has, in the end, what was announced and answered.

Cases need what they are made of: those of PostgreSQL an installed server, those of a full disk a tmpfs that root may
mount; ``write-refused`` and ``sqlite-locked`` need nothing. What cannot be run is said.

Run: python benchmarks/outages.py [--cases sqlite-locked ...] [--seconds 60]
"""

import argparse
import os
import resource
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

import numpy as np
import zenoh
from loopback import free_endpoint
from postgres_cluster import PostgresCluster, find_programs
from saving import run_benchmark
from service_child import ServiceChild, own_process
from service_process import RATE_HZ, SAMPLES, Flights, RestClient, prepare_kernels, wait_until

from wingwatch.baselines import AlertRecord, open_database
from wingwatch.service.settings import ServeSettings
from wingwatch.simulation import demo_fleet
from wingwatch.telemetry import JSON, ZenohSettings, decode_service_object, open_session

PATIENCE_S = 90.0
EVERY_S = 4.0
"""Between two alerts that are raised, and two actions, in an outage."""
TMPFS_MIB, POSTGRES_MIB = 48, 160


@dataclass(frozen=True, slots=True)
class Place:
    """Where a case keeps its data, and what goes wrong there.

    Attributes:
        folder: of the service's data.
        database: a path or URL; None for the file in ``folder``.
        outage: begins when it is entered and is over when it is left; given the service's process id.
    """

    folder: Path
    database: str | None
    outage: Callable[[int], AbstractContextManager[None]]


@dataclass
class Course:
    """What was found in one case; times in s.

    Attributes:
        before_s, during_s: of each message, from its arrival to the state that rests on it.
        said_s: until the service said what is wrong; said: its words.
        healed_s: from the end of the outage until nothing is wrong and all that was raised is there.
        announced: alerts as received over Zenoh, by id; raised: how many; acted: notes of answered actions, by
            alert; refused: alerts whose action was answered with 503.
        wrong: what was announced or answered and is not in the database, or was refused and is.
    """

    before_s: list[float] = field(default_factory=list)
    during_s: list[float] = field(default_factory=list)
    said_s: float = float("inf")
    said: str = ""
    healed_s: float = float("inf")
    raised: int = 0
    announced: dict[str, tuple[str, ...]] = field(default_factory=dict)
    acted: dict[str, str] = field(default_factory=dict)
    refused: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)


class Fleet:
    """Three vehicles in real time, in a thread; use it in a ``with`` statement."""

    def __init__(self, endpoint: str) -> None:
        self._endpoint, self._end = endpoint, threading.Event()
        self._thread = threading.Thread(target=self._fly, name="flights", daemon=True)

    def __enter__(self) -> "Fleet":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()

    def _fly(self) -> None:
        flights = Flights(demo_fleet(), 1)
        with open_session(ZenohSettings.for_vehicle((self._endpoint,))) as session:
            flights.announce(session)
            due_s = time.monotonic()
            while not self._end.wait(max(0.0, due_s - time.monotonic())):
                flights.send(session)
                due_s += SAMPLES / RATE_HZ


@contextmanager
def listening(endpoint: str, announced: dict[str, tuple[str, ...]]) -> Iterator[None]:
    """Keep the notes of every alert that is announced over Zenoh."""

    def heard(sample: zenoh.Sample) -> None:
        alert = decode_service_object("alerts", sample.payload.to_bytes(), JSON)
        announced[alert["id"]] = tuple(alert["notes"])

    with open_session(ZenohSettings.for_vehicle((endpoint,))) as session:
        subscriber = session.declare_subscriber("wingwatch/v1/*/*/alerts", heard)
        try:
            yield
        finally:
            subscriber.undeclare()  # type: ignore[no-untyped-call]


class Operator(RestClient):
    """What a person sees and does."""

    def problem(self) -> str | None:
        """What the readiness says is wrong, None where nothing is."""
        checks: Mapping[str, str | None] = self.http.get("/health/ready").json()["checks"]
        wrong = {part: text for part, text in checks.items() if text is not None}
        return "; ".join(f"{part}: {text}" for part, text in wrong.items()) or None

    def acknowledge(self, alert: str, course: Course) -> None:
        """Acknowledge an alert, and note what was answered."""
        answer = self.http.post(f"/v1/alerts/{alert}/acknowledge", json={"who": "ann"})
        if answer.status_code == 200:
            course.acted[alert] = "ann: acknowledge"
        elif answer.status_code == 503:
            course.refused.append(alert)
        else:
            course.wrong.append(f"{alert} was answered with {answer.status_code}")

    def shows(self, alerts: set[str]) -> bool:
        """Whether all of them are shown."""
        return alerts <= {alert["id"] for alert in self.items("/v1/alerts?limit=500")}


def run(place: Place, seconds: float) -> Course:
    """One case: some flight, the outage, and what is left of it."""
    course, endpoint = Course(), free_endpoint()
    settings = ServeSettings(port=0, listen=(endpoint,), data=place.folder, database=place.database)
    prepared = [f"p{k}" for k in range(round(seconds / EVERY_S) + 1)]
    with (
        own_process(settings) as service,
        listening(endpoint, course.announced),
        Fleet(endpoint),
    ):
        client = Operator(service.port)
        for name in prepared:
            service.raise_alert(name)
        wait_until(lambda: client.shows(set(prepared)) and client.problem() is None, PATIENCE_S)
        time.sleep(3.0)  # the vehicles' monitors are made
        service.look()
        time.sleep(seconds)
        course.before_s = service.look().inside_s
        with place.outage(service.pid):
            disturb(client, service, course, prepared, seconds)
            course.during_s = service.look().inside_s
        raised = {f"r{k}" for k in range(course.raised)}
        course.healed_s = wait_until(
            lambda: client.problem() is None and client.shows(raised | set(prepared)), PATIENCE_S
        )
        for name in course.refused.copy():
            course.refused.remove(name)
            client.acknowledge(name, course)
        course.wrong += [f"{name} was refused after the outage" for name in course.refused]
        time.sleep(1.0)
    missing(settings, course)
    return course


def disturb(
    client: Operator, service: ServiceChild, course: Course, prepared: list[str], seconds: float
) -> None:
    """In the outage: raise alerts, act, and wait for the service to say what is wrong."""
    begin_s = time.monotonic()
    waiting, due_s = iter(prepared), begin_s
    while time.monotonic() < begin_s + seconds:
        if time.monotonic() >= due_s:
            service.raise_alert(f"r{course.raised}")
            course.raised += 1
            due_s += EVERY_S
            if (name := next(waiting, None)) is not None:
                client.acknowledge(name, course)
        if not course.said and (problem := client.problem()) is not None:
            course.said_s, course.said = time.monotonic() - begin_s, problem
        time.sleep(0.1)


def missing(settings: ServeSettings, course: Course) -> None:
    """What the database lacks of what was announced and answered."""
    with open_database(settings.where) as database:
        kept: dict[str, AlertRecord] = {a.id: a for a in database.alerts(limit=1000).items}
    for name, notes in course.announced.items():
        if name not in kept or not set(notes) <= set(kept[name].note):
            course.wrong.append(f"{name} was announced and is not kept")
    course.wrong += [
        f"{name} was raised and is not kept" for k in range(course.raised) if (name := f"r{k}") not in kept
    ]
    for name, note in course.acted.items():
        found = kept[name].note if name in kept else ()
        if found.count(note) != 1:
            course.wrong.append(f"{name} was acted on, and the database has {found}")


# -- what goes wrong -----------------------------------------------------------------------------------


class Unavailable(Exception):
    """A case that cannot be run here; one clause."""


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Another program holds SQLite's write lock."""
    other = sqlite3.connect(path, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    try:
        yield
    finally:
        other.execute("ROLLBACK")
        other.close()


@contextmanager
def write_refused(pid: int) -> Iterator[None]:
    """No file of the process can grow, as where its quota is used up."""
    soft, hard = resource.prlimit(pid, resource.RLIMIT_FSIZE)
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (0, hard))
    try:
        yield
    finally:
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (soft, hard))


@contextmanager
def full(folder: Path) -> Iterator[None]:
    """The disk of a folder has not a byte left."""
    filler = folder / "filler"
    with filler.open("wb", buffering=0) as file:
        for size in (2**20, 4096, 1):
            with suppress(OSError):
                for _ in count():
                    file.write(b"\0" * size)
    try:
        yield
    finally:
        filler.unlink()


@contextmanager
def tmpfs(folder: Path, mib: int) -> Iterator[Path]:
    """A small disk.

    Raises:
        Unavailable: it cannot be mounted.
    """
    folder.mkdir()
    command = ("mount", "-t", "tmpfs", "-o", f"size={mib}m", "tmpfs", str(folder))
    if os.geteuid() or subprocess.run(command, check=False, capture_output=True).returncode:
        raise Unavailable("a tmpfs cannot be mounted")
    try:
        yield folder
    finally:
        subprocess.run(("umount", "-l", str(folder)), check=False)


def own_postgres(stack: ExitStack, folder: Path, small: bool) -> tuple[PostgresCluster, Path]:
    """A server, and the folder of its tables."""
    if find_programs() is None:
        raise Unavailable("no PostgreSQL server is installed")
    home, data = folder / "server", folder / "tables"
    home.mkdir()
    if small:
        stack.enter_context(tmpfs(data, POSTGRES_MIB))
    else:
        data.mkdir()
    folder.chmod(0o755)
    return stack.enter_context(PostgresCluster(home, data)), data


def place(case: str, stack: ExitStack) -> Place:
    """Where a case is run.

    Raises:
        Unavailable: it cannot be run here.
    """
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
    home = folder / "data"
    if case.startswith("postgres"):
        server, tables = own_postgres(stack, folder, case == "postgres-full")

        @contextmanager
        def restarted(_: int) -> Iterator[None]:
            server.stop()
            server.start()
            yield

        outages: dict[str, Callable[[int], AbstractContextManager[None]]] = {
            "postgres-stopped": lambda _: server.stopped(),
            "postgres-frozen": lambda _: server.frozen(),
            "postgres-restarted": restarted,
            "postgres-full": lambda _: full(tables),
        }
        return Place(home, server.url, outages[case])
    if case == "sqlite-locked":
        return Place(home, None, lambda _: locked(home / "wingwatch.db"))
    if case == "write-refused":
        return Place(home, None, write_refused)
    disk = stack.enter_context(tmpfs(home, TMPFS_MIB))
    return Place(disk, None, lambda _: full(disk))


CASES = (
    "sqlite-locked", "write-refused", "disk-full", "postgres-stopped", "postgres-frozen", "postgres-restarted",
    "postgres-full",
)  # fmt: skip


def show(case: str, course: Course) -> None:
    """Print what was found."""

    def times(values_s: list[float]) -> str:
        if not values_s:
            return f"{'-':>8}{'-':>8}{'-':>8}"
        p50, p99 = np.percentile(values_s, [50.0, 99.0])
        return "".join(f"{1e3 * s:8.0f}" for s in (p50, p99, max(values_s)))

    print(
        f"{case:<20}{times(course.before_s)}{times(course.during_s)}{course.said_s:8.1f}{course.healed_s:8.1f}"
        f"{course.raised:8d}{len(course.acted):9d}{len(course.wrong):7d}"
    )
    print(f"    {course.said or 'nothing was said'}", flush=True)
    for text in course.wrong:
        print(f"    WRONG: {text}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description="The service while its database or disk does not work.")
    parser.add_argument(
        "--cases", nargs="+", choices=CASES, default=CASES, metavar="CASE", help=", ".join(CASES)
    )
    parser.add_argument("--seconds", type=float, default=60.0, help="of an outage, 2 to 600")
    arguments = parser.parse_args()
    if not 2.0 <= arguments.seconds <= 600.0:
        parser.error(f"--seconds is {arguments.seconds}; give 2 to 600")
    prepare_kernels()
    print(f"3 vehicles at {RATE_HZ:g} Hz in real time; outages of {arguments.seconds:g} s")
    print(f"{'':<20}{'inside before, ms':>24}{'inside during, ms':>24}{'said':>8}{'healed':>8}{'alerts':>8}")
    heading = "".join(f"{name:>8}" for name in ("p50", "p99", "largest") * 2)
    print(f"{'':<20}{heading}{'after, s':>8}{'after, s':>9}{'raised':>7}{'actions':>9}{'wrong':>7}")
    failed = False
    for case in arguments.cases:
        with ExitStack() as stack:
            try:
                course = run(place(case, stack), arguments.seconds)
            except Unavailable as error:
                print(f"{case:<20} not run: {error}")
                continue
        show(case, course)
        failed |= bool(course.wrong) or not np.isfinite(course.healed_s)
    sys.exit(failed)


if __name__ == "__main__":
    run_benchmark(main)
