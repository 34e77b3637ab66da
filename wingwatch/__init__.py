"""wingwatch: online aircraft derivatives, compared with what is expected, and the alert when they change.

The names a script needs, imported from the package that owns them:

========================================  ==========================================================
``wingwatch.aircraft``                    derivative vocabulary, mode structures, flight condition,
                                          conventions, the aircraft file and its library
``wingwatch.telemetry``                   the sample, channel maps, readers, cleaning, messages, Zenoh
``wingwatch.estimators``                  recursive Fourier least squares and the extended Kalman filter
``wingwatch.baselines``                   expectation with standard error at a flight condition
``wingwatch.monitor``                     findings, causes, alerts and the live loop
``wingwatch.simulation``                  flights whose truth is known
========================================  ==========================================================
"""

__version__ = "0.1.0"
