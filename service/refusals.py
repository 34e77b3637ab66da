"""What Zenoh's access rules refuse: counted and logged, where this process keeps the rules.

Zenoh says that its rules have refused a message in its own log alone, which it writes to the process's standard
output. While rules are kept that output is read here, and what the program itself prints goes round it. Of a publisher
that declares its key the log names the key once; of one that does not, every message.
"""

import logging
import os
import re
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

import zenoh

from wingwatch.telemetry.keys import KeyNameError, parse_key

__all__ = ["Refusals", "noticed_refusals"]

_LOG = logging.getLogger(__name__)
_FILTER = "zenoh::net::routing::interceptor::access_control=trace"
_COLOURS = re.compile(rb"\x1b\[[0-9;]*m")
_REFUSED = re.compile(rb"(\S+) is unauthorized to Put \(ingress\) on (\S+)")
_NAME = re.compile(rb"(?:CertCommonName|Username)\(([^)]{1,200})\)")
_NO_SUBJECT = b"did not match any configured ACL subject"
_CHUNK, _MOST_LINE = 65_536, 16_384
_SAID_AGAIN_S = 60.0
_MOST_SAID = 1000
_JOIN_S = 1.0


class Refusals:
    """Reads Zenoh's log.

    Args:
        clock: monotonic seconds.

    Attributes:
        counts: ``refused_writes`` under keys of the contract, and ``unknown_subjects``: links of which no rule knows.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._rest = b""
        self._said_s: dict[tuple[str, str], float] = {}
        self.counts: dict[str, int] = {"refused_writes": 0, "unknown_subjects": 0}

    def take(self, text: bytes) -> None:
        """The next bytes of the log, cut anywhere."""
        *lines, rest = (self._rest + text).split(b"\n")
        self._rest = rest[-_MOST_LINE:]
        for line in lines:
            self._line(_COLOURS.sub(b"", line))

    def _line(self, line: bytes) -> None:
        if (found := _REFUSED.search(line)) is not None:
            who = _NAME.search(found[1])
            self._refused("somebody unknown" if who is None else who[1].decode("utf-8", "replace"), found[2])
        elif _NO_SUBJECT in line:
            self.counts["unknown_subjects"] += 1
            self._say("", "", "a link was opened by somebody of whom no access rule knows", None)

    def _refused(self, who: str, key: bytes) -> None:
        name = key.decode("utf-8", "replace")
        try:
            parsed = parse_key(name)
        except KeyNameError:
            return  # of a link's other business; nobody reads such keys
        self.counts["refused_writes"] += 1
        text = f"the access rules refuse that {who} writes {name}"
        self._say(who, name, text, f"{parsed.fleet}/{parsed.vehicle}")

    def _say(self, who: str, key: str, text: str, vehicle: str | None) -> None:
        """Once a minute for each who and each key."""
        now_s = self._clock()
        if now_s - self._said_s.get((who, key), float("-inf")) < _SAID_AGAIN_S:
            return
        if len(self._said_s) >= _MOST_SAID:
            self._said_s.clear()
        self._said_s[who, key] = now_s
        _LOG.warning("%s", text, extra={} if vehicle is None else {"vehicle": vehicle})


@contextmanager
def noticed_refusals(kept: bool) -> Iterator[Mapping[str, int]]:
    """The counts of what access rules refuse, which grow until the end.

    To be entered before a session is opened, once in a process.

    Args:
        kept: whether this process keeps rules; without, nothing is touched and nothing counted.
    """
    if not kept:
        yield {}
        return
    refusals = Refusals()
    sys.stdout.flush()
    ours, real = sys.stdout, os.dup(1)
    reading, writing = os.pipe()
    os.dup2(writing, 1)
    os.close(writing)
    sys.stdout = os.fdopen(os.dup(real), "w", buffering=1, encoding=ours.encoding)
    os.environ["RUST_LOG"] = f"{os.environ.get('RUST_LOG') or 'error'},{_FILTER}"
    zenoh.try_init_log_from_env()  # type: ignore[no-untyped-call]
    thread = threading.Thread(target=_read, args=(reading, refusals), name="wingwatch-refusals", daemon=True)
    thread.start()
    try:
        yield refusals.counts
    finally:
        sys.stdout.close()
        sys.stdout = ours
        os.dup2(real, 1)
        os.close(real)
        thread.join(_JOIN_S)


def _read(reading: int, refusals: Refusals) -> None:
    """Until the other end is closed. Whatever happens the log is read: who writes it would wait."""
    while text := os.read(reading, _CHUNK):
        try:
            refusals.take(text)
        except Exception:
            _LOG.exception("Zenoh's log could not be read")
    os.close(reading)
