"""The report in a browser: every picture is drawn, in light, dark, narrow and on paper."""

from collections.abc import Generator
from pathlib import Path

import pytest
from browser import Page, chromium_path, open_page
from diagnosis_examples import FOUND

from wingwatch.diagnosis import write_report

pytestmark = pytest.mark.skipif(
    chromium_path() is None,
    reason="the report needs a browser, and this machine has no Chromium: install the package chromium",
)

DRAWN = "[...document.querySelectorAll('.picture')].every((p) => p.querySelector('.main-svg'))"
TITLE_COLOUR = "getComputedStyle(document.querySelector('.gtitle')).fill"
PICTURES = 4 + len(FOUND.traces.spectra)


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(FOUND, path)
    return path


@pytest.fixture(scope="module")
def tab(report: Path) -> Generator[Page]:
    with open_page(report.as_uri()) as opened:
        opened.look(1100, 900)
        opened.wait(f"document.querySelectorAll('.picture').length === {PICTURES} && {DRAWN}", 60.0)
        yield opened


@pytest.fixture
def page(tab: Page) -> Page:
    """The page as it is at first; each test looks at it in its own way."""
    tab.look(1100, 900)
    tab.wait("document.querySelector('.main-svg').clientWidth > 700")
    return tab


def test_every_picture_is_drawn_without_a_complaint(page: Page) -> None:
    assert page.console == []
    assert page.ask("[...document.querySelectorAll('.gtitle')].every((t) => t.textContent.length > 5)")
    assert page.ask("performance.getEntriesByType('resource').length") == 0


@pytest.mark.parametrize("width", [340, 720, 1400])
def test_nothing_stands_out_of_the_page(page: Page, width: int) -> None:
    page.look(width, 900, mobile=width < 500)
    page.wait("document.querySelector('.main-svg').clientWidth <= innerWidth")
    assert page.ask("document.documentElement.scrollWidth") <= width


def test_colours_follow_the_reader_and_paper_is_light(page: Page) -> None:
    light = page.ask(TITLE_COLOUR)
    page.look(1100, 900, "dark")
    page.wait(f"{TITLE_COLOUR} !== {light!r}")
    page.ask("dispatchEvent(new Event('beforeprint'))")
    page.wait(f"{TITLE_COLOUR} === 'rgb(0, 0, 0)'")
    assert page.ask("document.querySelector('.main-svg').clientWidth") <= 700
    page.ask("dispatchEvent(new Event('afterprint'))")
    page.wait(f"{TITLE_COLOUR} !== 'rgb(0, 0, 0)'")
