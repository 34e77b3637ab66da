"""The documents of manoeuvres: `GET /v1/vehicles/{vehicle}/manoeuvres` and `wingwatch monitor --manoeuvres`."""

import math

from pydantic import BaseModel, ConfigDict, Field

from wingwatch.aircraft import MODEL_DERIVATIVES
from wingwatch.monitor.views import LearnedView, ManoeuvreView

__all__ = ["ManoeuvreDocument", "ManoeuvreList", "manoeuvre_document"]


class _Answer(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class LearnedDocument(_Answer):
    """What a manoeuvre taught of one derivative by one estimator."""

    estimator: str
    structure: str
    derivative: str
    standard_error_before: float | None = Field(description="null where nothing was estimated before")
    standard_error_after: float | None
    unit: str


class PoorDocument(_Answer):
    """What was poor in a manoeuvre."""

    what: str = Field(description="too_small, too_slow, too_fast, correlated_inputs or rough_air")
    text: str


class HelpfulInputDocument(_Answer):
    """An input that would teach more."""

    surface: str = Field(description="column of the flight table that it moves")
    shape: str
    amplitude_rad: float = Field(description="largest deflection from trim")
    width_s: float = Field(description="of the narrowest step")


class ManoeuvreDocument(_Answer):
    """Whether a manoeuvre was a good one."""

    number: int = Field(description="of the vehicle's manoeuvres since its watch began, from 1")
    begin_s: float = Field(description="the vehicle's own clock")
    end_s: float = Field(description="of the surfaces' movement")
    known_s: float = Field(description="when the verdict was made, at most two seconds later")
    surfaces: dict[str, float] = Field(description="by column, the largest deflection from trim, rad")
    good: bool = Field(description="whether nothing was poor")
    learned: list[LearnedDocument]
    poor: list[PoorDocument]
    inputs: list[HelpfulInputDocument] = Field(description="that would help; none where none is needed")
    text: str


class ManoeuvreList(_Answer):
    """The last manoeuvres of a vehicle, newest first."""

    items: list[ManoeuvreDocument]
    next: None = None


def manoeuvre_document(view: ManoeuvreView) -> ManoeuvreDocument:
    """The object of a verdict."""
    return ManoeuvreDocument(
        number=view.number, begin_s=view.begin_s, end_s=view.end_s, known_s=view.known_s,
        surfaces=dict(view.surfaces), good=view.good, learned=[_learned(one) for one in view.learned],
        poor=[PoorDocument(what=one.what, text=one.text) for one in view.poor],
        inputs=[
            HelpfulInputDocument(
                surface=one.surface, shape=one.shape, amplitude_rad=one.amplitude_rad, width_s=one.width_s
            )
            for one in view.inputs
        ],
        text=view.text,
    )  # fmt: skip


def _learned(view: LearnedView) -> LearnedDocument:
    return LearnedDocument(
        estimator=view.estimator, structure=view.structure, derivative=view.derivative,
        standard_error_before=_finite(view.before), standard_error_after=_finite(view.after),
        unit=MODEL_DERIVATIVES[view.derivative].unit,
    )  # fmt: skip


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
