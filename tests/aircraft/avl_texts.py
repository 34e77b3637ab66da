"""What AVL's command ST writes, written here from coefficients in body axes."""

import math
from collections.abc import Mapping

from wingwatch.aircraft import Aircraft

__all__ = ["CONTROLS", "st_text"]

CONTROLS = {"elevator": ("elevator", 1.0), "aileron": ("aileron", -1.0), "rudder": ("rudder", 1.0)}
"""Control variables by surface: name, and sign of its deflection by ours."""


def primed(c: Mapping[str, float], alpha: float) -> dict[str, float]:
    """Stability-axis derivatives by AVL's names: moments turned by alpha, rates too (x' along the wind)."""
    cos, sin = math.cos(alpha), math.sin(alpha)

    def rates(row: str) -> dict[str, float]:
        # A unit of p' is p = cos, r = sin in body axes, one of r' is p = -sin, r = cos.
        by_p, by_r = c[f"{row}_p"], c[f"{row}_r"]
        out = {"b": c[f"{row}_beta"], "p": by_p * cos + by_r * sin, "r": by_r * cos - by_p * sin}
        return out | {surface: c[f"{row}_{surface}"] for surface in ("aileron", "rudder")}

    side, roll, yaw = rates("CY"), rates("Cl"), rates("Cn")
    out = {f"CY{key}": value for key, value in side.items()}
    out |= {f"Cl{key}": roll[key] * cos + yaw[key] * sin for key in roll}
    out |= {f"Cn{key}": yaw[key] * cos - roll[key] * sin for key in yaw}
    out |= {"CLa": c["CL_alpha"], "CLq": c["CL_q"], "Cma": c["Cm_alpha"], "Cmq": c["Cm_q"]}
    return out | {"CLelevator": c["CL_elevator"], "Cmelevator": c["Cm_elevator"]}


def st_text(
    aircraft: Aircraft,
    alpha: float,
    elevator: float = 0.0,
    controls: Mapping[str, tuple[str, float]] = CONTROLS,
    geometric: bool = False,
    digits: str = "02d",
) -> str:
    """A run case of an aircraft at an angle of attack and an elevator deflection, rad."""
    c, g = dict(aircraft.need_coefficients("a test").items()), aircraft.need_geometry("a test")
    turned = -1.0 if geometric else 1.0
    lift = c["CL_zero"] + c["CL_alpha"] * alpha + c["CL_elevator"] * elevator
    pitch = c["Cm_zero"] + c["Cm_alpha"] * alpha + c["Cm_elevator"] * elevator
    drag = c["CD_min"] + lift**2 / (math.pi * 0.85 * g.span_m**2 / g.wing_area_m2)
    d = primed(c, alpha)
    orientation = (
        "Geometric axis orientation,  X aft, Z up"
        if geometric
        else "Standard axis orientation,  X fwd, Z down"
    )
    lines = [
        " Vortex Lattice Output -- Total Forces", "", " Configuration: made for a test",
        f"  Sref = {g.wing_area_m2:.7g}       Cref = {g.mean_chord_m:.7g}       Bref =  {g.span_m:.7g}",
        "  Xref = 0.49400       Yref =  0.0000       Zref =-0.43000E-01", "", f" {orientation}         ", "",
        f"  Alpha = {math.degrees(alpha):9.6f}     pb/2V =  -0.00000     p'b/2V =  -0.00000",
        "  Beta  =   0.00000     qc/2V =   0.00000", "  CXtot =   0.01234     Cltot =   0.00000     Cl'tot =   0.00000",
        f"  CYtot =  -0.00000     Cmtot = {pitch:10.7f}", f"  CLtot = {lift:10.7f}", f"  CDtot = {drag:10.7f}",
        "  CDvis =   0.00000     CDind = 0.0160000", "  CYff  =  -0.00000         e =    0.8500    | Plane  ",
    ]  # fmt: skip
    if elevator:
        lines.append(
            f"   {controls['elevator'][0]:16}= {math.degrees(elevator) * controls['elevator'][1]:10.7f}"
        )
    lines += ["", " Stability-axis derivatives...", ""]
    lines += [
        f" z' force CL |    CLa = {d['CLa']:10.6f}    CLb =   0.000000",
        f" y  force CY |    CYa =   0.000000    CYb = {d['CYb']:10.6f}",
        f" x' mom.  Cl'|    Cla =   0.000000    Clb = {turned * d['Clb']:10.6f}",
        f" y  mom.  Cm |    Cma = {d['Cma']:10.6f}    Cmb =   0.000000",
        f" z' mom.  Cn'|    Cna =   0.000000    Cnb = {turned * d['Cnb']:10.6f}",
        f" z' force CL |    CLp =   0.000000    CLq = {d['CLq']:10.6f}    CLr =   0.000000",
        f" y  force CY |    CYp = {turned * d['CYp']:10.6f}    CYq =  -0.000000    CYr = {turned * d['CYr']:10.6f}",
        f" x' mom.  Cl'|    Clp = {d['Clp']:10.6f}    Clq =   0.000000    Clr = {d['Clr']:10.6f}",
        f" y  mom.  Cm |    Cmp =   0.000000    Cmq = {d['Cmq']:10.6f}    Cmr =  -0.000000",
        f" z' mom.  Cn'|    Cnp = {d['Cnp']:10.6f}    Cnq =   0.000000    Cnr = {d['Cnr']:10.6f}",
    ]
    numbers = {surface: format(i + 1, digits) for i, surface in enumerate(controls)}
    lines.append("    ".join(f"{name}    d{numbers[s]} " for s, (name, _) in controls.items()))
    for row in ("CL", "CY", "Cl", "Cm", "Cn"):
        sign = turned if row in ("Cl", "Cn") else 1.0
        values = {s: sign * k * math.radians(d.get(row + s, 0.0)) for s, (_, k) in controls.items()}
        cells = (f"{row}d{numbers[s]} = {value:10.7f}" for s, value in values.items())
        lines.append(f" {row} | " + "    ".join(cells))
    lines += [
        " Neutral point  Xnp =   0.593846",
        "",
        " Clb Cnr / Clr Cnb  =   1.371210    (  > 1 if spirally stable )",
    ]
    return "\n".join(lines) + "\n"
