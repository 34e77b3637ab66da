"""Which surfaces have shown that they work: nothing healthy is said of one that never moved.

A surface has shown itself once a fault that leaves nothing of it would have been noticed: stuck by its relation of
position and command, or all effectiveness lost by the blocks of derivatives. That holds for the rest of the flight, so
the state does not come and go with the autopilot's use of a surface; what the last minutes could have shown is
``could_see``.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from wingwatch.aircraft import SURFACE_OF_INPUT, ModeStructure
from wingwatch.monitor.detection.redundancy import Hypothesis

__all__ = ["EFFECTIVENESS", "SURFACES", "SurfaceWatch", "SurfacesSeen", "surface_name"]

SURFACES = ("elevator_rad", "aileron_rad", "rudder_rad")
"""Columns of the flight table."""

EFFECTIVENESS: Mapping[str, str] = {
    column: f"{column.removesuffix('_rad')}_effectiveness" for column in SURFACES
}
"""The cause of derivatives that a surface without effect would be."""

LOOK_S = 10.0
"""Blocks of derivatives are as long."""


def surface_name(column: str) -> str:
    """``elevator`` for ``elevator_rad``."""
    return column.removesuffix("_rad")


@dataclass(slots=True)
class SurfacesSeen:
    """What is remembered of one vehicle.

    Attributes:
        unseen: columns of surfaces that have not shown themselves since the start of the flight.
        begun_s: stamp of the flight's first solution; None before it.
        looked_s: when surfaces were last looked at.
        waits_until_s: by column, until when it is not looked at: what is remembered is older than a fault that a person
            has said to be over.
    """

    unseen: tuple[str, ...] = ()
    begun_s: float | None = None
    looked_s: float = float("-inf")
    waits_until_s: dict[str, float] | None = None


class SurfaceWatch:
    """Surfaces of a vehicle; the state is handed in.

    Args:
        present: channels that its samples carry.
        compared: structures whose derivatives are compared.
        hypotheses: of its relations.
    """

    def __init__(
        self, present: Sequence[str], compared: Sequence[ModeStructure], hypotheses: Sequence[Hypothesis]
    ) -> None:
        self.surfaces = tuple(column for column in SURFACES if column in present)
        related = {h.channel for h in hypotheses if h.cause == "surface_stuck"}
        inputs = {f"{SURFACE_OF_INPUT[u]}_rad" for structure in compared for u in structure.inputs}
        self._shown_by_anything = related | inputs

    def init(self) -> SurfacesSeen:
        """At the start of a flight."""
        return SurfacesSeen(self.surfaces)

    def due(self, state: SurfacesSeen, now_s: float, block_s: float | None) -> bool:
        """Whether what could have been seen is to be worked out now: after a block, without blocks every ``LOOK_S``.

        Args:
            block_s: end of the latest block that was compared.
        """
        fresh = block_s is not None and state.looked_s < block_s <= now_s
        return bool(state.unseen) and (fresh or not 0.0 <= now_s - state.looked_s < LOOK_S)

    def look(
        self,
        state: SurfacesSeen,
        now_s: float,
        airframe: Mapping[str, float | None],
        relations: Sequence[tuple[Hypothesis, float | None]],
    ) -> None:
        """Take in what could have been seen (arguments as of ``could_see``)."""
        state.looked_s = now_s
        waits = state.waits_until_s or {}
        stuck = {h.channel for h, size in relations if h.cause == "surface_stuck" and _seen_whole(size)}
        state.unseen = tuple(
            column
            for column in state.unseen
            if now_s < waits.get(column, float("-inf"))
            or not (column in stuck or _seen_whole(airframe.get(EFFECTIVENESS[column])))
        )

    def forget(self, state: SurfacesSeen, column: str, until_s: float) -> None:
        """A fault of the surface was said to be over: it must show itself anew, by what comes after it."""
        if column in self.surfaces:
            state.unseen = tuple(c for c in self.surfaces if c == column or c in state.unseen)
            state.waits_until_s = {**(state.waits_until_s or {}), column: until_s}

    def text(self, state: SurfacesSeen) -> str:
        """Why nothing can be said yet, with the input that would help; empty where all have shown themselves."""
        return "; ".join(self._clauses(state))

    def _clauses(self, state: SurfacesSeen) -> Iterator[str]:
        able = [surface_name(c) for c in state.unseen if c in self._shown_by_anything]
        if able:
            which = " or ".join(able)
            yield (
                f"a stuck {which} would not have been noticed yet: it has hardly moved since the start of the flight; "
                f"{' and '.join(f'a doublet of the {name}' for name in able)} would help"
            )
        for column in state.unseen:
            if column not in self._shown_by_anything:
                name = surface_name(column)
                yield (
                    f"a stuck {name} cannot be noticed by the channels that are sent: give its command beside its "
                    "position, or vanes"
                )


def _seen_whole(size: float | None) -> bool:
    return size is not None and size <= 1.0
