/* Small parts that several views show: tags, scales of z, lists of facts, heads of tables. */

import { drawn, make } from "./dom.js";
import { fixed } from "./format.js";

export const Z_BAND = 2;
const Z_RANGE = 8;

export const STATES = ["degraded", "not_observable", "stale", "unknown", "healthy"];

const SHAPES = {
  healthy: "M8 1.5a6.5 6.5 0 1 0 0 13 6.5 6.5 0 0 0 0-13zM4.8 8.2l2.2 2.2 4.2-4.6",
  degraded: "M8 2l6.5 11.5h-13zM8 6.5v3.5M8 11.7v.3",
  not_observable: "M1 8s2.5-4.5 7-4.5S15 8 15 8s-2.5 4.5-7 4.5S1 8 1 8zM2.5 13.5l11-11",
  stale: "M8 1.5a6.5 6.5 0 1 0 0 13 6.5 6.5 0 0 0 0-13zM8 4.5V8l2.5 2",
  unknown: "M8 1.5a6.5 6.5 0 1 0 0 13 6.5 6.5 0 0 0 0-13zM6 6.3a2 2 0 1 1 2.6 1.9c-.4.1-.6.4-.6.9M8 11.4v.2",
  cleared: "M3 8h10",
};

const LEVELS = ["critical", "warning", "watch"], LIFE = ["active", "acknowledged", "shelved", "cleared"];

/** The smaller the sooner somebody should look: what nobody has seen yet before the rest, then by level. */
export function urgency(alert) {
  return 10 * LIFE.indexOf(alert.state) + LEVELS.indexOf(alert.level);
}

/** A state's picture: its shape says what its colour says. */
export function shape(state) {
  const path = { d: SHAPES[state] ?? SHAPES.unknown, fill: "none", stroke: "currentColor", "stroke-width": 1.4,
    "stroke-linecap": "round", "stroke-linejoin": "round" };
  return drawn("svg", { viewBox: "0 0 16 16", "aria-hidden": "true" }, drawn("path", path));
}

/** A state or level as picture and word. */
export function tag(state, text, tone = state) {
  return make("span", "tag", { data: { tone } }, shape(state), text);
}

/** An alert's level and where it is in its life. */
export function alertTag(alert) {
  const cleared = alert.state === "cleared";
  const standing = alert.state === "active" ? alert.level : `${alert.level}, ${alert.state}`;
  return tag(cleared ? "cleared" : "degraded", standing, cleared ? "cleared" : alert.level);
}

/** A part of the aircraft, by its column of the flight table. */
export function channelTag(channel) {
  return make("code", "part", channel);
}

/** Where a z lies: the band where flight and expectation agree, and a mark; beyond the range the mark is a wedge. */
export function scale(z, labelled) {
  const width = labelled ? 320 : 180, middle = width / 2, y = labelled ? 12 : 8, unit = (middle - 12) / Z_RANGE;
  const svg = drawn("svg", { class: "scale", viewBox: `0 0 ${width} ${labelled ? 36 : 16}`, "aria-hidden": "true" });
  svg.append(drawn("rect", { class: "band", x: middle - Z_BAND * unit, y: y - 7, width: 2 * Z_BAND * unit, height: 14, rx: 2 }));
  svg.append(drawn("line", { class: "axis", x1: 8, x2: width - 8, y1: y, y2: y }));
  for (let tick = -Z_RANGE; tick <= Z_RANGE; tick += Z_BAND) {
    const x = middle + tick * unit;
    svg.append(drawn("line", { class: "axis", x1: x, x2: x, y1: y - (tick ? 3 : 7), y2: y + (tick ? 3 : 7) }));
    if (labelled && tick % 4 === 0) svg.append(drawn("text", { x, y: y + 21 }, fixed(tick, 0)));
  }
  if (z === null) return svg;
  const x = middle + Math.max(-Z_RANGE, Math.min(Z_RANGE, z)) * unit, out = Math.sign(z) * 9;
  const wedge = `M${x - out / 2} ${y - 7}L${x + out} ${y}L${x - out / 2} ${y + 7}z`;
  const mark = Math.abs(z) > Z_RANGE ? { d: wedge } : { d: `M${x} ${y - 7}l5 7-5 7-5-7z` };
  svg.append(drawn("path", { class: "mark", ...mark }));
  return svg;
}

/** Names and values; one without a value is left out. `figures` stand beside each other, `facts` below. */
export function facts(className, pairs) {
  const list = make("dl", className);
  for (const [name, value] of pairs) {
    if (value === null || value === "") continue;
    const nodes = [make("dt", "", name), make("dd", "", value)];
    if (className === "figures") list.append(make("div", "", ...nodes));
    else list.append(...nodes);
  }
  return list;
}

/** The head of a table: a title a column. */
export function tableHead(titles) {
  return make("thead", "", make("tr", "", ...titles.map((title) => make("th", "", { scope: "col" }, title))));
}
