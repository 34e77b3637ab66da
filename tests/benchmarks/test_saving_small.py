"""`--save` of the benchmarks: which arguments it takes, and what it keeps."""

import sys
from pathlib import Path

import pytest
import saving


def test_the_name_is_the_argument_that_follows() -> None:
    assert saving.without_save(["--flights", "2"]) == (["--flights", "2"], None)
    assert saving.without_save(["--save", "--flights", "2"]) == (["--flights", "2"], "")
    assert saving.without_save(["--flights", "2", "--save", "small"]) == (["--flights", "2"], "small")


def test_a_name_is_no_path() -> None:
    with pytest.raises(SystemExit, match=r"--save: '\.\./x' is not a name"):
        saving.without_save(["--save", "../x"])


def test_a_head_names_no_folder_of_the_machine() -> None:
    said = saving.head(
        "/somewhere/benchmarks/real_flight.py", ["/data/flight 75.mat", "--rate", "50"], "abc1234", 0
    )
    assert said.startswith("# command: benchmarks/real_flight.py 'flight 75.mat' --rate 50\n# date: 20")
    assert said.endswith("\n# commit: abc1234\n\n")
    assert saving.head("x.py", [], "abc1234", 2).endswith("# exit code: 2\n\n")


@pytest.mark.parametrize(("code", "kept"), [(None, True), (3, True), ("no file", False)])
def test_what_is_printed_is_kept_and_printed(
    code: object,
    kept: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A benchmark that ends with a sentence, or an exception, has no output worth keeping."""
    seen = []

    def main() -> None:
        seen.append(sys.argv[1:])
        print("\n1.02 times the bound  ")
        if code is not None:
            raise SystemExit(code)

    monkeypatch.setattr(saving, "RESULTS", tmp_path)
    monkeypatch.setattr(sys, "argv", ["benchmarks/small.py", "--save", "--seeds", "3"])
    with pytest.raises(SystemExit) as ended:
        saving.run_benchmark(main)
    assert ended.value.code == (code or 0)
    assert seen == [["--seeds", "3"]]
    assert "1.02 times the bound  \n" in capsys.readouterr().out
    assert (tmp_path / "small.txt").exists() == kept
    if kept:
        text = (tmp_path / "small.txt").read_text()
        assert text.startswith("# command: benchmarks/small.py --seeds 3\n# date: ")
        assert text.endswith("\n\n1.02 times the bound\n")


def test_every_benchmark_takes_it() -> None:
    scripts = [path for path in saving.RESULTS.parent.glob("*.py") if '"__main__"' in path.read_text()]
    assert len(scripts) > 50
    assert [path.name for path in scripts if "    run_benchmark(main)\n" not in path.read_text()] == []
