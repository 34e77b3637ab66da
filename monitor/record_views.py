"""What is kept of a vehicle's last hour for pictures: what its blocks said, and how its messages arrived.

It is in memory alone, begins anew with each run of the service, and no other answer depends on it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

__all__ = ["BlockRecord", "FlightRecordView", "LinkSecond", "LinkView", "ModeRecord"]


@dataclass(frozen=True, slots=True)
class ModeRecord:
    """What a block said of one structure by one estimator.

    Attributes:
        information_bit: information about the derivatives, in bits: half the binary logarithm of the determinant of
            I + N J N, with J the information matrix and N the natural sizes. It is 0 where nothing moved, None where
            the estimator's account of the block is not used.
        innovation: normalised innovation squared over its degrees of freedom: how far the block is from what was
            expected. Of an unchanged aircraft it is 1 on average; None where the block was not compared.
        limit: below which 95 % of the innovations of an unchanged aircraft are; None as above.
    """

    information_bit: float | None
    innovation: float | None
    limit: float | None


@dataclass(frozen=True, slots=True)
class BlockRecord:
    """A block of about ten seconds.

    Attributes:
        start_s, end_s: stamps of its first and last sample.
        modes: by structure and estimator.
        statistic: natural logarithm of the test's statistic after the block; None where nothing was compared.
        rough: structures whose air was too rough for it.
    """

    start_s: float
    end_s: float
    modes: Mapping[str, Mapping[str, ModeRecord]]
    statistic: float | None
    rough: Sequence[str]


@dataclass(frozen=True, slots=True)
class LinkSecond:
    """A second of arrivals.

    Attributes:
        time_s: latest stamp in it.
        samples, messages: that arrived.
        longest_step_s: between stamps of successive samples.
        delay_s: by how much longer than the fastest message of the last ten minutes the slowest one took.
    """

    time_s: float
    samples: int
    messages: int
    longest_step_s: float
    delay_s: float


@dataclass(frozen=True, slots=True)
class LinkView:
    """How a vehicle's messages arrive, by what is kept of the last ten minutes.

    Attributes:
        rate_hz: samples a second in the last ten seconds of arrivals; None before there was one.
        step_s: usual step between stamps, the median of the seconds' means; None as above.
        gaps: steps longer than ``GAP_STEPS`` usual ones; longest_gap_s: the longest; 0 without.
        delay_s: median over the seconds of the slowest message's delay beyond the fastest's; None as above.
        longest_delay_s: the largest.
        silent_s: since the last message; None before there was one.
        seconds: oldest first.
    """

    rate_hz: float | None
    step_s: float | None
    gaps: int
    longest_gap_s: float
    delay_s: float | None
    longest_delay_s: float | None
    silent_s: float | None
    seconds: Sequence[LinkSecond]


@dataclass(frozen=True, slots=True)
class FlightRecordView:
    """What is kept of a vehicle for pictures.

    Attributes:
        blocks: oldest first.
        threshold: of the blocks' statistic, from which on an alert is raised; None without a monitor.
        onsets_s: by id of its alerts, when the fault began as far as it was known; of this run of the service.
        link: how its messages arrive.
    """

    blocks: Sequence[BlockRecord]
    threshold: float | None
    onsets_s: Mapping[str, float]
    link: LinkView
