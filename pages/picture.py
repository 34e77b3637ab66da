"""What a picture is: plotly's data and layout in the page's own frame.

A colour is written ``$name`` for the page's CSS variable ``--name``, so that light, dark and print each have their own;
``@name`` stands for an array that several traces share.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

__all__ = ["BOTTOM_PX", "TOP_PX", "Figure", "axis_layout", "plain_numbers"]

TOP_PX, BOTTOM_PX = 84, 52


@dataclass(frozen=True, slots=True)
class Figure:
    """One picture.

    Attributes:
        name: of its element in the page.
        title: stands in the picture.
        data, layout: as plotly has them.
        height_px: it keeps, whatever its width.
        shared: arrays that traces name as ``@key``.
    """

    name: str
    title: str
    data: list[dict[str, Any]]
    layout: dict[str, Any]
    height_px: int
    shared: Mapping[str, list[float | None]] = field(default_factory=dict)

    @property
    def content(self) -> dict[str, Any]:
        """For JSON."""
        title = {
            "text": self.title, "x": 0.0, "xref": "container", "xanchor": "left", "y": 1.0, "yref": "container",
            "yanchor": "top", "pad": {"t": 8, "l": 4}, "font": {"size": 15},
        }  # fmt: skip
        legend = {
            "orientation": "h", "x": 0.0, "xref": "container", "y": 1.0 - 32.0 / self.height_px, "yref": "container",
            "yanchor": "top", "bgcolor": "rgba(0,0,0,0)", "traceorder": "normal",
        }  # fmt: skip
        frame = {
            "title": title, "legend": legend, "height": self.height_px, "showlegend": True,
            "margin": {"t": TOP_PX, "b": BOTTOM_PX, "l": 62, "r": 16},
            "font": {"color": "$ink", "size": 12}, "paper_bgcolor": "rgba(0,0,0,0)", "plot_bgcolor": "rgba(0,0,0,0)",
            "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": "$quiet", "activecolor": "$ink"},
            "hoverlabel": {"bgcolor": "$card", "font": {"color": "$ink"}},
        }  # fmt: skip
        return {
            "name": self.name,
            "data": self.data,
            "layout": frame | self.layout,
            "shared": dict(self.shared),
        }


def axis_layout(title: str = "") -> dict[str, Any]:
    """An axis as all pictures have it."""
    axis: dict[str, Any] = {"gridcolor": "$line", "zeroline": False, "linecolor": "$soft", "automargin": True}
    return axis | {"title": {"text": title, "standoff": 8}} if title else axis


def plain_numbers(values: Iterable[float]) -> list[float | None]:
    """Five digits are more than a picture shows; what is not known is None."""
    return [float(f"{v:.5g}") if math.isfinite(v) else None for v in values]
