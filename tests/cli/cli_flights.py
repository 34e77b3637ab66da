"""Flights and calls that the command line's tests share."""

import functools
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from wingwatch.cli.main import main
from wingwatch.simulation import demo_fleet, simulate
from wingwatch.telemetry import SampleBlock

ROOT = Path(__file__).parents[2]
THOR75 = ROOT.parent / "shared" / "data" / "thor75" / "thor_flight75.mat"
THOR75_MAP = ROOT / "docs" / "maps" / "thor75.toml"


@functools.cache
def demo_block(name: str, seconds: float) -> SampleBlock:
    """A flight of the demonstration's vehicle of that name."""
    scenario = next(s for s in demo_fleet() if s.name == name)
    return simulate(scenario, seconds)


def with_column(block: SampleBlock, name: str, values: NDArray[np.float64]) -> SampleBlock:
    """The block with another column."""
    columns = {present: block.column(present) for present in block.present}
    return SampleBlock.from_columns({**columns, name: values})


def without(block: SampleBlock, *names: str) -> SampleBlock:
    """The block without some columns."""
    return SampleBlock.from_columns({n: block.column(n) for n in block.present if n not in names})


@dataclass(frozen=True)
class Ran:
    """What a command gave."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> dict[str, Any]:
        """Standard output, which must be one JSON line and nothing else."""
        assert self.out.count("\n") == 1
        value = json.loads(self.out)
        assert isinstance(value, dict)
        return value

    @property
    def sentence(self) -> str:
        """The refusal: exit code 2, nothing on standard output, one line on standard error."""
        assert self.code == 2
        assert self.out == ""
        lines = self.err.splitlines()
        assert len(lines) == 1
        assert lines[0].startswith("wingwatch")
        assert "Traceback" not in self.err
        return lines[0]


def run(capsys: pytest.CaptureFixture[str], arguments: Sequence[object]) -> Ran:
    """Call the command in this process."""
    try:
        code = main([str(a) for a in arguments])
    except SystemExit as end:
        code = int(end.code or 0)
    captured = capsys.readouterr()
    return Ran(code, captured.out, captured.err)
