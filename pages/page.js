"use strict";
// Draws the page's pictures in the colours of its style sheet, again whenever those change, and for paper.
(function () {
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const root = document.documentElement;
  const PAPER_PX = 690;

  // "$name" is a colour of the style sheet, "@name" an array that several lines share.
  function resolved(value, colour, shared) {
    if (typeof value === "string") {
      if (value[0] === "$") return colour(value.slice(1));
      if (value[0] === "@") return shared[value.slice(1)];
      return value;
    }
    if (Array.isArray(value)) {
      const nested = value.length <= 2 || (typeof value[0] === "object" && value[0] !== null); // not the long ones
      return nested ? value.map((v) => resolved(v, colour, shared)) : value;
    }
    if (value !== null && typeof value === "object") {
      return Object.fromEntries(Object.entries(value).map(([k, v]) => [k, resolved(v, colour, shared)]));
    }
    return value;
  }

  function draw(width) {
    const style = getComputedStyle(root);
    const colour = (name) => style.getPropertyValue("--" + name).trim();
    for (const figure of figures) {
      const place = document.getElementById(figure.name);
      const layout = resolved(figure.layout, colour, figure.shared);
      layout.font.family = style.fontFamily;
      if (width) layout.width = Math.min(width, place.closest(".grid") ? width / 2 - 12 : width);
      Plotly.react(place, resolved(figure.data, colour, figure.shared), layout, {
        responsive: true, displaylogo: false, scrollZoom: false,
        displayModeBar: matchMedia("(hover: hover) and (min-width: 42rem)").matches ? undefined : false,
        modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
      });
    }
  }

  draw();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => draw());
  addEventListener("beforeprint", () => { root.classList.add("paper"); draw(PAPER_PX); });
  addEventListener("afterprint", () => { root.classList.remove("paper"); draw(); });
})();
