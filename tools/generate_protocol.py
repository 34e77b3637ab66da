"""Generates the Python side of the message schema: telemetry/protocol/*_pb2.py and .pyi from proto/."""

import argparse
import shutil
import sys
import tempfile
from importlib import resources
from pathlib import Path

from grpc_tools import protoc

ROOT = Path(__file__).resolve().parents[1]
SCHEMA = ROOT / "proto"
TARGET = ROOT / "telemetry" / "protocol"


def generate(target: Path) -> list[Path]:
    """Runs the compiler over every schema file and puts what it makes into ``target``; the files made.

    The compiler sees each file by its path from ``proto/``, so descriptors carry a name of their own
    (``wingwatch/v1/vehicle.proto``) wherever the Python files lie.

    Raises:
        RuntimeError: the compiler refused a schema file; it has said why on standard error.
    """
    sources = [str(path.relative_to(SCHEMA)) for path in sorted(SCHEMA.rglob("*.proto"))]
    includes = str(resources.files("grpc_tools") / "_proto")
    with tempfile.TemporaryDirectory() as scratch:
        options = [f"-I{SCHEMA}", f"-I{includes}", f"--python_out={scratch}", f"--pyi_out={scratch}"]
        if protoc.main(["protoc", *options, *sources]) != 0:
            raise RuntimeError("the schema does not compile")
        made = sorted(Path(scratch).rglob("*_pb2.py*"))
        return [Path(shutil.copyfile(path, target / path.name)) for path in made]


def main() -> int:
    """Command line: ``generate_protocol.py [--out FOLDER]``."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=TARGET, help="folder for the generated files")
    for path in generate(parser.parse_args().out):
        print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
