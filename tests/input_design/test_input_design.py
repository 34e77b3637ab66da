"""Designed inputs: shapes and widths of thesis 4.2.3, spectra, orthogonality, and what is refused."""

import functools
import math
from typing import Literal

import numpy as np
import pytest
from scipy.signal import chirp

from wingwatch.aircraft import LATERAL, SHORT_PERIOD, FlightCondition, linearised_derivatives, load_aircraft
from wingwatch.aircraft.excitation import relative_peak_factor, schroeder_phases_rad
from wingwatch.input_design import (
    INPUT_KINDS,
    InputDesign,
    SurfaceTarget,
    design_input,
    surface_targets,
)

AMPLITUDE = math.radians(2.0)
OMEGA = 11.397  # thesis table 7.1: 2.3 / 0.2018 s
BAND = (0.1, 4.0)
ELEVATOR = SurfaceTarget("elevator", AMPLITUDE, OMEGA, BAND, (-6.0 + 9.69j, -6.0 - 9.69j))
TRIO = (
    ELEVATOR,
    SurfaceTarget("aileron", AMPLITUDE, 6.0, (0.1, 6.0), (-20.0, -1.0 + 6.0j, -1.0 - 6.0j)),
    SurfaceTarget("rudder", AMPLITUDE, 6.0, (0.1, 6.0), (-20.0, -1.0 + 6.0j, -1.0 - 6.0j)),
)
FINE_HZ = 1000.0
STEPS = ("impulse", "step", "doublet", "3211", "3211-modified", "1123", "211")
MULTISINES = ("multisine", "weighted-multisine")


@functools.cache
def for_three(kind: str, rate_hz: float = 50.0) -> InputDesign:
    return design_input(kind, TRIO, 10.0, rate_hz)


def steps(kind: str, rate_hz: float = FINE_HZ) -> list[tuple[float, float]]:
    """Length in s and deflection over the amplitude of each step, up to the return to trim."""
    u = design_input(kind, (ELEVATOR,), 10.0, rate_hz).inputs_rad[:, 0] / AMPLITUDE
    ends = np.flatnonzero(np.diff(u)) + 1
    starts = np.concatenate([[0], ends[:-1]])
    return [((b - a) / rate_hz, float(u[a])) for a, b in zip(starts, ends, strict=True)]


def power(design: InputDesign, frequency_hz: float) -> float:
    """Squared Fourier integral of the first surface's held deflections at one frequency, without the FFT."""
    s = 2j * np.pi * frequency_hz
    held = (1.0 - np.exp(-s / design.rate_hz)) / s
    return float(np.abs(held * (design.inputs_rad[:, 0] * np.exp(-s * design.time_s)).sum()) ** 2)


def strongest_hz(design: InputDesign) -> float:
    grid = np.linspace(0.05, 8.0, 1600)
    return float(grid[np.argmax([power(design, f) for f in grid])])


@pytest.mark.parametrize(
    ("kind", "units", "levels", "width_s"),
    [
        ("doublet", (1, 1), (1.0, -1.0), 0.2018),  # thesis table 7.1
        ("3211", (3, 2, 1, 1), (1.0, -1.0, 1.0, -1.0), 1.6 / OMEGA),
        ("3211-modified", (3, 2, 1, 1), (2.0 / 3.0, -1.0, 1.0, -1.0), 2.1 / OMEGA),
        ("1123", (1, 1, 2, 3), (1.0, -1.0, 1.0, -1.0), 1.6 / OMEGA),
        ("211", (2, 1, 1), (1.0, -1.0, 1.0), 1.6 / OMEGA),
    ],
)
def test_steps_have_the_widths_of_the_thesis(
    kind: str, units: tuple[int, ...], levels: tuple[float, ...], width_s: float
) -> None:
    found = steps(kind)
    half_sample = 0.5 / FINE_HZ
    assert len(found) == len(units)
    for (length, level), n, wanted in zip(found, units, levels, strict=True):
        assert abs(length / n - width_s) <= half_sample + 1e-4 / 2  # the table is printed to 1e-4 s
        assert level == pytest.approx(wanted)


def test_a_doublet_is_strongest_at_its_mode_and_a_3211_has_a_wider_band() -> None:
    # sin^2(x/2)^2 / x^2 has its top at x = 2.331: 1.35 % above the 2.3 of equation 4.2
    doublet = design_input("doublet", (ELEVATOR,), 10.0, FINE_HZ)
    assert strongest_hz(doublet) * 2.0 * math.pi == pytest.approx(OMEGA * 2.331 / 2.3, rel=0.005)
    widths = {}
    for kind in ("doublet", "3211"):
        design = design_input(kind, (ELEVATOR,), 10.0, FINE_HZ)
        grid = np.geomspace(0.05, 10.0, 400)
        strong = grid[np.array([power(design, f) for f in grid]) > 0.25 * power(design, strongest_hz(design))]
        widths[kind] = strong[-1] / strong[0]
    assert widths["3211"] > 1.5 * widths["doublet"]


def test_an_impulse_is_flat_in_the_band_and_a_step_is_half_as_strong_at_its_mode() -> None:
    impulse, step = (design_input(kind, (ELEVATOR,), 10.0, FINE_HZ) for kind in ("impulse", "step"))
    assert 10.0 * math.log10(power(impulse, BAND[1]) / power(impulse, 1e-3)) == pytest.approx(-1.0, abs=0.02)
    assert power(step, OMEGA / (2.0 * math.pi)) / power(step, 1e-3) == pytest.approx(0.5, abs=0.005)


@pytest.mark.parametrize("kind", ["doublet", "3211-modified", "multisine", "weighted-multisine"])
def test_what_keeps_the_trim_adds_up_to_nothing(kind: str) -> None:
    u = design_input(kind, (ELEVATOR,), 10.0).inputs_rad[:, 0]
    assert abs(u.sum()) < len(u) * 1e-16


@pytest.mark.parametrize(("kind", "method"), [("sweep", "linear"), ("logarithmic-sweep", "logarithmic")])
def test_a_sweep_is_scipys_chirp_and_ends_at_zero(
    kind: str, method: Literal["linear", "logarithmic"]
) -> None:
    u = design_input(kind, (ELEVATOR,), 20.0, FINE_HZ).inputs_rad[:, 0]
    n = int(np.flatnonzero(u)[-1]) + 1
    t = np.arange(n) / FINE_HZ
    wanted = AMPLITUDE * chirp(t, BAND[0], 20.0, BAND[1], method=method, phi=-90.0)
    np.testing.assert_allclose(u[:n], wanted, atol=AMPLITUDE * 1e-9)
    assert abs(u[n - 1]) <= AMPLITUDE * 2.0 * math.pi * BAND[1] / FINE_HZ  # a sample before the crossing
    assert 20.0 - n / FINE_HZ < 0.5 / BAND[1] + 1.0 / FINE_HZ


@pytest.mark.parametrize("kind", INPUT_KINDS)
def test_the_spectrum_adds_up_to_the_mean_square(kind: str) -> None:
    for rate in (50.0, 50.1):  # an even and an odd number of samples
        design = for_three(kind, rate)
        frequency, density = design.spectrum()
        assert len(design.inputs_rad) == round(10.0 * rate)
        assert frequency[1] == pytest.approx(1.0 / design.length_s)
        total = density.sum(axis=0) / design.length_s
        np.testing.assert_allclose(total, np.mean(design.inputs_rad**2, axis=0), rtol=1e-12)
        np.testing.assert_allclose(design.energy_rad2_s, total * design.length_s, rtol=1e-12)


@pytest.mark.parametrize("kind", MULTISINES)
def test_multisines_of_three_surfaces_are_orthogonal_within_their_bands(kind: str) -> None:
    design = for_three(kind)
    u = design.inputs_rad
    gram = u.T @ u
    size = np.sqrt(np.diagonal(gram))
    assert np.abs(gram / np.outer(size, size) - np.eye(3)).max() < len(u) * 1e-16
    np.testing.assert_allclose(design.share_in_band(), 1.0, atol=1e-12)
    for target, ks, column in zip(TRIO, design.harmonics, design.spectrum()[1].T, strict=True):
        assert target.band_hz[0] <= ks[0] / 10.0
        assert ks[-1] / 10.0 <= target.band_hz[1]
        assert np.delete(column, list(ks)).max() < 1e-25 * column.max()
    # the amplitude is set at 16 instants a cycle of the fastest sine
    assert (np.abs(u).max(axis=0) <= AMPLITUDE / math.cos(math.pi / 16.0)).all()
    assert np.abs(u[0]).max() < 1e-14


def test_a_weighted_multisine_is_as_strong_as_the_mode_answers() -> None:
    design = design_input("weighted-multisine", (ELEVATOR,), 10.0)
    ks = list(design.harmonics[0])
    s = 2j * np.pi * np.array(ks) / 10.0
    damping = 6.0 / math.hypot(6.0, 9.69)
    natural = math.hypot(6.0, 9.69)
    gain = np.abs(natural**2 / (s**2 + 2.0 * damping * natural * s + natural**2))
    lines = design.spectrum()[1][ks, 0]
    np.testing.assert_allclose(lines / lines[0], (gain / gain[0]) ** 2, rtol=1e-9)


@pytest.mark.parametrize("kind", MULTISINES)
def test_phases_make_the_peak_lower_than_schroeders(kind: str) -> None:
    design = design_input(kind, (ELEVATOR,), 10.0)
    ks = design.harmonics[0]
    lines = np.sqrt(design.spectrum()[1][list(ks), 0])
    schroeder = relative_peak_factor(ks, schroeder_phases_rad(len(ks), lines), lines)
    in_phase = relative_peak_factor(ks, np.full(len(ks), math.pi / 2.0), lines)
    mine = float(design.relative_peak_factors[0])
    assert mine < schroeder < in_phase
    assert mine < 1.05  # a sine has 1


def test_schroeders_phases_for_equal_powers_are_the_quadratic() -> None:
    k = np.arange(1, 12)
    np.testing.assert_allclose(schroeder_phases_rad(11), -np.pi * k * (k - 1) / 11.0, atol=1e-13)


def test_relative_peak_factors_of_known_shapes() -> None:
    assert design_input("doublet", (ELEVATOR,), 10.0).relative_peak_factors[0] == pytest.approx(
        math.sqrt(0.5)
    )
    narrow = SurfaceTarget("rudder", 0.1, 6.0, (0.95, 1.05))
    assert design_input("multisine", (narrow,), 10.0).relative_peak_factors[0] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("kind", [k for k in INPUT_KINDS if k not in MULTISINES])
def test_steps_and_sweeps_move_one_surface_after_another(kind: str) -> None:
    u = design_input(kind, TRIO, 15.0).inputs_rad
    assert (np.count_nonzero(u, axis=1) <= 1).all()
    for i in range(3):
        moved = np.flatnonzero(u[:, i]) / 50.0
        assert 5.0 * i <= moved[0] < 5.0 * i + 0.05
        assert moved[-1] < 5.0 * (i + 1)
    assert (np.abs(u).max(axis=0) <= AMPLITUDE).all()


def test_steps_take_effect_in_whole_samples() -> None:
    design = design_input("doublet", (ELEVATOR,), 10.0, 50.0)
    assert design.widths_s == (0.2,)
    assert np.count_nonzero(design.inputs_rad) == 20


def test_the_surfaces_of_a_mode_take_its_frequency_and_roots() -> None:
    aircraft = load_aircraft("aerosonde")
    for structure, names in ((SHORT_PERIOD, ["elevator"]), (LATERAL, ["aileron", "rudder"])):
        derivatives = linearised_derivatives(aircraft, FlightCondition(25.0, 1000.0), structure)
        targets = surface_targets(structure, derivatives, (0.1, 4.0), 0.02)
        assert [t.surface for t in targets] == names
        oscillation = max(targets[0].poles, key=lambda root: root.imag)
        assert targets[0].natural_frequency_rad_s == pytest.approx(abs(oscillation))
        assert len(targets[0].poles) == len(structure.states)


@pytest.mark.parametrize(
    ("kind", "changes", "length_s", "rate_hz", "says"),
    [
        ("triplet", {}, 10.0, 50.0, "'triplet'; give one of impulse, step"),
        ("doublet", {"amplitude_rad": 2.0}, 10.0, 50.0, "amplitude 114.592 degrees"),
        ("doublet", {"natural_frequency_rad_s": math.nan}, 10.0, 50.0, "natural frequency nan"),
        ("sweep", {"band_hz": (4.0, 0.1)}, 10.0, 50.0, "band 4 to 0.1 Hz"),
        ("sweep", {"band_hz": (0.1, 25.0)}, 10.0, 50.0, "too fast for 50 samples a second"),
        ("sweep", {"band_hz": (0.1, 0.2)}, 2.0, 50.0, "less than a whole cycle"),
        ("doublet", {"natural_frequency_rad_s": 500.0}, 10.0, 50.0, "a rate of at least 218 Hz"),
        ("3211", {"natural_frequency_rad_s": 1.0}, 10.0, 50.0, "takes 11.2 s, more than its 10 s"),
        ("multisine", {"band_hz": (0.101, 0.199)}, 10.0, 50.0, "no harmonic for elevator"),
        ("doublet", {}, math.nan, 50.0, "length of nan s"),
        ("doublet", {}, 1e5, 50.0, "give 2 to 100000 samples"),
        ("doublet", {}, 10.0, 0.5, "rate of 0.5 Hz"),
    ],
)
def test_what_cannot_be_designed_is_said(
    kind: str, changes: dict[str, object], length_s: float, rate_hz: float, says: str
) -> None:
    values: dict[str, object] = {
        "surface": "elevator", "amplitude_rad": AMPLITUDE, "natural_frequency_rad_s": OMEGA, "band_hz": BAND,
    }  # fmt: skip
    with pytest.raises(ValueError, match=says.replace("(", r"\(")):
        design_input(kind, (SurfaceTarget(**(values | changes)),), length_s, rate_hz)  # type: ignore[arg-type]


def test_a_surface_moves_once_and_some_surface_moves() -> None:
    with pytest.raises(ValueError, match="elevator, elevator; give each surface once"):
        design_input("doublet", (ELEVATOR, ELEVATOR), 10.0)
    with pytest.raises(ValueError, match="no surface"):
        design_input("doublet", (), 10.0)
