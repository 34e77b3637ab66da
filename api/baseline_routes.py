"""Routes about the baseline: what is expected of aircraft, what vehicles' flights taught, and taking a version back."""

import logging
from collections.abc import Callable, Mapping
from http import HTTPStatus
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Path, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, Field

from wingwatch.aircraft import Aircraft, Convention
from wingwatch.api.access import admission_of
from wingwatch.api.door import Door
from wingwatch.api.encoding import json_answer
from wingwatch.api.guards import BodySize
from wingwatch.api.ports import BaselineImport, BaselinePort, BaselineQuestion, BaselineRevert
from wingwatch.api.problems import ProblemError, printable
from wingwatch.api.schemas import Name

__all__ = ["BASELINE_SIZE", "baseline_router"]

_LOG = logging.getLogger(__name__)
_LINE = r"^[^\x00-\x1f\x7f]*$"
_MOST_ID = 2**53

BASELINE_SIZE = BodySize(16 * 2**20, 60.0)
"""Of what `wingwatch baseline export` wrote: a hundred vehicles of one aircraft."""

AircraftName = Annotated[str, Path(min_length=1, max_length=200, pattern=_LINE)]
Configuration = Annotated[str, Field(min_length=1, max_length=100, pattern=_LINE)]


class _Open(BaseModel):
    """An object as `wingwatch baseline --json` prints it; keys may be added."""

    model_config = ConfigDict(frozen=True, extra="allow")


class BaselineList(_Open):
    """What the database knows something of."""

    aircraft: list[dict[str, Any]] = Field(
        description="by configuration: entries by structure and provenance"
    )
    vehicles: list[dict[str, Any]] = Field(
        description="what each vehicle's flights taught: blocks, seconds, cells"
    )


class BaselineDocument(_Open):
    """What is expected of an aircraft."""

    aircraft: str
    configuration: str
    convention: str
    structures: dict[str, list[dict[str, Any]]] = Field(description="entries by structure")


class ShownBaseline(BaselineDocument):
    """What counts now."""

    at: dict[str, Any] | None = Field(
        description="expectation and flights side by side at a flight condition; null where none is known"
    )


class BaselineHistory(BaselineDocument):
    """All that there ever was."""

    changes: list[dict[str, Any]] = Field(description="that people made")


class RevertedBaseline(_Open):
    """What was taken back, and what counts again: ids of entries, or of versions where it is about a vehicle."""

    aircraft: str
    configuration: str
    withdrawn: list[int]
    restored: list[int]
    cells: int


class ImportedBaseline(_Open):
    """How much the file had, and how many of these records were not there already."""

    entries: int
    references: int
    cells: int
    stored: int


class BaselineFile(BaseModel):
    """What `wingwatch baseline export` writes; its records are checked one by one."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: Literal["wingwatch baseline"]
    version: int
    units: dict[str, str] = Field(description="of each derivative")
    entries: list[dict[str, Any]] = Field(description="expectations at flight conditions")
    references: list[dict[str, Any]] = Field(description="what vehicles taught")
    cells: list[dict[str, Any]] = Field(description="what vehicles remember of cells of the envelope")


class HistoryQuestion(BaseModel):
    """Of whom, and in which convention."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    configuration: Configuration = "clean"
    convention: Convention = Convention.CONCISE
    fleet: Name = "default"
    vehicle: Name | None = Field(default=None, description="whose flights' teaching; nobody's without")


class ShowQuestion(HistoryQuestion):
    """The same, and where expectation and flights are set side by side: cruise where nothing is given."""

    airspeed_true_m_s: float | None = Field(default=None, gt=0.0, le=1000.0, allow_inf_nan=False)
    altitude_m: float | None = Field(default=None, ge=-5000.0, le=47_000.0, allow_inf_nan=False)


class Signed(BaseModel):
    """Who does it, and why."""

    model_config = ConfigDict(frozen=True, extra="forbid", str_strip_whitespace=True)

    who: str | None = Field(
        default=None, min_length=1, max_length=100, pattern=_LINE,
        description="required without a token; with one it stands behind the token's name",
    )  # fmt: skip
    note: str = Field(default="", max_length=1000, pattern=_LINE)


class RevertRequest(Signed):
    """Who takes back what; without an entry or version the newest."""

    configuration: Configuration = "clean"
    structure: str | None = Field(default=None, max_length=50, pattern=_LINE)
    fleet: Name = "default"
    vehicle: Name | None = Field(default=None, description="whose flights' teaching; expectations without")
    entry: int | None = Field(default=None, ge=1, le=_MOST_ID, description="only this expectation")
    version: int | None = Field(
        default=None,
        ge=0,
        le=_MOST_ID,
        description="that is to count again of what the vehicle taught, 0: none",
    )


def baseline_router(door: Door) -> APIRouter:
    """The routes ``/baselines...``; each reads the database, in a thread."""
    router = APIRouter(tags=["baselines"])

    @router.get("/baselines", response_model=BaselineList, summary="What the baseline database knows")
    def baselines() -> Response:
        return json_answer(BaselineList.model_validate(_port(door).listed()))

    @router.get(
        "/baselines/{aircraft}", response_model=ShownBaseline, summary="What is expected of an aircraft"
    )
    def show(aircraft: AircraftName, query: Annotated[ShowQuestion, Query()]) -> Response:
        at = None
        if query.airspeed_true_m_s is not None and query.altitude_m is not None:
            at = (query.airspeed_true_m_s, query.altitude_m)
        elif query.airspeed_true_m_s is not None or query.altitude_m is not None:
            raise ProblemError(
                HTTPStatus.UNPROCESSABLE_ENTITY,
                "airspeed_true_m_s and altitude_m belong together; give both.",
            )
        return _answer(ShownBaseline, _port(door).shown, _question(door, aircraft, query, at))

    @router.get(
        "/baselines/{aircraft}/history",
        response_model=BaselineHistory,
        summary="Every entry and version there was",
    )
    def history(aircraft: AircraftName, query: Annotated[HistoryQuestion, Query()]) -> Response:
        return _answer(BaselineHistory, _port(door).past, _question(door, aircraft, query, None))

    @router.put(
        "/baselines/{aircraft}",
        response_model=ImportedBaseline,
        summary="Put what export wrote into the database",
    )
    def put(
        request: Request, aircraft: AircraftName, file: BaselineFile, query: Annotated[Signed, Query()]
    ) -> Response:
        who = _signature(request, query, "query")
        name = _known(door, aircraft).name
        try:
            done = _port(door).imported(BaselineImport(name, file.model_dump(), who, query.note))
        except ValueError as error:
            raise ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, f"{str(error).rstrip('.')}.") from error
        counts = ", ".join(f"{number} {what}" for what, number in done.items())
        _LOG.info("import into the baseline of %s (%s) by %s", printable(aircraft), counts, who)
        return json_answer(ImportedBaseline.model_validate(done))

    @router.post(
        "/baselines/{aircraft}/revert",
        response_model=RevertedBaseline,
        summary="Take the newest version back",
    )
    def revert(request: Request, aircraft: AircraftName, wanted: RevertRequest) -> Response:
        who = _signature(request, wanted)
        asked = BaselineRevert(
            aircraft, wanted.configuration, wanted.structure, wanted.fleet, wanted.vehicle, wanted.entry,
            wanted.version, who, wanted.note,
        )  # fmt: skip
        try:
            done = _port(door).reverted(asked)
        except ValueError as error:
            raise ProblemError(HTTPStatus.CONFLICT, f"{error}.") from error
        of = "expectations" if wanted.vehicle is None else f"what {wanted.fleet}/{wanted.vehicle} taught"
        ids = ", ".join(str(one) for one in done["withdrawn"])
        _LOG.info("revert of the baseline of %s, %s (%s) by %s", printable(aircraft), of, ids, who)
        return json_answer(RevertedBaseline.model_validate(done))

    return router


def _port(door: Door) -> BaselinePort:
    if door.baselines is None:
        raise ProblemError(HTTPStatus.NOT_FOUND, "This service keeps no baseline database.")
    return door.baselines


def _known(door: Door, aircraft: str) -> Aircraft:
    try:
        return door.aircraft(aircraft)
    except ValueError as error:
        raise ProblemError(HTTPStatus.NOT_FOUND, f"{str(error).rstrip('.')}.") from error


def _question(
    door: Door, aircraft: str, query: HistoryQuestion, at: tuple[float, float] | None
) -> BaselineQuestion:
    known = _known(door, aircraft)
    return BaselineQuestion(known, query.configuration, str(query.convention), query.fleet, query.vehicle, at)


def _answer(
    kind: type[_Open],
    ask: Callable[[BaselineQuestion], Mapping[str, Any]],
    question: BaselineQuestion,
) -> Response:
    try:
        found = ask(question)
    except ValueError as error:
        raise ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, f"{str(error).rstrip('.')}.") from error
    return json_answer(kind.model_validate(found))


def _signature(request: Request, wanted: Signed, where: str = "body") -> str:
    """Under which name it is noted: the token's comes first, for it alone is known to be true."""
    caller = admission_of(request).caller
    if caller is None:
        if wanted.who is None:
            fault = {"type": "missing", "loc": (where, "who"), "msg": "Field required", "input": None}
            raise RequestValidationError([fault])
        return wanted.who
    return caller.name if wanted.who in (None, caller.name) else f"{caller.name}, for {wanted.who}"
