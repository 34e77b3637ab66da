"""The non-dimensional coefficients of an aircraft file, and exactly what they mean.

American convention: rates are made non-dimensional by c/(2 V) and b/(2 V) (thesis B.3), angles in rad,
moments about the centre of gravity in body axes. Deflections follow thesis 4.2.2: positive gives a negative
response. ``force_axes`` says where CL, CD and CY point:

- ``wind``: lift and drag normal to and along the relative wind, CY along the wind's y axis, so drag has a
  share in the side force of body axes when the aircraft sideslips;
- ``stability``: the frame is turned by the angle of attack alone, CY lies along y body.
"""

from collections.abc import Iterator
from functools import cache
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

__all__ = [
    "Coefficients",
    "DirectionalCoefficients",
    "DragCoefficients",
    "LiftCoefficients",
    "PitchCoefficients",
    "StallBlend",
    "coefficient_names",
]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class LiftCoefficients(_Table):
    """CL = zero + alpha α + q q̂ + alphadot (α̇ c/2V) + elevator η, the first two blended at the stall."""

    zero: float = 0.0
    alpha: float = Field(gt=0.0)
    q: float = 0.0
    alphadot: float = 0.0
    elevator: float = 0.0


class DragCoefficients(_Table):
    """CD = min + (CL_line - CL_at_min)^2 / (π oswald aspect_ratio) + elevator |η| + aileron |ξ| + rudder |ζ|.

    CL_line is the straight line zero + alpha α of the lift table, without the stall: drag goes on growing
    there.
    """

    min: float = Field(ge=0.0)
    CL_at_min: float = 0.0
    oswald: float = Field(gt=0.0, le=1.5)
    elevator: float = 0.0
    aileron: float = 0.0
    rudder: float = 0.0


class DirectionalCoefficients(_Table):
    """CY, Cl or Cn = beta β + p p̂ + r r̂ + aileron ξ + rudder ζ."""

    beta: float
    p: float = 0.0
    r: float = 0.0
    aileron: float = 0.0
    rudder: float = 0.0


class PitchCoefficients(_Table):
    """Cm = zero + alpha α + q q̂ + alphadot (α̇ c/2V) + elevator η."""

    zero: float = 0.0
    alpha: float
    q: float
    alphadot: float = 0.0
    elevator: float


class StallBlend(_Table):
    """Blend from the straight lift line to a flat plate, 2 sign(α) sin²α cosα, by a sigmoid.

    σ = (1 + e^{-M(α-α0)} + e^{M(α+α0)}) / ((1 + e^{-M(α-α0)}) (1 + e^{M(α+α0)})), M ``sharpness`` and α0
    ``angle_rad`` (Beard and McLain, Small Unmanned Aircraft, chapter 4).
    """

    sharpness: float = Field(gt=0.0)
    angle_rad: float = Field(gt=0.0, lt=1.5)


@cache
def coefficient_names() -> tuple[str, ...]:
    """Every coefficient as ``CL_alpha``, ``Cn_rudder``: the keys of the standard-error tables."""
    return tuple(f"{table}_{key}" for table, model in _TABLES.items() for key in model.model_fields)


_TABLES: dict[str, type[_Table]] = {
    "CL": LiftCoefficients,
    "CD": DragCoefficients,
    "CY": DirectionalCoefficients,
    "Cl": DirectionalCoefficients,
    "Cm": PitchCoefficients,
    "Cn": DirectionalCoefficients,
}


def _known_keys(table: dict[str, float]) -> dict[str, float]:
    known = ("default", *coefficient_names())
    for key in table:
        if key not in known:
            raise ValueError(f"{key!r} is no coefficient; allowed are {', '.join(known)}")
    return table


ErrorTable = Annotated[dict[str, Annotated[float, Field(ge=0.0)]], AfterValidator(_known_keys)]


class Coefficients(_Table):
    """The set of one aircraft in its clean configuration; see the module for conventions.

    ``relative_standard_error`` and ``standard_error_floor`` say how far each coefficient is trusted before
    any flight, by name (``Cm_q``) with ``default`` for the rest; what neither names takes the handbook
    figures of ``wingwatch.aircraft.uncertainty``.
    """

    force_axes: Literal["wind", "stability"]
    CL: LiftCoefficients
    CD: DragCoefficients
    CY: DirectionalCoefficients
    Cl: DirectionalCoefficients
    Cm: PitchCoefficients
    Cn: DirectionalCoefficients
    stall: StallBlend | None = None
    relative_standard_error: ErrorTable = Field(default_factory=dict)
    standard_error_floor: ErrorTable = Field(default_factory=dict)

    def items(self) -> Iterator[tuple[str, float]]:
        """Every coefficient's name (``CL_alpha``) and value."""
        for table in _TABLES:
            for key, value in getattr(self, table):
                yield f"{table}_{key}", value

    def with_value(self, name: str, value: float) -> "Coefficients":
        """A copy with one coefficient (``CL_alpha``) replaced; KeyError for a name that is none."""
        if name not in coefficient_names():
            raise KeyError(name)
        table, key = name.split("_", 1)
        changed = getattr(self, table).model_copy(update={key: value})
        return self.model_copy(update={table: changed})
