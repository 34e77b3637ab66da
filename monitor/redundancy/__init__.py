"""Analytical redundancy: channels that must agree with one another, whatever the aircraft does, second by second.

``RedundancyWatch`` takes samples and tests, ``RedundancyBook`` makes alerts of what it finds.
Method: ``docs/methods/redundancy.md``.
"""

from wingwatch.monitor.redundancy.book import RedundancyBook, RedundancyBookState
from wingwatch.monitor.redundancy.hypotheses import Hypothesis
from wingwatch.monitor.redundancy.watch import RedundancyState, RedundancyWatch

__all__ = ["Hypothesis", "RedundancyBook", "RedundancyBookState", "RedundancyState", "RedundancyWatch"]
