"""The process in which one flight is diagnosed, behind the service's back.

``python -m wingwatch.service.diagnosis_worker FOLDER`` reads FOLDER's ``request.json`` and ``aircraft.toml``, and
``flight`` with ``map.toml`` (where there is one), or ``samples.npz`` where the request is about an alert. It tells its
progress as lines of JSON on standard output, and writes ``report.html`` and ``result.json``. It yields to whatever else
wants the processor or the memory, and ends when its standard input does: with the service.
"""

import contextlib
import json
import os
import sys
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TextIO

from wingwatch.operations.diagnosis_files import AIRCRAFT, CHANGE, FLIGHT, MAP, REPORT, REQUEST, RESULT

__all__ = ["main"]

_LOWEST_PRIORITY, _OF_ALERTS = 19, 10
"""Niceness of uploaded flights, which may take minutes; and of alerts, whose answer is waited for."""
_FIRST_TO_GO = "1000"


def main(folder: Path) -> int:
    """Diagnose; exit code 0 with a result, 2 with a sentence on the flight, 1 with one on the program."""
    request = json.loads((folder / REQUEST).read_text())
    _step_back(_OF_ALERTS if CHANGE in request else _LOWEST_PRIORITY)
    threading.Thread(target=_end_with_the_service, daemon=True).start()
    with _private_output() as out:

        def tell(**fields: Any) -> None:
            out.write(json.dumps(fields) + "\n")
            out.flush()

        return _diagnose(folder, request, tell)


def _diagnose(folder: Path, request: Mapping[str, Any], tell: Callable[..., None]) -> int:
    from wingwatch.operations.faults import user_error

    name = str(request["file"])
    answer = _of_alert if CHANGE in request else _of_upload
    try:
        result = answer(folder, name, lambda what, fraction: tell(doing=what, progress=fraction))
        (folder / RESULT).write_text(json.dumps(result, allow_nan=False))
    except Exception as error:
        sentence = user_error(error)
        if sentence is not None:
            tell(problem=_with_name(sentence, folder, name))
            return 2
        tell(problem=f"internal error: {type(error).__name__}: {' '.join(str(error).split())[:300]}")
        return 1
    return 0


def _of_upload(folder: Path, name: str, progress: Callable[[str, float], None]) -> dict[str, Any]:
    from wingwatch.aircraft import load_aircraft
    from wingwatch.diagnosis import as_json, write_report
    from wingwatch.operations.diagnosing import diagnose_file

    channel_map = folder / MAP if (folder / MAP).exists() else None
    aircraft = load_aircraft(folder / AIRCRAFT)
    found, _ = diagnose_file(folder / FLIGHT, aircraft, channel_map, progress=progress, source=name)
    write_report(found, folder / REPORT)
    return as_json(found)


def _of_alert(folder: Path, name: str, progress: Callable[[str, float], None]) -> dict[str, Any]:
    from wingwatch.operations.diagnosis_change import diagnose_request

    return diagnose_request(folder, folder / REPORT, progress)


def _with_name(sentence: str, folder: Path, name: str) -> str:
    """The user knows the flight by its name, not by where it lies here."""
    return sentence.replace(str(folder / FLIGHT), name).replace(f"{folder}{os.sep}", "")


def _step_back(niceness: int) -> None:
    """Low priority for the processor; the first to be ended where memory runs out."""
    os.nice(niceness)
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(_FIRST_TO_GO)


def _end_with_the_service() -> None:
    while os.read(0, 4096):  # a pipe into which nothing is ever written
        pass
    os._exit(1)


def _private_output() -> TextIO:
    """Standard output for our lines alone; what libraries print there goes to standard error."""
    private = os.dup(1)
    os.dup2(2, 1)
    return os.fdopen(private, "w", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
