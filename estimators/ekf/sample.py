"""One sample of the Kalman filter: what drives it, what is measured, and where it is computed; named arrays.

Axes and units as in ``state``.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Drive", "Gains", "Posterior", "Readings", "Sample", "Step", "Transition", "Workspace"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class Posterior(NamedTuple):
    """One vehicle's augmented state: mean (nz,) and covariance (nz, nz)."""

    z: Array
    cov: Array


class Sample(NamedTuple):
    """One vehicle's last three signal rows and the step between the last two."""

    new: Array
    old: Array
    older: Array
    dt_s: float
    inertial: bool
    """Whether vane and accelerometer are there at both ends."""
    motion: float
    """How far specific force and kinematics have carried the first state since the row before, m/s; 0 where not
    ``inertial``."""


class Step(NamedTuple):
    """What drives the model over one step, besides its state."""

    dt_s: float
    pressure_ratio: float
    """Dynamic pressure over that of the reference; the trim constants go with it."""
    airspeed_m_s: float
    inertial: bool
    """Whether vane and accelerometer are there at both ends: gusts are known from their difference."""
    rolling: bool
    """Whether equations answer to rolling air as their derivatives by roll rate are, else as ``direction`` says."""
    direction: Array
    """(ns,): over the answer of the first rate."""
    inputs: Array
    """(nu,): mean over the step."""
    early: Array
    """(nu,): how much earlier than evenly the inputs come: the mean of (1/2 - t/dt) u."""
    newest_fraction: Array
    """(nu,): of the newer reading in ``inputs``."""
    course_variance: Array
    """(nu,): of ``inputs``, by commands between the readings."""
    inputs_end: Array
    """(nu,): at the end of the step."""
    scale: Array
    """(k,): referred to present derivatives."""
    forward: Array
    """(ns,): kinematic part of the first equation per state, m/s."""
    rest: Array
    """(ns,): acceleration of each state that is due neither to states nor air: of the first gravity and products
    of states, m/s2; of the rates inertia coupling, rad/s2."""
    decay: Array
    """(ng,): of the gust states over the step; 0 of what has passed at once."""


class Drive(NamedTuple):
    """The arrays of a ``Step``."""

    inputs: Array
    early: Array
    newest_fraction: Array
    course_variance: Array
    inputs_end: Array
    scale: Array
    forward: Array
    rest: Array
    decay: Array


class Transition(NamedTuple):
    """One step of the model, and what it is computed in."""

    after: Array
    """(nz,): the state after the step."""
    jacobian: Array
    """(nx, nz): its sensitivity, the rows of states and gust states; the others are the identity."""
    system: Array
    """(ns, ns): dt A, all of it; ``aerodynamic`` without the forward speed."""
    aerodynamic: Array
    squared: Array
    cubed: Array
    series: Array
    """(ns, ns): I + A/2 + A^2/6 + A^3/24."""
    rate: Array
    """(ns,): the part of dx/dt that does not depend on x."""
    early_rate: Array
    """(ns,): B times ``Step.early``."""
    mean_decay: Array
    """(ng,): of the gust states, mean over the step."""


class Readings(NamedTuple):
    """The measurements of one instant: the states', then the accelerometer's."""

    variance: Array
    """(ns + 1,)."""
    innovation: Array
    """(ns + 1,): reading less what is predicted."""
    row: Array
    """(nz,): the accelerometer's Jacobian."""
    measured: Flags
    """(ns + 1,): which of them are there."""


class Gains(NamedTuple):
    """What the measurements of one instant do; m an even number of at least ns + 1, rows past ns are zero."""

    gain: Array
    """(m, nz): gains times the standard deviations of the innovations."""
    innovation: Array
    """(m,): normalised innovations."""
    inverse_std: Array
    """(m,): inverse standard deviations of the innovations, 0 where nothing was measured."""


class Workspace(NamedTuple):
    """Where a step is computed; one for all vehicles."""

    drive: Drive
    transition: Transition
    process: Array
    """(nx, nx): process noise of states and gust states."""
    sources: Array
    """(2, nx): of ``process_noise_into``, and elsewhere for whoever needs it."""
    drift: Array
    """(ns,): process variance of the trim constants."""
    product: Array
    """(nx, nz): Jacobian times covariance."""
    readings: Readings
    gains: Gains
    variance: Array
    """(nx,): predicted, of states and gust states."""
    square: Array
    """(ns + 1, ns + 1): of ``moment_level``."""
