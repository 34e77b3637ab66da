"""Commands that look into the baseline load no more than they need, and what stands in the place of it is right."""

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy
from alembic.script import ScriptDirectory

from wingwatch.aircraft.bracketed_root import bracketed_root
from wingwatch.baselines import Reference, ReferenceKey, connection, open_database
from wingwatch.operations.baseline_comparison import chi_square_tail

SHOW = """
import sys
from wingwatch.cli.main import main
code = main(["baseline", "show", sys.argv[1], "--aircraft", "aerosonde", "--vehicle", "uav1", "--json"])
heavy = [name for name in ("alembic", "numba", "pandas", "scipy.optimize", "scipy.special") if name in sys.modules]
print(heavy, file=sys.stderr)
raise SystemExit(code)
"""


def test_show_loads_neither_scipy_s_solvers_nor_alembic_nor_numba(tmp_path: Path) -> None:
    path = tmp_path / "w.db"
    with open_database(path) as database:
        key = ReferenceKey("default", "uav1", "aerosonde", "clean", "short_period")
        database.save_reference(key, Reference(np.eye(6), np.ones(6), 3, 30.0), 1.0)
    done = subprocess.run([sys.executable, "-c", SHOW, str(path)], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"
    assert '"distance":{"squared"' in done.stdout


def test_the_revisions_that_files_are_named_by_are_alembic_s() -> None:
    script = ScriptDirectory(str(connection._MIGRATIONS))
    known = tuple(one.revision for one in script.walk_revisions())
    assert connection._known_revisions(connection._MIGRATIONS) == known
    assert connection.head_revision() == script.get_current_head()


@pytest.mark.parametrize("freedom", [1, 2, 3, 6, 15])
def test_the_tail_of_chi_square_is_scipy_s(freedom: int) -> None:
    for squared in (0.0, 1e-6, 0.5, 3.0, 12.0, 80.0):
        expected = float(scipy.stats.chi2.sf(squared, freedom))
        assert chi_square_tail(squared, freedom) == pytest.approx(expected, rel=1e-12)


def test_a_bracketed_root_is_scipy_s_brentq() -> None:
    draw = np.random.default_rng(3)
    found = 0
    for a, b, c, d in draw.normal(size=(200, 4)):

        def function(x: float, a: float = a, b: float = b, c: float = c, d: float = d) -> float:
            return a + b * x + c * x**3 + d * math.exp(x / 3.0)

        if function(-2.0) * function(2.5) < 0.0:
            expected = scipy.optimize.brentq(function, -2.0, 2.5, xtol=1e-14, rtol=1e-14)
            assert bracketed_root(function, -2.0, 2.5) == pytest.approx(expected, abs=1e-14)
            found += 1
    assert found > 50
    assert bracketed_root(lambda x: x - 2.5, -2.0, 2.5) == 2.5
    with pytest.raises(ValueError, match="same sign"):
        bracketed_root(lambda x: x * x + 1.0, -2.0, 2.5)
    with pytest.raises(ArithmeticError):
        bracketed_root(lambda x: math.nan if x > 0.0 else -1.0, -2.0, 2.5)
