"""Lines of a channel map that would mend a channel, written with what the user's own map says of it already."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from wingwatch.telemetry.maps import ChannelEntry

__all__ = ["Lines"]

_DEGREES = 0.017453292519943295
_OWN = {"scale": 1.0, "offset": 0.0, "delay_s": 0.0}


@dataclass(frozen=True, slots=True)
class Lines:
    """Writes entries of a channel map.

    Attributes:
        entries: by channel, what the flight's map says.
    """

    entries: Mapping[str, ChannelEntry] = field(default_factory=dict)

    def entry(self, channel: str) -> ChannelEntry:
        """What the map says of a channel; its own name where it says nothing."""
        return self.entries.get(channel) or ChannelEntry(source=channel)

    def in_unit(self, channel: str, unit: str, factor: float = 1.0) -> str:
        """The channel in another unit, perhaps with its sign turned."""
        entry = self.entry(channel)
        return _written(channel, entry.model_copy(update={"unit": unit, "scale": entry.scale * factor}))

    def turned(self, channel: str) -> str:
        """The channel with its sign turned."""
        entry = self.entry(channel)
        changed = {"scale": -entry.scale, "offset": 0.0 - entry.offset}
        return _written(channel, entry.model_copy(update=changed))

    def earlier(self, channel: str, lag_s: float) -> str:
        """The channel read ``lag_s`` later than now."""
        entry = self.entry(channel)
        return _written(channel, entry.model_copy(update={"delay_s": round(entry.delay_s + lag_s, 3)}))

    def from_source_of(self, channel: str, other: str) -> str:
        """The channel from where another one is read now."""
        return _written(channel, self.entry(other))

    def with_gravity(self) -> str:
        """Accelerometers to which gravity is added again; empty where their columns cannot be added to."""
        roll, pitch = self._angle("roll_rad"), self._angle("pitch_rad")
        terms = {
            "x": f"+ 9.80665 * sin({pitch})",
            "y": f"- 9.80665 * cos({pitch}) * sin({roll})",
            "z": f"- 9.80665 * cos({pitch}) * cos({roll})",
        }
        written = []
        for axis, term in terms.items():
            channel = f"specific_force_{axis}_m_s2"
            entry = self.entry(channel)
            plain = entry.unit in (None, "m/s2") and (entry.scale, entry.offset, entry.delay_s) == (
                1.0,
                0.0,
                0.0,
            )
            if not (plain and roll and pitch):
                return ""
            written.append(_written(channel, entry.model_copy(update={"source": f"{entry.source} {term}"})))
        return "\n".join(written)

    def _angle(self, channel: str) -> str:
        """An attitude as a term in rad; empty where it has an offset or a delay."""
        entry = self.entry(channel)
        if entry.unit not in (None, "rad", "deg") or entry.offset != 0.0 or entry.delay_s != 0.0:
            return ""
        factor = entry.scale * (_DEGREES if entry.unit == "deg" else 1.0)
        return entry.source if factor == 1.0 else f"{factor:.9g} * ({entry.source})"


def _written(channel: str, entry: ChannelEntry) -> str:
    """The entry as a line of TOML, without what need not be said."""
    said = []
    for key, value in entry.model_dump(exclude_none=True).items():
        if value == _OWN.get(key):
            continue
        if isinstance(value, str):
            escaped = value.replace("\\", "\\\\").replace('"', '\\"')
            said.append(f'{key} = "{escaped}"')
        else:
            said.append(f"{key} = {value:.9g}")
    return f"{channel} = {{ {', '.join(said)} }}"
