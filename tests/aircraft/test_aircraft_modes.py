"""Frequencies, damping ratios and time constants with standard errors, against differences and Monte Carlo."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from wingwatch.aircraft import (
    DUTCH_ROLL,
    LATERAL,
    LATERAL_FULL,
    LONGITUDINAL,
    PHUGOID,
    ROLL,
    SHORT_PERIOD,
    SHORT_PERIOD_ALPHA,
    SPIRAL,
    FlightCondition,
    ModeQuantity,
    ModeStructure,
    linearised_derivatives,
    load_aircraft,
    mode_quantities,
    natural_frequency_and_damping,
    state_matrix,
    trimmed,
)

AEROSONDE = load_aircraft("aerosonde")
CONDITION = trimmed(AEROSONDE, FlightCondition(25.0, 1000.0))
USUAL = [
    SHORT_PERIOD,
    SHORT_PERIOD_ALPHA,
    PHUGOID,
    LONGITUDINAL,
    DUTCH_ROLL,
    ROLL,
    SPIRAL,
    LATERAL,
    LATERAL_FULL,
]
OVERDAMPED = {"z_w": -9.0, "z_q": 20.0, "z_eta": -2.0, "m_w": -0.1, "m_q": -4.0, "m_eta": -30.0}

Array = NDArray[np.float64]


def values_of(structure: ModeStructure) -> dict[str, float]:
    return linearised_derivatives(AEROSONDE, CONDITION, structure)


def by_name(quantities: tuple[ModeQuantity, ...]) -> dict[tuple[str, str], ModeQuantity]:
    return {(q.mode, q.name): q for q in quantities}


def spread_of(structure: ModeStructure, values: dict[str, float], relative: float) -> Array:
    """A covariance with correlations, standard errors a share of the values (of 1 at least)."""
    k = len(structure.derivatives)
    mix = np.random.default_rng(7).normal(size=(k, 2 * k))
    correlation = mix @ mix.T
    size = np.array([relative * max(1.0, abs(values[s])) for s in structure.derivatives])
    size /= np.sqrt(np.diagonal(correlation))
    return correlation * np.outer(size, size)


@pytest.mark.parametrize("structure", USUAL, ids=lambda s: s.name)
def test_names_and_order_and_the_figures_of_the_roots(structure: ModeStructure) -> None:
    values = values_of(structure)
    k = len(structure.derivatives)
    found = by_name(mode_quantities(structure, values, np.zeros((k, k)), CONDITION))
    modes = [mode for mode, _ in found]
    assert set(modes) == {*structure.oscillations, *structure.subsidences}
    roots = np.linalg.eigvals(state_matrix(structure, values, CONDITION))
    pairs = sorted((complex(r) for r in roots if r.imag > 0.0), key=abs, reverse=True)
    real = sorted((r.real for r in roots if r.imag == 0.0 and abs(r) > 1e-12), key=abs, reverse=True)
    for mode, root in zip(structure.oscillations, pairs, strict=True):
        got = [
            found[mode, name].value
            for name in ("natural_frequency_rad_s", "damping_ratio", "time_constant_s")
        ]
        assert got == pytest.approx([abs(root), -root.real / abs(root), -1.0 / root.real], rel=1e-9)
    for mode, single in zip(structure.subsidences, real, strict=True):
        assert found[mode, "time_constant_s"].value == pytest.approx(-1.0 / single, rel=1e-9)
    assert {q.unit for q in found.values()} <= {"rad/s", "", "s"}
    assert all(q.standard_error == 0.0 for q in found.values())


def test_the_fastest_mode_is_what_natural_frequency_and_damping_says() -> None:
    for structure in (SHORT_PERIOD, DUTCH_ROLL, LATERAL):
        values = values_of(structure)
        found = {
            q.name: q.value
            for q in mode_quantities(structure, values, np.eye(len(values)))
            if q.mode != "roll"
        }
        expected = natural_frequency_and_damping(structure, state_matrix(structure, values))
        assert (found["natural_frequency_rad_s"], found["damping_ratio"]) == pytest.approx(
            expected, rel=1e-12
        )


@pytest.mark.parametrize(
    ("structure", "values"),
    [(s, None) for s in USUAL] + [(SHORT_PERIOD, OVERDAMPED)],
    ids=lambda x: getattr(x, "name", "usual" if x is None else "overdamped"),
)
def test_standard_errors_of_one_derivative_are_its_slope(
    structure: ModeStructure, values: dict[str, float] | None
) -> None:
    """With one variance alone the standard error is |slope|: against central differences, every derivative."""
    known = values_of(structure) if values is None else values
    k = len(structure.derivatives)
    for i, symbol in enumerate(structure.derivatives):
        only = np.zeros((k, k))
        only[i, i] = 1.0
        got = by_name(mode_quantities(structure, known, only, CONDITION))
        step = 1e-5 * max(1.0, abs(known[symbol]))
        up, down = (
            by_name(
                mode_quantities(
                    structure, {**known, symbol: known[symbol] + sign * step}, np.zeros((k, k)), CONDITION
                )
            )
            for sign in (1.0, -1.0)
        )
        for key, quantity in got.items():
            slope = (up[key].value - down[key].value) / (2.0 * step)
            # step of 1e-5: truncation 1e-10 of third derivatives a few orders larger than the slope; rounding of the
            # value, 1e-14 of it through roots that are 1e-3 of the fastest, over the step
            assert quantity.standard_error == pytest.approx(
                abs(slope), rel=1e-5, abs=1e-11 * abs(quantity.value) / step
            )


@pytest.mark.parametrize(
    ("structure", "values"),
    [(s, None) for s in USUAL] + [(SHORT_PERIOD, OVERDAMPED)],
    ids=lambda x: getattr(x, "name", "usual" if x is None else "overdamped"),
)
def test_standard_errors_are_the_scatter_of_drawn_derivatives(
    structure: ModeStructure, values: dict[str, float] | None
) -> None:
    known = values_of(structure) if values is None else values
    spread = spread_of(structure, known, 1e-4)
    stated = by_name(mode_quantities(structure, known, spread, CONDITION))
    draws = 3000
    rng = np.random.default_rng(11)
    middle = np.array([known[s] for s in structure.derivatives])
    none = np.zeros_like(spread)
    seen: dict[tuple[str, str], list[float]] = {key: [] for key in stated}
    for row in rng.multivariate_normal(middle, spread, size=draws):
        drawn = dict(zip(structure.derivatives, row.tolist(), strict=True))
        for quantity in mode_quantities(structure, drawn, none, CONDITION):
            seen[quantity.mode, quantity.name].append(quantity.value)
    for key, quantity in stated.items():
        assert len(seen[key]) == draws
        # the scatter of a standard deviation from n draws is 1 / sqrt(2 n); five of them
        assert np.std(seen[key]) == pytest.approx(quantity.standard_error, rel=5.0 / math.sqrt(2.0 * draws))


def test_intervals_hold_the_truth_at_errors_as_they_are_in_flight() -> None:
    """Errors of 5 %: the delta method's 95 % interval about each draw, by its own covariance's slopes."""
    structure, draws = SHORT_PERIOD, 2000
    truth = values_of(structure)
    spread = np.diag([(0.05 * truth[s]) ** 2 for s in structure.derivatives])
    exact = by_name(mode_quantities(structure, truth, spread))
    rng = np.random.default_rng(3)
    inside = dict.fromkeys(exact, 0)
    for row in rng.multivariate_normal([truth[s] for s in structure.derivatives], spread, size=draws):
        drawn = by_name(
            mode_quantities(structure, dict(zip(structure.derivatives, row, strict=True)), spread)
        )
        for key, quantity in drawn.items():
            inside[key] += abs(quantity.value - exact[key].value) < 1.96 * quantity.standard_error
    for key, count in inside.items():
        # binomial scatter of 2000 draws is 0.49 %, four of them
        assert count / draws == pytest.approx(0.95, abs=0.02), key


def test_critical_damping_has_a_frequency_but_no_slope_of_its_roots() -> None:
    """z_w = m_q = -2, z_q m_w = 0: a double root -2, and A is defective where z_q stays."""
    values = {"z_w": -2.0, "z_q": 20.0, "z_eta": 0.0, "m_w": 0.0, "m_q": -2.0, "m_eta": 0.0}
    found = by_name(mode_quantities(SHORT_PERIOD, values, np.diag([0.01, 0.0, 0.0, 0.0, 0.0, 0.0])))
    frequency = found["short_period", "natural_frequency_rad_s"]
    # w_n = sqrt(z_w m_q - z_q m_w): by z_w it moves by m_q / (2 w_n) = -1/2; damping = 2 / w_n ... has no slope
    assert (frequency.value, frequency.standard_error) == pytest.approx((2.0, 0.05))
    damping = found["short_period", "damping_ratio"]
    assert (damping.value, damping.standard_error) == pytest.approx((1.0, 0.0), abs=1e-12)
    for i in (1, 2):
        constant = found["short_period", f"time_constant_{i}_s"]
        assert constant.value == pytest.approx(0.5)
        assert constant.standard_error == math.inf


def test_an_overdamped_pair_has_two_time_constants() -> None:
    values = OVERDAMPED | {"z_q": 0.0, "m_w": 0.0}
    spread = np.diag([0.09, 0.0, 0.0, 0.0, 0.04, 0.0])
    found = by_name(mode_quantities(SHORT_PERIOD, values, spread))
    got = [(found["short_period", f"time_constant_{i}_s"]) for i in (1, 2)]
    # roots -9 +- 0.3 and -4 +- 0.2: T = 1/9 with 0.3 / 81, 1/4 with 0.2 / 16
    assert [(q.value, q.standard_error) for q in got] == [
        pytest.approx((1 / 9, 0.3 / 81)),
        pytest.approx((0.25, 0.2 / 16)),
    ]
    assert found["short_period", "natural_frequency_rad_s"].value == pytest.approx(6.0)
    assert found["short_period", "damping_ratio"].value == pytest.approx(13.0 / 12.0)


def test_a_divergence_has_a_negative_time_constant_and_no_frequency() -> None:
    values = {"z_w": -3.0, "z_q": 20.0, "z_eta": 0.0, "m_w": 1.0, "m_q": -2.0, "m_eta": 0.0}
    found = by_name(mode_quantities(SHORT_PERIOD, values, np.eye(6) * 1e-4))
    roots = np.sort(np.roots([1.0, 5.0, 6.0 - 20.0]))
    assert math.isnan(found["short_period", "natural_frequency_rad_s"].value)
    assert math.isnan(found["short_period", "natural_frequency_rad_s"].standard_error)
    assert math.isnan(found["short_period", "damping_ratio"].value)
    constants = [found["short_period", f"time_constant_{i}_s"].value for i in (1, 2)]
    assert constants == pytest.approx([-1.0 / roots[0], -1.0 / roots[1]])
    assert constants[1] < 0.0 < constants[0]


def test_an_unstable_oscillation_has_negative_damping() -> None:
    values = values_of(SHORT_PERIOD) | {"m_q": 6.0}
    found = by_name(mode_quantities(SHORT_PERIOD, values, np.eye(6)))
    assert found["short_period", "damping_ratio"].value < 0.0
    assert found["short_period", "time_constant_s"].value < 0.0
    assert found["short_period", "natural_frequency_rad_s"].standard_error > 0.0


def test_roots_that_are_not_those_of_a_conventional_aircraft_get_plain_names() -> None:
    """A roll and a spiral that have grown into one oscillation, and a lateral motion without any oscillation."""
    k = len(LATERAL_FULL.derivatives)
    values = values_of(LATERAL_FULL) | {"l_p": -0.5, "n_p": 0.0, "l_v": -2.0, "l_r": 0.0}
    roots = np.linalg.eigvals(state_matrix(LATERAL_FULL, values, CONDITION))
    assert (roots.imag > 1e-6).sum() == 2
    coupled = by_name(mode_quantities(LATERAL_FULL, values, np.eye(k), CONDITION))
    assert {mode for mode, _ in coupled} == {"oscillation_1", "oscillation_2"}
    one, two = (coupled[f"oscillation_{i}", "natural_frequency_rad_s"].value for i in (1, 2))
    assert one > two
    still = dict.fromkeys(LATERAL.derivatives, 0.0) | {"y_v": -1.0, "l_p": -9.0, "n_r": -3.0}
    found = by_name(mode_quantities(LATERAL, still, np.eye(15)))
    assert [mode for mode, _ in found] == ["aperiodic_1", "aperiodic_2", "aperiodic_3"]
    assert [q.value for q in found.values()] == pytest.approx([1 / 9, 1 / 3, 1.0])
    # each root is its own derivative here: a unit variance is 1 / root^2
    assert [q.standard_error for q in found.values()] == pytest.approx([1 / 81, 1 / 9, 1.0])


def test_an_aperiodic_short_period_keeps_its_name_beside_the_phugoid() -> None:
    values = values_of(LONGITUDINAL) | {"m_w": 0.03}
    roots = np.linalg.eigvals(state_matrix(LONGITUDINAL, values, CONDITION))
    assert (roots.imag > 1e-6).sum() == 1
    found = by_name(mode_quantities(LONGITUDINAL, values, np.eye(12) * 1e-6, CONDITION))
    fast = sorted((r.real for r in roots if abs(r.imag) < 1e-9), key=abs)[-2:]
    assert found["short_period", "time_constant_1_s"].value == pytest.approx(-1.0 / fast[1])
    assert found["short_period", "time_constant_2_s"].value == pytest.approx(-1.0 / fast[0])
    assert found["phugoid", "damping_ratio"].standard_error > 0.0


def test_a_root_that_others_repeat_has_no_slope() -> None:
    still = dict.fromkeys(LATERAL.derivatives, 0.0) | {"y_v": -1.0, "l_p": -3.0, "n_r": -3.0, "l_r": 1.0}
    found = by_name(mode_quantities(LATERAL, still, np.eye(15)))
    assert found["aperiodic_1", "time_constant_s"].value == pytest.approx(1 / 3)
    assert found["aperiodic_1", "time_constant_s"].standard_error == math.inf
    assert found["aperiodic_3", "time_constant_s"].standard_error == pytest.approx(1.0)


def test_what_is_not_known_stays_unknown() -> None:
    values = values_of(SHORT_PERIOD)
    nothing = mode_quantities(SHORT_PERIOD, values | {"m_q": math.nan}, np.eye(6))
    assert [q.name for q in nothing] == ["natural_frequency_rad_s", "damping_ratio", "time_constant_s"]
    assert all(math.isnan(q.value) and math.isnan(q.standard_error) for q in nothing)
    open_end = np.diag([1.0, 1.0, math.inf, 1.0, 1.0, 1.0])  # z_eta: no part in any root
    known = mode_quantities(SHORT_PERIOD, values, np.eye(6))
    assert mode_quantities(SHORT_PERIOD, values, open_end) == known
    open_end[3, 3] = math.inf
    found = by_name(mode_quantities(SHORT_PERIOD, values, open_end))
    assert found["short_period", "natural_frequency_rad_s"].standard_error == math.inf
    # the envelope of an oscillation is the trace alone, so m_w is not in it
    assert math.isfinite(found["short_period", "time_constant_s"].standard_error)
    neutral = mode_quantities(ROLL, {"l_p": 0.0, "l_xi": -1.0}, np.eye(2))
    assert [(q.value, q.standard_error) for q in neutral] == [(math.inf, math.inf)]


def test_a_covariance_of_another_shape_is_refused() -> None:
    with pytest.raises(ValueError, match=r"covariance of short_period has shape \(6, 6\), got \(4, 4\)"):
        mode_quantities(SHORT_PERIOD, values_of(SHORT_PERIOD), np.eye(4))
    with pytest.raises(ValueError, match="matrices of longitudinal depend on airspeed"):
        mode_quantities(LONGITUDINAL, values_of(LONGITUDINAL), np.eye(12))
