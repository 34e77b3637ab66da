"""AVL's derivatives become the file's coefficients: axes, signs, degrees, units, versions, and files that are none."""

from pathlib import Path

import numpy as np
import pytest
from avl_texts import st_text

from wingwatch.aircraft import AvlError, avl_coefficients, load_aircraft, read_avl_mass, read_avl_run

TWIN = load_aircraft("twinotter")
TRUTH = dict(TWIN.need_coefficients("a test").items())
ALPHA, ELEVATOR = 0.09, -0.05


def written(folder: Path, text: str) -> Path:
    path = folder / "run.st"
    path.write_text(text)
    return path


@pytest.mark.parametrize("geometric", [False, True])
def test_coefficients_of_body_axes_come_back(tmp_path: Path, geometric: bool) -> None:
    run = read_avl_run(written(tmp_path, st_text(TWIN, ALPHA, ELEVATOR, geometric=geometric)))
    read = avl_coefficients(run, 1.0, {})
    for key, value in read.coefficients.items():
        if not key.startswith("CD_"):
            assert value == pytest.approx(TRUTH[key], abs=2e-4), key
    drag = read.coefficients.CD
    assert drag.min == pytest.approx(TRUTH["CD_min"], abs=1e-5)
    assert drag.oswald == 0.85
    assert read.geometry.span_m == pytest.approx(TWIN.need_geometry("a test").span_m)
    assert read.reference_x_m == pytest.approx(0.494)
    assert sum("aileron is turned" in note for note in read.notes) == 1
    assert any("geometric" in note for note in read.notes) == geometric


def test_signs_and_names_of_controls_are_found_or_given(tmp_path: Path) -> None:
    controls = {"elevator": ("Elevon_sym", -1.0), "aileron": ("AILERONS", 1.0), "rudder": ("tailfin", -1.0)}
    path = written(tmp_path, st_text(TWIN, ALPHA, ELEVATOR, controls, digits="d"))
    run = read_avl_run(path)
    with pytest.raises(AvlError, match=r"--control elevator=NAME of Elevon_sym, AILERONS, tailfin"):
        avl_coefficients(run, 1.0, {})
    some = avl_coefficients(run, 1.0, {"elevator": "Elevon_sym"})
    assert some.coefficients.Cm.elevator == pytest.approx(TRUTH["Cm_elevator"], abs=2e-4)
    assert some.coefficients.Cm.zero == pytest.approx(TRUTH["Cm_zero"], abs=2e-4)
    assert some.coefficients.Cn.rudder == 0.0
    assert any("no control variable is the rudder" in note for note in some.notes)
    every = avl_coefficients(run, 1.0, {"elevator": "Elevon_sym", "rudder": "tailfin"})
    assert every.coefficients.Cn.rudder == pytest.approx(TRUTH["Cn_rudder"], abs=2e-4)
    with pytest.raises(AvlError, match="control variables are Elevon_sym"):
        avl_coefficients(run, 1.0, {"elevator": "stabilator"})


def test_inches_are_taken_by_the_unit_of_length(tmp_path: Path) -> None:
    g = TWIN.need_geometry("a test")
    sizes = {"wing_area_m2": g.wing_area_m2 / 0.0254**2, "span_m": g.span_m / 0.0254}
    inches = g.model_copy(update={**sizes, "mean_chord_m": g.mean_chord_m / 0.0254})
    path = written(tmp_path, st_text(TWIN.model_copy(update={"geometry": inches}), ALPHA))
    read = avl_coefficients(read_avl_run(path), 0.0254, {})
    assert read.geometry.wing_area_m2 == pytest.approx(g.wing_area_m2, rel=1e-5)
    assert read.coefficients.Cl.p == pytest.approx(TRUTH["Cl_p"], abs=2e-4)


def test_of_several_run_cases_the_last_is_taken(tmp_path: Path) -> None:
    text = st_text(load_aircraft("aerosonde"), 0.02) + st_text(TWIN, ALPHA)
    run = read_avl_run(written(tmp_path, text))
    assert run.values["CLa"] == pytest.approx(TRUTH["CL_alpha"], abs=1e-5)
    assert "2 run cases" in run.notes[0]


def test_a_profile_drag_that_avl_was_not_given_is_typical(tmp_path: Path) -> None:
    bare = TWIN.need_coefficients("a test").with_value("CD_min", 0.0)
    path = written(tmp_path, st_text(TWIN.model_copy(update={"coefficients": bare}), ALPHA))
    read = avl_coefficients(read_avl_run(path), 1.0, {})
    assert read.coefficients.CD.min == 0.047
    assert any("no profile drag" in note for note in read.notes)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda text: text.replace("Stability-axis", "Geometry-axis"), "command SB"),
        (lambda text: "span = 2\n", "holds no derivatives"),
        (lambda text: text.replace("Cnr =", "Cxx ="), "lacks Cnr"),
        (lambda text: text.replace("Alpha =  5.156620", "Alpha = *********"), "Alpha is not finite"),
        (lambda text: text.replace("CLa =", "CLa = NaN #"), "CLa is not finite"),
        (lambda text: text.replace("Sref = 39.0193", "Sref = 0.0"), "Sref is 0"),
    ],
)
def test_what_is_no_run_case_is_refused_in_a_sentence(tmp_path: Path, change: object, sentence: str) -> None:
    assert callable(change)
    with pytest.raises(AvlError, match=sentence) as refused:
        read_avl_run(written(tmp_path, change(st_text(TWIN, ALPHA))))
    assert "\n" not in str(refused.value)


def test_random_bytes_and_files_that_are_not_there_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "noise.st"
    path.write_bytes(b"Stability-axis derivatives" + np.random.default_rng(1).bytes(1_000_000))
    with pytest.raises(AvlError, match=r"lacks Sref"):
        read_avl_run(path)
    with pytest.raises(AvlError, match=r"holds no item|is no item"):
        read_avl_mass(path)
    with pytest.raises(AvlError, match="no such file"):
        read_avl_run(tmp_path / "none.st")


def test_a_mass_file_is_summed_about_its_centre_of_gravity(tmp_path: Path) -> None:
    """Four items of 1 kg at x 0, 0.4, 0.4, 0.4 m (the last by a sum), in cm and g."""
    path = tmp_path / "a.mass"
    path.write_text(
        "# made for a test\nLunit = 0.01 m\nMunit = 0.001 kg\nTunit = 1.0 s\ng = 9.81\nrho = 1.225\n"
        "#  mass   x    y     z   Ixx  Iyy  Izz\n"
        "  1000.0  0.0  0.0  10.0                    ! battery\n"
        "*  1.0  1.0  1.0  1.0  2.0  2.0  2.0\n"
        "  1000.0  40.0  50.0  0.0  100.0  0.0  0.0  ! right\n"
        "  1000.0  40.0 -50.0  0.0  100.0  0.0  0.0  ! left\n"
        "*  1.0  1.0  1.0  1.0\n+  0.0  5.0\n"
        "  1000.0  35.0  0.0  -10.0\n"
    )  # fmt: skip
    found = read_avl_mass(path)
    assert (found.mass_kg, found.length_unit_m) == (4.0, 0.01)
    assert found.centre_m == pytest.approx((0.3, 0.0, 0.0))
    x, y, z, xz = found.inertia_kg_m2
    along, up = 0.3**2 + 3 * 0.1**2, 2 * 0.1**2
    assert x == pytest.approx(2 * 0.5**2 + up + 2 * 2 * 100.0 * 1e-7)
    assert y == pytest.approx(along + up)
    assert z == pytest.approx(along + 2 * 0.5**2)
    assert xz == pytest.approx(-0.3 * 0.1 + 0.1 * -0.1)


def test_a_line_that_is_no_item_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.mass"
    path.write_text("1.0 2.0 wing\n")
    with pytest.raises(AvlError, match=r"line 1: '1\.0 2\.0 wing' is no item"):
        read_avl_mass(path)
