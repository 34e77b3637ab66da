"""Cases for the diagnosis: flights whose aircraft differs from its file by an effect that is known.

    case = draw("simulation", seed=3)                    # one hidden effect
    case = draw("simulation", seed=3, effects="none")    # the same flight without one
    case = FIXED["gyro-delay"]()                         # a named one

The instrument shares no code with a finder below the flight table and the aircraft file. A hidden effect is one that
can be seen: flown alone in still air without noise it changes some channel by at least ``LEAST_SIGNAL`` times its
noise.
"""

from collections.abc import Callable, Mapping
from typing import Literal

from diagnosis_fixed import FIXED
from diagnosis_from_jsbsim import draw_jsbsim
from diagnosis_from_plants import draw_plant
from diagnosis_from_simulation import draw_simulation
from diagnosis_hidden import Case, Hidden

__all__ = ["FIXED", "SOURCES", "Case", "Effects", "Hidden", "Source", "draw"]

Source = Literal["jsbsim", "simulation", "plant"]
Effects = Literal["one", "none", "two"]
_DRAW: Mapping[Source, Callable[[int, int], Case]] = {
    "jsbsim": draw_jsbsim, "simulation": draw_simulation, "plant": draw_plant,
}  # fmt: skip
SOURCES: tuple[Source, ...] = tuple(_DRAW)
COUNT: Mapping[Effects, int] = {"none": 0, "one": 1, "two": 2}


def draw(source: Source, seed: int, effects: Effects = "one") -> Case:
    """One case by its seed.

    Args:
        source: who flies it.
        seed: the same seed gives the same case.
        effects: how many are hidden. What is flown goes by the seed alone.

    Raises:
        ValueError: a source that there is not.
        RuntimeError: none of many draws could be flown and seen.
    """
    if source not in _DRAW:
        raise ValueError(f"there is no source {source!r}; give one of {', '.join(SOURCES)}")
    return _DRAW[source](seed, COUNT[effects])
