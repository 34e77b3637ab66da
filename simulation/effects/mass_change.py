"""Mass that comes or goes at a place: what becomes of mass, centre of gravity and inertia tensor."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import AircraftDataError
from wingwatch.simulation.effects.effect import Parameters

__all__ = ["add_mass"]

_NO_INERTIA = np.zeros((3, 3))
_TENSOR = (
    ("inertia_x", 0, 0, 1.0), ("inertia_y", 1, 1, 1.0), ("inertia_z", 2, 2, 1.0),
    ("inertia_xz", 0, 2, -1.0), ("inertia_xy", 0, 1, -1.0), ("inertia_yz", 1, 2, -1.0),
)  # fmt: skip
"""Parameter, where it stands in the tensor, and its sign there."""


def add_mass(
    parameters: Parameters,
    mass_kg: float,
    place_m: NDArray[np.float64],
    own_inertia: NDArray[np.float64] = _NO_INERTIA,
) -> None:
    """Add a body, or take one away (negative mass and negative own inertia).

    With M the mass before, m the body's, d its place from the centre of gravity before: the centre of gravity moves by
    m d/(M + m), and by the parallel-axis theorem, about both centres, the tensor about the new one is
    J + J_own + m M/(M + m) (d.d I - d d^T).

    Args:
        parameters: changed.
        mass_kg: of the body.
        place_m: of the body's own centre, from the reference point, body axes, shape (3,).
        own_inertia: tensor of the body about its own centre, shape (3, 3).

    Raises:
        AircraftDataError: more mass leaves than there is, or an inertia that no body has is left.
    """
    before = parameters["mass_kg"]
    after = before + mass_kg
    if not after > 0.0:
        raise AircraftDataError(
            f"{-mass_kg:g} kg leave aircraft {parameters.aircraft.name} of {before:g} kg; take away less"
        )
    centre = np.array([parameters[f"cg_{axis}_m"] for axis in "xyz"])
    tensor = np.empty((3, 3))
    for name, i, j, sign in _TENSOR:
        tensor[i, j] = tensor[j, i] = sign * parameters[name]
    d = place_m - centre
    tensor += own_inertia + mass_kg * before / after * (float(d @ d) * np.eye(3) - np.outer(d, d))
    if not np.linalg.eigvalsh(tensor)[0] > 0.0:
        raise AircraftDataError(
            f"{-mass_kg:g} kg cannot have been {[round(float(x), 3) for x in place_m]} m from the reference point of "
            f"aircraft {parameters.aircraft.name}: its moments of inertia are too small; take less or from nearer"
        )
    parameters["mass_kg"] = after
    for axis, moved in zip("xyz", centre + mass_kg / after * d, strict=True):
        parameters[f"cg_{axis}_m"] = float(moved)
    for name, i, j, sign in _TENSOR:
        parameters[name] = sign * float(tensor[i, j])
