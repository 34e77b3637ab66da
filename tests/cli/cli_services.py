"""Services on free ports that take no samples in: no kernel is needed for what these tests ask."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from loopback import free_endpoint

from wingwatch.api import KernelsView
from wingwatch.service.service import Service, running_service
from wingwatch.service.settings import ServeSettings

__all__ = ["service_in"]


class _Waiting:
    """A preparation that goes on until it is ended."""

    def __init__(self) -> None:
        self._end = threading.Event()

    def prepare(self) -> bool:
        self._end.wait(60.0)
        return False

    def view(self) -> KernelsView | None:
        return None

    def stop(self) -> None:
        self._end.set()


@contextmanager
def service_in(folder: Path, **settings: Any) -> Iterator[Service]:
    """A service whose data are in ``folder``; its samples wait."""
    given = {"listen": (free_endpoint(),), **settings}
    with running_service(ServeSettings(port=0, data=folder, **given), preparation=_Waiting()) as service:
        yield service
