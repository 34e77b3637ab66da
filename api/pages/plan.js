/* Where the aircraft are, seen from above: north up, no map. One path a state, so that 500 marks cost as little as five. */

import { drawn, make, setText } from "./dom.js";
import { number, vehicleName, words } from "./format.js";
import { STATES } from "./parts.js";

const METRES_A_DEGREE = 111195; // of latitude, on a sphere of 6371 km
const WIDTH = 340, HEIGHT = 260, MARGIN = 26, LEAST_M = 400, MOST_LABELS = 8, NEAR_PX = 18;
const LETTER = 7, LINE = 13; // of a label, about
const MARKS = {
  degraded: (x, y) => `M${x} ${y - 5}l5 9h-10z`,
  stale: (x, y) => `M${x - 3.5} ${y - 3.5}l7 7m0-7l-7 7`,
};
const dot = (x, y) => `M${x - 3.5} ${y}a3.5 3.5 0 1 0 7 0a3.5 3.5 0 1 0-7 0z`;

export class Plan {
  /** `opened(row)`: a mark was clicked. */
  constructor(opened) {
    this.paths = new Map(STATES.map((state) => [state, drawn("path", { class: "mark", "data-tone": state, "data-state": state })]));
    this.labels = drawn("g", { class: "labels" });
    this.bar = drawn("path", { class: "bar" });
    this.length = drawn("text", { x: MARGIN, y: HEIGHT - 17 });
    this.svg = drawn("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img" }, ...[...STATES].reverse().map((state) => this.paths.get(state)),
      this.labels, this.bar, this.length,
      drawn("path", { class: "bar", d: `M${WIDTH - 18} 34v-20m-4 6l4-7 4 7` }), drawn("text", { x: WIDTH - 18, y: 46, "text-anchor": "middle" }, "N"));
    this.hint = make("p", "soft plan-hint", "");
    this.node = make("figure", "plan card", { hidden: true }, make("figcaption", "soft", "Positions"), this.svg, this.hint);
    this.places = [];
    this.frame = null;
    this.svg.addEventListener("click", (event) => {
      const near = this.#nearest(event);
      if (near) opened(near.row);
    });
    this.svg.addEventListener("pointermove", (event) => {
      const near = this.#nearest(event);
      setText(this.hint, near ? `${vehicleName(near.row)}, ${words(near.row.state)}` : this.said ?? "");
      this.svg.classList.toggle("at-mark", Boolean(near));
    });
    this.svg.addEventListener("pointerleave", () => setText(this.hint, this.said ?? ""));
  }

  /** Show these rows; false where none says where it is. */
  set(rows) {
    const placed = rows.filter((row) => row.group === undefined && row.latitude_deg !== null);
    this.node.hidden = placed.length === 0;
    if (!placed.length) return false;
    this.frame = frameOf(placed, this.frame);
    const { east, north, scale } = this.frame;
    this.places = placed.map((row) => {
      const [x, y] = metres(row, this.frame);
      return { row, x: WIDTH / 2 + (x - east) * scale, y: HEIGHT / 2 - (y - north) * scale };
    });
    for (const [state, path] of this.paths) {
      const some = this.places.filter(({ row }) => row.state === state);
      path.setAttribute("d", some.map(({ x, y }) => (MARKS[state] ?? dot)(x.toFixed(1) * 1, y.toFixed(1) * 1)).join(""));
    }
    this.#label();
    this.#measure(rows.filter((row) => row.group === undefined).length);
    return true;
  }

  /** The names of those that are degraded, and of all where they are few. */
  #label() {
    const worst = this.places.filter(({ row }) => row.state === "degraded");
    const some = (this.places.length <= MOST_LABELS ? this.places : worst).slice(0, MOST_LABELS);
    const taken = [], fits = ({ row, x, y }) => {
      const wide = LETTER * row.vehicle.length, from = x < WIDTH * 0.7 ? x + 8 : x - 8 - wide;
      if (taken.some((other) => Math.abs(other.y - y) < LINE && from < other.from + other.wide && other.from < from + wide)) return false;
      taken.push({ from, wide, y });
      return true;
    };
    this.labels.replaceChildren(...some.filter(fits).map(({ row, x, y }) => {
      const right = x < WIDTH * 0.7;
      return drawn("text", { x: right ? x + 8 : x - 8, y: y + 4, "text-anchor": right ? "start" : "end" }, row.vehicle);
    }));
  }

  #measure(all) {
    const length = round125((WIDTH / 3) / this.frame.scale), wide = length * this.frame.scale;
    this.bar.setAttribute("d", `M${MARGIN} ${HEIGHT - 12}v5h${wide.toFixed(1)}v-5`);
    const text = length >= 1000 ? `${number(length / 1000)} km` : `${number(length)} m`;
    setText(this.length, text);
    const missing = all - this.places.length;
    this.said = `${this.places.length} aircraft${missing ? `; ${missing} do not say where they are` : ""}`;
    if (!this.svg.matches(":hover")) setText(this.hint, this.said);
    this.svg.setAttribute("aria-label", `Positions of ${this.places.length} aircraft, north up; the bar is ${text} long.`);
  }

  #nearest(event) {
    const box = this.svg.getBoundingClientRect(), unit = Math.max(WIDTH / box.width, HEIGHT / box.height);
    const x = WIDTH / 2 + (event.clientX - box.left - box.width / 2) * unit, y = HEIGHT / 2 + (event.clientY - box.top - box.height / 2) * unit;
    let best = null, least = NEAR_PX * unit;
    for (const place of this.places) {
      const distance = Math.hypot(place.x - x, place.y - y);
      if (distance < least) [best, least] = [place, distance];
    }
    return best;
  }
}

/** East and north of a row in metres from the frame's origin, on a plane that touches the sphere there. */
function metres(row, { latitude, longitude }) {
  const east = ((row.longitude_deg - longitude + 540) % 360) - 180;
  return [east * METRES_A_DEGREE * Math.cos((latitude * Math.PI) / 180), (row.latitude_deg - latitude) * METRES_A_DEGREE];
}

/** The frame that holds all marks. The one before stays while they fit in it and fill it by half: the plan must not shake. */
function frameOf(rows, before) {
  const origin = before ?? { latitude: rows[0].latitude_deg, longitude: rows[0].longitude_deg };
  const places = rows.map((row) => metres(row, origin));
  const [west, eastmost] = ends(places.map(([x]) => x)), [south, northmost] = ends(places.map(([, y]) => y));
  const wide = Math.max(eastmost - west, LEAST_M), tall = Math.max(northmost - south, LEAST_M);
  const fitting = Math.min((WIDTH - 2 * MARGIN) / wide, (HEIGHT - 2 * MARGIN) / tall);
  if (before) {
    const inside = Math.abs(west - before.east) * before.scale < WIDTH / 2 - 8 && Math.abs(eastmost - before.east) * before.scale < WIDTH / 2 - 8
      && Math.abs(south - before.north) * before.scale < HEIGHT / 2 - 8 && Math.abs(northmost - before.north) * before.scale < HEIGHT / 2 - 8;
    if (inside && fitting < 2 * before.scale) return before;
  }
  return { latitude: origin.latitude, longitude: origin.longitude, east: (west + eastmost) / 2, north: (south + northmost) / 2, scale: fitting / 1.15 };
}

function ends(values) {
  return [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))];
}

/** The largest of 1, 2, 5, 10, ... that is not above a length. */
function round125(length) {
  const ten = 10 ** Math.floor(Math.log10(length));
  return [5, 2, 1].map((step) => step * ten).find((step) => step <= length) ?? ten;
}
