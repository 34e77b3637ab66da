"""Estimates over time in pandas: a script with cell marks, which Jupyter, VS Code and Spyder open as a notebook.

First write the estimates of a flight:  wingwatch estimate flight.csv --aircraft aerosonde --history estimates.csv
Then:  python examples/estimates.py estimates.csv   (needs pandas)
A service gives such a table without what is expected:  /v1/vehicles/NAME/derivatives/history, "Accept: text/csv".
"""

# %% The table: one row for each instant, estimator and derivative
import sys

import pandas

SOURCE = sys.argv[1] if len(sys.argv) > 1 else "estimates.csv"
estimates = pandas.read_csv(SOURCE)
print(estimates.head())

# %% What counts at the end of the flight
last = estimates.groupby(["structure", "derivative", "estimator"]).tail(1)
converged = last[last["outcome"] == "converged"]
print(
    converged[["structure", "derivative", "estimator", "value", "standard_error", "unit"]].to_string(
        index=False
    )
)

# %% How far each estimator is from the expectation, in standard errors of both
if "expected" in converged:
    joint = (converged["standard_error"] ** 2 + converged["expected_standard_error"] ** 2) ** 0.5
    z = (converged["value"] - converged["expected"]) / joint
    print(z.groupby(converged["estimator"]).describe())

# %% One derivative over time, both estimators side by side
pitch_damping = estimates[estimates["derivative"] == "m_q"]
over_time = pitch_damping.pivot_table(index="time_s", columns="estimator", values=["value", "standard_error"])
print(over_time.tail())
