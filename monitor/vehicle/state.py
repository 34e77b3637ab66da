"""All that the monitor of one vehicle remembers, as one value that can be saved and restored."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators import BlockEvidence, Validity
from wingwatch.monitor.detection.alerts import BookState
from wingwatch.monitor.detection.blocks import BlockView
from wingwatch.monitor.detection.cell_memory import CellBookState
from wingwatch.monitor.detection.judge_state import JudgeState, Verdict
from wingwatch.monitor.detection.redundancy import RedundancyBookState, RedundancyState
from wingwatch.monitor.detection.surfaces_seen import SurfacesSeen
from wingwatch.monitor.detection.vehicle_alerts import AlertMemory
from wingwatch.monitor.estimation.chain import Chain, SavedChain, Solution
from wingwatch.monitor.estimation.flight_regime import RegimeState
from wingwatch.monitor.estimation.mode_solution import ModeSolution
from wingwatch.monitor.positions import Position
from wingwatch.monitor.state_codec import NOT_SAVED
from wingwatch.monitor.views import VehicleState
from wingwatch.telemetry import AlignerState, CleanerState, CleaningReport

__all__ = ["MonitorState", "SavedMode", "SavedSolution", "WatchMemory"]

Array = NDArray[np.float64]


@dataclass(slots=True)
class WatchMemory:
    """What a monitor remembers beside its parts' own states; the latest solution is saved as a ``SavedSolution``."""

    latest: Solution | None = field(default=None, metadata=NOT_SAVED)
    block: BlockView | None = None
    verdict: Verdict | None = None
    observable_s: float = 0.0
    state: VehicleState = VehicleState.UNKNOWN
    state_since_s: float | None = None
    outside: str = ""
    regime: RegimeState = field(default_factory=RegimeState)
    surfaces: SurfacesSeen = field(default_factory=SurfacesSeen)
    position: Position | None = None


@dataclass(frozen=True, slots=True)
class SavedMode:
    """A ``ModeSolution`` without the estimators that it was made by and without the estimates that follow from it."""

    seen: tuple[Validity, Validity]
    block: BlockEvidence | None
    gained: tuple[Array, Array] | None
    rough: bool
    comparable: bool


@dataclass(frozen=True, slots=True)
class SavedSolution:
    """A ``Solution``."""

    time_s: float
    modes: Mapping[str, SavedMode]

    @classmethod
    def of(cls, solution: Solution) -> "SavedSolution":
        """As it is saved."""
        modes = {
            name: SavedMode(mode.seen, mode.block, mode.gained, bool(mode.rough), bool(mode.comparable))
            for name, mode in solution.modes.items()
        }
        return cls(solution.time_s, modes)

    def solution(self, chain: Chain) -> Solution:
        """By the estimators of a chain.

        Raises:
            ValueError: it has modes that the chain does not estimate.
        """
        pairs = chain.supervisor.pairs
        if set(self.modes) - set(pairs):
            raise ValueError("the latest solution belongs to other structures than the monitor's")
        modes = {
            name: ModeSolution(pairs[name], mode.seen, mode.block, mode.gained, mode.rough, mode.comparable)
            for name, mode in self.modes.items()
        }
        return Solution(self.time_s, modes)


@dataclass(frozen=True, slots=True)
class MonitorState:
    """Everything that decides what a monitor says of the next samples, its settings and the aircraft's apart.

    Attributes:
        cleaner, cleaned: stream position and counts of samples; aligner: rows that wait for stated delays.
        chain: the estimators' lanes, the air, the grid of solutions.
        judge: remembered blocks and references; book: the alert in force; cells: memory by cell.
        redundancy, redundancy_book: relations between channels, and the alerts in force by them; alerts: what was in
            force and is over a short time ago.
        memory, latest: the state shown and the latest solution.
    """

    cleaner: CleanerState
    cleaned: CleaningReport
    aligner: AlignerState
    chain: SavedChain
    judge: JudgeState
    book: BookState
    redundancy: RedundancyState
    redundancy_book: RedundancyBookState
    alerts: AlertMemory
    cells: CellBookState
    memory: WatchMemory
    latest: SavedSolution | None
