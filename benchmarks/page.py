"""What the page costs a browser: first paint, processor and memory with many aircraft drawn anew twice a second.

The page runs in this machine's Chromium without a screen; the fleet behind it is drawn (``drawn_fleet``), served by the
product's own application. Processor times are of Chromium's processes as it states them. Without a graphics card it
paints by the processor, and that is in the figure of the whole browser. Over a slow link files are measured compressed,
as they are sent, and plain, as a browser is sent them that takes no compression.

Run: python benchmarks/page.py [--vehicles 100 500] [--seconds 30] [--minutes 0] [--seed 0] [--slow 0]
    [--screenshots FOLDER]
"""

import argparse
import contextlib
import shutil
import statistics
import threading
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drawn_fleet import DrawnFleet
from playwright.sync_api import Browser, BrowserContext, CDPSession, Page, sync_playwright
from saving import run_benchmark

from wingwatch.api import HttpServer, create_app, listen

LOADS, SETTLE_MS = 5, 2000.0
SHOWN = """(() => {
  const look = () => {
    if (document.querySelector('.rows .row')) window.rowsAt = performance.now();
    else requestAnimationFrame(look);
  };
  look();
})()"""
PAINT = "() => [performance.getEntriesByName('first-contentful-paint')[0].startTime, window.rowsAt]"
WEIGHT = """() => performance.getEntries().filter((one) => one.encodedBodySize && !one.name.includes('/v1/'))
  .reduce((sum, one) => sum + one.encodedBodySize, 0)"""
PLOTLY = """async () => {
  const address = '/pages/plotly.js', begun = performance.now();
  await (await fetch(address)).text();
  const took = performance.now() - begun;
  await new Promise((over) => setTimeout(over, 100));
  return [performance.getEntriesByType('resource').find((one) => one.name.endsWith(address)).encodedBodySize, took];
}"""
LATENCY_MS = 20.0
UPDATES = (
    "() => performance.getEntriesByType('resource').filter((one) => one.name.endsWith('/v1/fleet')).length"
)
LAPTOP, PHONE = {"width": 1440, "height": 900}, {"width": 390, "height": 844}
VIEWS = {
    "fleet": "/",
    "vehicle": "/vehicles/uav-001",
    "alerts": "/alerts",
    "docs": "/docs",
}


@dataclass(frozen=True)
class Cost:
    """What a browser spent: CPU seconds by kind of process, seconds of the page's own thread."""

    processes: dict[str, float]
    thread_s: float


@contextlib.contextmanager
def flying(vehicles: int, seed: int, alerts: int = 3) -> Generator[str]:
    """A fleet in flight behind the application; the address of its page."""
    fleet, over = DrawnFleet(vehicles, alerts, seed), threading.Event()
    app = create_app(fleet, lambda: {"http": None}, None, "benchmark")
    thread = threading.Thread(target=fleet.fly, args=(over,))
    with HttpServer(app, listen("127.0.0.1", 0)) as server:
        thread.start()
        try:
            yield server.url
        finally:
            over.set()
            thread.join()


@contextlib.contextmanager
def chromium() -> Generator[Browser]:
    """This machine's Chromium."""
    path = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if path is None:
        raise SystemExit("This machine has no Chromium: install the package chromium.")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        try:
            yield browser
        finally:
            browser.close()


def first_paints(browser: Browser, url: str) -> list[tuple[float, float]]:
    """Of some loads with nothing kept: ms until something is painted, and until rows are there."""
    found = []
    for _ in range(LOADS):
        with browser.new_context(viewport=LAPTOP) as context:  # type: ignore[arg-type]
            context.add_init_script(SHOWN)
            page = context.new_page()
            page.goto(url)
            page.wait_for_selector(".rows .row")
            page.wait_for_timeout(100.0)
            found.append(tuple(page.evaluate(PAINT)))
    return found


def over_a_slow_link(browser: Browser, url: str, mbit_s: float) -> None:
    """Print what the fleet's files and plotly.js weigh, and how long they take over a link, plain and compressed.

    Loads of both kinds take turns, after one of each that does not count, for the service compresses a file once.
    """
    forms = {"plain": {"Accept-Encoding": "identity"}, "compressed": {}}
    found: dict[str, list[list[float]]] = {said: [] for said in forms}
    for _ in range(1 + LOADS):
        for said, headers in forms.items():
            found[said].append(_load(browser, url, mbit_s, headers))
    print(f"over {mbit_s:g} Mbit/s, {LATENCY_MS:g} ms, medians of {LOADS} loads with nothing kept:")
    for said, loads in found.items():
        paint, rows, weight, size, took = (statistics.median(v) for v in zip(*loads[1:], strict=True))
        print(
            f"  {said}: fleet {weight / 1e3:.0f} kB of files, first paint {paint:.0f} ms, rows {rows:.0f} ms; "
            f"plotly.js {size / 1e3:.0f} kB, {took:.0f} ms"
        )


def _load(browser: Browser, url: str, mbit_s: float, headers: dict[str, str]) -> list[float]:
    """One load: ms until something is painted and rows are there, bytes of files; bytes and ms of plotly.js."""
    link = {
        "offline": False, "latency": LATENCY_MS,
        "downloadThroughput": mbit_s * 125e3, "uploadThroughput": mbit_s * 125e3,
    }  # fmt: skip
    with browser.new_context(viewport=LAPTOP, extra_http_headers=headers) as context:  # type: ignore[arg-type]
        page = context.new_page()
        context.new_cdp_session(page).send("Network.emulateNetworkConditions", link)
        page.add_init_script(SHOWN)
        page.goto(url)
        page.wait_for_selector(".rows .row")
        page.wait_for_timeout(100.0)
        return [*page.evaluate(PAINT), page.evaluate(WEIGHT), *page.evaluate(PLOTLY)]


def cost(browser: Browser, session: CDPSession) -> Cost:
    """What has been spent so far."""
    system = browser.new_browser_cdp_session()
    processes: dict[str, float] = {}
    for process in system.send("SystemInfo.getProcessInfo")["processInfo"]:
        processes[process["type"]] = processes.get(process["type"], 0.0) + process["cpuTime"]
    system.detach()
    metrics = {one["name"]: one["value"] for one in session.send("Performance.getMetrics")["metrics"]}
    return Cost(processes, metrics["TaskDuration"])


def memory(session: CDPSession) -> tuple[float, int]:
    """MB of the page's heap after its rubbish is collected, and its nodes."""
    session.send("HeapProfiler.collectGarbage")
    metrics: dict[str, Any] = {
        one["name"]: one["value"] for one in session.send("Performance.getMetrics")["metrics"]
    }
    return metrics["JSHeapUsedSize"] / 2**20, int(metrics["Nodes"])


def watched(browser: Browser, page: Page, seconds: float) -> str:
    """A line on what a page that is left alone costs."""
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable")
    page.wait_for_timeout(SETTLE_MS)
    page.evaluate("performance.clearResourceTimings()")
    before = cost(browser, session)
    page.wait_for_timeout(1000.0 * seconds)
    after = cost(browser, session)
    updates = page.evaluate(UPDATES) / seconds
    used = {
        kind: (total - before.processes.get(kind, 0.0)) / seconds for kind, total in after.processes.items()
    }
    parts = ", ".join(f"{kind} {100 * part:.1f}" for kind, part in sorted(used.items()) if part >= 0.001)
    thread = 100 * (after.thread_s - before.thread_s) / seconds
    return (
        f"{updates:.1f} updates a second, page's thread {thread:.1f} % of a core, "
        f"all of the browser {100 * sum(used.values()):.1f} % ({parts})"
    )


def remember(page: Page, minutes: float) -> None:
    """Print a line a minute on the page's memory, and what it grows by in an hour once a tenth of the time is over."""
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable")
    heaps = []
    for minute in range(int(minutes) + 1):
        if minute:
            page.wait_for_timeout(60_000.0)
        heap, nodes = memory(session)
        heaps.append(heap)
        print(f"  after {minute:3d} min: heap {heap:.2f} MB, {nodes} nodes", flush=True)
    begin = len(heaps) // 10
    if len(heaps) - begin > 2:
        slope = statistics.linear_regression(range(begin, len(heaps)), heaps[begin:]).slope
        print(f"  heap from minute {begin} on: {60.0 * slope:+.2f} MB an hour (straight line through all)")


def measure(browser: Browser, vehicles: int, seconds: float, minutes: float, seed: int) -> None:
    """Print what the page of so many vehicles costs."""
    with flying(vehicles, seed) as url:
        paints = first_paints(browser, url)
        first, rows = (statistics.median(times) for times in zip(*paints, strict=True))
        print(
            f"{vehicles} vehicles: first paint {first:.0f} ms, rows {rows:.0f} ms (medians of {LOADS} loads)"
        )
        with browser.new_context(viewport=LAPTOP) as context:  # type: ignore[arg-type]
            page = context.new_page()
            page.goto(url)
            page.wait_for_selector(".rows .row")
            print(f"{vehicles} vehicles at 2 Hz: {watched(browser, page, seconds)}", flush=True)
            if minutes:
                remember(page, minutes)


def take_screenshots(browser: Browser, folder: Path, seed: int) -> None:
    """Every view, on a laptop light and dark and on a phone, as PNG files."""
    folder.mkdir(parents=True, exist_ok=True)
    looks: dict[str, dict[str, Any]] = {
        "light": {"viewport": LAPTOP, "color_scheme": "light"},
        "dark": {"viewport": LAPTOP, "color_scheme": "dark"},
        "phone": {"viewport": PHONE, "color_scheme": "light", "device_scale_factor": 2, "is_mobile": True},
    }
    with flying(40, seed) as url:
        for look, settings in looks.items():
            with browser.new_context(**settings) as context:
                for name, path in VIEWS.items():
                    screenshot(context, url + path, folder / f"{name}-{look}.png")


def screenshot(context: BrowserContext, url: str, path: Path) -> None:
    """One view as a PNG file."""
    page = context.new_page()
    page.goto(url)
    page.wait_for_timeout(SETTLE_MS)
    page.screenshot(path=path)
    page.close()
    print(path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, or take pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, nargs="+", default=[100, 500])
    parser.add_argument("--seconds", type=float, default=30.0, help="for which processor time is counted")
    parser.add_argument(
        "--minutes", type=float, default=0.0, help="for which memory is looked at, once a minute"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--slow", type=float, default=0.0, help="Mbit/s of a slow link, measured instead")
    parser.add_argument("--screenshots", type=Path, help="take pictures into this folder instead")
    chosen = parser.parse_args(arguments)
    with chromium() as browser:
        if chosen.screenshots is not None:
            take_screenshots(browser, chosen.screenshots, chosen.seed)
            return 0
        if chosen.slow > 0.0:
            with flying(chosen.vehicles[0], chosen.seed) as url:
                over_a_slow_link(browser, url, chosen.slow)
            return 0
        for vehicles in chosen.vehicles:
            measure(browser, vehicles, chosen.seconds, chosen.minutes, chosen.seed)
    return 0


if __name__ == "__main__":
    run_benchmark(main)
