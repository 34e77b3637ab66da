"""The baseline for REST: the objects of `wingwatch baseline --json`, waited for no longer than other questions."""

from collections.abc import Callable, Mapping
from typing import Any

from wingwatch.api import BaselineImport, BaselineQuestion, BaselineRevert
from wingwatch.baselines import BaselineLedger, ChangeRecord, Database, Selection
from wingwatch.operations.baseline_exchange import changes_of, imported_object
from wingwatch.operations.baseline_files import content_of
from wingwatch.operations.baseline_objects import Asked, history_object, list_object, show_object
from wingwatch.operations.baseline_revert import revert_text, reverted_object
from wingwatch.operations.convention import check_convention
from wingwatch.operations.faults import CommandError
from wingwatch.service.patient import PatientReader

__all__ = ["PatientBaselines"]


class PatientBaselines:
    """Implements the door's ``BaselinePort``.

    Args:
        database: open.
        wall_clock: seconds since 1970-01-01 UTC.
    """

    def __init__(self, database: Database, wall_clock: Callable[[], float]) -> None:
        self._database, self._wall_clock = database, wall_clock
        self._reader = PatientReader()

    def listed(self) -> Mapping[str, Any]:
        """What the database knows something of."""
        return self._reader.ask(lambda: list_object(self._database))

    def shown(self, question: BaselineQuestion) -> Mapping[str, Any]:
        """What counts now."""
        asked, now_s = _asked(question), self._wall_clock()
        return self._reader.ask(lambda: show_object(self._database, asked, now_s))

    def past(self, question: BaselineQuestion) -> Mapping[str, Any]:
        """All that there ever was."""
        asked = _asked(question)
        return self._reader.ask(lambda: history_object(self._database, asked))

    def imported(self, request: BaselineImport) -> Mapping[str, Any]:
        """Put what ``export`` wrote into the database."""
        try:
            content = content_of(request.document, "the body", request.aircraft)
        except CommandError as error:
            raise ValueError(str(error).replace("leave out --aircraft", "ask for that one")) from None
        text = f"imported over REST: {request.note}" if request.note else "imported over REST"
        changes = changes_of(content, self._wall_clock(), request.who, text)
        ledger = BaselineLedger(self._database)
        stored = self._reader.ask(lambda: ledger.put(changes, content))
        return imported_object(content) | {"stored": stored}

    def reverted(self, request: BaselineRevert) -> Mapping[str, Any]:
        """Take a version back."""
        of_vehicle = request.vehicle is not None
        if request.version is not None and not of_vehicle:
            raise ValueError("version names one of what a vehicle taught; give the vehicle, or an entry")
        if request.entry is not None and of_vehicle:
            raise ValueError(
                "entry names an expectation of the type; leave out the vehicle, or give a version"
            )
        selection = Selection(
            request.aircraft, request.configuration, request.structure, request.fleet, request.vehicle,
            request.entry, request.version,
        )  # fmt: skip
        text = ": ".join(part for part in (revert_text(selection), request.note) if part)
        change = ChangeRecord(
            self._wall_clock(), "revert", request.who, request.aircraft, request.configuration, text,
            request.fleet if of_vehicle else None, request.vehicle,
        )  # fmt: skip
        ledger = BaselineLedger(self._database)
        found = self._reader.ask(lambda: ledger.revert(change, selection))
        return reverted_object(found, selection)


def _asked(question: BaselineQuestion) -> Asked:
    """As the command line asks.

    Raises:
        ValueError: the aircraft cannot be shown in that convention.
    """
    try:
        check_convention(question.aircraft, question.convention)
    except CommandError as error:
        raise ValueError(str(error).removeprefix("--")) from None
    return Asked(
        question.aircraft,
        question.configuration,
        question.convention,
        question.fleet,
        question.vehicle,
        question.at,
    )
