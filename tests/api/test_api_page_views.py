"""What people do on the page: act on alerts, search their history, diagnose flights, open studies, read about REST."""

import dataclasses
from collections.abc import Generator, Sequence
from typing import Any

import pytest
from api_fakes import FakeDiagnoses, FakeMonitor, alert, diagnosis_view, served, vehicle
from axe_playwright_python.sync_playwright import Axe
from browser import Page, chromium, chromium_path, open_tab
from playwright.sync_api import Browser, FilePayload
from test_api_pages import fleet_of

from wingwatch.api import (
    AccessSettings,
    AppSettings,
    Caller,
    DiagnosisState,
    HttpServer,
    StudyView,
    TokenScope,
    create_app,
    listen,
)
from wingwatch.monitor.views import AlertAction, AlertState, AlertView, VehicleState

pytestmark = pytest.mark.skipif(
    chromium_path() is None,
    reason="the pages need a browser, and this machine has no Chromium: install the package chromium",
)

TOKENS = {"act": Caller("lead", TokenScope.OPERATE), "look": Caller("watcher", TokenScope.READ)}
ACTED = "[...document.querySelectorAll('#alerts .card .tag')].map((one) => one.textContent).join('; ')"


class Telling(FakeMonitor):
    """Says that something was done, as the service does."""

    def act_on_alert(self, alert_id: str, action: AlertAction, *rest: Any, **more: Any) -> AlertView | None:
        view = super().act_on_alert(alert_id, action, *rest, **more)
        self.tell("alert", {"id": alert_id})
        return view


@pytest.fixture(scope="module")
def browser() -> Generator[Browser]:
    with chromium() as launched:
        yield launched


@pytest.fixture
def monitor() -> FakeMonitor:
    filled = Telling()
    filled.views = [
        vehicle("aero-2", VehicleState.DEGRADED, active_alerts=("a2", "a1")),
        vehicle("aero-1"),
    ]
    filled.raised = [
        alert(2, kind="sensor", cause="sensor_bias", level="watch", channel="pitch_rate_rad_s", evidence=()),
        alert(1),
    ]
    return filled


@pytest.fixture
def page(browser: Browser, monitor: FakeMonitor) -> Generator[Page]:
    with served(monitor) as (server, _), open_tab(browser, server.url) as opened:
        opened.wait("document.querySelectorAll('#alerts > li').length === 2")
        opened.wait("document.getElementById('link').dataset.link === 'live'")
        yield opened


def test_who_acts_is_asked_once_and_every_open_page_sees_it(page: Page, monitor: FakeMonitor) -> None:
    other = page.tab.context.browser
    assert other is not None
    with open_tab(other, page.tab.url) as second:
        second.wait("document.querySelectorAll('#alerts > li').length === 2")
        second.wait("document.getElementById('link').dataset.link === 'live'")
        page.tab.click("#alerts [data-alert=a1] [data-act=acknowledge]")
        page.tab.fill("#act-who", "ana")
        page.tab.fill("#act-note", "leaving\nthe layer")
        page.key("Tab")
        page.key("Enter")
        page.wait(f"{ACTED} === 'watch; warning, acknowledged'")
        assert monitor.raised[1].note == ("acknowledge by ana: leaving the layer",)
        assert page.text("#announcer") == "Acknowledged: icing on aero-2."
        second.wait(f"{ACTED} === 'watch; warning, acknowledged'", seconds=4.0)  # the poll is every 5 s
        page.tab.click("#alerts [data-alert=a2] [data-act=acknowledge]")
        page.wait(f"{ACTED} === 'warning, acknowledged; watch, acknowledged'")
        assert monitor.raised[0].note == ("acknowledge by ana: ",)
        assert page.console + second.console == []


def test_the_keyboard_acts_on_the_alert_that_has_the_focus(page: Page, monitor: FakeMonitor) -> None:
    page.key("?")
    assert "shelve it for a time" in page.text("dialog[open]")
    page.key("Escape")
    page.wait("!document.querySelector('dialog[open]') && document.querySelector('#view .card[data-alert]')")
    page.key("j")
    page.wait("document.activeElement.dataset.alert")
    assert page.ask("document.activeElement.dataset.alert") == "a1"
    page.key("s")
    page.tab.fill("#act-who", "ana")
    page.tab.select_option("#act-minutes", "240")
    page.key("Enter")
    page.wait("!document.querySelector('dialog[open]')")
    page.wait(f"{ACTED} === 'watch; warning, shelved'")
    assert monitor.shelved_s == [14400.0]
    page.key("r")
    page.key("c")
    assert page.text("#act-title") == "Clear: sensor bias on aero-2"
    page.key("Enter")
    assert page.ask("document.querySelector('dialog[open]') !== null"), "a cleared alert has a note"
    page.tab.keyboard.type("the sensor was changed")
    page.tab.click("dialog[open] .main")
    page.wait(f"{ACTED} === 'warning, shelved'")
    assert monitor.raised[0].state is AlertState.CLEARED
    page.key("k")
    page.key("u")
    page.wait(f"{ACTED} === 'warning'")
    page.key("u")
    assert page.text("#notice") == "Icing on aero-2 is active; unshelve does not apply."
    assert page.console == []


def test_a_page_that_nobody_sees_listens_only_if_no_other_does(page: Page, monitor: FakeMonitor) -> None:
    hide = (
        "Object.defineProperty(document, 'hidden', {{configurable: true, get: () => {}}});"
        "document.dispatchEvent(new Event('visibilitychange'))"
    )
    closed = "[...performance.getEntriesByType('resource')].filter((one) => one.name.includes('/v1/events')).length"
    other = Page(page.tab.context.new_page())
    other.tab.goto(page.tab.url)
    for one in (page, other):
        one.wait("document.getElementById('link').dataset.link === 'live'")
        one.ask(hide.format("true"))
    page.wait("document.getElementById('link').dataset.link === 'live'")
    other.wait(f"{closed} === 1")
    monitor.raised = [alert(7, vehicle="aero-1"), *monitor.raised]
    monitor.tell("alert", {"id": "a7"})
    page.wait("document.title.startsWith('(3)')", seconds=4.0)
    other.ask(hide.format("false"))
    other.wait("document.title.startsWith('(3)')", seconds=4.0)
    other.wait("document.getElementById('link').dataset.link === 'live'")
    assert page.console + other.console == []


def test_a_refusal_says_why(page: Page, monitor: FakeMonitor) -> None:
    monitor.store_fault = ValueError("alert a1 is cleared; nothing more can be done to it.")
    page.tab.click("#alerts [data-alert=a1] [data-act=clear]")
    page.tab.fill("#act-who", "ana")
    page.tab.fill("#act-note", "x")
    page.tab.click("dialog[open] .main")
    page.wait("document.querySelector('dialog[open] .problem').textContent !== ''")
    assert page.text("dialog[open] .problem") == "alert a1 is cleared; nothing more can be done to it."


def test_with_a_token_its_name_is_kept_and_who_may_only_read_has_no_buttons(
    browser: Browser, monitor: FakeMonitor
) -> None:
    access = AccessSettings(find=TOKENS.get, required=True)
    with served(monitor, access=access) as (server, _), open_tab(browser, server.url) as page:
        page.wait("document.getElementById('login').hidden === false")
        page.tab.fill("#token", "look")
        page.key("Enter")
        page.wait("document.querySelectorAll('#alerts > li').length === 2")
        assert page.ask("document.querySelectorAll('#view [data-act]:not([hidden])').length") == 0
        page.tab.click("#logout")
        page.wait("document.getElementById('login').hidden === false")
        assert page.ask("document.getElementById('view').childElementCount") == 0
        page.tab.fill("#token", "act")
        page.key("Enter")
        page.tab.click("#alerts [data-alert=a1] [data-act=acknowledge]")
        page.wait(f"{ACTED} === 'watch; warning, acknowledged'")
        assert monitor.raised[1].note == ("acknowledge by lead: ",)


def test_sound_and_notifications_are_off_until_switched_on_and_for_warnings_alone(
    browser: Browser, monitor: FakeMonitor
) -> None:
    sounded = "Number(document.documentElement.dataset.sounded ?? 0)"
    with served(monitor) as (server, _), open_tab(browser, server.url) as page:
        page.tab.context.grant_permissions(["notifications"])
        page.tab.add_init_script(
            "window.notices = []; window.Notification = class { static permission = 'granted';"
            "static async requestPermission() { return 'granted'; } constructor(title) { notices.push(title); } };"
        )
        page.tab.reload()
        page.wait("document.getElementById('link').dataset.link === 'live'")

        def tell(number: int, **changes: Any) -> None:
            monitor.raised = [alert(number, vehicle="aero-1", **changes), *monitor.raised]
            monitor.tell("alert", {"id": f"a{number}"})
            page.wait(f"document.querySelector('#alerts [data-alert=a{number}]') !== null")

        tell(3)
        assert (page.ask(sounded), page.ask("notices")) == (0, [])
        page.tab.click("#sound")
        page.tab.click("#notify")
        assert page.ask(sounded) == 1, "it sounds once it is switched on"
        tell(4, level="critical")
        tell(5, level="watch")
        assert (page.ask(sounded), page.ask("notices")) == (2, ["Icing on aero-1"])
        page.tab.reload()
        page.wait("document.querySelectorAll('#alerts > li').length === 5")
        assert page.ask("document.getElementById('sound').getAttribute('aria-pressed')") == "true"
        assert page.ask(sounded) == 0, "what was there before is no news"
        assert page.console == []


def test_the_history_is_searched_paged_and_one_alert_opened(browser: Browser, monitor: FakeMonitor) -> None:
    old = {"state": AlertState.CLEARED, "cleared_s": 300.0}
    monitor.raised += [alert(0, vehicle=f"uav-{k}", **old) for k in range(60)]
    monitor.raised = [
        dataclasses.replace(view, id=f"a{k}", note=("ana: clear (landed)",) if k == 30 else ())
        for k, view in enumerate(monitor.raised)
    ]
    rows = "document.querySelectorAll('#history > tr:not(.detail)').length"
    with served(monitor) as (server, _), open_tab(browser, server.url + "/alerts?level=warning") as page:
        page.wait(f"{rows} === 50")
        page.tab.click("text=Older ones")
        page.wait(f"{rows} === 61")
        page.tab.fill("#find-vehicle", "uav-28")
        page.wait(f"{rows} === 1")
        assert page.ask("location.search") == "?vehicle=uav-28&level=warning"
        page.tab.click("#history button[data-open]")
        detail = page.text("#history .detail")
        assert "ana: clear (landed)" in detail
        assert "−116.3 ± 1.8 1/s²" in detail
        assert page.ask("location.search") == "?vehicle=uav-28&level=warning&id=a30"
        page.tab.fill("#find-vehicle", "")
        page.tab.select_option("#find-state", "active")
        page.wait(f"{rows} === 1")
        assert "Icing" in page.text("#history")
        page.tab.fill("#find-cause", "no such!")
        page.wait("document.querySelector('#view > .problem, #view .problem').textContent !== ''")
        assert "cause" in page.text("#view .problem")


def test_a_flight_is_uploaded_followed_cancelled_and_its_report_opened(
    browser: Browser, monitor: FakeMonitor
) -> None:
    jobs = FakeDiagnoses()
    jobs.page = b"<h1>the report</h1>"
    flight = FilePayload(name="flight <1>.csv", mimeType="text/csv", buffer=b"time_s\n0\n")
    with served(monitor, diagnoses=jobs) as (server, _), open_tab(browser, server.url) as page:
        page.key("3")
        page.wait("document.querySelector('#jobs') !== null")
        page.tab.set_input_files("#up-file", files=[flight])
        page.tab.fill("#up-aircraft", "boeing")
        page.tab.click(".upload .main")
        page.wait("document.querySelector('.upload .problem').textContent !== ''")
        assert page.text(".upload .problem") == "Aircraft 'boeing' is not known here."
        page.tab.fill("#up-aircraft", "aerosonde")
        page.tab.click(".upload .main")
        page.wait("document.querySelectorAll('#jobs > li').length === 1")
        assert (jobs.uploads[0].file, jobs.uploads[0].content) == ("flight <1>.csv", b"time_s\n0\n")
        assert "flight <1>.csv" in page.text("#jobs")
        jobs.views[0] = dataclasses.replace(
            jobs.views[0], state=DiagnosisState.RUNNING, progress=0.5, doing="fitting <i>"
        )
        page.wait("document.querySelector('#jobs').innerText.includes('fitting <i>')")
        assert page.ask("document.querySelector('#jobs progress').value") == 0.5
        jobs.views = [
            dataclasses.replace(jobs.views[0], state=DiagnosisState.DONE),
            diagnosis_view("d7", file="alert a1 of default/aero-2"),
        ]
        page.wait("document.querySelector('#jobs h3 a') !== null")
        assert page.text("#jobs h3 a") == "Icing on aero-2"
        assert page.ask("document.querySelector('#jobs h3 a').getAttribute('href')") == "/alerts?id=a1"
        with page.tab.context.expect_page() as opened:
            page.tab.click("text=Open the report")
        assert opened.value.inner_text("h1") == "the report"
        page.tab.click("[data-remove=d7]")
        page.wait("document.querySelectorAll('#jobs > li').length === 1")
        assert [view.id for view in jobs.views] == ["d0"]


class Studies:
    """Obeys StudyPort."""

    def studies(self) -> Sequence[StudyView]:
        return [StudyView("ice & damage", "Study: icing", "From 0.05 on <b>ice</b> is noticed", 1.7e9, 1000)]

    def report(self, name: str) -> bytes | None:
        return b"<h1>noticed</h1>" if name == "ice & damage" else None


def test_finished_studies_are_listed_and_opened(browser: Browser, monitor: FakeMonitor) -> None:
    app = create_app(monitor, dict, None, "1", AppSettings(studies=Studies()))
    with (
        HttpServer(app, listen("127.0.0.1", 0)) as server,
        open_tab(browser, server.url + "/studies") as page,
    ):
        page.wait("document.querySelectorAll('#studies > li').length === 1")
        assert "From 0.05 on <b>ice</b> is noticed" in page.text("#studies")
        with page.tab.context.expect_page() as opened:
            page.tab.click("text=Open the report")
        assert opened.value.inner_text("h1") == "noticed"
        assert page.console == []


def test_a_service_without_studies_says_how_to_show_them(page: Page) -> None:
    page.key("4")
    page.wait("document.querySelector('#studies ~ *, #view .quiet').textContent !== ''")
    assert "start it with --studies" in page.text("#view .quiet:not([hidden])")


def test_rest_is_described_offline(browser: Browser, monitor: FakeMonitor) -> None:
    with served(monitor) as (server, client), open_tab(browser, server.url + "/docs") as page:
        page.tab.wait_for_selector(".opblock")
        described = client.get("/openapi.json").json()
        operations = sum(len(methods) for methods in described["paths"].values())
        assert page.ask("document.querySelectorAll('.opblock').length") == operations
        page.tab.click(".opblock >> nth=0")
        page.tab.wait_for_selector(".opblock .responses-table")
        elsewhere = (
            "performance.getEntriesByType('resource').filter((one) => !one.name.startsWith(origin)).length"
        )
        assert page.ask(elsewhere) == 0
        assert page.console == []


def serious(page: Page, width: int = 1280) -> list[str]:
    """What axe finds that keeps somebody from using the page; a dark page differs from a light one by its colours."""
    found = []
    for scheme, options in (("light", None), ("dark", {"runOnly": ["color-contrast"]})):
        page.look(width, 900, scheme, mobile=width < 500)
        answer = Axe().run(page.tab, options=options).response["violations"]
        found += [
            f"{scheme} {one['id']}: {one['help']} {one['nodes'][0]['html']}"
            for one in answer
            if one["impact"] in ("serious", "critical")
        ]
    return found


VIEWS = {
    "/": ".rows .row", "/vehicles/uav-007?fleet=north": "#view h1", "/alerts?id=a1": "#history .detail",
    "/diagnoses": "#jobs > li", "/studies": "#studies > li", "/docs": ".opblock", "/help": "main h1",
}  # fmt: skip


def test_axe_finds_nothing_serious_in_any_view_light_or_dark(browser: Browser, monitor: FakeMonitor) -> None:
    monitor.views = fleet_of(30)
    monitor.raised += [
        alert(k, level=level, vehicle="uav-007", fleet="north")
        for k, level in ((3, "critical"), (4, "watch"))
    ]
    monitor.raised.append(alert(9, state=AlertState.CLEARED, cleared_s=90.0))
    jobs = FakeDiagnoses()
    jobs.views = [diagnosis_view(f"d{k}", state=state) for k, state in enumerate(DiagnosisState)]
    app = create_app(monitor, dict, None, "1", AppSettings(studies=Studies(), diagnoses=jobs))
    found: list[str] = []
    with HttpServer(app, listen("127.0.0.1", 0)) as server, open_tab(browser, server.url) as page:
        for path, shown in VIEWS.items():
            page.tab.goto(server.url + path)
            page.tab.wait_for_selector(shown)
            found += serious(page)
        page.tab.goto(server.url)
        page.tab.wait_for_selector(".rows .row")
        page.key("?")
        found += serious(page, width=390)
    assert found == []
    assert [
        one for one in page.console if "404 (Not Found)" not in one
    ] == []  # documents are not installed here


def test_on_paper_every_alert_and_row_stands_without_what_is_pressed(page: Page) -> None:
    page.tab.emulate_media(media="print", color_scheme="dark")
    seen = (
        "[...document.querySelectorAll('button, nav, input')].filter((one) => one.checkVisibility()).length"
    )
    assert page.ask(seen) <= 5  # the counts by state
    assert "Icing on aero-2" in page.text("#alerts")
    assert page.ask("getComputedStyle(document.body).color") == "rgb(0, 0, 0)"
    band = "getComputedStyle(document.querySelector('.scale .band')).fill"
    assert page.ask(band) == "rgb(217, 230, 224)", "paper is light, whatever the screen was"
