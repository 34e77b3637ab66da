"""The filter online: full likelihood of the innovations as a recursion, for a batch of vehicles.

Model, likelihood, gate and guards are those of ``filter_error``; what differs is that samples come one after another
and are forgotten. docs/methods/filter_error.md, section 9, has the recursion.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.estimate import Estimate
from wingwatch.estimators.filter_error.guards import Guards
from wingwatch.estimators.filter_error.increments import LAGS, Head, Sums, row_width
from wingwatch.estimators.filter_error.intake import (
    BLOCK,
    BLOCK_ROWS,
    LOST,
    RECORD,
    WARM_ROWS,
    Intake,
    begins,
    block_rows,
    regrid,
    take_rows,
    to_rows,
)
from wingwatch.estimators.filter_error.lanes import Lanes
from wingwatch.estimators.filter_error.model import Layout
from wingwatch.estimators.filter_error.online_guards import Account, online_guards
from wingwatch.estimators.filter_error.online_setup import FilterConfig, Fixed, fixed_for
from wingwatch.estimators.filter_error.recursion import (
    BLOCKS_A_GROUP,
    GROUPS,
    Evidence,
    Filters,
    One,
    Window,
    absorb_all,
    add_block,
    begin,
    current,
    gained,
)
from wingwatch.estimators.filter_error.stepping import Trial, solve_vehicle
from wingwatch.estimators.filter_error.verdict import unsettled
from wingwatch.estimators.reference import ConcisePosterior, offsets, referred_scale, standing
from wingwatch.estimators.signals import SignalLayout

__all__ = ["FilterConfig", "FilterEstimator", "FilterState"]

Array = NDArray[np.float64]

_GATE = 8.0
"""Log-likelihood that a gust must gain over none at all (docs/methods/filter_error.md, section 5)."""

_CONTRADICTED = 3.0
"""Root of the chi-square per degree of freedom of what surfaces drive, from which on nothing is converged."""

_NOT_AT_REST = 1.0
"""Standard errors that the next step would move a derivative by, from which on nothing is converged."""

_GUST_SCALE_M = 100.0
"""Expected scale length of gusts; estimated, known to a factor of e."""

_NO_GUST = -100.0
"""ln of an intensity that is none."""


class FilterState(NamedTuple):
    """Everything the filter remembers, one row a vehicle; changed in place.

    Attributes:
        intake: samples that wait (``intake.Intake``).
        window: those of the last 18 to 20 s (``recursion.Window``).
        filters: for still air and with gusts (``recursion.Filters``).
        condition: airspeed, altitude, density, angle of attack of the last sample, (vehicles, 4).
        status: whether priors are set; whether a record began without a vane, (vehicles, 2).
    """

    intake: Intake
    window: Window
    filters: Filters
    condition: Array
    status: NDArray[np.int64]


class FilterEstimator:
    """The filter: ``init``, ``update``, ``solve``, ``estimate``; a batch of vehicles at a time."""

    name = "filter"

    def __init__(self, config: FilterConfig) -> None:
        self.config = config
        s = config.structure
        self.signals = SignalLayout(len(s.states), len(s.inputs))
        self.layout = Layout(s, len(s.states) + int(config.use_accelerometer))
        self._fixed = fixed_for(config, self.layout, self.signals)

    def init(self, vehicles: int) -> FilterState:
        """State before the first sample."""
        n, ns, nu, ch = vehicles, self.signals.states, self.signals.inputs, self.layout.channels
        width, columns = row_width(ns, nu, ch), self.signals.columns
        intake = Intake(
            np.zeros((n, WARM_ROWS, columns + 1)), np.zeros((n, 4), dtype=np.int64), np.zeros((n, 2)),
            np.full((n, columns), np.nan), np.zeros((n, columns)), np.zeros((n, 6, nu)), np.zeros((n, 2, ch)),
            np.zeros((n, ch)),
        )  # fmt: skip
        window = Window(
            np.zeros((n, GROUPS, BLOCKS_A_GROUP * BLOCK_ROWS, width)), np.zeros((n, GROUPS), dtype=np.int64),
            np.zeros((n, 3), dtype=np.int64), np.zeros((n, 2 + ch + nu)),
        )  # fmt: skip
        return FilterState(
            intake, window, self._filters(n), np.full((n, 4), np.nan), np.zeros((n, 2), dtype=np.int64)
        )

    def _filters(self, n: int) -> Filters:
        size = self.layout.size + self.layout.channels
        k = self.layout.theta.stop
        heads, sums = self._memory(n, 2)
        mean = np.tile(self._fixed.mean, (n, 2, 1))
        arrival = np.tile(np.diag(self._fixed.priors.std**-2.0), (n, 2, 1, 1))
        shape = (n, 2)
        channels, nu = self.layout.channels, self.signals.inputs
        left = Evidence(
            np.zeros((*shape, k, k)), np.zeros((*shape, k, k)), np.zeros((*shape, k)), np.zeros((*shape, k, size)),
            np.zeros((*shape, LAGS, channels, channels)), np.zeros((*shape, LAGS, channels, channels)),
            np.zeros((*shape, size, size)), np.zeros((*shape, size, size)),
            np.zeros((*shape, 1)), np.zeros((*shape, size, size)),
        )  # fmt: skip
        return Filters(
            self._lanes((n, 2)), heads, sums, mean.copy(), mean, arrival, mean.copy(), np.zeros((n, 2, 1)), left,
            np.zeros((*shape, nu, 1)), np.zeros((*shape, nu, size)), np.zeros((*shape, nu, size, size)),
            np.zeros((n, 2, 6)),
        )  # fmt: skip

    def _states(self) -> int:
        """Of one lane."""
        lag = 2 if self._fixed.setup.vane_ahead_m > 0.0 else 0
        return 2 * self.signals.states + 3 + lag + self.layout.disturbances

    def _lanes(self, shape: tuple[int, ...]) -> Lanes:
        ns, ch, n, width = self.signals.states, self.layout.channels, self._states(), 1 + self.layout.size
        m = ns + self.signals.inputs
        return Lanes(
            np.zeros((*shape, n, n, width)), np.zeros((*shape, n, n, width)), np.zeros((*shape, ns, ns, width)),
            np.zeros((*shape, ns, ns, width)), np.zeros((*shape, ch, n, width)), np.zeros((*shape, ch, width)),
            np.zeros((*shape, ns, m, width)), np.zeros((*shape, n, n, width)),
            np.zeros((*shape, n), dtype=np.int64), np.zeros((*shape, n, n), dtype=np.int64),
            np.zeros((*shape, m - ns, ns, ns)), np.zeros((*shape, m - ns, ch)), np.ones((*shape, 1 + ns)),
        )  # fmt: skip

    def _memory(self, vehicles: int, filters: int) -> tuple[Head, Sums]:
        """Heads and sums of a window's groups."""
        ns, ch, n, width = self.signals.states, self.layout.channels, self._states(), 1 + self.layout.size
        k, size = self.layout.theta.stop, self.layout.size + ch
        shape = (vehicles, filters, GROUPS + 1)
        heads = Head(
            np.zeros((*shape, n, width)), np.zeros((*shape, n, n, width)), np.zeros((*shape, ch, n, width)),
            np.ones((*shape, ch, width)), np.zeros((*shape, n, ch + k)), np.zeros((*shape, ns, 1 + k)),
            np.zeros((*shape, LAGS, ch)), np.zeros((*shape, row_width(ns, self.signals.inputs, ch))),
            np.zeros((*shape, 4), dtype=np.int64),
        )  # fmt: skip
        shape = (vehicles, filters, GROUPS)
        sums = Sums(
            np.zeros((*shape, 1)), np.zeros((*shape, size)), np.zeros((*shape, size, size)), np.zeros((*shape, k, k)),
            np.zeros((*shape, k)), np.zeros((*shape, k, size)), np.zeros((*shape, LAGS, ch, ch)),
            np.zeros((*shape, LAGS, ch, ch)), np.zeros((*shape, 2 + self.signals.inputs)),
        )  # fmt: skip
        return heads, sums

    def update(self, state: FilterState, signals: Array) -> None:
        """Take in samples: shape (vehicles, samples, columns) from ``Signals``; incomplete rows are passed over.

        Raises:
            ValueError: signals of another structure; a record in whose first two seconds no vane measured the velocity.
        """
        for i, rows in enumerate(self.signals.checked(signals)):
            _update_one(self._fixed, state, i, rows)
        if state.status[:, 1].any():
            vehicles = ", ".join(str(i) for i in np.flatnonzero(state.status[:, 1]))
            state.status[:, 1] = 0
            raise ValueError(
                f"no vane measured the velocity of vehicle {vehicles}: the filter has nothing that tells gusts from "
                "motion; use the Fourier estimator"
            )

    def solve(self, state: FilterState) -> None:
        """Move the points of linearisation where the data of the last seconds ask for it."""
        heads, sums = self._memory(1, 1)
        trial = Trial(Head(*(a[0, 0] for a in heads)), Sums(*(a[0, 0] for a in sums)), self._lanes(()))
        for i in range(state.status.shape[0]):
            solve_vehicle(self._fixed.setup, self._fixed.priors, state.filters, state.window, i, trial)

    def estimate(self, state: FilterState, vehicle: int = 0) -> Estimate:
        """Concise derivatives of one vehicle as of the last sample, at its present flight condition."""
        c, at = self.config, self.layout.theta
        airspeed, altitude, density, alpha = state.condition[vehicle]
        time_s = float(state.intake.clock[vehicle, 1])
        scale = referred_scale(c.structure, airspeed, density, c.reference)
        h, value, covariance, guards = self.judged(state, vehicle)
        error = np.sqrt(np.diagonal(covariance)[at])
        # what is known beforehand stays known, whatever the data
        factors = np.minimum(guards.factors, np.maximum(c.prior_ratio / error, 1.0))
        factors = factors * c.natural * scale
        begun = bool(state.status[vehicle, 0])
        estimate = standing(
            self.name, c.structure, time_s if begun else float("nan"),
            ConcisePosterior(
                value[at] * c.natural * scale + offsets(c.structure, airspeed, alpha),
                covariance[at, at] * np.outer(factors, factors), 3.0 * c.natural * scale, c.prior_ratio,
            ),
            np.full(at.stop, -np.inf), np.inf, begun, np.array([airspeed, altitude, density, alpha]),
        )  # fmt: skip
        if state.filters.search[vehicle, h, 1] > _NOT_AT_REST:
            return unsettled(estimate, "the search for the most likely derivatives has not come to rest")
        if guards.driven > _CONTRADICTED:
            return unsettled(estimate, "what the surfaces did contradicts what rough air and the rest say")
        if h == 1 and self.layout.rolling_air:
            first = len(c.structure.regressors)
            return unsettled(estimate, "moments of rolling air are not modelled well enough", first)
        return estimate

    def judged(self, state: FilterState, vehicle: int) -> tuple[int, Array, Array, Guards]:
        """Which filter counts (0 still air, 1 gusts), its parameters (size,), their covariance (size, size), and what
        the guards say."""
        f, w = state.filters, state.window
        h = int(gained(f, w, vehicle) > _GATE)
        value, covariance = current(One(f, w, vehicle, h))
        return h, value, covariance, online_guards(self._account(state, vehicle, h, value, covariance))

    def _account(self, state: FilterState, i: int, h: int, value: Array, covariance: Array) -> Account:
        f, groups = state.filters, state.window.tally[i, 0]
        point, sums = f.point[i, h], Sums(*(array[i, h, :groups] for array in f.sums))
        left = Evidence(*(array[i, h] for array in f.left))
        whole = groups - int(state.window.tally[i, 1] < BLOCKS_A_GROUP) if groups else 0
        echo = sums.samples[:whole, 2:] @ f.echo_score[i, h]
        scores = sums.score[:whole] + echo - sums.information[:whole] @ (value - point)
        driven = sums.driven.sum(axis=0)
        return Account(
            left.driven + driven,
            left.driven_square + driven,
            left.driven_vector + (sums.driven_score + sums.cross @ point).sum(axis=0),
            left.cross + sums.cross.sum(axis=0),
            left.products + sums.products.sum(axis=0),
            left.squares + sums.squares.sum(axis=0),
            left.scatter + scores.T @ scores,
            left.information + sums.information[:whole].sum(axis=0),
            float(left.groups[0]) + whole,
            value, covariance, f.prior[i, h], self._fixed.priors.std,
        )  # fmt: skip


def _set_priors(fixed: Fixed, state: FilterState, i: int) -> None:
    """Means that depend on airspeed and on what the first two seconds show."""
    setup, airspeed = fixed.setup, float(state.window.condition[i, 1])
    noise = setup.states * (setup.states + setup.inputs)
    gust = noise + setup.channels
    span = gust + 1 + setup.states
    for h in range(2):
        mean = state.filters.prior[i, h]
        mean[noise:gust] = np.log(state.intake.noise[i])
        mean[gust] = math.log(0.02 * airspeed) if h == 1 else _NO_GUST
        mean[span] = math.log(fixed.span_m[0] / airspeed)
        mean[span + 1] = math.log(_GUST_SCALE_M / airspeed)
        if setup.rolling:
            intensity = 1.9 * 0.02 * airspeed / math.sqrt(_GUST_SCALE_M * fixed.span_m[2])
            mean[span + 3 + setup.moments] = math.log(intensity)
        state.filters.point[i, h] = mean
        state.filters.centre[i, h] = mean
    state.status[i, 0] = 1


def _begin_record(fixed: Fixed, state: FilterState, i: int) -> None:
    """A record begins with the rows that wait; they are put on its clock."""
    intake, condition, ch = state.intake, state.window.condition[i], fixed.setup.channels
    if not begins(fixed.columns, intake, i):
        state.status[i, 1] = 1
    condition[0] = intake.clock[i, 0]
    condition[1] = max(intake.origin[i, fixed.columns.kinematic + 2], 1.0)
    condition[2 : 2 + ch] = 1e-300
    condition[2 + ch :] = fixed.columns.input_variance
    if state.status[i, 0] == 0:
        _set_priors(fixed, state, i)
    begin(fixed.setup, state.filters, state.window, i)
    regrid(fixed.columns, intake, i)
    _work(fixed, state, i)


_FLOOR = 1e-5
"""Noise below this part of a channel's own spread is not believed: models are no better."""


def _work(fixed: Fixed, state: FilterState, i: int) -> None:
    """Take in the half seconds that wait."""
    intake, ch = state.intake, fixed.setup.channels
    taken = block_rows(intake.clock[i, 0])
    while intake.tally[i, 0] >= taken:
        rows = np.zeros((taken, state.window.rows.shape[3]))
        to_rows(fixed.columns, intake, i, taken, rows)
        add_block(fixed.setup, fixed.priors, state.filters, state.window, i, rows)
        variance = intake.spread[i, 0] / np.maximum(intake.spread[i, 1], 1.0)
        state.window.condition[i, 2 : 2 + ch] = np.maximum(_FLOOR**2 * variance, 1e-300)


def _update_one(fixed: Fixed, state: FilterState, i: int, rows: Array) -> None:
    """Rows of one vehicle, (samples, columns)."""
    at = 0
    while at < len(rows):
        event, at = take_rows(fixed.columns, state.intake, state.condition, i, rows, at)
        if event == LOST:
            absorb_all(fixed.setup, fixed.priors, state.filters, state.window, i)
            state.intake.tally[i, :2] = 0
        elif event == RECORD:
            _begin_record(fixed, state, i)
        elif event == BLOCK:
            _work(fixed, state, i)
