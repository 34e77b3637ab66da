"""The page's fleet: nothing from elsewhere, nothing received becomes markup, live and honest when it is not."""

import dataclasses
import gzip
import re
from collections.abc import Generator
from pathlib import Path

import httpx
import pytest
from api_fakes import COMPILING, ICED, FakeMonitor, alert, served, vehicle
from browser import Page, chromium, chromium_path, open_tab
from playwright.sync_api import Browser

import wingwatch.api
from wingwatch.api import HttpServer, KernelsView, create_app, listen
from wingwatch.monitor.positions import Position
from wingwatch.monitor.views import (
    AlertGroupView,
    AlertState,
    CandidateView,
    VehicleState,
    VehicleView,
    WorstDerivative,
)

FOLDER = Path(wingwatch.api.__file__).parent / "pages"
NASTY = "<img src=x onerror=\"document.title='owned'\"><script>document.title='owned'</script>&amp;"
SPEAKING = (("m_eta", 7.0), ("m_w", 1.5), ("z_w", 0.0), ("m_q", 0.04), ("y_v", -3.0), ("z_q", -0.1))
ROWS = "document.querySelectorAll('.rows > .row').length"

needs_chromium = pytest.mark.skipif(
    chromium_path() is None,
    reason="the pages need a browser, and this machine has no Chromium: install the package chromium",
)


@pytest.fixture
def monitor() -> FakeMonitor:
    filled = FakeMonitor()
    filled.views = [
        vehicle("aero-2", VehicleState.DEGRADED, reason="icing " + NASTY, active_alerts=("a1",)),
        vehicle("aero-1", worst=None, basis=None, basis_text="", condition={}, reason="fine " + NASTY),
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


@pytest.fixture(scope="module")
def browser() -> Generator[Browser]:
    with chromium() as launched:
        yield launched


@pytest.fixture
def page(browser: Browser, door: tuple[HttpServer, httpx.Client]) -> Generator[Page]:
    with open_tab(browser, door[0].url) as opened:
        opened.wait(f"{ROWS} === 2")
        yield opened


def test_every_file_of_the_page_is_served_with_a_strict_policy(door: tuple[HttpServer, httpx.Client]) -> None:
    _, client = door
    kinds = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
    files = [path for path in FOLDER.rglob("*") if path.suffix in kinds]
    assert len(files) > 20
    views = ("/", "/vehicles/aero-2", "/alerts", "/diagnoses", "/studies")
    wanted = {f"/pages/{path.relative_to(FOLDER)}": kinds[path.suffix] for path in files}
    for path, kind in {**wanted, **dict.fromkeys(views, "text/html")}.items():
        answer = client.get(path)
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith(kind)
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert set(re.findall(r"'[a-z-]+'", policy)) == {"'none'", "'self'"}
        assert answer.headers["x-content-type-options"] == "nosniff"
        again = client.get(path, headers={"if-none-match": answer.headers["etag"]})
        assert (again.status_code, again.content) == (304, b"")


def test_files_come_compressed_to_who_takes_that_and_the_event_stream_never(
    door: tuple[HttpServer, httpx.Client], monitor: FakeMonitor
) -> None:
    _, client = door
    forms = {}
    for accepted in ("gzip, deflate, br", "identity", "br, gzip;q=0"):
        with client.stream("GET", "/pages/plotly.js", headers={"Accept-Encoding": accepted}) as answer:
            sent = b"".join(answer.iter_raw())
        assert answer.headers["vary"] == "Accept-Encoding"
        forms[accepted] = sent, answer.headers["etag"], answer.headers.get("content-encoding")
    small, whole, refused = forms.values()
    assert refused == whole
    assert small[2] == "gzip"
    assert gzip.decompress(small[0]) == whole[0]
    assert len(small[0]) < 0.4 * len(whole[0])
    asked = {"Accept-Encoding": "gzip", "If-None-Match": small[1]}
    assert client.get("/pages/plotly.js", headers=asked).status_code == 304
    assert client.get("/pages/plotly.js", headers={**asked, "If-None-Match": whole[1]}).status_code == 200
    with client.stream("GET", "/v1/events", headers={"Accept-Encoding": "gzip"}) as answer:
        assert "content-encoding" not in answer.headers
        pieces = answer.iter_raw()
        assert next(pieces).startswith(b"retry: 2000")
        monitor.tell("status", {})
        assert b"event: status" in next(pieces)


def test_nothing_is_loaded_from_elsewhere_and_nothing_received_becomes_markup() -> None:
    forbidden = ("innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval(", "Function(")
    files = [path for path in FOLDER.rglob("*") if path.is_file()]
    for path in files:
        content = path.read_text()
        addresses = set(re.findall(r"https?://[^\s\"')]+", content))
        assert addresses <= {"http://www.w3.org/2000/svg"}, path  # a namespace's name, never fetched
        assert "url(" not in content, path
        assert not any(word in content for word in forbidden), path
        if path.suffix == ".html":
            assert not re.search(r"\son[a-z]+=|<style|\sstyle=|<script(?! src=)", content)


def test_no_file_outside_the_page_can_be_asked_for(door: tuple[HttpServer, httpx.Client]) -> None:
    _, client = door
    paths = (
        "/pages/",
        "/pages/../app.py",
        "/pages/%2e%2e/app.py",
        "/pages/..%2fapp.py",
        "/main.js",
        "/pages/index.html",
    )
    for path in (*paths, "/pages/index.html", "/vehicles", "/vehicles/a/b"):
        assert client.get(path).status_code == 404


@needs_chromium
def test_it_shows_state_derivative_cause_and_evidence_and_escapes_all(page: Page) -> None:
    shown = page.text("#alerts")
    assert "Icing on aero-2" in shown
    assert "0.0625 ± 0.0078" in shown
    assert "96.9 %" in shown
    assert "−116.3 ± 1.8 1/s²" in shown
    assert "−131.5 ± 2.5 1/s²" in shown
    assert "+5.0" in shown
    assert "a-priori expectation" in shown
    assert "<script>document.title='owned'</script>&amp;" in shown
    row = page.text(".rows > .row").split("\n")
    assert row[:4] == ["degraded", "aero-2", "aerosonde", "Icing 0.0625 ± 0.0078, warning"]
    assert {"47 s", "−1.3", "all moved"} <= set(row)
    assert "fine " + NASTY in page.text(".rows > .row:nth-child(2)")
    assert page.ask("document.querySelectorAll('main img, main script').length") == 0
    assert page.ask("document.title") == "(1) wingwatch"
    assert page.console == []


@needs_chromium
def test_it_says_what_is_being_compiled_until_that_is_done(browser: Browser) -> None:
    state: list[KernelsView | None] = [dataclasses.replace(COMPILING, text=COMPILING.text + NASTY)]
    checks = {"estimators": COMPILING.text}
    compiling = served(FakeMonitor(), checks=checks, kernels=lambda: state[0])
    with compiling as (server, _), open_tab(browser, server.url) as page:
        page.wait("document.getElementById('kernels').hidden === false")
        assert page.text("#kernels-text") == COMPILING.text + NASTY
        assert page.ask("document.getElementById('service-problems').hidden"), "their card alone says so"
        parts = "[...document.querySelectorAll('#kernels-parts > li')].map((item) => item.innerText)"
        assert page.ask(parts) == [
            "the tail\ncompiled",
            "the wings\ncompiling",
            "the paint\nwaiting, in the background",
        ]
        assert page.ask("document.getElementById('kernels-done').value") == 1
        state[0] = None
        page.wait("document.getElementById('kernels').hidden", seconds=8.0)  # it asks every 2 s meanwhile
        assert page.console == []


@needs_chromium
def test_it_says_what_does_not_work_until_it_does(browser: Browser) -> None:
    checks: dict[str, str | None] = {
        "zenoh": None,
        "database": "it is locked " + NASTY,
        "messages": "they wait.",
    }
    monitor = FakeMonitor()
    with served(monitor, checks=checks) as (server, _), open_tab(browser, server.url) as page:
        page.wait("document.getElementById('service-problems').hidden === false")
        problems = "[...document.querySelectorAll('#service-problems li')].map((item) => item.innerText)"
        assert page.ask(problems) == ["database: it is locked " + NASTY, "messages: they wait."]
        checks.update(messages=None, database=None)
        page.wait("document.getElementById('link').dataset.link === 'live'")
        monitor.tell("status", {})
        page.wait("document.getElementById('service-problems').hidden", seconds=8.0)
        assert page.console == []


@needs_chromium
def test_an_event_brings_news_at_once_in_every_view(page: Page, monitor: FakeMonitor) -> None:
    page.wait("document.getElementById('link').dataset.link === 'live'")
    page.tab.click("nav a[href='/studies']")
    assert page.ask("document.title") == "(1) Studies · wingwatch"
    monitor.raised = [alert(2, cause="elevator_effectiveness", size=0.5, vehicle="aero-1"), *monitor.raised]
    monitor.tell("alert", {"id": "a2"})
    # sooner than the poll every 5 s could; the stream's 0.1 s and the page's 0.5 s are the way
    page.wait("document.title.startsWith('(2)')", seconds=4.0)
    assert page.text("#announcer") == "New warning: elevator effectiveness on aero-1."
    page.tab.go_back()
    page.wait("document.querySelectorAll('#alerts > li').length === 2")
    assert "50.00 ± 0.78 %" in page.text("#alerts")


@needs_chromium
def test_it_survives_a_restart_of_the_service_and_says_how_old_it_is(
    browser: Browser, monitor: FakeMonitor
) -> None:
    first = listen("127.0.0.1", 0)
    address = first.getsockname()[1]
    app = create_app(monitor, dict, None, "1")
    with HttpServer(app, first) as server, open_tab(browser, server.url) as page:
        page.wait("document.getElementById('link').dataset.link === 'live'")
        server.stop()
        page.wait("document.getElementById('link').dataset.link === 'lost'")
        assert "has not answered since" in page.text("#banner")
        assert " s old" in page.text("#link")
        assert "aero-2" in page.text(".rows"), "what was known stays readable"
        other = FakeMonitor()
        other.views = [vehicle("late"), *monitor.views]
        with HttpServer(create_app(other, dict, None, "2"), listen("127.0.0.1", address)):
            page.wait("document.getElementById('link').dataset.link === 'live'")
            page.wait(f"{ROWS} === 3")
            assert page.ask("document.getElementById('banner').hidden")
            assert page.text("#version") == "wingwatch 2."
            assert "load the page again" in page.text("#notice")


@needs_chromium
def test_a_client_that_cannot_stream_is_served_by_polling(browser: Browser, monitor: FakeMonitor) -> None:
    class Silent(FakeMonitor):
        def events(self, after: int) -> list[object]:  # type: ignore[override]
            raise RuntimeError("no events today")

    silent = Silent()
    silent.views = monitor.views
    with served(silent) as (server, _), open_tab(browser, server.url) as page:
        page.wait(f"{ROWS} === 2")
        page.wait("document.getElementById('link').dataset.link === 'polling'")
        silent.views = [dataclasses.replace(silent.views[1], vehicle="late"), *silent.views]
        page.wait(f"{ROWS} === 3")
        assert page.ask("document.getElementById('link').dataset.link") == "polling"


@needs_chromium
def test_evidence_that_does_not_speak_folds_away_and_stays_as_the_reader_left_it(
    page: Page, monitor: FakeMonitor
) -> None:
    parts = [dataclasses.replace(ICED, derivative=d, z=z) for d, z in SPEAKING]
    monitor.raised = [alert(1, evidence=parts, probability=0.99999)]
    monitor.tell("alert", {"id": "a1"})
    page.wait("document.querySelectorAll('#alerts details').length === 1")
    assert page.ask("document.querySelectorAll('#alerts .sides > div > table tbody tr').length") == 4
    assert "2 more derivatives are within 2 standard errors" in page.text("#alerts")
    assert "above 99.9 %" in page.text("#alerts")
    assert "+0.0" not in page.text("#alerts")
    page.ask("document.querySelector('#alerts summary').focus()")
    page.key("Enter")
    monitor.raised = [alert(1, evidence=parts, text="Changed.")]
    monitor.tell("alert", {"id": "a1"})
    page.wait("document.querySelector('#alerts .text').textContent === 'Changed.'")
    assert page.ask("document.querySelector('#alerts details').open")
    assert page.ask("document.activeElement.tagName") == "SUMMARY"
    assert "−0.1" in page.text("#alerts details")


@needs_chromium
def test_alerts_stand_worst_first_with_parts_and_candidates(page: Page, monitor: FakeMonitor) -> None:
    possible = (
        CandidateView("sensor_bias", "pitch_rate_rad_s" + NASTY, 0.62),
        CandidateView("sensor_bias", "pitch_rad", 0.3796),
        CandidateView("icing" + NASTY, None, 0.0004),
        CandidateView("thrust_loss", "throttle", float("nan")),
    )
    sensor = {"kind": "sensor", "cause": "sensor_bias", "channel": "pitch_rate_rad_s" + NASTY, "evidence": ()}
    monitor.raised = [
        alert(4, state=AlertState.ACKNOWLEDGED),
        alert(3, candidates=possible, **sensor),
        alert(
            2, kind="damage", cause="thrust_loss", channel="throttle", size=0.3, evidence=(), level="critical"
        ),
        alert(1),
        alert(0, kind="damage", cause="surface_stuck", channel="rudder_rad", size=1.0, evidence=()),
    ]
    monitor.tell("alert", {"id": "a3"})
    page.wait("document.querySelectorAll('#alerts > li').length === 5")
    heads = "[...document.querySelectorAll('#alerts h3')].map((one) => one.innerText.split(' on ')[0])"
    assert page.ask(heads) == ["Thrust loss", "Sensor bias", "Icing", "Surface stuck", "Icing"]
    assert "Sensor bias on aero-2 pitch_rate_rad_s" + NASTY in page.text("#alerts > li:nth-child(2) h3")
    causes = "[...document.querySelectorAll('#alerts .candidates li')].map((one) => one.textContent)"
    assert page.ask(causes) == [
        "62 %sensor bias pitch_rate_rad_s" + NASTY,
        "38 %sensor bias pitch_rad",
        "below 0.1 %icing" + NASTY.replace("_", " "),
        "unknownthrust loss throttle",
    ]
    assert "30.00 ± 0.78 %" in page.text("#alerts > li")
    assert "Size" not in page.text("#alerts > li:nth-child(4)")
    assert page.ask("document.querySelectorAll('main img, main script').length") == 0
    assert page.console == []


@needs_chromium
def test_ice_on_several_aircraft_stands_once(page: Page, monitor: FakeMonitor) -> None:
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
    group = page.text("#alerts > li.group")
    assert group.startswith("Ice on 2 aircraft")
    assert words in group
    assert "aero-2, aero-1" in group
    assert "Leave the icing layer" not in group
    page.tab.click("#alerts > li.group > details > summary")
    assert "Icing on aero-1" in page.text("#alerts > li.group")
    assert "3 times" in page.text("#alerts > li.group")
    page.look(360, 740, "dark", mobile=True)
    assert page.ask("document.documentElement.scrollWidth <= 360")
    assert page.console == []


def fleet_of(number: int) -> list[VehicleView]:
    """One is degraded, every fifth stale; two fleets; all but the last say where they are."""
    views = [
        vehicle(
            f"uav-{k:03d}",
            VehicleState.STALE if k % 5 == 0 else VehicleState.HEALTHY,
            fleet="north" if k % 2 else "south",
            worst=WorstDerivative("ekf", "short_period", "m_q", 0.01 * k),
            position=Position(50.0 + 0.001 * k, 10.0, 500.0),
            sample_age_s=0.25,
        )
        for k in range(number)
    ]
    views[-1] = dataclasses.replace(views[-1], position=None)
    views[7] = dataclasses.replace(views[7], state=VehicleState.DEGRADED, active_alerts=("a1",))
    return views


@needs_chromium
def test_of_500_vehicles_only_those_near_the_screen_are_built_and_keys_reach_all(browser: Browser) -> None:
    monitor = FakeMonitor()
    monitor.views = fleet_of(500)
    monitor.raised = [alert(1, fleet="north", vehicle="uav-007")]
    with served(monitor) as (server, _), open_tab(browser, server.url) as page:
        page.wait(f"{ROWS} > 5")
        assert page.ask(ROWS) < 60
        assert page.ask("document.querySelector('[role=grid]').getAttribute('aria-rowcount')") == "501"
        assert "uav-007" in page.text(".rows > .row")
        assert "499 aircraft; 1 do not say where they are" in page.text(".plan")
        labels = "[...document.querySelectorAll('.plan .labels text')].map((one) => one.textContent)"
        assert page.ask(labels) == ["uav-007"], "of many, those that are degraded are named"
        active = (
            "document.activeElement.getAttribute('aria-rowindex') + ' ' + document.activeElement.dataset.key"
        )
        page.key("r")
        assert page.ask(active) == "2 north/uav-007"
        page.key("End")
        assert page.ask(active) == "501 south/uav-498"
        assert page.ask("document.querySelector('.row.head').getBoundingClientRect().top") == 0
        assert page.ask(ROWS) < 60
        page.key("ArrowUp")
        assert page.ask(active) == "500 south/uav-496"
        monitor.views[0] = dataclasses.replace(monitor.views[0], reason="news")
        monitor.tell("status", {})
        page.tab.wait_for_timeout(700)
        assert page.ask(active) == "500 south/uav-496", "what arrives takes the focus from nobody"
        page.key("Enter")
        page.wait("location.pathname + location.search === '/vehicles/uav-496?fleet=south'")
        assert page.ask("document.activeElement.tagName") == "H1"
        assert page.console == []


@needs_chromium
def test_rows_are_filtered_grouped_and_ordered_and_the_address_keeps_it(browser: Browser) -> None:
    monitor = FakeMonitor()
    monitor.views = fleet_of(20)
    monitor.raised = [alert(1, fleet="north", vehicle="uav-007")]
    names = "[...document.querySelectorAll('.rows .c-name a')].map((one) => one.textContent)"
    with served(monitor) as (server, _), open_tab(browser, server.url) as page:
        page.look(1280, 2000)
        page.wait(f"{ROWS} === 20")
        page.tab.click("#counts button[data-state=stale]")
        assert page.ask(names) == ["uav-005", "uav-015", "uav-000", "uav-010"]
        page.key("/")
        page.tab.keyboard.type("north 15")
        page.wait(f"{ROWS} === 1")
        assert page.text("#shown") == "1 of 20"
        assert page.ask("location.search") == "?state=stale&q=north+15"
        page.tab.reload()
        page.wait(f"{ROWS} === 1")
        page.tab.fill("#search", "")
        page.tab.click("#counts button[data-state=stale]")
        page.tab.select_option("#order", "z")
        page.wait(f"{names}[0] === 'uav-019'")
        page.tab.check("#grouped")
        heads = "[...document.querySelectorAll('.fleet-head')].map((one) => one.innerText)"
        assert page.ask(heads) == [
            "north\n10 aircraft: 1 degraded, 2 stale, 7 healthy",
            "south\n10 aircraft: 2 stale, 8 healthy",
        ]
        assert page.console == []


@needs_chromium
def test_it_fits_a_phone_and_the_keyboard_reaches_everything(page: Page) -> None:
    page.look(390, 844, "dark", mobile=True)
    assert page.ask("document.documentElement.scrollWidth <= 390")
    page.wait("document.querySelector('#alerts summary')?.textContent.startsWith('Evidence')")
    assert not page.ask("document.querySelector('#alerts details').open"), (
        "the aircraft are not screens below"
    )
    colours = "getComputedStyle(document.body).backgroundColor"
    dark = page.ask(colours)
    page.look(1280, 900, "light")
    assert page.ask(colours) != dark
    page.wait("document.querySelector('#alerts .sides table') !== null")
    reached = []
    for _ in range(30):
        page.key("Tab")
        reached.append(page.ask("document.activeElement.tagName + ' ' + document.activeElement.innerText"))
        if "Cleared" in reached[-1]:
            page.key("Enter")
    for wanted in ("A Alerts", "BUTTON ?", "BUTTON Acknowledge", "SUMMARY Cleared alerts (1)", "A REST"):
        assert wanted in reached
    assert any(one.startswith("DIV degraded") for one in reached)
    assert page.ask("document.getElementById('past').open")
    assert "not known" in page.text("#cleared")
