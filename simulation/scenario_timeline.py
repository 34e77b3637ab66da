"""The parameters of a scenario's flight over time: what is flown, and so what is true."""

from collections.abc import Sequence

from wingwatch.simulation.effects import Effect
from wingwatch.simulation.scenario import Scenario
from wingwatch.simulation.timeline import Timeline, base_row, timeline
from wingwatch.simulation.turbulence import Turbulence, gust_scales

__all__ = ["filter_level", "timeline_of"]


def filter_level(scenario_level: Turbulence, effects: Sequence[Effect]) -> Turbulence:
    """Level of the gust filter: that of the scenario; "light" where turbulence begins in flight."""
    if scenario_level == "none" and any(effect.name == "turbulence" for effect in effects):
        return "light"
    return scenario_level


def timeline_of(scenario: Scenario) -> Timeline:
    """The parameters of a scenario's flight.

    Raises:
        AircraftDataError, TrimError: as ``base_row``.
    """
    level = filter_level(scenario.turbulence, scenario.effects)
    sigma = gust_scales(level, scenario.height_m, scenario.turbulence_model).sigma_w_m_s
    gain = 0.0 if scenario.turbulence == "none" else 1.0
    clean = base_row(scenario.aircraft, scenario.condition, gain, sigma)
    return timeline(scenario.aircraft, scenario.condition, scenario.effects, clean)
