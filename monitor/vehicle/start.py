"""What the watch of a vehicle starts from, and what it gives back."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from wingwatch.monitor.detection.judge_state import JudgeConfig
from wingwatch.monitor.detection.redundancy import RedundancyWatch
from wingwatch.monitor.estimation.chain import Chain, Solution
from wingwatch.monitor.ports import VehicleMemory
from wingwatch.monitor.vehicle.manoeuvre_watch import FlownManoeuvre
from wingwatch.monitor.views import AlertView
from wingwatch.telemetry import derivations

__all__ = ["Judged", "MonitorStart", "Report", "surface_kinds"]

Array = NDArray[np.float64]


def surface_kinds(given: Sequence[str]) -> dict[str, str]:
    """``command`` for every surface whose position is not given and is taken from its command."""
    return {
        name: "command"
        for name, sources in derivations(given).items()
        if len(sources) == 1 and sources[0].endswith("_command_rad")
    }


@dataclass(frozen=True, slots=True)
class Judged:
    """What one solution led to.

    Attributes:
        alert: that was raised, changed or cleared.
        manoeuvre: that has ended with it.
        resumed: by structure, information (k, k) and vector (k,) that its Fourier estimator is to go on from in the
            place of its closed blocks (``Chain.resume``).
    """

    alert: AlertView | None
    manoeuvre: FlownManoeuvre | None
    resumed: Mapping[str, tuple[Array, Array]]


@dataclass(frozen=True, slots=True)
class Report:
    """What a block of samples led to: solutions, alerts that were raised, changed or cleared, manoeuvres that ended."""

    solutions: list[Solution] = field(default_factory=list)
    alerts: list[AlertView] = field(default_factory=list)
    manoeuvres: list[FlownManoeuvre] = field(default_factory=list)

    def add(self, solution: Solution, judged: Judged) -> None:
        """One solution more, and what it led to."""
        self.solutions.append(solution)
        if judged.alert is not None:
            self.alerts.append(judged.alert)
        if judged.manoeuvre is not None:
            self.manoeuvres.append(judged.manoeuvre)

    def add_alerts(self, alerts: Sequence[AlertView]) -> None:
        """Alerts by the samples after the last solution."""
        self.alerts.extend(alerts)


@dataclass(frozen=True, slots=True)
class MonitorStart:
    """What the watch of a vehicle starts from, beside its aircraft file.

    Attributes:
        configuration: of the aircraft, as its file names it.
        memory: what is kept of the vehicle's earlier flights.
        chain: of a vehicle of the same type, channels, configuration and expectations; its estimators, whose workspace
            is larger than what they remember of a vehicle, then serve this one as well. relations: of the same vehicle.
        judge: settings of the test.
        engine: of the filter; ``filterpy`` is one vehicle's, and slow.
        memory_s: time constant with which both estimators forget; their own where None. Of a ``chain`` that is given it
            is that chain's.
    """

    configuration: str = "clean"
    memory: VehicleMemory = field(default_factory=VehicleMemory)
    chain: Chain | None = None
    relations: RedundancyWatch | None = None
    judge: JudgeConfig = field(default_factory=JudgeConfig)
    engine: Literal["compiled", "filterpy"] = "compiled"
    memory_s: float | None = None
