"""The documents as a site: it builds without a warning, needs no other machine, and newcomers find their answers."""

import html
import json
import os
import posixpath
import re
import subprocess
import sys
from collections.abc import Callable, Generator, Mapping
from functools import cache
from pathlib import Path
from urllib.parse import unquote

import pytest
from api_fakes import VERSION, FakeMonitor
from axe_playwright_python.sync_playwright import Axe
from browser import chromium_path, open_page

from wingwatch.api import AppSettings, HttpServer, create_app, listen

ROOT = Path(__file__).parents[2]
ELSEWHERE = re.compile(r"^(?:https?:)?//")
QUESTIONS: Mapping[str, tuple[str, str]] = {
    "run it on my log": ("how_to/log.html", "wingwatch report logs/flight.ulg"),
    "add an aircraft": ("how_to/aircraft.html", "wingwatch aircraft new"),
    "get an alert on my phone": ("how_to/phone.html", "wingwatch notify test"),
    "secure it": ("security.html", "wingwatch token create"),
    "find equation 12": ("methods/fourier.html#equation-12", 'id="equation-12"'),
}
"""What a newcomer asks: the page with the answer, and words of the answer there."""

pytest.importorskip("mkdocs", reason="the extra docs is not installed")


@pytest.fixture(scope="module")
def site(made_once: Callable[[str, Callable[[Path], object]], Path]) -> Path:
    return made_once("site", build)


def build(folder: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@cache
def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


@cache
def links(site: Path, page: str) -> frozenset[str]:
    """What a page links to, from the site's folder on, anchors included; what is elsewhere is left out."""
    found = re.findall(r'<a[^>]*?\bhref="([^"]*)"', text_of(site / page))
    folder = posixpath.dirname(page)
    inside = (html.unescape(unquote(link)) for link in found if not re.match(r"[a-z]+:|//", link))
    targets = set()
    for link in inside:
        path, mark, anchor = link.partition("#")
        place = posixpath.normpath(posixpath.join(folder, path)) if path else page
        targets.add(f"{place}{mark}{anchor}" if anchor else place)
    return frozenset(targets)


def pages(site: Path) -> list[str]:
    return sorted(str(path.relative_to(site)) for path in site.rglob("*.html"))


def test_every_link_between_pages_leads_somewhere(site: Path) -> None:
    anchors = {page: set(re.findall(r'\bid="([^"]+)"', text_of(site / page))) for page in pages(site)}
    broken = []
    for page in pages(site):
        for link in links(site, page):
            path, _, anchor = link.partition("#")
            path = "index.html" if path == "." else path
            known = anchors.get(path)
            if not (site / path).is_file() or (anchor and known is not None and anchor not in known):
                broken.append(f"{page}: {link}")
    assert not broken


def test_pages_load_nothing_from_another_machine(site: Path) -> None:
    """Links may lead away; scripts, styles, pictures and fonts may not come from there."""
    fetched = []
    for page in pages(site):
        text = text_of(site / page)
        sources = re.findall(r'<(?:script|img|iframe|source|video|audio)[^>]*?\bsrc="([^"]*)"', text)
        sources += re.findall(r'<link[^>]*?\bhref="([^"]*)"', text)
        fetched += [f"{page}: {source}" for source in sources if ELSEWHERE.match(source)]
    for style in site.rglob("*.css"):
        urls = re.findall(r"url\(['\"]?([^'\")]+)", text_of(style)) + re.findall(
            r"@import\s+['\"]([^'\"]+)", text_of(style)
        )
        fetched += [f"{style.name}: {url}" for url in urls if ELSEWHERE.match(url)]
    assert not fetched


def test_no_page_has_a_script_or_style_in_itself(site: Path) -> None:
    """The service's policy would keep the browser from using it."""
    found = []
    for page in pages(site):
        text = text_of(site / page)
        scripts = re.findall(r"<script(?![^>]*\bsrc=)(?![^>]*application/json)[^>]*>", text)
        found += [
            f"{page}: {one[:60]}"
            for one in (*scripts, *re.findall(r"<style\b[^>]*>|<[^>]+\sstyle=|\son[a-z]+=\"", text))
        ]
    assert not found


@pytest.mark.parametrize("question", QUESTIONS)
def test_a_newcomer_s_question_is_two_clicks_away_at_most(site: Path, question: str) -> None:
    answer, words = QUESTIONS[question]
    clicks = clicks_to(site, answer)
    assert clicks is not None
    assert clicks <= 2
    shown = re.sub(r"<(?!span id=)[^>]+>", "", text_of(site / answer.partition("#")[0]))
    assert words in html.unescape(shown)


def clicks_to(site: Path, target: str) -> int | None:
    """How many links lead from the front page to a target, by the shortest way; None for one without a way."""
    seen, front = {"index.html"}, {"index.html"}
    for clicks in range(1, 5):
        found = frozenset().union(*(links(site, page) for page in front if (site / page).is_file()))
        if target in found:
            return clicks
        paths = {link.partition("#")[0] for link in found}
        front = {path for path in paths - seen if path.endswith(".html")}
        seen |= front
    return None


def test_the_search_index_has_every_page(site: Path) -> None:
    """Search runs in the browser, over one file of the site."""
    index = json.loads(text_of(site / "search" / "search_index.json"))
    found = {entry["location"].partition("#")[0] or "index.html" for entry in index["docs"]}
    assert set(pages(site)) <= found
    assert any((site / "assets" / "javascripts" / "workers").glob("search.*.js"))


@pytest.fixture(scope="module")
def served_site(site: Path) -> Generator[str]:
    app = create_app(FakeMonitor(), dict, None, VERSION, AppSettings(documents=site))
    with HttpServer(app, listen("127.0.0.1", 0)) as server:
        yield server.url


@pytest.mark.skipif(
    chromium_path() is None, reason="this machine has no Chromium: install the package chromium"
)
def test_the_service_shows_the_site_and_its_search_finds(served_site: str) -> None:
    """In a browser under the service's policy: nothing is refused, nothing missing, and the search answers."""
    with open_page(f"{served_site}/help/index.html") as page:
        page.wait("document.querySelector('.md-search__input') !== null")
        page.ask(
            "(() => { const field = document.querySelector('.md-search__input'); field.focus();"
            " field.value = 'doublet'; field.dispatchEvent(new Event('input', {bubbles: true}));"
            " field.dispatchEvent(new KeyboardEvent('keyup', {bubbles: true})); })()"
        )
        page.wait("document.querySelectorAll('.md-search-result__item').length > 0")
        assert page.ask("getComputedStyle(document.querySelector('.md-header')).position") == "sticky"
        fetched = page.ask("performance.getEntriesByType('resource').map(one => one.name)")
        assert page.console == []
    assert len(fetched) > 3
    assert all(name.startswith((served_site, "data:")) for name in fetched)


@pytest.mark.skipif(
    chromium_path() is None, reason="this machine has no Chromium: install the package chromium"
)
def test_axe_finds_nothing_serious_in_the_documents_light_or_dark(served_site: str) -> None:
    found = []
    with open_page(f"{served_site}/help/index.html") as page:
        for name in ("how_to/log", "limits"):
            for scheme, options in (("light", None), ("dark", {"runOnly": ["color-contrast"]})):
                page.look(700, 900, scheme)  # tables are wider than that, and scroll
                page.tab.goto(f"{served_site}/help/{name}.html")
                violations = Axe().run(page.tab, options=options).response["violations"]
                found += [f"{name} {scheme} {one['id']}: {one['nodes'][0]['html']}" for one in violations
                          if one["impact"] in ("serious", "critical")]  # fmt: skip
        assert page.console == []
    assert found == []
