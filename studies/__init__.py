"""Studies: thousands of seeded flights through simulation and monitor, one row each, and what they say."""

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
