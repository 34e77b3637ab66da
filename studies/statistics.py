"""Statistics of studies: every figure with its interval. Pure functions of arrays.

Intervals are two-sided at 95 % where nothing else is said. References: Wilson (1927) for proportions; Garwood (1936)
for Poisson rates; Firth (1993) and Fieller (1954) for the detection curve; Kaplan and Meier (1958) for delays that not
every flight has; Lorden (1971) and Moustakides (2004) for the quickest detection there is. Derivations:
``docs/methods/study_statistics.md``.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import expit, gammainccinv, gammaincinv, logit
from scipy.stats import chi2, norm

__all__ = [
    "DetectionCurve",
    "Interval",
    "RankedRates",
    "clustered_proportion",
    "clustered_ratio",
    "exceedance_rates",
    "fit_detection",
    "noticed_fraction",
    "poisson_rate",
    "quickest_delay_s",
    "time_to_notice",
    "wilson",
]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_MOST_STEPS = 60
_FEWEST_FLIGHTS = 8


@dataclass(frozen=True, slots=True)
class Interval:
    """A figure with the limits of its confidence interval; NaN where it is not known, inf where it has no limit."""

    value: float
    low: float
    high: float


UNKNOWN = Interval(math.nan, math.nan, math.nan)


def wilson(successes: float, trials: float, confidence: float = 0.95) -> Interval:
    """A proportion with Wilson's score interval; unknown without a trial."""
    if trials <= 0:
        return UNKNOWN
    z = float(norm.ppf(0.5 + 0.5 * confidence))
    p, w = successes / trials, z**2 / trials
    centre = (p + 0.5 * w) / (1.0 + w)
    half = z / (1.0 + w) * math.sqrt(p * (1.0 - p) / trials + 0.25 * w / trials)
    return Interval(p, min(max(0.0, centre - half), p), max(min(1.0, centre + half), p))


def poisson_rate(events: float, exposure: float, confidence: float = 0.95) -> Interval:
    """Events per exposure with Garwood's exact interval; unknown without exposure."""
    if exposure <= 0.0:
        return UNKNOWN
    tail = 0.5 * (1.0 - confidence)
    low = float(gammaincinv(events, tail)) if events > 0 else 0.0
    return Interval(events / exposure, low / exposure, float(gammainccinv(events + 1.0, tail)) / exposure)


@dataclass(frozen=True, slots=True)
class DetectionCurve:
    """Probability of detection against size: ``logit P = intercept + slope log(size)`` (hit-or-miss data of
    MIL-HDBK-1823A).

    Attributes:
        covariance: of intercept and slope, (2, 2).
        smallest, largest: size that was flown; the curve is not known beyond.
        fit_probability: of a Pearson statistic as large as that of the binned flights, were the curve true.
    """

    intercept: float
    slope: float
    covariance: Array
    smallest: float
    largest: float
    fit_probability: float

    def probability(self, sizes: ArrayLike) -> tuple[Array, Array, Array]:
        """Probability at sizes, and the lower and upper edge of its pointwise 95 % band."""
        x = np.log(np.asarray(sizes, dtype=np.float64))
        v = self.covariance
        middle = self.intercept + self.slope * x
        half = _Z * np.sqrt(np.maximum(v[0, 0] + 2.0 * x * v[0, 1] + x**2 * v[1, 1], 0.0))
        return _expit(middle), _expit(middle - half), _expit(middle + half)

    def size_at(self, probability: float) -> Interval:
        """The size that is detected with a probability; the limits are where the band's edges cross it (Fieller).

        Where the whole band lies above the probability, it is the smallest size flown or less. A curve that does not
        rise beyond doubt has no limits: 0 and inf.
        """
        if self.probability([self.smallest, self.largest])[1].min() >= probability:
            return Interval(self.smallest, 0.0, self.smallest)
        if self.slope <= 0.0:
            return Interval(math.inf, 0.0, math.inf)
        v, level = self.covariance, float(logit(probability))
        a = self.slope**2 - _Z**2 * v[1, 1]
        b = self.slope * (self.intercept - level) - _Z**2 * v[0, 1]
        c = (self.intercept - level) ** 2 - _Z**2 * v[0, 0]
        value = _exp((level - self.intercept) / self.slope)
        if a <= 0.0:
            return Interval(value, 0.0, math.inf)
        half = math.sqrt(max(b**2 - a * c, 0.0))
        return Interval(value, _exp((-b - half) / a), _exp((-b + half) / a))


_Z = float(norm.ppf(0.975))


def _exp(x: float) -> float:
    return math.exp(x) if x < 700.0 else math.inf


def _expit(x: Array) -> Array:
    return np.asarray(expit(x), dtype=np.float64)


def fit_detection(sizes: ArrayLike, detected: ArrayLike) -> DetectionCurve | None:
    """Logistic regression on the logarithm of size, with Firth's correction, so that it exists for separated data too.

    None where the flights are too few or of one size.
    """
    s, y = np.asarray(sizes, dtype=np.float64), np.asarray(detected, dtype=np.float64)
    used = np.isfinite(s) & (s > 0.0)
    s, y = s[used], y[used]
    if s.size < _FEWEST_FLIGHTS or np.ptp(s) <= 1e-9 * s.max():
        return None
    x = np.log(s)
    centre, scale = float(x.mean()), float(x.std())
    beta, covariance = _firth(np.column_stack([np.ones(s.size), (x - centre) / scale]), y)
    back = np.array([[1.0, -centre / scale], [0.0, 1.0 / scale]])
    intercept, slope = back @ beta
    curve = DetectionCurve(
        float(intercept), float(slope), back @ covariance @ back.T, float(s.min()), float(s.max()), math.nan
    )
    return DetectionCurve(
        curve.intercept,
        curve.slope,
        curve.covariance,
        curve.smallest,
        curve.largest,
        _fit_probability(curve, s, y),
    )


def _firth(x: Array, y: Array) -> tuple[Array, Array]:
    """Coefficients and covariance that maximise the likelihood times Jeffreys' prior."""

    def penalised(beta: Array) -> float:
        eta = x @ beta
        p = _expit(eta)
        information = x.T @ (x * (p * (1.0 - p))[:, None])
        return float(y @ eta - np.logaddexp(0.0, eta).sum() + 0.5 * np.linalg.slogdet(information)[1])

    beta: Array = np.zeros(2)
    value = penalised(beta)
    for _ in range(_MOST_STEPS):
        p = _expit(x @ beta)
        w = p * (1.0 - p)
        covariance = np.linalg.inv(x.T @ (x * w[:, None]))
        leverage = w * np.einsum("ij,jk,ik->i", x, covariance, x)
        step = covariance @ (x.T @ (y - p + leverage * (0.5 - p)))
        step *= min(1.0, 3.0 / max(float(np.abs(step).max()), 1e-300))
        while (new := penalised(beta + step)) < value - 1e-12 * abs(value) and np.abs(step).max() > 1e-9:
            step = 0.5 * step
        beta, value = beta + step, new
        if np.abs(step).max() < 1e-8:
            break
    p = _expit(x @ beta)
    return beta, np.asarray(np.linalg.inv(x.T @ (x * (p * (1.0 - p))[:, None])), dtype=np.float64)


def _fit_probability(curve: DetectionCurve, s: Array, y: Array) -> float:
    """Pearson's test in up to ten classes of equally many flights; NaN where there are too few for one."""
    classes = min(10, s.size // 20)
    if classes < 4:
        return math.nan
    statistic, used = 0.0, 0
    p, _, _ = curve.probability(s)
    for rows in np.array_split(np.argsort(s, kind="stable"), classes):
        variance = float((p[rows] * (1.0 - p[rows])).sum())
        if variance > 0.5:
            statistic += float((y[rows] - p[rows]).sum()) ** 2 / variance
            used += 1
    return float(chi2.sf(statistic, used - 2)) if used > 2 else math.nan


def noticed_fraction(delays: ArrayLike, watched: ArrayLike) -> tuple[Array, Array, Array, Array]:
    """Fraction noticed over the time since onset (Kaplan-Meier), where a flight's end may come before its alert.

    Args:
        delays: of each flight, NaN where nothing was said.
        watched: how long each flight was watched after its onset.

    Returns:
        times, fraction, and its lower and upper limits (log-log, Greenwood); times are those of alerts.
    """
    d, end = np.asarray(delays, dtype=np.float64), np.asarray(watched, dtype=np.float64)
    seen = np.isfinite(d)
    last = np.where(seen, np.where(seen, d, 0.0), end)
    found, counts = np.unique(last[seen], return_counts=True)
    times: Array = found.astype(np.float64)
    if not times.size:
        return times, times, times, times
    at_risk = last.size - np.searchsorted(np.sort(last), times, side="left")
    with np.errstate(divide="ignore", invalid="ignore"):
        left: Array = np.cumprod(1.0 - counts / at_risk, dtype=np.float64)
        greenwood = np.cumsum(counts / (at_risk * (at_risk - counts)))
        half = _Z * np.sqrt(greenwood) / np.abs(np.log(left))
        high: Array = 1.0 - left ** np.exp(half)
        low: Array = 1.0 - left ** np.exp(-half)
    certain = left <= 0.0
    low[certain] = low[~certain][-1] if (~certain).any() else 0.0
    high[certain] = 1.0
    return times, 1.0 - left, low, high


def time_to_notice(delays: ArrayLike, watched: ArrayLike, fraction: float) -> Interval:
    """The time by which a fraction is noticed; inf where the flights did not last to it."""
    times, middle, low, high = noticed_fraction(delays, watched)

    def first(curve: Array) -> float:
        reached = np.flatnonzero(curve >= fraction - 1e-12)
        return float(times[reached[0]]) if reached.size else math.inf

    return Interval(first(middle), first(high), first(low))


def quickest_delay_s(mean_time_between_false_alarms_s: float, information_rate_per_s: ArrayLike) -> Array:
    """Lorden's bound: the smallest mean delay (worst case) of any test with that mean time between false alarms.

    For information that arrives evenly the cumulative-sum test attains it: with the threshold h that solves
    ``exp(h) - h - 1 = rate * time``, the delay is ``(exp(-h) + h - 1) / rate``, which tends to
    ``log(rate * time) / rate``. inf where no information arrives.
    """
    rate = np.asarray(information_rate_per_s, dtype=np.float64)
    some = rate > 0.0
    wanted = np.where(some, rate, 1.0) * mean_time_between_false_alarms_s
    h = np.where(wanted > 1.0, np.log1p(wanted) + 0.5, np.sqrt(2.0 * wanted))
    for _ in range(_MOST_STEPS):
        h = h - (np.expm1(h) - h - wanted) / np.maximum(np.expm1(h), 1e-300)
    return np.where(
        some, (np.expm1(-h) + h) / np.where(some, rate, 1.0), np.where(np.isnan(rate), np.nan, np.inf)
    )


@dataclass(frozen=True, slots=True)
class RankedRates:
    """How often healthy time exceeds each of several thresholds: rate per hour with its interval, (n,) each."""

    threshold: Array
    rate: Array
    low: Array
    high: Array


def exceedance_rates(
    peaks: ArrayLike, hours: ArrayLike, thresholds: ArrayLike, confidence: float = 0.95
) -> RankedRates:
    """Rate at which evidence passes each threshold in healthy time, from each flight's largest evidence.

    Passages are taken as a Poisson process: a flight of h hours has one with probability ``1 - exp(-rate h)``. The
    rate is that of largest likelihood; its interval is Garwood's for the number of flights, scaled to it.
    """
    peak, h = np.asarray(peaks, dtype=np.float64), np.asarray(hours, dtype=np.float64)
    used = np.isfinite(peak) & (h > 0.0)
    order = np.argsort(-peak[used], kind="stable")
    ranked, h = -peak[used][order], h[used][order]
    total, counted = (
        float(h.sum()),
        np.searchsorted(ranked, -np.asarray(thresholds, dtype=np.float64), side="right"),
    )
    found = {int(k): _passage_rate(h, int(k), total, confidence) for k in np.unique(counted)}
    rows = np.array([found[int(k)] for k in counted]).reshape(-1, 3)
    return RankedRates(np.asarray(thresholds, dtype=np.float64), rows[:, 0], rows[:, 1], rows[:, 2])


def _passage_rate(hours: Array, passed: int, total: float, confidence: float) -> tuple[float, float, float]:
    """Rate and limits where the first ``passed`` of the flights had at least one passage."""
    plain = poisson_rate(passed, total, confidence)
    if passed in (0, hours.size):
        return (plain.value, plain.low, plain.high) if passed == 0 else (math.inf, plain.low, math.inf)
    with_one, without = hours[:passed], total - float(hours[:passed].sum())
    if without <= 0.0:
        return math.inf, plain.low, math.inf
    low, high = math.log(plain.value), math.log(passed / without)
    for _ in range(_MOST_STEPS):
        middle = 0.5 * (low + high)
        rate = math.exp(middle)
        gain = float((with_one / np.expm1(np.maximum(rate * with_one, 1e-300))).sum())
        low, high = (middle, high) if gain > without else (low, middle)
        if high - low < 1e-9:
            break
    rate = math.exp(0.5 * (low + high))
    return rate, plain.low * rate / plain.value, plain.high * rate / plain.value


def clustered_ratio(numerator: ArrayLike, denominator: ArrayLike) -> Interval:
    """Ratio of two sums over flights; rows of one flight belong together, so each flight is one term of both sums."""
    a, b = np.asarray(numerator, dtype=np.float64), np.asarray(denominator, dtype=np.float64)
    n = a.size
    if n == 0 or b.sum() <= 0.0:
        return UNKNOWN
    ratio = float(a.sum() / b.sum())
    if n < 2 or ratio <= 0.0:
        return Interval(ratio, math.nan, math.nan)
    error = math.sqrt(n / (n - 1.0) * float(((a - ratio * b) ** 2).sum())) / float(b.sum())
    spread = math.exp(_Z * error / ratio)
    return Interval(ratio, ratio / spread, ratio * spread)


def clustered_proportion(successes: ArrayLike, trials: ArrayLike) -> Interval:
    """A proportion of trials that belong together by flight; unknown without a trial.

    Wilson's interval for as many independent trials as would have the variance that the flights show (design effect,
    Kish 1965), at most all. No success, or nothing but successes, shows no dependence, so all trials count.
    """
    a, b = np.asarray(successes, dtype=np.float64), np.asarray(trials, dtype=np.float64)
    n, total = a.size, float(b.sum())
    if total <= 0.0:
        return UNKNOWN
    p = float(a.sum()) / total
    plain = p * (1.0 - p) / total
    effect = 1.0
    if n > 1 and plain > 0.0:
        effect = max(1.0, n / (n - 1.0) * float(((a - p * b) ** 2).sum()) / total**2 / plain)
    return wilson(p * total / effect, total / effect)
