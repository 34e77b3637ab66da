"""Studies: thousands of seeded flights through simulation and monitor, one row each, and what they say.

Example:
    One flight of the icing study, everything about it drawn from its seed:

    >>> from wingwatch.studies import draw_plan, load_fleet, load_grid
    >>> grid = load_grid("icing", None)
    >>> plan = draw_plan("icing", grid, 7, load_fleet(grid))
    >>> plan.aircraft, plan.effect, plan.target, round(plan.severity, 2), round(plan.onset_s)
    ('ultrastick25e', 'icing', 'wing', 0.25, 81)
    >>> plan == draw_plan("icing", grid, 7, load_fleet(grid))
    True
"""

from wingwatch.studies.grid import KINDS, Grid, Kind, StudyError, load_grid
from wingwatch.studies.plan import FlightPlan, draw_plan, load_fleet
from wingwatch.studies.table import COLUMNS, SCHEMA, Study, StudySettings, read_study

__all__ = [
    "COLUMNS",
    "KINDS",
    "SCHEMA",
    "FlightPlan",
    "Grid",
    "Kind",
    "Study",
    "StudyError",
    "StudySettings",
    "draw_plan",
    "load_fleet",
    "load_grid",
    "read_study",
]
