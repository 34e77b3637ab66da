"""REST tokens: made once, kept as hashes, withdrawn at once; and a service that others reach asks for them."""

import json
import ssl
import stat
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import pytest
from certificates import Authority, needs_openssl
from cli_flights import run
from cli_services import service_in

from wingwatch.api import Caller, TokenScope
from wingwatch.operations.faults import CommandError
from wingwatch.service.settings import ServeSettings
from wingwatch.service.tokens import TokenFile, TokenRegister

FILE = "tokens.json"


def create(capsys: pytest.CaptureFixture[str], folder: Path, name: str, scope: str = "read") -> str:
    ran = run(capsys, ["token", "create", name, "--scope", scope, "--data", str(folder), "--json"])
    assert ran.code == 0, ran.err
    made = json.loads(ran.out)
    assert (made["name"], made["scope"]) == (name, scope)
    token = made["token"]
    assert isinstance(token, str)
    return token


def test_a_token_is_shown_once_and_kept_as_a_hash_that_only_the_owner_reads(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    folder = tmp_path / "new"
    tokens = [create(capsys, folder, "tower"), create(capsys, folder, "lead", "operate")]
    assert len(set(tokens)) == 2
    assert all(len(token) >= 43 for token in tokens)  # 256 random bits
    kept = (folder / FILE).read_text()
    assert not any(token in kept or token[3:] in kept for token in tokens)
    assert stat.S_IMODE((folder / FILE).stat().st_mode) == 0o600
    assert [path.name for path in folder.iterdir()] == [FILE]
    listed = json.loads(run(capsys, ["token", "list", "--data", str(folder), "--json"]).out)["tokens"]
    assert [(entry["name"], entry["scope"]) for entry in listed] == [("tower", "read"), ("lead", "operate")]
    assert all(set(entry) == {"name", "scope", "created_at"} for entry in listed)
    register = TokenRegister(TokenFile(folder))
    assert register.find(tokens[1]) == Caller("lead", TokenScope.OPERATE)
    assert register.find(tokens[1] + "x") is None
    assert register.find("\ud800") is None


def test_for_people_the_token_alone_is_on_standard_output(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    data = ["--data", str(tmp_path)]
    assert "There is no token" in run(capsys, ["token", "list", *data]).out
    made = run(capsys, ["token", "create", "tower", *data])
    assert TokenRegister(TokenFile(tmp_path)).find(made.out.strip()) == Caller("tower", TokenScope.READ)
    assert "only time" in made.err
    assert "tower" in run(capsys, ["token", "list", *data]).out
    assert run(capsys, ["token", "revoke", "tower", *data]).code == 0
    assert "tower" not in run(capsys, ["token", "list", *data]).out


def test_what_cannot_be_is_told_in_a_sentence(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    data = ["--data", str(tmp_path)]
    create(capsys, tmp_path, "tower")
    assert "a token 'tower' already" in run(capsys, ["token", "create", "tower", *data]).sentence
    assert "no token 'lead'" in run(capsys, ["token", "revoke", "lead", *data]).sentence
    assert "'The Lead' is no valid name" in run(capsys, ["token", "create", "The Lead", *data]).sentence
    assert "'write'" in run(capsys, ["token", "create", "lead", "--scope", "write", *data]).sentence
    for text in ("", "{", '{"format": 2, "tokens": []}', '{"format": 1, "tokens": [{"name": "a"}]}'):
        (tmp_path / FILE).write_text(text)
        assert "is no file of tokens" in run(capsys, ["token", "create", "lead", *data]).sentence
        assert (tmp_path / FILE).read_text() == text  # what may be repaired is not overwritten


def test_two_who_make_tokens_at_once_lose_none(tmp_path: Path) -> None:
    names = [f"t{number}" for number in range(24)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda name: TokenFile(tmp_path).create(name, TokenScope.READ), names))
    assert sorted(entry.name for entry in TokenFile(tmp_path).entries()) == sorted(names)


def test_a_file_that_breaks_while_the_service_runs_permits_nobody(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file = TokenFile(tmp_path)
    token = file.create("tower", TokenScope.READ)
    whole = file.path.read_bytes()
    register = TokenRegister(file)
    assert register.find(token) is not None
    file.path.write_bytes(b"{")
    assert register.find(token) is None
    assert register.problem is not None
    assert "is no file of tokens" in register.problem
    assert register.find(token) is None
    assert len(caplog.records) == 1
    file.path.write_bytes(whole)
    assert register.find(token) is not None
    assert register.problem is None


def test_beyond_loopback_it_does_not_start_without_a_token(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    folder = tmp_path / "data"
    for more in (["--host", "0.0.0.0"], ["--require-token"]):
        ran = run(capsys, ["serve", "--port", "0", "--data", str(folder), *more])
        assert ran.code == 2
        assert f"`wingwatch token create NAME --scope operate --data {folder}`" in ran.sentence
        assert not folder.exists()  # nothing was begun
    folder.mkdir()
    (folder / FILE).write_text("{")
    assert (
        "is no file of tokens" in run(capsys, ["serve", "--port", "0", "--data", str(folder), *more]).sentence
    )


def test_beyond_loopback_only_a_token_opens_it_and_a_withdrawn_one_no_longer(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file = TokenFile(tmp_path)
    token = file.create("tower", TokenScope.READ)
    with service_in(tmp_path, host="0.0.0.0") as service:
        assert "without TLS" in caplog.text
        with httpx.Client(base_url=service.url) as client:
            assert client.get("/health/live").status_code == 200
            assert client.get("/v1/status").status_code == 401
            headers = {"Authorization": f"Bearer {token}"}
            assert client.get("/v1/status", headers=headers).status_code == 200
            late = {"Authorization": f"Bearer {file.create('late', TokenScope.READ)}"}
            assert client.get("/v1/status", headers=late).status_code == 200
            file.revoke("tower")
            assert client.get("/v1/status", headers=headers).status_code == 401


def test_on_loopback_nothing_is_asked_for(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with service_in(tmp_path) as service:
        assert httpx.get(f"{service.url}/v1/status").status_code == 200
        assert httpx.get(f"{service.url}/v1/session").json()["required"] is False
        assert service.readiness()["tokens"] is None
    assert caplog.records == []


def test_a_certificate_needs_its_key(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    ran = run(capsys, ["serve", "--certificate", str(tmp_path / "a.pem"), "--data", str(tmp_path / "d")])
    assert "both --certificate and --private-key" in ran.sentence
    with pytest.raises(CommandError, match="both"):
        ServeSettings(private_key=tmp_path / "a.key")


@needs_openssl
def test_with_a_certificate_and_a_name_it_serves_https_under_that_name(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    authority = Authority(tmp_path)
    own = authority.sign("service")
    token = TokenFile(tmp_path).create("tower", TokenScope.READ)
    trust = ssl.create_default_context(cafile=str(authority.certificate))
    shown = {"certificate": own.certificate, "private_key": own.private_key}
    with service_in(tmp_path, host="0.0.0.0", name=("wing.example",), **shown) as service:
        assert service.url.startswith("https://")
        headers = {"Authorization": f"Bearer {token}"}
        with httpx.Client(base_url=service.url, verify=trust, headers=headers) as client:
            assert client.get("/v1/status").status_code == 200
            assert client.get("/v1/status", headers={"Host": "wing.example"}).status_code == 200
            assert client.get("/v1/status", headers={"Host": "other.example"}).status_code == 421
    assert "without TLS" not in caplog.text
