"""The derivatives' names: symbol, unit, meaning and the sign physics allows.

Symbols are the British concise derivatives of thesis equations 3.17 and 3.18 and tables B.1 to B.4: the first letter
is the equation (x, y, z force; l, m, n moment; theta, phi the rate of an attitude in a reduced model), the index is the
motion, attitude or control that causes it (u, w, q, v, p, r; alpha, beta; theta, phi; eta elevator, xi aileron, zeta
rudder, tau throttle).
"""

from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["DERIVATIVES", "MODEL_DERIVATIVES", "SURFACES", "SURFACE_OF_INPUT", "Derivative"]

SURFACE_OF_INPUT: Mapping[str, str] = {"eta": "elevator", "xi": "aileron", "zeta": "rudder"}
"""Surface behind each control input of a model structure; the throttle, tau, is none."""

SURFACES: tuple[str, ...] = tuple(SURFACE_OF_INPUT.values())


@dataclass(frozen=True, slots=True)
class Derivative:
    """One concise derivative.

    Attributes:
        symbol: its name in every interface, such as ``m_q``.
        unit: its SI unit as printed (angles in rad are left out).
        meaning: one line for a reader who does not know the symbol.
        sign: the sign of a conventional stable aircraft under the sign convention of thesis 4.2.2
            (-1 or +1), or 0 where both occur.
    """

    symbol: str
    unit: str
    meaning: str
    sign: int


_STREAMED: tuple[tuple[str, str, str, int], ...] = (
    ("z_w", "1/s", "normal acceleration due to normal velocity", -1),
    ("z_q", "m/s", "normal acceleration due to pitch rate, with the forward speed in it", +1),
    ("z_eta", "m/s2", "normal acceleration due to elevator", -1),
    ("m_w", "1/(m s)", "pitch acceleration due to normal velocity", -1),
    ("m_q", "1/s", "pitch acceleration due to pitch rate", -1),
    ("m_eta", "1/s2", "pitch acceleration due to elevator", -1),
    ("y_v", "1/s", "lateral acceleration due to lateral velocity", -1),
    ("y_p", "m/s", "lateral acceleration due to roll rate", 0),
    ("y_r", "m/s", "lateral acceleration due to yaw rate, with minus the forward speed in it", -1),
    ("y_xi", "m/s2", "lateral acceleration due to aileron", 0),
    ("y_zeta", "m/s2", "lateral acceleration due to rudder", +1),
    ("l_v", "1/(m s)", "roll acceleration due to lateral velocity", -1),
    ("l_p", "1/s", "roll acceleration due to roll rate", -1),
    ("l_r", "1/s", "roll acceleration due to yaw rate", +1),
    ("l_xi", "1/s2", "roll acceleration due to aileron", -1),
    ("l_zeta", "1/s2", "roll acceleration due to rudder", 0),
    ("n_v", "1/(m s)", "yaw acceleration due to lateral velocity", +1),
    ("n_p", "1/s", "yaw acceleration due to roll rate", 0),
    ("n_r", "1/s", "yaw acceleration due to yaw rate", -1),
    ("n_xi", "1/s2", "yaw acceleration due to aileron", 0),
    ("n_zeta", "1/s2", "yaw acceleration due to rudder", -1),
)
_FURTHER: tuple[tuple[str, str, str, int], ...] = (
    ("x_u", "1/s", "forward acceleration due to forward velocity", -1),
    ("x_w", "1/s", "forward acceleration due to normal velocity", 0),
    ("x_q", "m/s", "forward acceleration due to pitch rate, with minus the normal speed in it", 0),
    ("x_theta", "m/s2", "forward acceleration due to pitch attitude (phugoid alone)", -1),
    ("x_eta", "m/s2", "forward acceleration due to elevator", 0),
    ("x_tau", "m/s2", "forward acceleration due to full throttle", +1),
    ("z_u", "1/s", "normal acceleration due to forward velocity", -1),
    ("z_alpha", "m/s2", "normal acceleration due to angle of attack", -1),
    ("z_tau", "m/s2", "normal acceleration due to full throttle", 0),
    ("m_u", "1/(m s)", "pitch acceleration due to forward velocity", 0),
    ("m_alpha", "1/s2", "pitch acceleration due to angle of attack", -1),
    ("m_tau", "1/s2", "pitch acceleration due to full throttle", 0),
    ("y_beta", "m/s2", "lateral acceleration due to sideslip", -1),
    ("n_beta", "1/s2", "yaw acceleration due to sideslip", +1),
    ("theta_u", "1/m", "pitch rate due to forward velocity, w and q at balance (phugoid alone)", +1),
    ("theta_theta", "1/s", "pitch rate due to pitch attitude, w and q at balance (phugoid alone)", 0),
    ("theta_eta", "1/s", "pitch rate due to elevator, w and q at balance (phugoid alone)", -1),
    ("phi_phi", "1/s", "rate of bank due to bank, v, p and r at balance (spiral alone)", 0),
    ("phi_zeta", "1/s", "rate of bank due to rudder, v, p and r at balance (spiral alone)", 0),
)


def _vocabulary(*rows: tuple[str, str, str, int]) -> dict[str, Derivative]:
    return {row[0]: Derivative(*row) for row in rows}


DERIVATIVES: Mapping[str, Derivative] = _vocabulary(*_STREAMED)
"""Every derivative of ``STRUCTURES``, by symbol: those estimated on streams, and that an effect can change."""

MODEL_DERIVATIVES: Mapping[str, Derivative] = _vocabulary(*_STREAMED, *_FURTHER)
"""Every derivative of ``MODEL_STRUCTURES``, by symbol."""
