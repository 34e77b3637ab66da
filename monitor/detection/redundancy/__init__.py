"""Analytical redundancy: channels that must agree with one another, whatever the aircraft does, second by second.

``RedundancyWatch`` takes samples and tests, for all vehicles of a type; ``VehicleRelations`` are one vehicle's, with
the alerts of what is found.
Method: ``docs/methods/redundancy.md``.
"""

from wingwatch.monitor.detection.redundancy.book import RedundancyBookState
from wingwatch.monitor.detection.redundancy.hypotheses import Hypothesis
from wingwatch.monitor.detection.redundancy.vehicle_relations import VehicleRelations
from wingwatch.monitor.detection.redundancy.watch import RedundancyState, RedundancyWatch

__all__ = ["Hypothesis", "RedundancyBookState", "RedundancyState", "RedundancyWatch", "VehicleRelations"]
