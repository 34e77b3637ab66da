"""Ice on several vehicles of one area is one event: their alerts are shown as a group."""

from collections.abc import Iterator, Mapping, Sequence

from wingwatch.monitor.positions import Place, Position, near_one_another
from wingwatch.monitor.views import LEVELS, AlertGroupView, AlertState, AlertView

__all__ = ["IcingGroups"]

NEAR_M = 32_200.0
"""17.4 nautical miles: the standard extent of a stratiform icing cloud (14 CFR part 25, appendix C, figure 3)."""
ABOVE_M = 2_000.0
"""6,500 ft: the greatest depth of continuous icing (appendix C, figure 1)."""
WITHIN_S = 1_800.0
"""Wall-clock time between two onsets; a judgement: what is in one cloud half an hour later may be in another."""


class IcingGroups:
    """Where and when alerts of icing were raised, and which of them belong together.

    With the fleet's lock held. What was raised before the service started has no place, and is in no group.
    """

    def __init__(self) -> None:
        self._places: dict[str, tuple[int, Place]] = {}

    def note(self, alert: AlertView, position: Position | None, at_s: float) -> None:
        """A version of an alert: remembers where and when it was raised, and again where it has come back.

        Args:
            position: of the vehicle now; None where it does not say.
            at_s: when the alert was raised, by a clock that all vehicles share.
        """
        if alert.state is AlertState.CLEARED:
            self._places.pop(alert.id, None)
        elif alert.kind == "icing" and position is not None:
            repeats, _ = self._places.get(alert.id, (-1, None))
            if alert.repeats > repeats:
                self._places[alert.id] = alert.repeats, Place(position, at_s)

    @property
    def places(self) -> Mapping[str, tuple[int, Place]]:
        """Where and when alerts in force were raised, by id, with how often each had come back by then."""
        return dict(self._places)

    def take(self, places: Mapping[str, tuple[int, Place]]) -> None:
        """What others have remembered, too; of the same alert what was noted last."""
        for name, (repeats, place) in places.items():
            if repeats > self._places.get(name, (-1, None))[0]:
                self._places[name] = repeats, place

    def groups(self, alerts: Sequence[AlertView]) -> list[AlertGroupView]:
        """Groups of at least two vehicles, largest first.

        Args:
            alerts: all that are announced, newest first; those in force count.
        """
        iced = [
            alert
            for alert in reversed(alerts)
            if alert.kind == "icing" and alert.state is not AlertState.CLEARED and alert.id in self._places
        ]
        places = [self._places[alert.id][1] for alert in iced]
        clusters = near_one_another(places, NEAR_M, ABOVE_M, WITHIN_S)
        return sorted(_groups(iced, places, clusters), key=lambda group: -len(group.vehicles))


def _groups(
    alerts: Sequence[AlertView], places: Sequence[Place], clusters: Sequence[int]
) -> Iterator[AlertGroupView]:
    for number in dict.fromkeys(clusters):
        members = [k for k, cluster in enumerate(clusters) if cluster == number]
        own = [alerts[k] for k in members]
        vehicles = tuple(dict.fromkeys((alert.fleet, alert.vehicle) for alert in own))
        if len(vehicles) < 2:
            continue
        latitude, longitude, altitude = _middle([places[k].position for k in members])
        where = f"{_angle(latitude, 'NS')} {_angle(longitude, 'EW')} at {altitude:.0f} m"
        yield AlertGroupView(
            id=f"group-{own[0].id}",
            kind="icing",
            level=max((alert.level for alert in own), key=LEVELS.index),
            alerts=tuple(alert.id for alert in own),
            vehicles=vehicles,
            latitude_deg=latitude,
            longitude_deg=longitude,
            altitude_m=altitude,
            text=f"Ice on {len(vehicles)} vehicles near {where}. Keep others out of this area and altitude.",
        )


def _middle(positions: Sequence[Position]) -> tuple[float, float, float]:
    """Mean latitude, longitude and altitude; longitudes count from the first one, on either side of 180 degrees."""
    first, n = positions[0].longitude_deg, len(positions)
    east = sum((p.longitude_deg - first + 180.0) % 360.0 - 180.0 for p in positions) / n
    longitude = (first + east + 180.0) % 360.0 - 180.0
    return sum(p.latitude_deg for p in positions) / n, longitude, sum(p.altitude_m for p in positions) / n


def _angle(degrees: float, letters: str) -> str:
    return f"{abs(degrees):.2f}° {letters[degrees < 0.0]}"
