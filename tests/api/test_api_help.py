"""``/help``: the documents as files of one folder, open to everybody, and nothing beside them."""

from collections.abc import Generator
from pathlib import Path

import httpx
import pytest
from api_fakes import VERSION, FakeMonitor

from wingwatch.api import AccessSettings, AppSettings, HttpServer, create_app, listen
from wingwatch.api.help_files import HELP_POLICY
from wingwatch.cli.arguments import build_parser
from wingwatch.operations.faults import CommandError
from wingwatch.service.settings import serve_settings


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    site = tmp_path / "site"
    (site / "maps").mkdir(parents=True)
    (site / "index.html").write_text("<title>Documents</title>")
    (site / "maps" / "thor75.toml").write_text("[channels]\n")
    (tmp_path / "secret.txt").write_text("not for everybody")
    (site / "way_out.txt").symlink_to(tmp_path / "secret.txt")
    return site


def client_of(documents: Path | None) -> Generator[httpx.Client]:
    settings = AppSettings(documents=documents, access=AccessSettings(required=True))
    app = create_app(FakeMonitor(), dict, None, VERSION, settings)
    with (
        HttpServer(app, listen("127.0.0.1", 0)) as server,
        httpx.Client(base_url=server.url, verify=False) as client,
    ):
        yield client


@pytest.fixture
def client(folder: Path) -> Generator[httpx.Client]:
    yield from client_of(folder)


@pytest.fixture
def without() -> Generator[httpx.Client]:
    yield from client_of(None)


def test_pages_are_served_without_a_token_under_a_policy_of_their_own(client: httpx.Client) -> None:
    front = client.get("/help", follow_redirects=True)
    assert (front.status_code, front.url.path) == (200, "/help/index.html")
    assert front.text == "<title>Documents</title>"
    assert front.headers["content-security-policy"] == HELP_POLICY
    assert "unsafe" not in HELP_POLICY
    assert "http" not in HELP_POLICY
    aircraft = client.get("/help/maps/thor75.toml")
    assert aircraft.headers["content-type"] == "text/plain; charset=utf-8"
    again = client.get("/help/maps/thor75.toml", headers={"If-None-Match": aircraft.headers["etag"]})
    assert (aircraft.text, again.status_code) == ("[channels]\n", 304)
    assert client.get("/v1/vehicles").status_code == 401


@pytest.mark.parametrize(
    "path", ["way_out.txt", "%2e%2e/secret.txt", "..%2fsecret.txt", "maps", "none.html", "a%00b", "x" * 5000]
)
def test_nothing_beside_the_folder_is_served(client: httpx.Client, path: str) -> None:
    answer = client.get(f"/help/{path}")
    assert answer.status_code in (401, 404)
    assert "everybody" not in answer.text


def test_a_service_without_documents_says_how_to_have_them(without: httpx.Client) -> None:
    answers = [without.get(path) for path in ("/help", "/help/index.html")]
    assert [answer.status_code for answer in answers] == [404, 404]
    assert all("make docs" in answer.text and "--documents" in answer.text for answer in answers)


def test_the_folder_is_a_setting_and_must_hold_the_site(folder: Path) -> None:
    def given(path: Path) -> Path | None:
        return serve_settings(build_parser("0").parse_args(["serve", "--documents", str(path)]), {}).documents

    assert given(folder) == folder
    with pytest.raises(CommandError, match=r"no index\.html; `make docs` builds"):
        given(folder / "maps")
