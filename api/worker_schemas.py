"""Workers as REST shows them."""

from pydantic import BaseModel, ConfigDict, Field

from wingwatch.api.ports import WorkerView

__all__ = ["WorkerDocument", "WorkerList", "worker_document"]


class WorkerDocument(BaseModel):
    """A process that watches vehicles."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    worker: str = Field(description="its name")
    host: str
    pid: int
    load: float = Field(
        description="part of the last ten seconds in which it took messages in; at 1 it can take no more"
    )
    capacity: float = Field(description="what it can take beside others")
    vehicles: int = Field(description="that it watches")
    left_out: int = Field(description="of these, not watched because it is overloaded")
    behind_s: float = Field(description="how long its oldest message has waited")
    moves: dict[str, int] = Field(description="vehicles taken over and given up since it started")
    silent_s: float = Field(description="for how long it has not answered; 0 where it does")


class WorkerList(BaseModel):
    """Every worker."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    items: list[WorkerDocument] = Field(description="by name")
    next: None = None


def worker_document(view: WorkerView) -> WorkerDocument:
    """A worker as REST shows it."""
    return WorkerDocument(
        worker=view.name,
        host=view.host,
        pid=view.pid,
        load=view.load,
        capacity=view.capacity,
        vehicles=view.vehicles,
        left_out=view.left_out,
        behind_s=view.behind_s,
        moves=dict(view.moves),
        silent_s=view.silent_s,
    )
