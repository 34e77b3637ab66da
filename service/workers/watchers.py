"""Who watches which vehicle, as workers have said: their views, events and counts, and what of those that end.

A worker that does not answer keeps its vehicles, shown as they were and ``unknown``. One that has ended leaves them
until another has them, for ten minutes at most; what it has counted does not fall.
"""

import threading
from collections import Counter
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace

from wingwatch.monitor import Event, FleetFigures, VehicleState, VehicleView
from wingwatch.monitor.fleet.kept_events import KeptEvents
from wingwatch.monitor.fleet.views import worst_first
from wingwatch.service.workers.link import PATIENCE_S
from wingwatch.service.workers.messages import NewsWanted, WorkerNews, WorkerState

__all__ = ["SILENT_S", "Key", "Place", "Watchers"]

Key = tuple[str, str]
"""Fleet and name of a vehicle."""

SILENT_S = PATIENCE_S
"""Without an answer for so long, a worker counts as silent."""
_WHOLE_S, _FRESH_S = 1.0, 0.5
_ORPHANED_S = 600.0
_MOST_EVENTS = 10_000
_NEVER = float("-inf")


@dataclass(slots=True)
class _Watcher:
    """A worker as it is known here.

    Attributes:
        answered_s: when it answered last, or was first seen; asked: whether a question is out; whole_s: when all was
            asked for last.
        start, newest: of its events; None before its first answer.
        views: its vehicles; viewed_s: when it has shown all of them last.
    """

    answered_s: float
    asked: bool = False
    whole_s: float = _NEVER
    start: str = ""
    newest: int | None = None
    state: WorkerState | None = None
    views: dict[Key, VehicleView] = field(default_factory=dict)
    viewed_s: float = _NEVER


@dataclass(frozen=True, slots=True)
class _Orphan:
    """A vehicle whose worker has ended, and since when."""

    view: VehicleView
    worker: str
    since_s: float


@dataclass(frozen=True, slots=True)
class Place:
    """Where a vehicle is watched.

    Attributes:
        worker: its name; None where it has ended.
        view: as it is shown without asking.
    """

    worker: str | None
    view: VehicleView


class Watchers:
    """Every method is thread-safe.

    Args:
        clock: monotonic seconds.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._workers: dict[str, _Watcher] = {}
        self._orphans: dict[Key, _Orphan] = {}
        self._gone: dict[str, Counter[str]] = {}
        self._gone_counts: Counter[str] = Counter()
        self._gone_solutions = 0
        self._events = KeptEvents(_MOST_EVENTS)

    # -- as the thread that asks goes on ---------------------------------------------------------------

    def follow(self, live: Set[str]) -> bool:
        """Take in which workers are there; whether one has ended."""
        now_s = self._clock()
        with self._lock:
            for name in live - self._workers.keys():
                self._workers[name] = _Watcher(now_s)
            gone = self._workers.keys() - live
            for name in gone:
                self._end(name, self._workers.pop(name), now_s)
            self._orphans = {k: o for k, o in self._orphans.items() if now_s - o.since_s < _ORPHANED_S}
        return bool(gone)

    def _end(self, name: str, watcher: _Watcher, now_s: float) -> None:
        for key, view in watcher.views.items():
            self._orphans[key] = _Orphan(view, name, now_s)
            data = {"fleet": key[0], "vehicle": key[1], "state": str(VehicleState.UNKNOWN)}
            self._events.add("status", data)
        if watcher.state is not None:
            for part, counts in watcher.state.counters.items():
                self._gone.setdefault(part, Counter()).update(counts)
            self._gone_solutions += watcher.state.figures.solutions
            self._gone_counts.update(watcher.state.figures.counts)

    def to_ask(self) -> Mapping[str, NewsWanted]:
        """What is to be asked now, by worker: of each that has answered the last question."""
        now_s, wanted = self._clock(), {}
        with self._lock:
            for name, watcher in self._workers.items():
                if watcher.asked:
                    continue
                whole = now_s - watcher.whole_s >= _WHOLE_S
                watcher.asked = True
                watcher.whole_s = now_s if whole else watcher.whole_s
                wanted[name] = NewsWanted(watcher.newest, whole)
        return wanted

    def unanswered(self, name: str) -> None:
        """A worker has not answered, or something else; it is asked for all the next time."""
        with self._lock:
            watcher = self._workers.get(name)
            if watcher is not None:
                watcher.asked, watcher.whole_s = False, _NEVER

    def take(self, name: str, news: WorkerNews) -> None:
        """A worker has answered."""
        with self._lock:
            watcher = self._workers.get(name)
            if watcher is None:
                return
            anew = watcher.newest is not None and watcher.start != news.start
            if watcher.newest is not None and not anew and watcher.newest < news.complete_after:
                self._events.complete_after = self._events.newest
            watcher.asked, watcher.answered_s, watcher.start = False, self._clock(), news.start
            watcher.newest = None if anew else news.newest
            for event in () if anew else news.events:
                self._events.add(event.kind, event.data)
            if news.whole is not None:
                watcher.state = news.whole.state
                before = watcher.views
                watcher.views = {
                    (v.fleet, v.vehicle): _brought_up(before.get((v.fleet, v.vehicle)), v, name)
                    for v in news.whole.vehicles
                }
                self._adopted(watcher)
            elif any(_owner(event) not in watcher.views for event in news.events):
                watcher.whole_s = _NEVER  # of a vehicle that is not shown yet

    def take_views(self, name: str, views: Sequence[VehicleView]) -> None:
        """A worker has shown all its vehicles."""
        with self._lock:
            watcher = self._workers.get(name)
            if watcher is not None:
                watcher.views = {(v.fleet, v.vehicle): replace(v, worker=name) for v in views}
                watcher.viewed_s = self._clock()
                self._adopted(watcher)

    def _adopted(self, watcher: _Watcher) -> None:
        for key in watcher.views:
            self._orphans.pop(key, None)

    # -- what is known of vehicles ---------------------------------------------------------------------

    def vehicles(self) -> list[VehicleView]:
        """All known ones, worst state first."""
        with self._lock:
            shown: dict[Key, tuple[float, VehicleView]] = {}
            for name, watcher in self._workers.items():
                silent_s = self._silent_s(watcher)
                for key, view in watcher.views.items():
                    age_s = self._age_s(watcher, view)
                    if key not in shown or age_s < shown[key][0]:
                        shown[key] = age_s, _with_silence(view, name, silent_s)
            orphans = [self._orphaned(o) for k, o in self._orphans.items() if k not in shown]
        return worst_first([*(view for _, view in shown.values()), *orphans])

    def place(self, key: Key) -> Place | None:
        """Where a vehicle is watched, of two places the one that has had samples last; None for an unknown one."""
        with self._lock:
            having = [(n, w) for n, w in self._workers.items() if key in w.views]
            if having:
                name, watcher = min(having, key=lambda one: self._age_s(one[1], one[1].views[key]))
                return Place(name, _with_silence(watcher.views[key], name, self._silent_s(watcher)))
            orphan = self._orphans.get(key)
            return None if orphan is None else Place(None, self._orphaned(orphan))

    def _age_s(self, watcher: _Watcher, view: VehicleView) -> float:
        age_s = float("inf") if view.sample_age_s is None else view.sample_age_s
        return age_s + self._clock() - watcher.answered_s

    def _orphaned(self, orphan: _Orphan) -> VehicleView:
        why = f"its worker {orphan.worker} has ended, and no other watches it"
        return replace(_unwatched(orphan.view, why, self._clock() - orphan.since_s), worker=None)

    # -- what is known of workers ----------------------------------------------------------------------

    def _silent_s(self, watcher: _Watcher) -> float:
        silent_s = self._clock() - watcher.answered_s
        return silent_s if silent_s > SILENT_S else 0.0

    def silent_s(self, name: str) -> float:
        """For how long a worker has not answered; 0 where it does, or has ended."""
        with self._lock:
            watcher = self._workers.get(name)
            return 0.0 if watcher is None else self._silent_s(watcher)

    def answering(self) -> list[str]:
        """Names of those that answer."""
        with self._lock:
            return [n for n, w in self._workers.items() if w.state is not None and not self._silent_s(w)]

    def to_view(self) -> list[str]:
        """Names of those that answer and have not shown their vehicles within half a second."""
        now_s = self._clock()
        with self._lock:
            return [
                name
                for name, watcher in self._workers.items()
                if watcher.state and not self._silent_s(watcher) and now_s - watcher.viewed_s > _FRESH_S
            ]

    def states(self) -> Mapping[str, tuple[WorkerState | None, float]]:
        """By worker what it says of itself, None before its first answer, and for how long it has been silent."""
        with self._lock:
            return {name: (w.state, self._silent_s(w)) for name, w in self._workers.items()}

    def gone_counters(self) -> Mapping[str, Mapping[str, int]]:
        """What workers that have ended have counted, by part."""
        with self._lock:
            return {part: dict(counts) for part, counts in self._gone.items()}

    def figures(self) -> FleetFigures:
        """All workers' fleets in numbers without alerts, those that have ended included."""
        with self._lock:
            found = [w.state.figures for w in self._workers.values() if w.state is not None]
            states = Counter(
                _with_silence(view, name, self._silent_s(w)).state
                for name, w in self._workers.items()
                for view in w.views.values()
            )
            states.update(self._orphaned(orphan).state for orphan in self._orphans.values())
            counts, solutions = Counter(self._gone_counts), self._gone_solutions
        for one in found:
            counts.update(one.counts)
        solutions += sum(one.solutions for one in found)
        waiting, left_out = sum(one.waiting for one in found), sum(one.left_out for one in found)
        return FleetFigures(states, {}, counts, solutions, waiting, left_out)

    # -- events -----------------------------------------------------------------------------------------

    def events(self, after: int) -> Sequence[Event]:
        """Those with an id above ``after``, oldest first."""
        with self._lock:
            return self._events.after(after)

    @property
    def events_complete_after(self) -> int:
        """As ``MonitorPort.events_complete_after``."""
        return self._events.complete_after


def _owner(event: Event) -> Key:
    return str(event.data.get("fleet")), str(event.data.get("vehicle"))


def _brought_up(view: VehicleView | None, brief: VehicleView, worker: str) -> VehicleView:
    """A view as it was shown last, with what is known in brief since."""
    if view is None or view.aircraft != brief.aircraft:
        return replace(brief, worker=worker)
    return replace(
        view,
        state=brief.state,
        reason=brief.reason,
        last_sample_time_s=brief.last_sample_time_s,
        counts=brief.counts,
        active_alerts=brief.active_alerts,
        sample_age_s=brief.sample_age_s,
    )


def _with_silence(view: VehicleView, worker: str, silent_s: float) -> VehicleView:
    why = f"its worker {worker} has not answered for {silent_s:.0f} s"
    return _unwatched(view, why, silent_s) if silent_s else view


def _unwatched(view: VehicleView, why: str, since_s: float) -> VehicleView:
    """A vehicle whose samples nobody takes in: an alert outlasts that, and the vehicle does not pass for health."""
    age_s = None if view.sample_age_s is None else view.sample_age_s + since_s
    if view.state is VehicleState.DEGRADED:
        return replace(view, reason=f"{view.reason.rstrip('.')}. Meanwhile {why}", sample_age_s=age_s)
    return replace(view, state=VehicleState.UNKNOWN, reason=why, sample_age_s=age_s)
