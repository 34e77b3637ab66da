"""The aircraft a service knows: those of the library and those of the files it was given."""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

from wingwatch.aircraft import Aircraft, library_names, load_aircraft
from wingwatch.operations.faults import CommandError

__all__ = ["AircraftRegistry"]


class AircraftRegistry:
    """Finds an aircraft by its name. A name that came over the network never opens a file.

    Args:
        files: aircraft files, read now; each is known by the ``name`` it states.

    Raises:
        AircraftFileError: a file that cannot be used.
        CommandError: two files, or a file and the library, claim the same name.
    """

    def __init__(self, files: Sequence[Path] = ()) -> None:
        self._given: dict[str, Aircraft] = {}
        for path in files:
            aircraft = load_aircraft(path)
            if aircraft.name in self._given or aircraft.name in library_names():
                raise CommandError(
                    f"aircraft file {path}: the name {aircraft.name!r} is taken by another file or the library; "
                    "give it a name of its own"
                )
            self._given[aircraft.name] = aircraft
        self._of_library = lru_cache(maxsize=len(library_names()))(load_aircraft)

    @property
    def names(self) -> tuple[str, ...]:
        """Every name that can be announced."""
        return tuple(sorted((*library_names(), *self._given)))

    def find(self, name: str) -> Aircraft:
        """The aircraft of that name.

        Raises:
            ValueError: there is none; one sentence.
        """
        if name in self._given:
            return self._given[name]
        if name not in library_names():
            raise ValueError(
                f"aircraft {name!r} is not known here, which has {', '.join(self.names)}; "
                "start the service with --aircraft FILE"
            )
        return self._of_library(name)
