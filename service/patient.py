"""Questions to the database that whoever asks waits for no longer than a few seconds, whatever state it is in."""

import threading
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

from wingwatch.baselines import (
    Database,
    DatabaseError,
    FlightRecord,
    HistoryColumns,
    HistoryKey,
    HistoryRow,
    HistoryWanted,
)

__all__ = ["PatientHistory", "PatientReader"]

_Answer = TypeVar("_Answer")

_PLACE_S = 2.0  # whoever waits holds a thread of the HTTP server


class _Question(Generic[_Answer]):
    """One question, in a thread of its own; it gives its place back when the database answers, however late."""

    def __init__(self, ask: Callable[[], _Answer], places: threading.Semaphore) -> None:
        self._ask, self._places = ask, places
        self._answer: list[_Answer] = []
        self._fault: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="wingwatch-question", daemon=True)

    def answer(self, patience_s: float) -> _Answer:
        """Wait for the answer.

        Raises:
            DatabaseError: none has come in time, or the database's own.
        """
        self._thread.start()
        self._thread.join(patience_s)
        if self._fault is not None:
            raise self._fault
        if not self._answer:
            raise DatabaseError(f"the database has not answered within {patience_s:g} s; try again later")
        return self._answer[0]

    def _run(self) -> None:
        try:
            self._answer.append(self._ask())
        except Exception as error:
            self._fault = error
        finally:
            self._places.release()


class PatientReader:
    """Asks at most a few questions at once; a frozen server holds these up, and nobody who asks.

    Args:
        patience_s: how long whoever asks waits.
        most: questions at once; where as many are unanswered, a further one waits for its turn.
    """

    def __init__(self, patience_s: float = 10.0, most: int = 4) -> None:
        self._patience_s = patience_s
        self._places = threading.Semaphore(most)

    def ask(self, question: Callable[[], _Answer]) -> _Answer:
        """The answer.

        Raises:
            DatabaseError: none has come in time, or the database's own.
        """
        if not self._places.acquire(timeout=min(_PLACE_S, self._patience_s)):
            raise DatabaseError("the database has not answered earlier questions yet; try again later")
        return _Question(question, self._places).answer(self._patience_s)


class PatientHistory:
    """The history of a database, for REST.

    Args:
        database: open.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self._reader = PatientReader()

    def history_rows(self, fleet: str, vehicle: str, wanted: HistoryWanted) -> Sequence[HistoryRow]:
        """A part of a vehicle's history; ``DatabaseError`` where it has not been read in time."""
        return self._reader.ask(lambda: self._database.history_rows(fleet, vehicle, wanted))

    def history_columns(
        self, fleet: str, vehicle: str, wanted: HistoryWanted
    ) -> tuple[Sequence[HistoryColumns], HistoryKey | None]:
        """The same as columns; ``DatabaseError`` likewise."""
        return self._reader.ask(lambda: self._database.history_columns(fleet, vehicle, wanted))

    def flights(self, fleet: str, vehicle: str) -> Sequence[FlightRecord]:
        """Flights of which estimates are kept, the newest first; ``DatabaseError`` likewise."""
        return self._reader.ask(lambda: self._database.flights(fleet, vehicle))
