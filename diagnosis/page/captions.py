"""One sentence per picture that says what one sees in it."""

import numpy as np

from wingwatch.diagnosis.page.traces import excerpt_s
from wingwatch.diagnosis.result import Diagnosis, Gain
from wingwatch.diagnosis.summary import by_misfit, display, label_title
from wingwatch.pages.texts import listed, number

__all__ = ["gain_caption", "misfit_caption", "ranking_caption", "spectrum_caption", "trace_caption"]

_MOSTLY = 0.5


def trace_caption(diagnosis: Diagnosis) -> str:
    """Which line is which, and where they part most."""
    worst = by_misfit(diagnosis.misfit)[0]
    misfit = diagnosis.misfit[worst]
    mended = ", solid colour the extended model" if diagnosis.causes and diagnosis.traces.mended else ""
    shown = excerpt_s(diagnosis.traces, worst)
    where = (
        "" if shown is None else " Shown are the 20 s where they part most, the strip is the whole flight."
    )
    return (
        f"Dotted is the simulation as it stands{mended}; measured and simulated part most in {display(worst).name} "
        f"(R2 {number(misfit.r_squared)}, Theil {number(misfit.tic)}).{where}"
    )


def misfit_caption(diagnosis: Diagnosis) -> str:
    """Which channel is missed most, and in how many noise is the larger part."""
    misfits = diagnosis.misfit
    noisy = sum(m.noise_fraction >= _MOSTLY for m in misfits.values())
    return (
        f"From 0 (the same) to 1 (nothing in common), a bar as short as its diamond is as good as sensors "
        f"and gusts allow; {display(by_misfit(misfits)[0]).name} is "
        f"missed most, and in {noisy} of {len(misfits)} channels noise is the larger part of the residual."
    )


_CLEARLY = 2.0
"""Times the noise that a residual's power must be before a caption points at it."""


def spectrum_caption(diagnosis: Diagnosis) -> str:
    """In which channel and at which frequency the residual stands most above noise, and what the extension leaves."""
    traces, most, where = diagnosis.traces, 0.0, ("", 0)
    for channel, (before, _, noise) in traces.spectra.items():
        ratio = np.where(traces.residual_hz > 0.0, before / noise, np.nan)
        if np.isfinite(ratio).any() and (highest := float(np.nanmax(ratio))) > most:
            most, where = highest, (channel, int(np.nanargmax(ratio)))
    if most < _CLEARLY:
        return "Where a line stands above the noise of sensors and gusts, a term is missing; here none does clearly."
    channel, peak = where
    _, after, noise = traces.spectra[channel]
    left = (
        f" and {number(float(after[peak] / noise[peak]), 2)} times extended"
        if diagnosis.causes and np.isfinite(after[peak])
        else ""
    )
    return (
        f"Where a line stands above the noise of sensors and gusts, a term is missing: most in {display(channel).name} "
        f"at {number(float(traces.residual_hz[peak]), 2)} Hz, {number(most, 2)} times the noise as it stands{left}."
    )


def ranking_caption(diagnosis: Diagnosis) -> str:
    """Which cause gains most, and that gains are not to be added up."""
    best = label_title(diagnosis.ranking[0][0])
    return f"Alone, {best} explains most; gains overlap where causes look alike, so they do not add up."


def gain_caption(gain: Gain) -> str:
    """How many channels improve or get worse beyond doubt."""
    better = [c for c, i in gain.change.items() if i.high < 0.0]
    worse = [c for c, i in gain.change.items() if i.low > 0.0]
    bad = f", {listed(display(c).name for c in worse)} worse" if worse else ", none worse"
    return (
        f"Left of zero is better: {len(better)} of {len(gain.change)} channels are better beyond doubt "
        f"(the whole interval lies there){bad}."
    )
