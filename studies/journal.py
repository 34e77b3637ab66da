"""Finished flights on disk as they come, so that a study goes on where it was when its process ended.

Beside ``STUDY.parquet`` stands the folder ``STUDY.parquet.parts`` with the settings and one small table a task, each
put there whole. When the last task is in, the tables become the study's file and the folder goes.
"""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from wingwatch.studies.grid import StudyError
from wingwatch.studies.table import StudySettings, read_settings, rows_table, write_atomically, write_study

__all__ = ["Journal", "settings_of"]

_SETTINGS = "study.json"


def _folder(out: Path) -> Path:
    return out.with_name(f"{out.name}.parts")


def settings_of(out: Path) -> StudySettings:
    """The settings of a study, finished or not.

    Raises:
        StudyError, OSError: as ``read_settings``.
    """
    unfinished = _folder(out) / _SETTINGS
    if not out.exists() and unfinished.exists():
        return StudySettings.from_json(unfinished.read_text(encoding="utf-8"), str(unfinished))
    return read_settings(out)


class Journal:
    """The unfinished study of one output file.

    Args:
        out: the study's file, which must not be there yet.
        settings: of the study.
        resume: go on with what is there.

    Raises:
        StudyError: the output or, without ``resume``, an unfinished study is already there; or one of other settings.
    """

    def __init__(self, out: Path, settings: StudySettings, *, resume: bool) -> None:
        self._out, self._settings = out, settings
        self.folder = _folder(out)
        if out.suffix.lower() != ".parquet":
            raise StudyError(f"{out}: a study is written as Parquet; end its name in .parquet")
        if not out.parent.is_dir():
            raise StudyError(f"{out}: there is no folder {out.parent}; create it")
        if out.exists():
            raise StudyError(f"{out} is there already; give another name, or delete it")
        if not self.folder.is_dir():
            self._begin()
        elif not resume:
            raise StudyError(
                f"{self.folder} holds an unfinished study; go on with it by --resume, or delete that folder"
            )
        else:
            self._check(StudySettings.from_json(self._text(), str(self.folder)))

    def _begin(self) -> None:
        try:
            self.folder.mkdir()
        except OSError as error:
            raise StudyError(f"{self.folder} cannot be created ({(error.strerror or '').lower()})") from None

        def write(path: Path) -> None:
            path.write_text(self._settings.as_json(), encoding="utf-8")

        write_atomically(self.folder / _SETTINGS, write)

    def _text(self) -> str:
        try:
            return (self.folder / _SETTINGS).read_text(encoding="utf-8")
        except FileNotFoundError:  # it ended before anything was flown
            return self._settings.as_json()

    def _check(self, begun: StudySettings) -> None:
        mine = self._settings
        for what, differs in (
            ("kind", begun.kind != mine.kind),
            ("grid", begun.grid != mine.grid),
            ("first seed", begun.first_seed != mine.first_seed),
            ("number of flights", begun.flights != mine.flights),
            ("aircraft file", begun.aircraft != mine.aircraft),
            ("version of the program", begun.code_version != mine.code_version),
            ("version of the monitor's settings", begun.settings_version != mine.settings_version),
        ):
            if differs:
                raise StudyError(
                    f"the unfinished study in {self.folder} has another {what}: go on with the one it was begun with, "
                    "or delete that folder"
                )

    def _part(self, index: int) -> Path:
        return self.folder / f"{index:08d}.parquet"

    def finished(self, tasks: int) -> set[int]:
        """The tasks whose rows are kept."""
        there = {path.name for path in self.folder.iterdir()}
        return {index for index in range(tasks) if self._part(index).name in there}

    def keep(self, index: int, rows: Sequence[Mapping[str, Any]]) -> None:
        """Keep a task's rows.

        Raises:
            StudyError: the disk is full or refuses.
        """
        table = rows_table(rows)

        def write(path: Path) -> None:
            with path.open("wb") as file:
                pq.write_table(table, file)

        write_atomically(self._part(index), write)

    def rows(self, index: int) -> list[dict[str, Any]]:
        """A task's rows."""
        found: list[dict[str, Any]] = pq.read_table(self._part(index)).to_pylist()
        return found

    def finish(self, tasks: int) -> None:
        """Write the study's file from all tasks, and remove the folder.

        Raises:
            StudyError: the file could not be written; the folder stays.
        """
        write_study(self._out, self._settings, (self._table(index) for index in range(tasks)))
        shutil.rmtree(self.folder, ignore_errors=True)

    def _table(self, index: int) -> Any:
        return pq.read_table(self._part(index))
