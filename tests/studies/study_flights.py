"""Small studies that several tests fly."""

import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from wingwatch.studies import Grid, Kind, StudySettings, load_fleet, load_grid
from wingwatch.studies.run import Answer, Progress, Task, fly_task, run_study
from wingwatch.studies.versions import code_version, settings_version

GRID = """
seconds = 40.0
aircraft = "aerosonde"
condition = "cruise"
route = "straight"
turbulence = "none"
excitation = "doublet"
excitation_period_s = 20.0
noise_scale = 1.0
sensors = "vanes"
surfaces = "positions"
onset_s = 20.0
ramp_s = 0.0
"""


class InThisProcess:
    """Flies tasks one after another; stops of itself after ``most``."""

    def __init__(self, most: int = 1_000_000) -> None:
        self.most = most
        self.flown: list[int] = []

    def answers(self, tasks: Sequence[Task], end: threading.Event) -> Iterator[Answer]:
        for task in tasks[: self.most]:
            self.flown.append(task.index)
            yield fly_task(task)


def small_grid(folder: Path, kind: Kind = "icing", more: str = "") -> Grid:
    """The grid above, with more keys."""
    path = folder / "grid.toml"
    path.write_text(GRID + more, encoding="utf-8")
    return load_grid(kind, path)


def settings(grid: Grid, flights: int, kind: Kind = "icing", first_seed: int = 0) -> StudySettings:
    return StudySettings(
        kind, grid, first_seed, flights, load_fleet(grid), code_version(), settings_version()
    )


def flown(study: StudySettings, out: Path, workers: Any, *, resume: bool = False) -> Progress:
    return run_study(study, out, workers, resume=resume, end=threading.Event(), show=lambda progress: None)


def untimed(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    """Rows without their timings, each value to the bit (NaN equals NaN)."""
    return [
        {
            name: value.hex() if isinstance(value, float) else repr(value)
            for name, value in row.items()
            if name not in ("wall_s", "processor_s")
        }
        for row in rows
    ]
