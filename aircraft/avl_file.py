"""What AVL's command ST writes, and its mass file: text to numbers, and nothing made of them.

AVL (Drela and Youngren, Athena Vortex Lattice) prints the derivatives in stability axes: lift, drag and the primed
moments are along axes that are turned by the angle of attack, and so are the rates p' and r'. Two forms of sign exist
and the file says which: "Standard axis orientation, X fwd, Z down" (right wing down, nose up, nose right positive, as
here), and "Geometric axis orientation, X aft, Z up", where roll and yaw, moments and rates, count the other way.
Sideslip is positive with wind from the right in both. Derivatives by a control are per unit of its control variable,
which is a degree where the gain in the .avl file is 1. Positions are along x aft, y right, z up, in the units of the
.avl file.
"""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["AvlError", "AvlMass", "AvlRun", "read_avl_mass", "read_avl_run"]

_MOST_BYTES = 5_000_000
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?"
_VALUE = re.compile(rf"([A-Za-z][\w'/]*)\s*=\s*({_NUMBER}|\*+|[-+]?(?:NaN|Inf(?:inity)?))", re.IGNORECASE)
_CONTROL = re.compile(r"(\S+)\s+d(\d+)\b")
_HEADER = ("Sref", "Cref", "Bref", "Xref", "Alpha", "CLtot", "CDtot", "Cmtot")
_DERIVATIVES = tuple(f"C{row}{by}" for row, by in (
    ("L", "a"), ("m", "a"), ("L", "q"), ("m", "q"),
    ("Y", "b"), ("l", "b"), ("n", "b"), ("Y", "p"), ("l", "p"), ("n", "p"), ("Y", "r"), ("l", "r"), ("n", "r"),
))  # fmt: skip
_TURNED = re.compile(r"(?:C[ln](?:b|d\d+)|CY[pr]|C[Lm][pr]|C[ln][aq])$")
"""What counts the other way in the geometric orientation: one turn of two, of moment and rate."""


class AvlError(ValueError):
    """A file of AVL that cannot be used; one sentence."""


@dataclass(frozen=True, slots=True)
class AvlRun:
    """One run case, in the file's units of length, standard orientation, stability axes.

    Attributes:
        values: numbers by their name in the file (``Sref``, ``Alpha`` in degrees, ``CLa``, ``Cnd02``).
        controls: number of each control variable by its name (``elevator``: 1).
        deflections: of the control variables by name, in their unit.
        notes: what was chosen.
    """

    values: Mapping[str, float]
    controls: Mapping[str, int]
    deflections: Mapping[str, float]
    notes: tuple[str, ...]

    def by_control(self, row: str, name: str) -> float:
        """Derivative of ``CL``, ``CY``, ``Cl``, ``Cm`` or ``Cn`` by a control variable, per its unit."""
        return self.values[f"{row}d{self.controls[name]}"]


def _text(path: Path) -> str:
    try:
        with path.open("rb") as stream:
            raw = stream.read(_MOST_BYTES + 1)
    except OSError as error:
        raise AvlError(f"{path} cannot be read: {(error.strerror or 'no such file').lower()}") from None
    if len(raw) > _MOST_BYTES:
        raise AvlError(
            f"{path} has more than {_MOST_BYTES} bytes, which no AVL file has; give a file that AVL wrote"
        )
    return raw.decode("utf-8", "replace")


def read_avl_run(path: Path) -> AvlRun:
    """The last run case of a file that AVL's command ST has written.

    Raises:
        AvlError: it is none, or a number is missing or is not finite.
    """
    text, notes = _text(path), []
    if "Stability-axis derivatives" not in text:
        what = (
            "body-axis derivatives (command SB)" if "Geometry-axis derivatives" in text else "no derivatives"
        )
        raise AvlError(f"{path} holds {what}; give the output of AVL's command ST")
    cases = re.split(r"(?=Vortex Lattice Output)", text)
    whole = [case for case in cases if "Stability-axis derivatives" in case]
    if len(whole) > 1:
        notes.append(f"{path.name} holds {len(whole)} run cases; the last is taken")
    case = whole[-1]
    head, _, tail = case.partition("Stability-axis derivatives")
    controls = {name: int(number) for name, number in _CONTROL.findall(tail)}
    values = _numbers(path, head, tail)
    deflections = _deflections(head, controls)
    if "Geometric axis orientation" in case:
        notes.append("roll and yaw are turned: the file is in AVL's geometric orientation")
        values = {name: -v if _TURNED.match(name) else v for name, v in values.items()}
    return AvlRun(values, controls, deflections, tuple(notes))


def _numbers(path: Path, head: str, tail: str) -> dict[str, float]:
    found = {}
    for part in (head, tail):
        # The spiral criterion's "Clb Cnr / Clr Cnb = 1.05" is no Cnb.
        lines = "\n".join(line for line in part.splitlines() if " / " not in line)
        for name, number in _VALUE.findall(lines):
            key = re.sub(r"^(C[LYlmnD]|CDff|e)d0*(\d+)$", r"\1d\2", name)
            found[key] = math.nan if "*" in number else float(number.replace("D", "E").replace("d", "e"))
    for name in (*_HEADER, *_DERIVATIVES):
        if name not in found:
            raise AvlError(f"{path} lacks {name}; write it anew with AVL's command ST")
        if not math.isfinite(found[name]):
            raise AvlError(
                f"{path}: {name} is not finite; the run case has not converged, execute it again (X)"
            )
    for name in ("Sref", "Cref", "Bref"):
        if not found[name] > 0.0:
            raise AvlError(f"{path}: {name} is {found[name]:g}; give a positive reference in the .avl file")
    return found


def _deflections(head: str, controls: Mapping[str, int]) -> dict[str, float]:
    out = dict.fromkeys(controls, 0.0)
    for line in head.splitlines():
        name, equals, value = line.partition("=")
        if equals and name.strip() in controls and re.fullmatch(_NUMBER, value.strip()):
            out[name.strip()] = float(value)
    return out


@dataclass(frozen=True, slots=True)
class AvlMass:
    """Sum of a mass file: SI, x aft and z up as AVL has them.

    Attributes:
        length_unit_m: the file's Lunit.
        mass_kg: of all items.
        centre_m: centre of gravity, shape (3,).
        inertia_kg_m2: x, y, z and the integral of x z dm, about the centre of gravity.
    """

    length_unit_m: float
    mass_kg: float
    centre_m: tuple[float, float, float]
    inertia_kg_m2: tuple[float, float, float, float]


def read_avl_mass(path: Path) -> AvlMass:
    """Sum the items of AVL's mass file: mass x y z Ixx Iyy Izz [Ixy Ixz Iyz], with its lines of factors and sums.

    Raises:
        AvlError: it holds no item, or a line that is none.
    """
    units = {"Lunit": 1.0, "Munit": 1.0}
    items: list[list[float]] = []
    factor, shift = np.ones(10), np.zeros(10)
    for number, line in _lines(path):
        stated = re.match(rf"([LMT]unit)\s*=\s*({_NUMBER})", line)
        if stated:
            units[stated[1]] = float(stated[2])
            continue
        if re.match(r"(g|rho)\s*=", line):
            continue
        mark, rest = (
            (line[0], line[1:]) if line[0] in "*+" and not re.match(rf"\+{_NUMBER}", line) else ("", line)
        )
        row = _row(path, number, rest, 1 if mark else 4)
        if mark == "*":
            factor = np.array(row + [1.0] * (10 - len(row)))
        elif mark == "+":
            shift = np.array(row + [0.0] * (10 - len(row)))
        else:
            items.append((np.array(row + [0.0] * (10 - len(row))) * factor + shift).tolist())
    table = np.array(items)
    if not items or not table[:, 0].sum() > 0.0:
        raise AvlError(
            f"{path} holds no item with a mass; give AVL's mass file: mass x y z Ixx Iyy Izz an item"
        )
    return _summed(table, units["Lunit"], units["Munit"])


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(_text(path).splitlines(), 1):
        kept = re.split(r"[#!]", line)[0].strip()
        if kept:
            yield number, kept


def _row(path: Path, number: int, text: str, least: int) -> list[float]:
    words = text.replace(",", " ").split()
    row: list[float] = []
    for word in words[:10]:
        if not re.fullmatch(_NUMBER, word):
            break
        row.append(float(word.replace("D", "E").replace("d", "e")))
    if len(row) < least:
        raise AvlError(f"{path}, line {number}: {text[:40]!r} is no item; give mass x y z Ixx Iyy Izz")
    return row


def _summed(table: NDArray[np.float64], length_m: float, mass_kg: float) -> AvlMass:
    mass = table[:, 0] * mass_kg
    place = table[:, 1:4] * length_m
    own = table[:, 4:10] * mass_kg * length_m**2
    total = float(mass.sum())
    centre = (mass[:, None] * place).sum(axis=0) / total
    x, y, z = (place - centre).T
    inertia = (
        float((own[:, 0] + mass * (y * y + z * z)).sum()),
        float((own[:, 1] + mass * (x * x + z * z)).sum()),
        float((own[:, 2] + mass * (x * x + y * y)).sum()),
        float((own[:, 4] + mass * x * z).sum()),
    )
    return AvlMass(length_m, total, (float(centre[0]), float(centre[1]), float(centre[2])), inertia)
