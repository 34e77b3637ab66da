"""The lock between the thread that takes samples in and those that answer."""

import threading
import time

from wingwatch.monitor.fleet.fair_lock import FairLock

PATIENCE_S = 60.0


def test_who_asks_again_at_once_does_not_overtake_who_waits() -> None:
    lock, asking, rounds = FairLock(), threading.Event(), 0
    answered_after: list[int] = []

    def answer() -> None:
        asking.set()
        with lock:
            answered_after.append(rounds)

    thread = threading.Thread(target=answer)
    deadline = time.monotonic() + PATIENCE_S
    while not answered_after and time.monotonic() < deadline:
        with lock:
            if rounds == 3:
                thread.start()
                asking.wait(PATIENCE_S)
                time.sleep(0.05)  # it waits by now
            rounds += 1
    thread.join(PATIENCE_S)
    assert answered_after == [4]


def test_its_holder_may_take_it_again_while_another_waits() -> None:
    lock, order = FairLock(), list[str]()

    def other() -> None:
        with lock:
            order.append("other")

    with lock:
        thread = threading.Thread(target=other)
        thread.start()
        time.sleep(0.05)
        with lock:
            order.append("inner")
        order.append("outer")
    thread.join(PATIENCE_S)
    assert order == ["inner", "outer", "other"]


def test_an_exception_lets_it_go() -> None:
    lock = FairLock()
    try:
        with lock:
            raise ValueError
    except ValueError:
        pass
    thread = threading.Thread(target=lock.__enter__)
    thread.start()
    thread.join(PATIENCE_S)
    assert not thread.is_alive()
