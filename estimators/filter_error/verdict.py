"""When nothing may be called converged, whatever the errors say."""

from dataclasses import replace

from wingwatch.estimators.estimate import Estimate, Outcome

__all__ = ["unsettled"]


def unsettled(estimate: Estimate, reason: str, first: int = 0) -> Estimate:
    """The same, but none of the derivatives from ``first`` on converged; ``reason`` says why."""
    outcomes = tuple(
        Outcome.SETTLING if o is Outcome.CONVERGED and k >= first else o
        for k, o in enumerate(estimate.outcomes)
    )
    outcome = Outcome.SETTLING if estimate.outcome is Outcome.CONVERGED else estimate.outcome
    reasons = f"{reason}; {estimate.reason}" if estimate.reason else reason
    return replace(estimate, outcomes=outcomes, outcome=outcome, reason=reasons)
