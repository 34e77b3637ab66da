"""This machine's Chromium without a screen, driven by playwright: open a page, ask it questions, press keys."""

import contextlib
import shutil
import time
from collections.abc import Generator
from typing import Any

from playwright.sync_api import Browser, ConsoleMessage, sync_playwright
from playwright.sync_api import Page as Tab

__all__ = ["Page", "chromium", "chromium_path", "open_page", "open_tab"]


def chromium_path() -> str | None:
    """Where Chromium lies on this machine, or None."""
    return shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


class Page:
    """One tab, with all that its console has said and every error of its scripts."""

    def __init__(self, tab: Tab) -> None:
        self.tab = tab
        self.console: list[str] = []
        tab.on("console", self._note)
        tab.on("pageerror", lambda error: self.console.append(str(error)))
        self._session = tab.context.new_cdp_session(tab)

    def ask(self, expression: str) -> Any:
        """The value of a JavaScript expression in the page."""
        return self.tab.evaluate(expression)

    def wait(self, expression: str, seconds: float = 15.0) -> None:
        """Return as soon as an expression is true; AssertionError with the page's text if it never is."""
        deadline = time.monotonic() + seconds
        while not self.ask(expression):
            if time.monotonic() > deadline:
                raise AssertionError(f"{expression} stayed false: {self.ask('document.body.innerText')}")
            self.tab.wait_for_timeout(30)

    def text(self, selector: str) -> str:
        """What an element shows."""
        return self.tab.locator(selector).first.inner_text()

    def key(self, key: str) -> None:
        """Press and release a key such as ``Tab`` or ``Enter``."""
        self.tab.keyboard.press(key)

    def look(self, width: int, height: int, scheme: str = "light", mobile: bool = False) -> None:
        """Choose the window's size and the colour scheme that the reader prefers."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": mobile}
        self._session.send("Emulation.setDeviceMetricsOverride", size)
        media = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
        self._session.send("Emulation.setEmulatedMedia", media)

    def _note(self, message: ConsoleMessage) -> None:
        if message.type in ("error", "assert"):
            self.console.append(message.text)


@contextlib.contextmanager
def chromium() -> Generator[Browser]:
    """A browser, which ends with the context."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium_path(), args=["--no-sandbox"])
        try:
            yield browser
        finally:
            browser.close()


@contextlib.contextmanager
def open_tab(browser: Browser, url: str) -> Generator[Page]:
    """A tab at ``url`` that shares nothing with others; it ends with the context."""
    context = browser.new_context()
    try:
        page = Page(context.new_page())
        page.tab.goto(url)
        yield page
    finally:
        context.close()


@contextlib.contextmanager
def open_page(url: str) -> Generator[Page]:
    """A tab at ``url`` in a browser of its own, which ends with the context."""
    with chromium() as browser, open_tab(browser, url) as page:
        yield page
