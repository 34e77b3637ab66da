"""What the judge is set to, remembers of a vehicle, and says after a block."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from wingwatch.baselines import Reference
from wingwatch.monitor.detection.blocks import BlockView
from wingwatch.monitor.detection.causes import Cause
from wingwatch.monitor.detection.comparison import Change
from wingwatch.monitor.estimation.sizes import MODEL_ERROR

__all__ = ["JudgeConfig", "JudgeState", "Verdict"]


@dataclass(frozen=True, slots=True)
class JudgeConfig:
    """Settings of the sequential test.

    Attributes:
        remembered_blocks: onsets considered; older blocks join the reference.
        false_alert_interval_h: mean time to a false alert, at least, per vehicle.
        block_s: length of a block.
        model_error: by how much each block's derivatives may differ from the mean for reasons that the linear model
            does not know, as a share of their natural size.
        cause_probability: a cause is named when its probability among the causes reaches this.
        patience_blocks: informative blocks to wait for a cause to become clear before calling it unexplained.
        off_pattern: share of its own effect by which a cause's effect on a derivative may differ from the pattern.
        off_natural: share of its natural size by which a cause of typical size may move any derivative besides.
        founded_blocks: informative blocks of its own flights after which an aircraft's reference is empirical.
        contradiction: probability below which flights contradict an a-priori expectation.
    """

    remembered_blocks: int = 18
    false_alert_interval_h: float = 1000.0
    block_s: float = 10.0
    model_error: float = MODEL_ERROR
    cause_probability: float = 0.9
    patience_blocks: int = 3
    off_pattern: float = 0.15
    off_natural: float = 0.05
    founded_blocks: int = 6
    contradiction: float = 1e-4

    @property
    def log_threshold(self) -> float:
        """Natural logarithm of the Shiryaev-Roberts threshold: the number of blocks in the false alert interval."""
        return float(np.log(self.false_alert_interval_h * 3600.0 / self.block_s))


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the test says after a block.

    Attributes:
        log_statistic: log of the Shiryaev-Roberts statistic.
        cause: likeliest cause; probability: among all causes, given that something changed; unexplained: the
            probability of a change in no known pattern.
        onset: index of the first changed block among those remembered; onset_s: end of the block before it.
        size, size_standard_error: of the cause.
        changes: per structure, the change since the onset.
        confirmed: whether the other estimator's evidence moves the same way. Size and changes are of the one whose
            evidence is stronger.
    """

    log_statistic: float
    cause: Cause
    probability: float
    unexplained: float
    onset: int
    onset_s: float
    size: float
    size_standard_error: float
    changes: Mapping[str, Change]
    confirmed: bool


@dataclass(slots=True)
class JudgeState:
    """What the judge remembers of one vehicle.

    Attributes:
        references: what its own flights taught, by structure, without the blocks still remembered; by the Fourier
            estimator's evidence, as it is kept from flight to flight.
        by_filter: the same of this flight alone, by the filter's: what rough air makes of the one is not in the other.
        identified: the expectation rests on flights of the type and is compared with as it stands.
        founded: so it does, or enough flights of its own are in the reference: the first block may be judged.
        contradictions: structures whose a-priori expectation does not fit, with the derivatives at fault.
        rough: structures whose evidence has been gathered in rough air, by which no expectation is judged.
    """

    references: dict[str, Reference]
    by_filter: dict[str, Reference]
    blocks: list[BlockView] = field(default_factory=list)
    identified: bool = False
    founded: bool = False
    contradictions: dict[str, tuple[str, ...]] = field(default_factory=dict)
    informative: int = 0
    rough: set[str] = field(default_factory=set)
