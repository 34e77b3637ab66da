"""The fleet as a list shows it: a short row a vehicle, cheap enough to be asked for twice a second."""

from collections.abc import Mapping, Sequence

from pydantic import BaseModel, ConfigDict, Field

from wingwatch.api.encoding import quantity
from wingwatch.api.schemas import (
    AlertDocument,
    AlertGroupDocument,
    KernelsDocument,
    WorstDocument,
    worst_document,
)
from wingwatch.monitor.views import VehicleState, VehicleView

__all__ = ["FleetDocument", "FleetRow", "fleet_row", "state_counts"]


class FleetRow(BaseModel):
    """One vehicle in a list."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    fleet: str
    vehicle: str
    aircraft: str | None
    state: VehicleState
    state_since_s: float | None
    reason: str = Field(description="why the state is what it is")
    last_sample_time_s: float | None = Field(description="the vehicle's own clock")
    sample_age_s: float | None = Field(
        description="since samples of it arrived last, by the service's clock; null before the first"
    )
    worst: WorstDocument | None
    active_alerts: list[str] = Field(description="ids of alerts that are not cleared, worst first")
    unseen_surfaces: list[str] = Field(
        description="surfaces that have not moved enough for a stuck one to be noticed"
    )
    air_fit_for_estimating: bool | None = Field(
        description="of the last half minute; null where it is not known"
    )
    airspeed_true_m_s: float | None
    altitude_m: float | None
    latitude_deg: float | None = Field(description="null where the vehicle does not send it")
    longitude_deg: float | None
    worker: str | None = Field(default=None, description="as of /v1/vehicles/{id}")


class FleetDocument(BaseModel):
    """The fleet in rows, its alerts in force, and what of the service does not work."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    version: str
    counts: dict[VehicleState, int] = Field(description="vehicles per state, every state listed")
    vehicles: list[FleetRow] = Field(description="worst first")
    alerts: list[AlertDocument] = Field(description="alerts that are not cleared, newest first")
    groups: list[AlertGroupDocument] = Field(description="events that several of these alerts are")
    kernels: KernelsDocument | None = Field(description="as of /v1/status")
    database: str | None = Field(description="as of /v1/status")
    problems: dict[str, str] = Field(description="as of /v1/status")


def fleet_row(view: VehicleView) -> FleetRow:
    """A vehicle's row."""
    position = view.position
    return FleetRow(
        fleet=view.fleet,
        vehicle=view.vehicle,
        aircraft=view.aircraft,
        state=view.state,
        state_since_s=quantity(view.state_since_s),
        reason=view.reason,
        last_sample_time_s=quantity(view.last_sample_time_s),
        sample_age_s=quantity(view.sample_age_s),
        worst=None if view.worst is None else worst_document(view.worst),
        active_alerts=list(view.active_alerts),
        unseen_surfaces=list(view.unseen_surfaces),
        air_fit_for_estimating=None if view.air is None else view.air.fit_for_estimating,
        airspeed_true_m_s=quantity(view.condition.get("airspeed_true_m_s")),
        altitude_m=quantity(view.condition.get("altitude_m")),
        latitude_deg=None if position is None else position.latitude_deg,
        longitude_deg=None if position is None else position.longitude_deg,
        worker=view.worker,
    )


def state_counts(vehicles: Sequence[VehicleView]) -> Mapping[VehicleState, int]:
    """How many vehicles are in each state."""
    return {state: sum(view.state == state for view in vehicles) for state in VehicleState}
