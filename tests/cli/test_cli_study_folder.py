"""Finished studies as the service shows them: reports of one folder, and nothing else."""

import os
from pathlib import Path

import httpx
from api_fakes import FakeMonitor

from wingwatch.api import AppSettings, HttpServer, create_app, listen
from wingwatch.operations.study_folder import StudyFolder
from wingwatch.pages.document import document


def test_reports_of_the_folder_are_listed_newest_first_and_served_in_a_sandbox(tmp_path: Path) -> None:
    for age, name in enumerate(("ice 2026", "old")):
        page = document(
            title=f"Study: {name}", kind="wingwatch study", answer=f"From 0.05 on {name} & more", lead="",
            about="", body="", style="",
        )  # fmt: skip
        (tmp_path / f"{name}.html").write_text(page)
        os.utime(tmp_path / f"{name}.html", (1e9 - age, 1e9 - age))
    (tmp_path / "table.parquet").write_bytes(b"PAR1")
    outside = tmp_path.parent / "outside.html"
    outside.write_text("<title>secret</title>")
    (tmp_path / "link.html").symlink_to(outside)
    (tmp_path / "folder.html").mkdir()
    app = create_app(FakeMonitor(), dict, None, "1", AppSettings(studies=StudyFolder(tmp_path)))
    with (
        HttpServer(app, listen("127.0.0.1", 0)) as server,
        httpx.Client(base_url=server.url, verify=False) as client,
    ):
        items = client.get("/v1/studies").json()["items"]
        assert [item["name"] for item in items] == ["ice 2026", "old"]
        assert items[0]["title"] == "Study: ice 2026"
        assert items[0]["answer"] == "From 0.05 on ice 2026 & more"
        assert items[0]["written_at_s"] == 1e9
        report = client.get(items[0]["report"])
        assert report.content == (tmp_path / "ice 2026.html").read_bytes()
        assert report.headers["content-security-policy"].startswith("sandbox ")
        for name in ("link", "folder", "table", "..%2Foutside", "outside"):
            assert client.get(f"/v1/studies/{name}/report").status_code == 404


def test_a_folder_that_is_not_there_has_no_studies(tmp_path: Path) -> None:
    folder = StudyFolder(tmp_path / "not")
    assert folder.studies() == []
    assert folder.report("x") is None
