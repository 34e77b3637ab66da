"""Parts of the service on their own: the ingest, the outputs, the display."""

import io
import threading
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any, cast

import pytest
import zenoh
from rich.console import Console

from wingwatch.api import KernelsView
from wingwatch.cli.fleet_display import FleetLines, fleet_table
from wingwatch.monitor import (
    AlertState,
    AlertView,
    CouldSeeView,
    EvidenceView,
    FleetMonitor,
    MonitorPort,
    ProposedInputView,
    VehicleState,
    VehicleView,
    WorstDerivative,
)
from wingwatch.service.kernels import KernelError
from wingwatch.service.outputs import ZenohOutputs
from wingwatch.service.service import IngestLoop
from wingwatch.telemetry import InboundMessage, SensorSubscriber, decode_service_object

PATIENCE_S = 60.0
ALERT = AlertView(
    id="a1", fleet="default", vehicle="uav1", kind="icing", cause="icing", level="warning",
    state=AlertState.ACTIVE, raised_s=80.5, cleared_s=None, size=0.1, size_standard_error=0.02, probability=0.97,
    basis="a-priori", text="Icing [of a kind].", evidence=(EvidenceView("z_w", -3.5, 0.1, -4.4, 0.2, 4.0),),
)  # fmt: skip
VEHICLE = VehicleView(
    fleet="default", vehicle="uav1", aircraft="aerosonde", configuration="clean", state=VehicleState.HEALTHY,
    state_since_s=1.0, reason="no change", last_sample_time_s=12.5, basis="a-priori", basis_text="...",
    worst=WorstDerivative("ekf", "short_period", "m_w", -2.25), counts={}, active_alerts=(), condition={},
)  # fmt: skip


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.005)


class Queue:
    """A subscriber's queue, filled by hand."""

    def __init__(self) -> None:
        self.messages: list[InboundMessage] = []

    def ages(self) -> Mapping[tuple[str, str], float]:
        return {("default", message.vehicle): 1.0 for message in self.messages}

    def drain(self, max_items: int, full: Collection[tuple[str, str]] = ()) -> list[InboundMessage]:
        waits = [(one.fleet, one.vehicle) in full for one in self.messages]
        taken = [one for one, stays in zip(self.messages, waits, strict=True) if not stays][:max_items]
        self.messages = [one for one in self.messages if one not in taken]
        return taken


class Recorder:
    """A monitor that notes what it gets, and fails on one vehicle."""

    def __init__(self) -> None:
        self.got: list[str] = []
        self.ticks = 0
        self.behind = False
        self.full: frozenset[tuple[str, str]] = frozenset()
        self.lags_s: Mapping[tuple[str, str], float] = {}

    def receive_all(self, messages: Sequence[InboundMessage]) -> None:
        for message in messages:
            if message.vehicle == "bad":
                raise ZeroDivisionError("a fault of the program")
            self.got.append(message.vehicle)

    def relieve(self, lags_s: Mapping[tuple[str, str], float]) -> None:
        self.lags_s = lags_s

    def tick(self) -> None:
        self.ticks += 1


class Prepared:
    """A preparation that is over at once, or fails, or ends on request."""

    def __init__(self, fault: Exception | None = None, held: bool = False) -> None:
        self._fault, self._held = fault, held
        self._asked_to_end = threading.Event()

    def prepare(self) -> bool:
        if self._fault is not None:
            raise self._fault
        return not (self._held and self._asked_to_end.wait(PATIENCE_S))

    def view(self) -> KernelsView:
        return KernelsView("Kernels are compiled for a test.", [], 1.0, None)

    def stop(self) -> None:
        self._asked_to_end.set()


def ingest_over(
    queue: Queue, monitor: Recorder, preparation: Prepared | None = None
) -> tuple[IngestLoop, threading.Event]:
    arrived = threading.Event()
    subscriber, fleet = cast(SensorSubscriber, queue), cast(FleetMonitor, monitor)
    return IngestLoop(subscriber, fleet, arrived, preparation or Prepared()), arrived


def message(vehicle: str) -> InboundMessage:
    return InboundMessage("default", vehicle, "sensors", b"", "", 0.0)


def test_a_fault_over_one_vehicle_does_not_end_the_watch_over_others() -> None:
    queue, monitor = Queue(), Recorder()
    ingest, arrived = ingest_over(queue, monitor)
    ingest.start()
    queue.messages = [message("a"), message("bad")]
    arrived.set()
    until(lambda: ingest.faults == 1)
    queue.messages = [message("b")]
    arrived.set()
    until(lambda: monitor.got == ["a", "b"])
    assert ingest.faults == 1
    until(lambda: ingest.in_hand_s == 0.0)
    assert sum(ingest.delays.view().counts) == 3
    assert ingest.problem is None
    assert monitor.ticks >= 1
    ingest.stop()
    assert not ingest.loop.alive
    assert ingest.problem is not None


def test_of_a_vehicle_that_has_enough_nothing_is_taken_and_how_long_it_waits_is_told() -> None:
    queue, monitor = Queue(), Recorder()
    monitor.full = frozenset({("default", "busy")})
    ingest, arrived = ingest_over(queue, monitor)
    queue.messages = [message("busy"), message("a")]
    ingest.start()
    arrived.set()
    until(lambda: monitor.got == ["a"])
    until(lambda: ("default", "busy") in monitor.lags_s)
    assert monitor.got == ["a"]
    monitor.full = frozenset()
    until(lambda: monitor.got == ["a", "busy"])
    ingest.stop()
    assert queue.messages == []


@pytest.mark.parametrize(
    "fault", [KernelError("They cannot be compiled: no space left"), OSError("no space left")]
)
def test_kernels_that_cannot_be_compiled_are_told(caplog: pytest.LogCaptureFixture, fault: Exception) -> None:
    ingest, _ = ingest_over(Queue(), Recorder(), Prepared(fault))
    assert ingest.problem == "Kernels are compiled for a test."
    ingest.start()
    until(lambda: not ingest.loop.alive)
    assert ingest.problem is not None
    assert ingest.problem.endswith("no space left.")
    assert not ingest.wait(0.0)
    traces = [record.exc_info is not None for record in caplog.records]
    assert traces == [isinstance(fault, OSError)]  # a sentence needs no trace


def test_an_end_during_the_preparation_is_at_once_and_no_fault(caplog: pytest.LogCaptureFixture) -> None:
    queue, monitor = Queue(), Recorder()
    ingest, arrived = ingest_over(queue, monitor, Prepared(held=True))
    ingest.start()
    queue.messages = [message("a")]
    arrived.set()
    assert not ingest.wait(0.1)
    assert monitor.got == []
    ingest.stop()
    assert not ingest.loop.alive
    assert caplog.records == []


class Session:
    """A Zenoh session that keeps what is put; it can be held as a congested link would hold it."""

    def __init__(self, listened: bool = True) -> None:
        self.listened = listened
        self.open = threading.Event()
        self.open.set()
        self.put_: list[tuple[str, bytes, Mapping[str, Any]]] = []

    def declare_publisher(self, key: str) -> Any:
        return SimpleNamespace(matching_status=SimpleNamespace(matching=self.listened))

    def put(self, key: str, payload: bytes, **options: Any) -> None:
        self.open.wait(PATIENCE_S)
        self.put_.append((key, payload, options))


def leaf(key: str) -> str:
    return key.rsplit("/", 1)[1]


def test_of_derivatives_and_status_the_newest_goes_out_of_alerts_each() -> None:
    session = Session()
    with ZenohOutputs(cast(zenoh.Session, session)) as outputs:
        session.open.clear()
        outputs.announce("default", "uav0", "status", lambda: replace(VEHICLE, vehicle="uav0"))
        until(lambda: not outputs._latest)  # the thread now hangs on the congested link
        began = time.monotonic()
        for k in range(50):
            current = {"time_s": float(k), "estimators": {}}
            status, alert = replace(VEHICLE, last_sample_time_s=float(k)), replace(ALERT, raised_s=float(k))
            outputs.announce("default", "uav1", "derivatives", partial(dict, current))
            outputs.announce("default", "uav1", "status", partial(replace, status))
            outputs.announce("default", "uav1", "alerts", partial(replace, alert))
        assert time.monotonic() - began < 1.0  # nobody who announces waits for the link
        session.open.set()
        until(lambda: len(session.put_) == 1 + 50 + 2)
    sent = session.put_[1:]
    assert [leaf(key) for key, _, _ in sent] == ["alerts"] * 50 + ["derivatives", "status"]
    raised = [decode_service_object("alerts", p, "application/json")["raised_s"] for _, p, _ in sent[:50]]
    assert raised == [float(k) for k in range(50)]
    derivatives = decode_service_object("derivatives", sent[50][1], "application/json")
    assert (derivatives["time_s"], derivatives["vehicle"], derivatives["convention"]) == (
        49.0,
        "uav1",
        "concise",
    )
    assert decode_service_object("status", sent[51][1], "application/json")["last_sample_time_s"] == 49.0
    controls = {leaf(key): options["congestion_control"] for key, _, options in sent}
    assert controls["alerts"] == zenoh.CongestionControl.BLOCK
    assert controls["derivatives"] == controls["status"] == zenoh.CongestionControl.DROP


def test_a_status_has_the_rows_of_could_see_where_they_have_changed_and_answers_to_queries_always() -> None:
    rows = (CouldSeeView("icing", None, 0.05, ""),), (CouldSeeView("icing", None, 0.04, ""),)
    seen = [rows[0], rows[0], rows[1], rows[1]]
    session = Session()
    with ZenohOutputs(cast(zenoh.Session, session)) as outputs:
        for k, could_see in enumerate(seen):
            view = replace(VEHICLE, could_see=could_see, last_sample_time_s=float(k))
            outputs.announce("default", "uav1", "status", partial(replace, view))
            until(lambda k=k: len(session.put_) == k + 1)  # type: ignore[misc]
        outputs.announce("default", "uav2", "status", lambda: replace(VEHICLE, could_see=rows[1]))
        until(lambda: len(session.put_) == 5)
        whole = replace(VEHICLE, could_see=rows[1])
        outputs._monitor = cast(
            MonitorPort, SimpleNamespace(vehicles=lambda: [VEHICLE], vehicle=lambda *_: whole, alerts=list)
        )
        answers = list(outputs._documents(zenoh.KeyExpr("wingwatch/v1/*/*/status")))
    sent = [decode_service_object("status", payload, "application/json") for _, payload, _ in session.put_]
    assert [len(one.get("could_see", ())) for one in sent] == [1, 0, 1, 0, 1]
    assert "could_see" not in sent[1]
    assert [len(document["could_see"]) for _, _, document in answers] == [1]


def test_a_proposed_input_goes_out_under_its_own_key_and_is_answered_while_it_is_valid() -> None:
    proposal = ProposedInputView(
        "p1", "rudder_rad", "doublet", 0.035, 0.2, 0.4, ((0.0, 0.035), (0.2, -0.035), (0.4, 0.0)), "why", 60.0, 120.0
    )  # fmt: skip
    session = Session()
    with ZenohOutputs(cast(zenoh.Session, session)) as outputs:
        outputs.announce("default", "uav1", "proposals", lambda: proposal)
        until(lambda: bool(session.put_))
        views = [replace(VEHICLE, proposed_input=proposal), replace(VEHICLE, vehicle="uav2")]
        outputs._monitor = cast(MonitorPort, SimpleNamespace(vehicles=lambda: views, alerts=list))
        answers = list(outputs._documents(zenoh.KeyExpr("wingwatch/v1/*/*/proposals")))
    ((key, payload, _),) = session.put_
    assert key == "wingwatch/v1/default/uav1/proposals"
    sent = decode_service_object("proposals", payload, "application/json")
    assert (sent["vehicle"], sent["surface"], sent["valid_until_s"]) == ("uav1", "rudder_rad", 120.0)
    assert sent["steps"][1] == {"start_s": 0.2, "deflection_rad": -0.035}
    assert [(key, stream, document) for key, stream, document in answers] == [(key, "proposals", sent)]


def test_what_nobody_listens_to_is_not_made() -> None:
    session = Session(listened=False)

    def made() -> VehicleView:
        raise AssertionError("nobody asked")

    with ZenohOutputs(cast(zenoh.Session, session)) as outputs:
        outputs.announce("default", "uav1", "derivatives", made)
        outputs.announce("default", "uav1", "status", made)
        outputs.announce("default", "uav1", "alerts", lambda: ALERT)
        until(lambda: [leaf(key) for key, _, _ in session.put_] == ["alerts"])
    assert outputs.dropped["unsent"] == 0


def test_whether_anybody_listens_is_asked_now_and_then_and_who_comes_later_is_heard() -> None:
    asked = 0

    class Asked(Session):
        @property
        def matching_status(self) -> SimpleNamespace:
            nonlocal asked
            asked += 1
            return SimpleNamespace(matching=self.listened)

        def declare_publisher(self, key: str) -> Any:
            return self

    session = Asked(listened=False)
    with ZenohOutputs(cast(zenoh.Session, session)) as outputs:
        began_s = time.monotonic()
        for _ in range(1000):
            outputs.announce("default", "uav1", "status", lambda: VEHICLE)
        assert asked <= 1 + 10.0 * (time.monotonic() - began_s)  # ten times a second at most
        assert not session.put_
        session.listened = True

        def heard() -> bool:
            outputs.announce("default", "uav1", "status", lambda: VEHICLE)
            return bool(session.put_)

        until(heard)


def test_alerts_that_find_no_room_and_values_that_cannot_be_sent_are_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("wingwatch.service.outputs._MOST_ALERTS", 2)
    session = Session()
    outputs = ZenohOutputs(cast(zenoh.Session, session))  # its thread does not run yet
    for _ in range(5):
        outputs.announce("default", "uav1", "alerts", lambda: ALERT)
    outputs.announce("default", "NOT A NAME", "derivatives", lambda: {"estimators": {}})
    assert outputs.dropped["alerts"] == 3
    with outputs:
        until(lambda: len(session.put_) == 2 and outputs.dropped["unsent"] == 1)


def test_alerts_wait_for_a_link_that_is_lost() -> None:
    session, connected = Session(), threading.Event()
    with ZenohOutputs(cast(zenoh.Session, session), connected.is_set) as outputs:
        outputs.announce("default", "uav1", "alerts", lambda: ALERT)
        outputs.announce("default", "uav1", "status", lambda: VEHICLE)
        until(lambda: [leaf(key) for key, _, _ in session.put_] == ["status"])
        time.sleep(0.3)
        assert len(session.put_) == 1
        connected.set()
        until(lambda: [leaf(key) for key, _, _ in session.put_] == ["status", "alerts"])


class Shown:
    """A monitor port with what the display reads."""

    def __init__(self, vehicles: list[VehicleView], alerts: list[AlertView]) -> None:
        self._vehicles, self._alerts = vehicles, alerts

    def vehicles(self) -> list[VehicleView]:
        return self._vehicles

    def alerts(self) -> list[AlertView]:
        return self._alerts


def test_the_table_shows_state_basis_worst_and_alerts_as_they_are() -> None:
    strange = replace(VEHICLE, vehicle="uav2", state=VehicleState.NOT_OBSERVABLE, worst=None, basis=None)
    cleared = replace(ALERT, id="a0", state=AlertState.CLEARED, text="long gone")
    of_a_sensor = replace(
        ALERT,
        id="a9",
        kind="sensor",
        cause="sensor_bias",
        channel="pitch_rate_rad_s",
        text="Pitch rate.",
        evidence=(),
    )
    shown = cast(MonitorPort, Shown([strange, VEHICLE], [ALERT, of_a_sensor, cleared]))
    console = Console(file=io.StringIO(), width=140)
    console.print(fleet_table(shown, "wingwatch [demo]"))
    text = cast(io.StringIO, console.file).getvalue()
    for words in (
        "wingwatch [demo]",
        "uav1",
        "12 s",
        "healthy",
        "a-priori",
        "m_w z = -2.2 (ekf)",
        "not observable",
    ):
        assert words in text
    assert "warning: Icing [of a kind]." in text  # text of the monitor is no markup
    assert "warning: Pitch rate." in text
    assert "long gone" not in text
    assert text.index("uav1") < text.index("uav2")


def test_lines_tell_each_change_once() -> None:
    lines = FleetLines()
    before = cast(MonitorPort, Shown([VEHICLE], []))
    assert list(lines.changes(before)) == ["   12.5 s uav1: healthy (no change)"]
    assert list(lines.changes(before)) == []
    degraded = replace(VEHICLE, state=VehicleState.DEGRADED, reason="ice")
    after = cast(MonitorPort, Shown([degraded], [ALERT]))
    assert list(lines.changes(after)) == [
        "   12.5 s uav1: degraded (ice)",
        "   80.5 s uav1: warning icing alert active: Icing [of a kind].",
    ]
    of_a_sensor = replace(
        ALERT,
        id="a9",
        kind="sensor",
        cause="sensor_bias",
        channel="pitch_rate_rad_s",
        text="Pitch rate.",
        evidence=(),
    )
    renamed = replace(of_a_sensor, channel="pitch_rad", text="Pitch.")
    for alert in (of_a_sensor, renamed):
        (line,) = lines.changes(cast(MonitorPort, Shown([degraded], [alert, ALERT])))
        assert line == f"   80.5 s uav1: warning sensor alert active: {alert.text}"
    cleared = replace(ALERT, state=AlertState.CLEARED, cleared_s=99.0)
    (line,) = lines.changes(cast(MonitorPort, Shown([degraded], [cleared])))
    assert line.startswith("   99.0 s uav1: warning icing alert cleared")
