/* The envelope: cells that the vehicle's flights taught, by airspeed and altitude, and where it flies now. */

import { drawn, make } from "../dom.js";
import { duration, fixed } from "../format.js";
import { tableHead } from "../parts.js";

const WIDTH = 400, HEIGHT = 250, LEFT = 46, BOTTOM = 40, TOP = 12, RIGHT = 12;
const DAY_S = 86400, FADED = 0.25;  // how much of its colour an old cell keeps

/** Round steps, about so many of them, over a range. */
function ticks(from, to, about) {
  const raw = (to - from) / about, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((one) => one >= raw);
  const found = [];
  for (let at = Math.ceil(from / step) * step; at <= to + 1e-9; at += step) found.push(at);
  return found;
}

/** Cells of all structures that share their edges, as one. */
function together(cells) {
  const found = new Map();
  for (const one of cells) {
    const key = [...one.airspeed_true_m_s, ...one.altitude_m].join();
    const known = found.get(key);
    if (known) {
      known.seconds = Math.max(known.seconds, one.seconds);
      known.age_s = Math.min(known.age_s, one.age_s);
    } else found.set(key, { ...one });
  }
  return [...found.values()];
}

/** The range of the axes: all cells and the point, with a margin. */
function range(values, least) {
  let [from, to] = [Math.min(...values), Math.max(...values)];
  const margin = Math.max(0.08 * (to - from), least);
  from = Math.max(0, from - margin);
  return [from, to + margin];
}

function picture(cells, here) {
  const [x0, x1] = range([...cells.flatMap((one) => one.airspeed_true_m_s), here.airspeed_true_m_s], 3);
  const [y0, y1] = range([...cells.flatMap((one) => one.altitude_m), here.altitude_m], 300);
  const across = (speed) => LEFT + ((speed - x0) / (x1 - x0)) * (WIDTH - LEFT - RIGHT);
  const up = (height) => HEIGHT - BOTTOM - ((height - y0) / (y1 - y0)) * (HEIGHT - BOTTOM - TOP);
  const svg = drawn("svg", { class: "envelope", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img",
    "aria-label": "Cells of the envelope by airspeed and altitude; the table below has the same" });
  for (const speed of ticks(x0, x1, 5)) {
    svg.append(drawn("line", { class: "grid", x1: across(speed), x2: across(speed), y1: TOP, y2: HEIGHT - BOTTOM }),
      drawn("text", { class: "across", x: across(speed), y: HEIGHT - BOTTOM + 16 }, fixed(speed, 0)));
  }
  for (const height of ticks(y0, y1, 5)) {
    svg.append(drawn("line", { class: "grid", x1: LEFT, x2: WIDTH - RIGHT, y1: up(height), y2: up(height) }),
      drawn("text", { class: "up", x: LEFT - 7, y: up(height) + 4 }, fixed(height, 0)));
  }
  for (const one of cells) {
    const [low, high] = one.airspeed_true_m_s, [below, above] = one.altitude_m;
    const fresh = FADED + (1 - FADED) / (1 + one.age_s / DAY_S);
    svg.append(drawn("rect", { class: "cell", x: across(low), y: up(above), width: across(high) - across(low), height: up(below) - up(above),
      "fill-opacity": (0.5 * fresh).toFixed(2) }),
    drawn("text", { class: "in", x: across(low) + 6, y: up(above) + 16 }, duration(one.seconds)),
    drawn("text", { class: "in age", x: across(low) + 6, y: up(above) + 30 }, `${duration(one.age_s)} old`));
  }
  svg.append(drawn("text", { class: "across", x: (LEFT + WIDTH - RIGHT) / 2, y: HEIGHT - 6 }, "true airspeed, m/s"),
    drawn("text", { class: "up title", x: LEFT - 7, y: TOP + 2 }, "m"),
    drawn("circle", { class: "here-ring", cx: across(here.airspeed_true_m_s), cy: up(here.altitude_m), r: 9 }),
    drawn("circle", { class: "here", cx: across(here.airspeed_true_m_s), cy: up(here.altitude_m), r: 4 }));
  return svg;
}

function table(cells) {
  const sorted = [...cells].sort((a, b) => a.age_s - b.age_s);
  return make("details", "", make("summary", "", `${cells.length === 1 ? "1 cell" : `${cells.length} cells`} as a table`),
    make("table", "", make("caption", "hidden", "Cells of the envelope"), tableHead(["Airspeed, m/s", "Altitude, m", "Flight in it", "Age"]),
      make("tbody", "", ...sorted.map((one) => make("tr", "",
        make("th", "number", { scope: "row" }, one.airspeed_true_m_s.map((edge) => fixed(edge, 1)).join(" to ")),
        make("td", "number", { data: { label: "altitude, m" } }, one.altitude_m.map((edge) => fixed(edge, 0)).join(" to ")),
        make("td", "number", { data: { label: "flight in it" } }, duration(one.seconds)),
        make("td", "number", { data: { label: "age" } }, duration(one.age_s)))))));
}

/** The envelope with the cells of the baseline and the vehicle's condition. */
export function envelope(cells, condition) {
  const { airspeed_true_m_s: speed, altitude_m: height } = condition;
  if (speed == null || height == null) return make("p", "soft", "The flight condition is not known yet.");
  const known = together(cells);
  const text = known.length ? `Its flights taught ${known.length} ${known.length === 1 ? "cell" : "cells"}; the dot is where it flies now, ${fixed(speed, 1)} m/s at ${fixed(height, 0)} m.`
    : `The baseline knows no cell of this vehicle's flights yet; the dot is where it flies now, ${fixed(speed, 1)} m/s at ${fixed(height, 0)} m.`;
  return make("div", "", make("p", "soft", text), picture(known, condition), ...(known.length ? [table(known)] : []));
}
