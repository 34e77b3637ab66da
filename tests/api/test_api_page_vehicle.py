"""The view of one vehicle: its card, what its flight could have shown, its alerts."""

import dataclasses
from collections.abc import Generator

import pytest
from api_fakes import FakeMonitor, alert, served, vehicle
from browser import chromium, chromium_path, open_tab
from playwright.sync_api import Browser
from test_api_pages import NASTY

from wingwatch.monitor.views import CouldSeeView, ProposedInputView, VehicleState

pytestmark = pytest.mark.skipif(
    chromium_path() is None,
    reason="the pages need a browser, and this machine has no Chromium: install the package chromium",
)

COULD_SEE = (
    CouldSeeView("sensor_bias", "pitch_rate_rad_s", 0.0123456, "rad/s"),
    CouldSeeView("sensor_bias", "specific_force_z_m_s2", 0.31, "m/s2" + NASTY, NASTY),
    CouldSeeView("elevator_effectiveness", None, 0.2, "", "a doublet of the elevator"),
    CouldSeeView("icing", None, None, ""),
    CouldSeeView("surface_stuck", "rudder_rad", 1.0, ""),
)
PROPOSAL = ProposedInputView(
    "p1", "rudder_rad", "doublet", 0.0349, 0.22, 0.44, ((0.0, 0.0349), (0.22, -0.0349), (0.44, 0.0)),
    "A stuck rudder would not have been noticed yet. " + NASTY, 60.0, 120.0,
)  # fmt: skip


ROWS = "[...document.querySelectorAll('#vehicle-could-see tbody tr')]"


@pytest.fixture(scope="module")
def browser() -> Generator[Browser]:
    with chromium() as launched:
        yield launched


def test_what_others_sent_is_text_and_no_markup(browser: Browser) -> None:
    monitor = FakeMonitor()
    shown = vehicle("aero-2", VehicleState.DEGRADED, fleet="north", reason="icing " + NASTY)
    monitor.views = [dataclasses.replace(shown, could_see=COULD_SEE, proposed_input=PROPOSAL)]
    monitor.raised = [alert(1, fleet="north"), alert(2)]
    with (
        served(monitor) as (server, _),
        open_tab(browser, server.url + "/vehicles/aero-2?fleet=north") as page,
    ):
        page.wait("document.body.textContent.includes('Proposed input')")
        assert page.ask("document.title") == "(2) north / aero-2 · wingwatch"
        text = page.text("main")
        for part in (
            "degraded",
            "rests on the aircraft file",
            "doublet of the rudder, ±2.0°, 0.44 s.",
            NASTY,
        ):
            assert part in text
        furthest = (
            "[...document.querySelectorAll('#vehicle dt')].find((one) => one.textContent === 'Furthest off')"
        )
        assert page.ask(furthest + ".nextElementSibling.innerText").replace("\n", "") == (
            "mq pitch acceleration due to pitch rate, z −1.3 (fourier, short period)"
        )
        page.tab.click("details:has(#vehicle-could-see) > summary")
        page.wait(f"{ROWS}.length === 5")
        assert page.ask(ROWS + ".map((row) => [...row.children].map((cell) => cell.textContent))") == [
            ["sensor bias pitch_rate_rad_s", "0.0123 rad/s", "none needed"],
            ["sensor bias specific_force_z_m_s2", "0.31 m/s²" + NASTY, NASTY],
            ["elevator effectiveness of the airframe", "20 %", "a doublet of the elevator"],
            ["icing of the airframe", "not seen", "none known"],
            ["surface stuck rudder_rad", "seen", "none needed"],
        ]
        assert page.ask("document.querySelectorAll('main img, main script').length") == 0
        monitor.views = [dataclasses.replace(monitor.views[0], reason="changed")]
        monitor.tell("status", {"fleet": "north", "vehicle": "aero-2"})
        page.wait("document.querySelector('#vehicle .reason').textContent === 'changed'")
        assert page.ask("document.querySelector('#vehicle-could-see').closest('details').open")
        assert page.ask("document.querySelectorAll('#vehicle-alerts > li').length") == 1
        page.look(360, 740, "dark", mobile=True)
        assert page.ask("document.documentElement.scrollWidth <= 360")
        assert page.ask("document.querySelectorAll('main img, main script').length") == 0
        assert page.console == []


def test_a_vehicle_that_nobody_knows_is_said_to_be_none(browser: Browser) -> None:
    with served(FakeMonitor()) as (server, _), open_tab(browser, server.url + "/vehicles/nobody") as page:
        page.wait("document.getElementById('vehicle-problem')?.hidden === false")
        assert "'nobody' of fleet 'default' is unknown" in page.text("#vehicle-problem")
