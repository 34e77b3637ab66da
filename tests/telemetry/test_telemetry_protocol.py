import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_generated_files_are_those_of_the_schema(tmp_path: Path) -> None:
    command = [sys.executable, str(ROOT / "tools" / "generate_protocol.py"), "--out", str(tmp_path)]
    subprocess.run(command, check=True, capture_output=True, text=True)
    made = {path.name: path.read_text() for path in tmp_path.iterdir()}
    committed = {path.name: path.read_text() for path in (ROOT / "telemetry" / "protocol").glob("*_pb2.py*")}
    assert sorted(made) == sorted(committed)
    stale = [name for name in made if made[name] != committed[name]]
    assert not stale, f"run tools/generate_protocol.py: {stale}"
