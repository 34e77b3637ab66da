"""Receivers on loopback that tests send to, alerts to send, and a channel that writes down what it is given."""

import http.server
import json
import queue
import socket
import socketserver
import ssl
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from wingwatch.monitor import AlertState, AlertView, EvidenceView
from wingwatch.notifications import NotDeliveredError, Notice, Patience, Selection
from wingwatch.notifications.dispatcher import Clocks, Dispatcher
from wingwatch.notifications.outbox import Outbox

__all__ = [
    "ICING",
    "NOT_NOW",
    "Bench",
    "HttpReceiver",
    "Recorder",
    "http_receiver",
    "smtp_receiver",
    "udp_receiver",
]

ICING = AlertView(
    id="a1", fleet="north", vehicle="uav1", kind="icing", cause="icing", level="warning", state=AlertState.ACTIVE,
    raised_s=80.5, cleared_s=None, size=0.16, size_standard_error=0.02, probability=0.97, basis="a-priori",
    text="Icing of severity 0.16 ± 0.02 (Twin Otter scale), since about 60 s. Leave icing conditions.",
    evidence=(EvidenceView("z_w", -2.8, 0.1, -3.5, 0.05, 6.3),),
)  # fmt: skip


@dataclass
class Recorder:
    """A channel that takes what it is given, or fails as it is asked to; after a kill it has still taken it."""

    place: str = "nowhere"
    keeps_first: bool = True
    fails: Exception | None = None
    taken: list[Notice] = field(default_factory=list)
    after: Callable[[], None] = lambda: None

    def send(self, notice: Notice) -> None:
        if self.fails is not None:
            raise self.fails
        self.taken.append(notice)
        self.after()

    def close(self) -> None:
        pass

    @property
    def steps(self) -> list[str]:
        return [f"{n.alert['id']} {'+'.join(n.steps)}" for n in self.taken]


class Bench:
    """A dispatcher with a clock that stands still, looked at by the test itself: no thread and no waiting."""

    def __init__(
        self, outbox: Any, channel: Recorder | None = None, selection: Selection | None = None
    ) -> None:
        self.now_s, self.wall_s = 0.0, 1_700_000_000.0
        self.outbox = Outbox(outbox)
        self.channel = channel or Recorder()
        clocks = Clocks(lambda: self.now_s, lambda: self.wall_s + self.now_s, lambda: 1.0)
        patience = Patience(first_s=1.0, most_s=60.0, keep_s=3600.0)
        self.dispatcher = Dispatcher(
            "test1", self.channel, self.outbox, selection or Selection(), patience, clocks
        )

    def hear(self, alert: AlertView = ICING, **changes: Any) -> AlertView:
        """A version of an alert is announced, and looked at."""
        changed = replace(alert, **changes)
        self.dispatcher.hear(lambda: changed)
        self.dispatcher.look()
        return changed

    def after(self, seconds: float) -> None:
        self.now_s += seconds
        self.dispatcher.look()


NOT_NOW = NotDeliveredError("not now")


@dataclass
class HttpReceiver:
    """What a receiver got: headers, body; ``answers`` are given in turn, the last for ever.

    An answer is a status, or a function that does something with the handler.
    """

    url: str
    answers: list[Any]
    got: list[tuple[dict[str, str], bytes]] = field(default_factory=list)
    news: threading.Condition = field(default_factory=threading.Condition)

    def await_got(self, count: int, patience_s: float = 20.0) -> list[tuple[dict[str, str], bytes]]:
        with self.news:
            assert self.news.wait_for(lambda: len(self.got) >= count, patience_s), (
                f"got {len(self.got)} of {count}"
            )
            return list(self.got)

    def alerts(self) -> list[Any]:
        return [json.loads(body) for _, body in self.got]


@contextmanager
def http_receiver(*answers: Any, context: ssl.SSLContext | None = None) -> Iterator[HttpReceiver]:
    """An HTTP server on a free port of loopback."""

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            with receiver.news:
                receiver.got.append((dict(self.headers), body))
                index = min(len(receiver.got), len(receiver.answers)) - 1
                answer = receiver.answers[index]
                receiver.news.notify_all()
            if callable(answer):
                answer(self)
                return
            self.send_response(answer)
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    class Server(http.server.ThreadingHTTPServer):
        daemon_threads = True
        block_on_close = False

        def handle_error(self, *_: object) -> None:
            pass

    server = Server(("127.0.0.1", 0), Handler)
    if context is not None:
        server.socket = context.wrap_socket(server.socket, server_side=True)
    scheme = "http" if context is None else "https"
    receiver = HttpReceiver(f"{scheme}://127.0.0.1:{server.server_port}", list(answers) or [200])
    thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    try:
        yield receiver
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


class _Smtp(socketserver.StreamRequestHandler):
    """As much of SMTP as a mail needs that is sent without TLS and password."""

    def handle(self) -> None:
        self.wfile.write(b"220 here\r\n")
        while words := self.rfile.readline().split():
            if words[0].upper() == b"DATA":
                self.wfile.write(b"354 go on\r\n")
                self.server.mails.put(b"".join(iter(self.rfile.readline, b".\r\n")))  # type: ignore[attr-defined]
            self.wfile.write(b"221 bye\r\n" if words[0].upper() == b"QUIT" else b"250 yes\r\n")


@contextmanager
def smtp_receiver() -> Iterator[tuple[int, "queue.Queue[bytes]"]]:
    """A mail server on a free port of loopback: the port, and the mails."""
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), _Smtp) as server:
        mails: queue.Queue[bytes] = queue.Queue()
        server.mails = mails  # type: ignore[attr-defined]
        thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
        thread.start()
        yield server.server_address[1], mails
        server.shutdown()
        thread.join()


@contextmanager
def udp_receiver() -> Iterator[socket.socket]:
    """A UDP socket on a free port of loopback."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        opened.bind(("127.0.0.1", 0))
        opened.settimeout(20.0)
        yield opened
