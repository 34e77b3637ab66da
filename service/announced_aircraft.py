"""What a vehicle calls the aircraft that it is."""

from pathlib import Path

from wingwatch.aircraft import library_names, load_aircraft
from wingwatch.operations.faults import CommandError, say

__all__ = ["announced"]


def announced(aircraft: str) -> str:
    """The name a vehicle announces: that of the library or the one its file states."""
    is_file = Path(aircraft).suffix == ".toml" or "/" in aircraft
    name = load_aircraft(Path(aircraft)).name if is_file else aircraft
    if name not in library_names():
        if not is_file:
            known = ", ".join(library_names())
            raise CommandError(
                f"aircraft {name!r} is not in the library, which has {known}; give the path of its file"
            )
        say(f"the service must have been started with --aircraft {aircraft}: it is not in the library")
    return name
