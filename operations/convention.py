"""What ``--convention`` does to derivatives on their way out: the code that ``?convention=`` runs."""

from collections.abc import Mapping
from typing import Any

from wingwatch.aircraft import Aircraft, AircraftDataError, Convention
from wingwatch.operations.faults import CommandError

__all__ = ["check_convention", "in_convention"]


def check_convention(aircraft: Aircraft, convention: str) -> None:
    """Refuse before the work what could not be printed after it.

    Raises:
        CommandError: the aircraft's file lacks what the convention needs.
    """
    if convention == Convention.CONCISE:
        return
    try:
        aircraft.need_mass(f"the {convention} convention")
        aircraft.need_geometry(f"the {convention} convention")
    except AircraftDataError as error:
        raise CommandError(f"--convention {convention}: {error}") from None


def in_convention(
    estimators: Mapping[str, Any],
    aircraft: Aircraft,
    convention: str,
    configuration: str = "clean",
    latest: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """Every mode of every estimator in a convention (``api.convert_modes``); concise ones are left as they are.

    ``latest`` is the flight condition of modes that state none.

    Raises:
        CommandError: the aircraft's file lacks what the convention needs.
    """
    if convention == Convention.CONCISE:
        return dict(estimators)
    from wingwatch.api import convert_modes  # concise derivatives do without the web framework

    try:
        return convert_modes(
            estimators, aircraft, Convention(convention), latest=latest, configuration=configuration
        )
    except ValueError as error:
        raise CommandError(f"--convention {convention}: {error}") from None
