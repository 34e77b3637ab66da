"""The status page: nothing from elsewhere, nothing received becomes markup, live and honest when it is not."""

import dataclasses
import re
from collections.abc import Generator
from pathlib import Path

import httpx
import pytest
from api_fakes import COMPILING, ICED, FakeMonitor, alert, served, vehicle
from browser import Page, chromium_path, open_page

import wingwatch.api
from wingwatch.api import HttpServer, KernelsView
from wingwatch.monitor.views import (
    AlertGroupView,
    AlertState,
    CandidateView,
    CouldSeeView,
    ProposedInputView,
    VehicleState,
)

FOLDER = Path(wingwatch.api.__file__).parent / "pages"
NASTY = "<img src=x onerror=\"document.title='owned'\"><script>document.title='owned'</script>&amp;"
SPEAKING = (("m_eta", 7.0), ("m_w", 1.5), ("z_w", 0.0), ("m_q", 0.04), ("y_v", -3.0), ("z_q", -0.1))

needs_chromium = pytest.mark.skipif(
    chromium_path() is None,
    reason="the pages need a browser, and this machine has no Chromium: install the package chromium",
)


@pytest.fixture
def monitor() -> FakeMonitor:
    filled = FakeMonitor()
    filled.views = [
        vehicle("aero-2", VehicleState.DEGRADED, reason="icing " + NASTY, active_alerts=("a1",)),
        vehicle("aero-1", worst=None, basis=None, basis_text="", condition={}),
    ]
    filled.raised = [
        alert(1, text="Leave the icing layer. " + NASTY, note=("acknowledged by ana: " + NASTY,)),
        alert(0, state=AlertState.CLEARED, cleared_s=80.0, size=float("nan")),
    ]
    return filled


@pytest.fixture
def door(monitor: FakeMonitor) -> Generator[tuple[HttpServer, httpx.Client]]:
    with served(monitor) as parts:
        yield parts


@pytest.fixture
def page(door: tuple[HttpServer, httpx.Client]) -> Generator[Page]:
    with open_page(door[0].url) as opened:
        opened.wait("document.querySelectorAll('#vehicles > li').length === 2")
        yield opened


def text(page: Page, selector: str) -> str:
    found = page.ask(f"document.querySelector({selector!r}).innerText")
    assert isinstance(found, str)
    return found


def test_every_file_of_the_page_is_served_with_a_strict_policy(door: tuple[HttpServer, httpx.Client]) -> None:
    _, client = door
    kinds = {"/": "text/html", "/pages/app.js": "text/javascript", "/pages/app.css": "text/css"}
    for path, kind in {**kinds, "/pages/icon.svg": "image/svg+xml"}.items():
        answer = client.get(path)
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith(kind)
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert set(re.findall(r"'[a-z-]+'", policy)) == {"'none'", "'self'"}
        assert answer.headers["x-content-type-options"] == "nosniff"
        again = client.get(path, headers={"if-none-match": answer.headers["etag"]})
        assert (again.status_code, again.content) == (304, b"")


def test_nothing_is_loaded_from_elsewhere_and_nothing_received_becomes_markup() -> None:
    files = {path.name: path.read_text() for path in FOLDER.iterdir()}
    assert set(files) == {"index.html", "app.css", "app.js", "icon.svg"}
    for name, content in files.items():
        addresses = set(re.findall(r"https?://[^\s\"')]+", content))
        assert addresses <= {"http://www.w3.org/2000/svg"}, name  # a namespace's name, never fetched
        assert "url(" not in content
    for forbidden in ("innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval(", "Function("):
        assert forbidden not in files["app.js"]
    assert not re.search(r"\son[a-z]+=|<style|\sstyle=|<script(?! src=)", files["index.html"])


def test_no_file_outside_the_page_can_be_asked_for(door: tuple[HttpServer, httpx.Client]) -> None:
    _, client = door
    for path in ("/pages/", "/pages/../app.py", "/pages/%2e%2e/app.py", "/pages/..%2fapp.py", "/app.js"):
        assert client.get(path).status_code == 404


@needs_chromium
def test_it_shows_state_derivative_basis_and_evidence_and_escapes_all(page: Page) -> None:
    shown = text(page, "#alerts")
    assert "Icing on aero-2" in shown
    assert "0.0625 ± 0.0078" in shown
    assert "96.9 %" in shown
    assert "−116.3 ± 1.8 1/s²" in shown
    assert "−131.5 ± 2.5 1/s²" in shown
    assert "+5.0" in shown
    assert "a-priori expectation" in shown
    assert "<script>document.title='owned'</script>&amp;" in shown
    first = text(page, "#vehicles > li")
    assert "aero-2" in first
    assert "degraded" in first
    assert "z −1.3" in first.replace("\n", " ")
    assert "pitch acceleration due to pitch rate" in first
    assert "rests on the aircraft file's own numbers" in first
    assert "nothing compared yet" in text(page, "#vehicles > li:nth-child(2)")
    assert page.ask("document.querySelectorAll('main img, main script').length") == 0
    assert page.ask("document.title") == "(1) wingwatch"
    assert page.console == []


@needs_chromium
def test_it_says_what_is_being_compiled_until_that_is_done() -> None:
    state: list[KernelsView | None] = [dataclasses.replace(COMPILING, text=COMPILING.text + NASTY)]
    with served(FakeMonitor(), kernels=lambda: state[0]) as (server, _), open_page(server.url) as page:
        page.wait("document.getElementById('kernels')?.hidden === false")
        assert text(page, "#kernels-text") == COMPILING.text + NASTY
        parts = "[...document.querySelectorAll('#kernels-parts > li')].map((item) => item.innerText)"
        assert page.ask(parts) == [
            "the tail\ncompiled",
            "the wings\ncompiling",
            "the paint\nwaiting, in the background",
        ]
        assert page.ask("document.getElementById('kernels-done').value") == 1
        assert page.ask("document.title") == "wingwatch"
        state[0] = None
        page.wait("document.getElementById('kernels').hidden", seconds=6.0)  # it asks every 2 s meanwhile
        assert page.console == []


@needs_chromium
def test_it_says_what_does_not_work_until_it_does() -> None:
    checks: dict[str, str | None] = {
        "zenoh": None,
        "database": "it is locked " + NASTY,
        "messages": "they wait.",
    }
    with served(FakeMonitor(), checks=checks) as (server, _), open_page(server.url) as page:
        page.wait("document.getElementById('service-problems')?.hidden === false")
        problems = "[...document.querySelectorAll('#service-problems li')].map((item) => item.innerText)"
        assert page.ask(problems) == ["database: it is locked " + NASTY, "messages: they wait."]
        checks["messages"] = None
        page.wait("document.querySelectorAll('#service-problems li').length === 1", seconds=8.0)
        checks["database"] = None
        page.wait("document.getElementById('service-problems').hidden", seconds=8.0)
        assert page.console == []


@needs_chromium
def test_while_kernels_are_compiled_their_card_alone_says_so() -> None:
    checks = {"estimators": COMPILING.text}
    compiling = served(FakeMonitor(), checks=checks, kernels=lambda: COMPILING)
    with compiling as (server, _), open_page(server.url) as page:
        page.wait("document.getElementById('kernels')?.hidden === false")
        assert page.ask("document.getElementById('service-problems').hidden") is True


@needs_chromium
def test_an_event_brings_news_at_once(page: Page, monitor: FakeMonitor) -> None:
    page.wait("document.getElementById('link').dataset.link === 'live'")
    monitor.raised = [alert(2, cause="elevator_effectiveness", size=0.5, vehicle="aero-1"), *monitor.raised]
    monitor.tell("alert", {"id": "a2"})
    # sooner than the poll every 5 s could; the stream's 0.1 s and the page's 0.5 s are the way
    page.wait("document.querySelectorAll('#alerts > li').length === 2", seconds=4.0)
    assert "Elevator effectiveness on aero-1" in text(page, "#alerts")
    assert "50.00 ± 0.78 %" in text(page, "#alerts")
    assert page.ask("document.getElementById('announcer').textContent") == (
        "New warning: elevator effectiveness on aero-1."
    )


@needs_chromium
def test_without_events_it_polls_and_without_answers_it_says_so(
    page: Page, door: tuple[HttpServer, httpx.Client]
) -> None:
    server, _ = door
    page.wait("document.getElementById('link').dataset.link === 'live'")
    server.stop()
    page.wait("document.getElementById('link').dataset.link === 'lost'")
    assert "has not answered since" in text(page, "#banner")
    assert "aero-2" in text(page, "#vehicles"), "what was known stays readable"


@needs_chromium
def test_a_client_that_cannot_stream_is_served_by_polling(monitor: FakeMonitor) -> None:
    class Silent(FakeMonitor):
        def events(self, after: int) -> list[object]:  # type: ignore[override]
            raise RuntimeError("no events today")

    silent = Silent()
    silent.views = monitor.views
    with served(silent) as (server, _), open_page(server.url) as page:
        page.wait("document.querySelectorAll('#vehicles > li').length === 2")
        page.wait("document.getElementById('link').dataset.link === 'polling'")
        silent.views = [dataclasses.replace(silent.views[1], vehicle="late"), *silent.views]
        page.wait("document.querySelectorAll('#vehicles > li').length === 3")


@needs_chromium
def test_evidence_that_does_not_speak_folds_away_and_stays_as_the_reader_left_it(
    page: Page, monitor: FakeMonitor
) -> None:
    parts = [dataclasses.replace(ICED, derivative=d, z=z) for d, z in SPEAKING]
    monitor.raised = [alert(1, evidence=parts, probability=0.99999)]
    monitor.tell("alert", {"id": "a1"})
    page.wait("document.querySelectorAll('#alerts details').length === 1")
    assert page.ask("document.querySelectorAll('#alerts > li > table tbody tr').length") == 4
    assert "2 more derivatives are within 2 standard errors" in text(page, "#alerts")
    assert "above 99.9 %" in text(page, "#alerts")
    assert "+0.0" not in text(page, "#alerts")
    page.ask("document.querySelector('#alerts summary').focus()")
    page.key("Enter")
    monitor.raised = [alert(1, evidence=parts, text="Changed.")]
    monitor.tell("alert", {"id": "a1"})
    page.wait("document.querySelector('#alerts .text').textContent === 'Changed.'")
    assert page.ask("document.querySelector('#alerts details').open")
    assert page.ask("document.activeElement.tagName") == "SUMMARY"
    assert "−0.1" in text(page, "#alerts details")


@needs_chromium
def test_an_alert_of_a_sensor_shows_its_part_and_candidates_and_no_evidence(
    page: Page, monitor: FakeMonitor
) -> None:
    possible = (
        CandidateView("sensor_bias", "pitch_rate_rad_s" + NASTY, 0.62),
        CandidateView("sensor_bias", "pitch_rad", 0.3796),
        CandidateView("icing" + NASTY, None, 0.0004),
        CandidateView("thrust_loss", "throttle", float("nan")),
    )
    changes = {
        "kind": "sensor",
        "cause": "sensor_bias",
        "channel": "pitch_rate_rad_s" + NASTY,
        "evidence": (),
    }
    monitor.raised = [
        alert(3, candidates=possible, **changes),
        alert(2, kind="damage", cause="thrust_loss", channel="throttle", size=0.3, evidence=()),
        alert(1),
        alert(0, kind="damage", cause="surface_stuck", channel="rudder_rad", size=1.0, evidence=()),
    ]
    monitor.tell("alert", {"id": "a3"})
    page.wait("document.querySelectorAll('#alerts > li').length === 4")
    assert text(page, "#alerts h3") == "Sensor bias on aero-2 pitch_rate_rad_s" + NASTY
    causes = "[...document.querySelectorAll('#alerts .candidates li')].map((one) => one.textContent)"
    assert page.ask(causes) == [
        "62 %sensor bias pitch_rate_rad_s" + NASTY,
        "38 %sensor bias pitch_rad",
        "below 0.1 %icing" + NASTY.replace("_", " "),
        "unknownthrust loss throttle",
    ]
    parts = (
        "[...document.querySelectorAll('#alerts > li')].map((one) => one.querySelectorAll('table').length)"
    )
    assert page.ask(parts) == [0, 0, 1, 0]
    assert "30.00 ± 0.78 %" in text(page, "#alerts > li:nth-child(2)")
    assert "Size" not in text(page, "#alerts > li:nth-child(4)")
    assert page.ask("document.querySelectorAll('#alerts > li:nth-child(3) .part').length") == 0
    assert page.ask("document.querySelectorAll('#alerts .candidates').length") == 1
    assert page.ask("document.querySelectorAll('main img, main script').length") == 0
    assert page.console == []


@needs_chromium
def test_what_a_flight_could_have_shown_is_asked_for_when_unfolded_and_stays_as_the_reader_left_it(
    page: Page, monitor: FakeMonitor
) -> None:
    could_see = (
        CouldSeeView("sensor_bias", "pitch_rate_rad_s", 0.0123456, "rad/s"),
        CouldSeeView("sensor_bias", "specific_force_z_m_s2", 0.31, "m/s2" + NASTY, NASTY),
        CouldSeeView("elevator_effectiveness", None, 0.2, "", "a doublet of the elevator"),
        CouldSeeView("icing", None, None, ""),
        CouldSeeView("surface_stuck", "rudder_rad", 1.0, ""),
    )
    first, second = monitor.views
    monitor.views = [dataclasses.replace(first, could_see=could_see), second]
    assert page.ask("document.querySelectorAll('#vehicles details').length") == 2
    assert page.ask("document.querySelector('#vehicles details').open") is False
    assert page.ask("document.querySelectorAll('#vehicles tbody tr').length") == 0
    assert text(page, "#vehicles summary") == "What this flight could have shown"
    page.ask("document.querySelector('#vehicles summary').click()")
    page.wait("document.querySelectorAll('#vehicles tbody tr').length === 5")
    rows = "[...document.querySelectorAll('#vehicles tbody tr')]"
    assert page.ask(rows + ".map((row) => [...row.children].map((cell) => cell.textContent))") == [
        ["sensor bias pitch_rate_rad_s", "0.0123 rad/s", "none needed"],
        ["sensor bias specific_force_z_m_s2", "0.31 m/s²" + NASTY, NASTY],
        ["elevator effectiveness of the airframe", "20 %", "a doublet of the elevator"],
        ["icing of the airframe", "not seen", "none known"],
        ["surface stuck rudder_rad", "seen", "none needed"],
    ]
    monitor.views = [dataclasses.replace(monitor.views[0], reason="changed"), second]
    monitor.tell("status", {"vehicle": "aero-2"})
    page.wait("document.querySelector('#vehicles .reason').textContent === 'changed'")
    assert page.ask("document.querySelector('#vehicles details').open")
    page.wait("document.querySelectorAll('#vehicles tbody tr').length === 5")
    page.look(360, 740, "dark", mobile=True)
    assert page.ask("document.documentElement.scrollWidth <= 360")
    assert page.ask("document.querySelectorAll('main img, main script').length") == 0
    assert page.console == []


@needs_chromium
def test_ice_on_several_aircraft_stands_once_and_a_proposed_input_is_shown(
    page: Page, monitor: FakeMonitor
) -> None:
    first, second = monitor.views
    proposal = ProposedInputView(
        "p1", "rudder_rad", "doublet", 0.0349, 0.22, 0.44, ((0.0, 0.0349), (0.22, -0.0349), (0.44, 0.0)),
        "A stuck rudder would not have been noticed yet. " + NASTY, 60.0, 120.0,
    )  # fmt: skip
    monitor.views = [first, dataclasses.replace(second, proposed_input=proposal)]
    monitor.raised += [
        alert(5, vehicle="aero-1", note=("wingwatch: raised again (3)",)),
        alert(6, kind="damage"),
    ]
    owners = (("default", "aero-2"), ("default", "aero-1"))
    words = "Ice on 2 vehicles near 50.02° N 10.00° E at 1000 m." + NASTY
    monitor.groups = [
        AlertGroupView("group-a1", "icing", "warning", ("a1", "a5"), owners, 50.02, 10.0, 1000.0, words)
    ]
    monitor.tell("alert", {"id": "a5"})
    page.wait("document.querySelectorAll('#alerts > li.group').length === 1")
    assert page.ask("document.querySelectorAll('#alerts > li').length") == 2
    group = text(page, "#alerts > li.group")
    assert group.startswith("Ice on 2 aircraft")
    assert words in group
    assert "aero-2, aero-1" in group
    assert "Leave the icing layer" not in group
    page.ask("document.querySelector('#alerts > li.group > details > summary').click()")
    assert "Icing on aero-1" in text(page, "#alerts > li.group")
    assert "3 times" in text(page, "#alerts > li.group")
    shown = text(page, "#vehicles .proposal")
    assert shown.startswith("Proposed input: doublet of the rudder, ±2.0°, 0.44 s.")
    assert "wingwatch does not fly it" in shown
    page.look(360, 740, "dark", mobile=True)
    assert page.ask("document.documentElement.scrollWidth <= 360")
    assert page.ask("document.querySelectorAll('main img, main script').length") == 0
    assert page.console == []


@needs_chromium
def test_it_fits_a_phone_and_the_keyboard_reaches_everything(page: Page) -> None:
    page.look(360, 740, "dark", mobile=True)
    assert page.ask("document.documentElement.scrollWidth <= 360")
    colours = "getComputedStyle(document.body).backgroundColor"
    dark = page.ask(colours)
    page.look(1280, 900, "light")
    assert page.ask(colours) != dark
    reached = []
    for _ in range(7):
        page.key("Tab")
        reached.append(page.ask("document.activeElement.tagName + ' ' + document.activeElement.innerText"))
        if "Cleared" in reached[-1]:
            page.key("Enter")
    assert all(one.startswith("SUMMARY What this flight") for one in reached[:2])
    assert reached[2].startswith("SUMMARY Cleared alerts")
    assert page.ask("document.getElementById('past').open")
    assert {"A status", "A alerts", "A OpenAPI"} <= set(reached)
    assert "not known" in text(page, "#cleared")
