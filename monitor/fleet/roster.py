"""The vehicles that are remembered: a bounded number, of which invented names cannot shut out the real ones."""

from collections.abc import Callable, Iterator

from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle

__all__ = ["KEPT_S", "Roster", "VehicleKey"]

VehicleKey = tuple[str, str]
"""Fleet and vehicle."""

KEPT_S = 600.0
"""Silence for which a vehicle whose aircraft is known keeps its place, whoever wants it."""

_LOOK_AGAIN_S = 1.0


class Roster:
    """Vehicles by name. Where all places are taken, a new name takes that of the longest silent stranger.

    A stranger is a vehicle whose aircraft is not known. Without one, a known vehicle that has been silent for
    ``KEPT_S`` gives way. One with an alert never does.

    Args:
        most: places.
        clock: wall clock, s.
        alarmed: whether an alert of the vehicle stands.

    Attributes:
        forgotten: vehicles that gave way; gone: what had been counted of them; refused: messages whose vehicle found no
            place.
    """

    def __init__(self, most: int, clock: Callable[[], float], alarmed: Callable[[VehicleKey], bool]) -> None:
        self._most, self._clock, self._alarmed = most, clock, alarmed
        self._vehicles: dict[VehicleKey, KnownVehicle] = {}
        self._strangers: dict[VehicleKey, None] = {}  # longest silent first
        self._full_until_s = float("-inf")
        self._forgot: Callable[[VehicleKey], object] = lambda _: None
        self.forgotten = 0
        self.gone: dict[str, int] = {}
        self.refused = 0

    def tell_forgotten(self, forgotten: Callable[[VehicleKey], object]) -> None:
        """Call this with the name of each vehicle that gives way from now on."""
        self._forgot = forgotten

    def __len__(self) -> int:
        return len(self._vehicles)

    def items(self) -> Iterator[tuple[VehicleKey, KnownVehicle]]:
        """All vehicles."""
        return iter(self._vehicles.items())

    def get(self, key: VehicleKey) -> KnownVehicle | None:
        """The vehicle of that name; None if it is not remembered."""
        return self._vehicles.get(key)

    def heard(self, key: VehicleKey) -> KnownVehicle | None:
        """The vehicle a message has come from, made room for if it is new; None where there is no room."""
        known = self._vehicles.get(key)
        if known is None:
            if len(self._vehicles) >= self._most and not self._make_room():
                self.refused += 1
                return None
            known = self._vehicles[key] = KnownVehicle()
        known.messages.hear(self._clock())
        self.sort(key)
        return known

    def resume(self, key: VehicleKey, known: KnownVehicle) -> bool:
        """A vehicle of before a restart takes its place; False where none is left."""
        if len(self._vehicles) >= self._most:
            return False
        known.counts.note_earlier_run(known.all_counts)
        self._vehicles[key] = known
        self.sort(key)
        return True

    def remove(self, key: VehicleKey) -> KnownVehicle | None:
        """A vehicle is watched elsewhere from now on; what it has counted stays counted."""
        known = self._vehicles.pop(key, None)
        if known is not None:
            known.add_counts(self.gone)
            self._strangers.pop(key, None)
        return known

    def sort(self, key: VehicleKey) -> None:
        """Put a vehicle where it belongs, after a message or when its aircraft may have become known."""
        self._strangers.pop(key, None)
        if self._vehicles[key].said is None:
            self._strangers[key] = None

    def _make_room(self) -> bool:
        now_s = self._clock()
        if not self._strangers and now_s < self._full_until_s:
            return False
        gone = next((key for key in self._strangers if not self._alarmed(key)), None) or self._silent(now_s)
        if gone is None:
            self._full_until_s = now_s + _LOOK_AGAIN_S  # looking through all of them is not for every message
            return False
        self._vehicles.pop(gone).add_counts(self.gone)
        self._strangers.pop(gone, None)
        self.forgotten += 1
        self._forgot(gone)
        return True

    def _silent(self, now_s: float) -> VehicleKey | None:
        """The longest silent of the known vehicles that may give way."""
        silent = [
            (known.messages.heard_s, key)
            for key, known in self._vehicles.items()
            if known.said is not None and now_s - known.messages.heard_s > KEPT_S and not self._alarmed(key)
        ]
        return min(silent)[1] if silent else None
