"""The process in which one uploaded flight is diagnosed, behind the service's back.

``python -m wingwatch.cli.diagnosis_worker FOLDER`` reads FOLDER's ``request.json``, ``aircraft.toml``, ``map.toml``
(where there is one) and ``flight``, tells its progress as lines of JSON on standard output, and writes ``report.html``
and ``result.json``. It yields to whatever else wants the processor or the memory, and ends when its standard input
does: with the service.
"""

import contextlib
import json
import os
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

__all__ = ["FLIGHT", "MAP", "AIRCRAFT", "REPORT", "REQUEST", "RESULT", "main"]

FLIGHT, MAP, AIRCRAFT, REQUEST = "flight", "map.toml", "aircraft.toml", "request.json"
REPORT, RESULT = "report.html", "result.json"

_LOWEST_PRIORITY = 19
_FIRST_TO_GO = "1000"


def main(folder: Path) -> int:
    """Diagnose; exit code 0 with a result, 2 with a sentence on the flight, 1 with one on the program."""
    _step_back()
    threading.Thread(target=_end_with_the_service, daemon=True).start()
    with _private_output() as out:

        def tell(**fields: Any) -> None:
            out.write(json.dumps(fields) + "\n")
            out.flush()

        return _diagnose(folder, tell)


def _diagnose(folder: Path, tell: Callable[..., None]) -> int:
    from wingwatch.aircraft import load_aircraft
    from wingwatch.cli.diagnosing import diagnose_file
    from wingwatch.cli.faults import blame
    from wingwatch.diagnosis import as_json, write_report

    name = str(json.loads((folder / REQUEST).read_text())["file"])
    try:
        channel_map = folder / MAP if (folder / MAP).exists() else None
        found = diagnose_file(
            folder / FLIGHT,
            load_aircraft(folder / AIRCRAFT),
            channel_map,
            progress=lambda what, fraction: tell(doing=what, progress=fraction),
            source=name,
        )
        write_report(found, folder / REPORT)
        (folder / RESULT).write_text(json.dumps(as_json(found), allow_nan=False))
    except Exception as error:
        sentence = blame(error)
        if sentence is not None:
            tell(problem=_with_name(sentence, folder, name))
            return 2
        tell(problem=f"internal error: {type(error).__name__}: {' '.join(str(error).split())[:300]}")
        return 1
    return 0


def _with_name(sentence: str, folder: Path, name: str) -> str:
    """The user knows the flight by its name, not by where it lies here."""
    return sentence.replace(str(folder / FLIGHT), name).replace(f"{folder}{os.sep}", "")


def _step_back() -> None:
    """Lowest priority for the processor; the first to be ended where memory runs out."""
    os.nice(_LOWEST_PRIORITY)
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
