"""Errors of files from dimensions: what the module states is what the benchmark measures."""

import empirical_aircraft as benchmark
import pytest

from wingwatch.aircraft import empirical


def test_the_tables_are_those_that_known_aircraft_give() -> None:
    found = {name: benchmark.rounded(values) for name, values in benchmark.tables().items()}
    stated = {
        "TYPICAL": empirical.TYPICAL,
        "TYPICAL_TAIL": empirical.TYPICAL_TAIL,
        "RADII_OVER_SPAN": empirical.RADII_OVER_SPAN,
        "INERTIA_ERRORS": empirical.INERTIA_ERRORS,
        "LIKENESS_INERTIA_ERRORS": empirical.LIKENESS_INERTIA_ERRORS,
        "ERRORS_BY_TAIL[True]": empirical.ERRORS_BY_TAIL[True],
        "ERRORS_BY_TAIL[False]": empirical.ERRORS_BY_TAIL[False],
        "TYPICAL_ERRORS": empirical.TYPICAL_ERRORS,
        "LIKENESS_ERRORS": empirical.LIKENESS_ERRORS,
        "LIKENESS_FLOORS": empirical.LIKENESS_FLOORS,
    }
    assert found.keys() == stated.keys()
    for name, values in stated.items():
        assert found[name] == pytest.approx(dict(values), rel=0.06), name  # two digits, across platforms


def test_most_known_coefficients_are_inside_their_intervals() -> None:
    for with_tail in (True, False):
        inside, of = benchmark.covered(with_tail)
        assert inside / of > 0.9


def test_the_aerosonde_is_inside_its_errors_where_its_inertias_are_stated() -> None:
    assert max(map(abs, benchmark.aerosonde_scores(True).values())) < benchmark.Z_95
    beyond = {s for s, z in benchmark.aerosonde_scores(False).items() if abs(z) > benchmark.Z_95}
    assert len(beyond) < 6
