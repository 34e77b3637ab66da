"""The view of one vehicle over time, in a real browser on a real flight into ice."""

import csv
import io
from collections.abc import Generator
from pathlib import Path
from typing import Any

import httpx
import pytest
from api_fakes import FakeMonitor, derivative, served, vehicle
from axe_playwright_python.sync_playwright import Axe
from browser import chromium, chromium_path
from flown_icing import ICE_FROM_S, FlownIcing, flown_icing
from playwright.sync_api import Browser, Page, expect

pytestmark = pytest.mark.skipif(
    chromium_path() is None,
    reason="the pages need a browser, and this machine has no Chromium: install the package chromium",
)

PATH = "/v1/vehicles/icing"
DRAWN = "#picture[data-drawn]"
WAIT_MS = 20_000


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Generator[FlownIcing]:
    with flown_icing(tmp_path_factory.mktemp("flown")) as made:
        yield made


@pytest.fixture(scope="module")
def rest(flown: FlownIcing) -> Generator[httpx.Client]:
    with httpx.Client(base_url=flown.url, verify=False) as client:
        yield client


@pytest.fixture(scope="module")
def browser() -> Generator[Browser]:
    with chromium() as launched:
        yield launched


def opened(browser: Browser, flown: FlownIcing, **options: Any) -> tuple[Page, list[str]]:
    """The vehicle's page once its picture is drawn, and what the browser complains of."""
    page = browser.new_context(**options).new_page()
    complaints: list[str] = []
    page.on("console", lambda m: complaints.append(m.text) if m.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(f"{flown.url}/vehicles/icing")
    page.wait_for_selector(DRAWN, timeout=WAIT_MS)
    return page, complaints


@pytest.fixture(scope="module")
def page(browser: Browser, flown: FlownIcing) -> Generator[Page]:
    found, complaints = opened(browser, flown)
    yield found
    assert complaints == []
    found.context.close()


def choose(page: Page, derivative: str) -> None:
    """Show this derivative; plotly has drawn it when the title of the picture says so and its lines are there."""
    page.click(f".tile[data-derivative='{derivative}']")
    page.wait_for_function(
        "(name) => window.Plotly && document.querySelector('#picture').data?.some((one) => one.name === 'Fourier')"
        " && document.querySelector('#picture-title .symbol').textContent === name.replace('_', '')",
        arg=derivative,
        timeout=WAIT_MS,
    )


def trace(page: Page, name: str) -> dict[str, list[Any]]:
    found = page.evaluate(
        "(name) => { const t = document.querySelector('#picture').data.find((one) => one.name === name);"
        " return { x: Array.from(t.x), y: Array.from(t.y) }; }",
        name,
    )
    assert isinstance(found, dict)
    return found


def series(rest: httpx.Client, derivative: str, estimator: str) -> dict[str, Any]:
    answer = rest.get(f"{PATH}/derivatives/series", params={"names": derivative, "points": 5000}).json()
    found = next(one for one in answer["series"] if one["estimator"] == estimator)
    assert isinstance(found, dict)
    return found


def test_the_picture_has_rests_numbers_and_their_95_percent_bands(page: Page, rest: httpx.Client) -> None:
    choose(page, "z_w")
    page.wait_for_function(
        "() => document.querySelector('#picture').data.find((one) => one.name === 'Fourier').x.length > 60"
    )
    for estimator, label in (("fourier", "Fourier"), ("ekf", "Kalman filter")):
        truth, line, band = series(rest, "z_w", estimator), trace(page, label), trace(page, f"{label}, 95 %")
        by_time = dict(
            zip(truth["time_s"], zip(truth["value"], truth["standard_error"], strict=True), strict=True)
        )
        known = [(x, y) for x, y in zip(line["x"], line["y"], strict=True) if y is not None]
        assert len(known) > 50
        assert all(by_time[x][0] == y for x, y in known)
        edges = [(x, y) for x, y in zip(band["x"], band["y"], strict=True) if y is not None]
        for x, y in edges:
            value, error = by_time[x]
            assert abs(y - value) == pytest.approx(1.96 * error)
    truth, band = series(rest, "z_w", "fourier"), trace(page, "Expected, 95 %")
    expected = dict(
        zip(
            truth["time_s"],
            zip(truth["expected"], truth["expected_standard_error"], strict=True),
            strict=True,
        )
    )
    last_s = max(x for x in band["x"] if x is not None)
    of_last = [y for x, y in zip(band["x"], band["y"], strict=True) if x == last_s]
    value, error = expected[last_s]
    assert sorted(of_last) == pytest.approx([value - 1.96 * error, value + 1.96 * error])


def test_onset_and_alert_are_marked_where_rest_says(page: Page, rest: httpx.Client) -> None:
    (mark,) = rest.get(f"{PATH}/evidence").json()["marks"]
    assert ICE_FROM_S <= mark["onset_s"] <= mark["raised_s"] <= 100.0
    page.wait_for_function(
        "() => document.querySelector('#picture').layout.annotations.some((one) => one.text.startsWith('icing'))"
    )
    layout = page.evaluate(
        "(() => { const { shapes, annotations } = document.querySelector('#picture').layout;"
        " return { shapes, annotations }; })()"
    )
    upright = {
        (s["x0"], s["line"]["dash"]) for s in layout["shapes"] if s["type"] == "line" and s["x0"] == s["x1"]
    }
    assert {(mark["onset_s"], "3px,3px"), (mark["raised_s"], "solid")} <= upright
    assert any("icing began" in one["text"] for one in layout["annotations"])


def test_innovation_excitation_and_the_test_stand_below(page: Page, rest: httpx.Client) -> None:
    choose(page, "n_v")
    page.wait_for_function(
        "() => document.querySelector('#picture').data.some((one) => one.name === 'Test' && one.x.length > 6)"
    )
    evidence = rest.get(f"{PATH}/evidence").json()
    blocks = [b for b in evidence["blocks"] if "lateral" in b["modes"]]
    ratios = {
        b["start_s"]: b["modes"]["lateral"]["fourier"]["innovation"]
        / b["modes"]["lateral"]["fourier"]["limit"]
        for b in blocks
        if b["modes"]["lateral"]["fourier"]["innovation"] is not None
    }
    shown = trace(page, "Innovation, Fourier")
    for x, y in zip(shown["x"][::3], shown["y"][::3], strict=True):  # a block: its start, its end, a gap
        assert y is None if x not in ratios else y == pytest.approx(min(max(ratios[x], 0.05), 100.0))
    after = [ratio for start_s, ratio in ratios.items() if start_s >= ICE_FROM_S]
    before = [ratio for start_s, ratio in ratios.items() if start_s < ICE_FROM_S - 10.0]
    assert max(after) > 2.0 > 1.0 > max(before)
    bars = trace(page, "Information, Fourier")
    assert [y for y in bars["y"] if y is not None] == [
        b["modes"]["lateral"]["fourier"]["information_bit"] for b in blocks
    ]


def test_tiles_agree_with_the_current_derivatives(page: Page, rest: httpx.Client) -> None:
    current = rest.get(f"{PATH}/derivatives").json()["estimators"]
    names = [
        n for structure in ("short_period", "lateral") for n in current["fourier"][structure]["derivatives"]
    ]
    assert page.eval_on_selector_all(".tile", "(all) => all.map((one) => one.dataset.derivative)") == names
    zs = []
    for estimator in ("fourier", "ekf"):
        one = current[estimator]["lateral"]["derivatives"]["n_v"]
        error = (one["standard_error"] ** 2 + one["expected_standard_error"] ** 2) ** 0.5
        zs.append((one["value"] - one["expected"]) / error)
    milder = min(zs, key=abs)
    sign = "−" if milder < 0.0 else "+"
    expect(page.locator(".tile[data-derivative='n_v'] .z")).to_have_text(f"z {sign}{abs(milder):.1f}")


def test_the_picture_moves_and_zooms_by_keys_and_reads_the_history_for_it(
    page: Page, rest: httpx.Client
) -> None:
    choose(page, "m_q")
    page.click("button:text-is('2 min')")
    with page.expect_response(lambda r: "names=m_q" in r.url and "to=" in r.url) as asked:
        page.focus("#picture-frame")
        page.keyboard.press("+")
    query = dict(httpx.URL(asked.value.url).params)
    assert float(query["from"]) < float(query["to"])
    width = (
        "(() => { const [a, b] = document.querySelector('#picture').layout.xaxis.range; return b - a; })()"
    )
    page.wait_for_function(f"() => {width} < 61")
    before = page.evaluate("document.querySelector('#picture').layout.xaxis.range[0]")
    page.keyboard.press("ArrowLeft")
    page.wait_for_function(
        "(before) => document.querySelector('#picture').layout.xaxis.range[0] < before", arg=before
    )
    page.keyboard.press("Home")
    page.wait_for_function(f"() => {width} > 90")


def test_the_numbers_stand_in_tables_too(page: Page, rest: httpx.Client) -> None:
    choose(page, "m_q")
    page.click('summary:has-text("The picture\'s numbers")')
    rows = page.locator(".picture .fold tbody tr")
    expect(rows.first).to_be_visible()
    assert 10 <= rows.count() <= 41
    page.click("summary:has-text('Derivatives now')")
    expect(page.locator("#vehicle-now tbody tr")).to_have_count(21)
    page.click("summary:has-text('Baseline at this condition')")
    expect(page.locator("#vehicle-baseline tbody tr")).to_have_count(27, timeout=WAIT_MS)
    assert "A priori" in page.inner_text("#vehicle-baseline thead")
    expect(page.locator("#vehicle-manoeuvres li").first).to_be_visible()
    expect(page.locator("#vehicle-telemetry")).to_contain_text("20 ms")
    expect(page.locator("#vehicle-envelope svg")).to_be_visible()


def test_the_csv_of_the_page_is_what_rest_has(page: Page, rest: httpx.Client) -> None:
    page.click("button:text-is('Flight')")
    with page.expect_download() as downloading:
        page.click("a.csv")
    rows = list(csv.DictReader(io.StringIO(Path(downloading.value.path()).read_text())))
    for estimator in ("fourier", "ekf"):
        truth = series(rest, "n_v", estimator)
        mine = [r for r in rows if (r["estimator"], r["structure"]) == (estimator, "lateral")]
        assert [float(r["time_s"]) for r in mine] == truth["time_s"]
        assert [float(r["n_v_per_m_s"]) if r["n_v_per_m_s"] else None for r in mine] == truth["value"]


def test_what_is_new_is_drawn_as_it_comes_and_nothing_while_hidden(page: Page, flown: FlownIcing) -> None:
    page.click("button:text-is('10 min')")
    last = "Math.max(...document.querySelector('#picture').data.find((one) => one.name === 'Fourier').x)"
    begun_s = page.evaluate(last)
    flown.fly(flown.now_s + 5)
    page.wait_for_function(f"() => {last} >= {begun_s + 4}", timeout=WAIT_MS)
    page.evaluate(
        "Object.defineProperty(document, 'hidden', { value: true, configurable: true });"
        "document.dispatchEvent(new Event('visibilitychange'))"
    )
    page.wait_for_timeout(50)
    drawn = page.get_attribute("#picture", "data-drawn")
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url) if PATH in request.url else None)
    flown.fly(flown.now_s + 5)
    page.wait_for_timeout(1500)
    assert page.get_attribute("#picture", "data-drawn") == drawn
    assert asked == []
    page.evaluate("delete document.hidden; document.dispatchEvent(new Event('visibilitychange'))")
    page.wait_for_function(f"() => {last} >= {begun_s + 9}", timeout=WAIT_MS)


@pytest.mark.parametrize(
    ("scheme", "width"), [("light", 1280), ("dark", 390)], ids=["light on a desk", "dark on a phone"]
)
def test_nothing_serious_for_axe_nothing_too_wide_and_no_complaint(
    browser: Browser, flown: FlownIcing, scheme: str, width: int
) -> None:
    page, complaints = opened(browser, flown, color_scheme=scheme, viewport={"width": width, "height": 844})
    for title in ("Derivatives now", "What this flight could have shown", "Baseline at this condition"):
        page.click(f"summary:has-text('{title}')")
    expect(page.locator("#vehicle-baseline tbody tr").first).to_be_visible(timeout=WAIT_MS)
    expect(page.locator("#vehicle-could-see tbody tr").first).to_be_visible(timeout=WAIT_MS)
    found = Axe().run(page, options={"resultTypes": ["violations"]}).response["violations"]
    serious = [(v["id"], v["nodes"][0]["html"]) for v in found if v["impact"] in ("serious", "critical")]
    assert serious == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.locator("#picture").scroll_into_view_if_needed()
    ink = page.evaluate("document.querySelector('#picture').layout.font.color")
    page.emulate_media(color_scheme="dark" if scheme == "light" else "light")
    page.wait_for_function("(ink) => document.querySelector('#picture').layout.font.color !== ink", arg=ink)
    assert complaints == []
    page.context.close()


def test_a_new_flight_takes_the_place_of_the_old_one_which_can_still_be_chosen(
    page: Page, flown: FlownIcing, rest: httpx.Client
) -> None:
    page.click("button:text-is('10 min')")
    flown.fly_anew(12)
    newest, oldest = (one["flight"] for one in rest.get(f"{PATH}/flights").json()["items"])
    page.wait_for_selector("select[aria-label=Flight]", timeout=WAIT_MS)
    last = "Math.max(...document.querySelector('#picture').data.find((one) => one.name === 'Fourier').x)"
    page.wait_for_function(f"() => {last} < 15", timeout=WAIT_MS)
    assert page.input_value("select[aria-label=Flight]") == str(newest)
    page.select_option("select[aria-label=Flight]", str(oldest))
    page.wait_for_function(f"() => {last} > 100", timeout=WAIT_MS)


def test_without_a_database_the_picture_is_of_what_the_page_has_seen(browser: Browser) -> None:
    monitor = FakeMonitor()
    monitor.views = [vehicle("aero-1")]

    def flown_to(time_s: float) -> None:
        one = derivative(-6.0 - 0.01 * time_s, 0.1, expected=-6.1, expected_standard_error=0.3)
        modes = {"short_period": {"outcome": "converged", "derivatives": {"m_q": one}}}
        current = {"time_s": time_s, "estimators": {"fourier": modes, "ekf": modes}}
        monitor.current = {("default", "aero-1"): current}
        monitor.tell("derivatives", {"fleet": "default", "vehicle": "aero-1", "time_s": time_s})

    flown_to(100.0)
    with served(monitor) as (server, _):
        page = browser.new_page()
        complaints: list[str] = []
        page.on("console", lambda m: complaints.append(m.text) if m.type in ("error", "warning") else None)
        page.goto(f"{server.url}/vehicles/aero-1")
        page.wait_for_selector(DRAWN, timeout=WAIT_MS)
        flown_to(102.0)
        line = "document.querySelector('#picture').data.find((one) => one.name === 'Kalman filter')"
        page.wait_for_function(f"() => {line}.x.length === 2", timeout=WAIT_MS)
        assert page.evaluate(f"Array.from({line}.y)") == [-7.0, -7.02]
        expect(page.locator("a.csv")).to_be_hidden()
        assert complaints == []
        page.close()


def test_a_vehicle_that_nobody_has_heard_of_is_said_to_be_so(browser: Browser, flown: FlownIcing) -> None:
    page = browser.new_page()
    page.goto(f"{flown.url}/vehicles/nobody")
    problem = page.locator("#vehicle-problem")
    expect(problem).to_contain_text("is unknown", timeout=WAIT_MS)
    assert "'nobody' of fleet 'default' is unknown" in problem.inner_text()
    page.close()
