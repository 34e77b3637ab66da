"""Takes the picture of the status page that the README shows: the demo's fleet while its alerts are in force.

    .venv/bin/python tools/screenshot.py --out docs/pictures/page.png

Starts `wingwatch demo` on free ports, waits for its two alerts (two minutes of flight), and lets Chromium draw
the page. Needs the package chromium and the extra dev.
"""

import argparse
import json
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

ALERTS = 2
"""Ice on one aircraft, half of the elevator lost on another."""


@contextmanager
def demo(data: Path) -> Iterator[str]:
    """A demo on free ports; yields the address of its page."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    arguments = ["demo", "--json", "--port", "0", "--listen", endpoint, "--data", str(data)]
    program = "import sys; from wingwatch.cli.main import main; sys.exit(main(sys.argv[1:]))"
    process = subprocess.Popen([sys.executable, "-c", program, *arguments], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield str(json.loads(process.stdout.readline())["url"])
    finally:
        process.terminate()
        process.wait()


def await_alerts(url: str, most_s: float) -> None:
    """Return once the demo's alerts are in force.

    Raises:
        TimeoutError: they are not within ``most_s``.
    """
    until = time.monotonic() + most_s
    while time.monotonic() < until:
        with urllib.request.urlopen(f"{url}/v1/alerts?state=active") as answer:
            active: list[Any] = json.load(answer)["items"]
        if len(active) >= ALERTS:
            return
        time.sleep(1.0)
    raise TimeoutError(f"the demo has raised no {ALERTS} alerts within {most_s:.0f} s")


def take(url: str, out: Path, size: tuple[int, int], chromium: str) -> None:
    """Draw the page as it is now."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": size[0], "height": size[1]}, color_scheme="light")
        page.goto(url)
        page.get_by_text("icing").first.wait_for()
        page.wait_for_timeout(2000)  # the first events draw what the page was not loaded with
        page.screenshot(path=str(out))
        browser.close()


def main() -> int:
    """Start the demo, wait, take the picture."""
    parser = argparse.ArgumentParser(description="The status page during the demo's alerts, as a picture.")
    parser.add_argument("--out", type=Path, default=Path("docs/pictures/page.png"))
    parser.add_argument("--url", help="of a service that runs already, in place of a demo")
    parser.add_argument(
        "--wait", type=float, default=600.0, metavar="S", help="for the alerts at most (default: 600)"
    )
    parser.add_argument("--size", type=int, nargs=2, default=(1200, 900), metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--chromium", default=shutil.which("chromium") or "/usr/bin/chromium")
    chosen = parser.parse_args()
    with (
        tempfile.TemporaryDirectory() as folder,
        demo(Path(folder)) if chosen.url is None else _given(chosen.url) as url,
    ):
        await_alerts(url, chosen.wait)
        take(url, chosen.out, tuple(chosen.size), chosen.chromium)
    print(chosen.out)
    return 0


@contextmanager
def _given(url: str) -> Iterator[str]:
    yield url.rstrip("/")


if __name__ == "__main__":
    sys.exit(main())
