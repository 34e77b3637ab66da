"""Groups of alerts as one fleet sees them."""

from collections.abc import Sequence

from wingwatch.monitor.views import AlertGroupView

__all__ = ["groups_of"]


def groups_of(groups: Sequence[AlertGroupView], fleet: str | None) -> list[AlertGroupView]:
    """Those with a vehicle of this fleet, whole: weather is no fleet's own; all without a fleet."""
    return [group for group in groups if fleet is None or fleet in (owner for owner, _ in group.vehicles)]
