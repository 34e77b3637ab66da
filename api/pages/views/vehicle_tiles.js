/* Small multiples: every derivative on the same time axis, one of them chosen for the large picture. */

import { drawn, make, setAttributes, setText } from "../dom.js";
import { plusMinus, signed, symbol } from "../format.js";
import { ESTIMATORS, keyOf } from "./vehicle_series.js";
import { outline, valueRange } from "./vehicle_figure.js";

const WIDTH = 160, HEIGHT = 46;
const BAND = 1.96;
const GROUPS = { short_period: "Longitudinal: short period", lateral: "Lateral: roll and Dutch roll", dutch_roll: "Lateral: Dutch roll" };
const STANDS = new Set(["converged", "settling"]);

/** z of a derivative by an estimator; null where it is not known or nothing is expected. */
export function zOf(one) {
  if (!one || !STANDS.has(one.outcome) || one.value === null || one.expected === null || one.expected === undefined) return null;
  return (one.value - one.expected) / Math.hypot(one.standard_error, one.expected_standard_error);
}

/** Of both estimators' z that which is nearer to 0, and the estimate that it is of. */
export function milder(rows) {
  const both = rows.map((one) => ({ one, z: zOf(one) })).filter(({ z }) => z !== null);
  return both.sort((a, b) => Math.abs(a.z) - Math.abs(b.z))[0] ?? null;
}

/** Structure and derivative of everything that is estimated now, in their order. */
export function listed(current) {
  const found = new Map();
  for (const modes of Object.values(current?.estimators ?? {})) {
    for (const [structure, mode] of Object.entries(modes)) {
      if (!found.has(structure)) found.set(structure, Object.keys(mode.derivatives));
    }
  }
  return [...found].flatMap(([structure, names]) => names.map((derivative) => ({ structure, derivative })));
}

/** What both estimators say now of a derivative. */
export function rowsOf(current, { structure, derivative }) {
  return ESTIMATORS.map(([estimator]) => current?.estimators?.[estimator]?.[structure]?.derivatives[derivative]);
}

function path(times, values, across, down) {
  let text = "", pen = "M";
  times.forEach((time, k) => {
    if (values[k] === null) {
      pen = "M";
      return;
    }
    text += `${pen}${across(time).toFixed(1)} ${down(values[k]).toFixed(1)}`;
    pen = "L";
  });
  return text;
}

class Tile {
  constructor(chosen, choose) {
    this.chosen = chosen;
    this.band = drawn("path", { class: "expected" });
    this.lines = ESTIMATORS.map(([estimator]) => drawn("path", { class: estimator }));
    this.marks = drawn("path", { class: "marks" });
    const svg = drawn("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none", "aria-hidden": "true" },
      this.band, this.marks, ...this.lines);
    this.z = make("span", "number z");
    this.value = make("span", "number value");
    this.node = make("button", "tile", { type: "button", "aria-pressed": "false", onclick: () => choose(chosen),
      data: { derivative: chosen.derivative, structure: chosen.structure } },
    make("span", "name", symbol(chosen.derivative), this.z), svg, this.value);
  }

  update(history, current, range, marks, pressed) {
    setAttributes(this.node, { "aria-pressed": String(pressed) });
    const found = milder(rowsOf(current, this.chosen));
    const rows = rowsOf(current, this.chosen).filter((one) => one && STANDS.has(one.outcome));
    const best = found?.one ?? rows[0] ?? null;
    this.node.dataset.off = found === null ? "unknown" : Math.abs(found.z) >= 3 ? "far" : Math.abs(found.z) >= 2 ? "off" : "near";
    setText(this.z, found === null ? "" : `z ${signed(found.z)}`);
    setText(this.value, best ? plusMinus(best.value, best.standard_error, best.unit) : "not observable");
    this.#draw(history, range, marks);
  }

  #draw(history, [from, to], marks) {
    const series = ESTIMATORS.map(([estimator]) => history.overview.get(keyOf({ ...this.chosen, estimator })));
    const present = series.filter(Boolean);
    const limits = present.length ? valueRange(present) : null;
    if (!limits || !(to > from)) return;
    const across = (time) => ((time - from) / (to - from)) * WIDTH;
    const down = (value) => HEIGHT - ((Math.min(Math.max(value, limits[0]), limits[1]) - limits[0]) / (limits[1] - limits[0])) * HEIGHT;
    const [first] = present;
    const side = (sign) => first.expected.map((value, k) => {
      const error = first.expected_standard_error[k];
      return value === null || error === null ? null : value + sign * BAND * error;
    });
    const shape = outline(first.time_s, side(-1), side(1));
    this.band.setAttribute("d", path(shape.x, shape.y, across, down));
    series.forEach((one, k) => {
      const values = one?.value.map((value, at) => (STANDS.has(one.outcome[at]) ? value : null));
      this.lines[k].setAttribute("d", one ? path(one.time_s, values, across, down) : "");
    });
    const times = marks.flatMap((mark) => [mark.onset_s, mark.raised_s]).filter((time) => time !== null && time >= from && time <= to);
    this.marks.setAttribute("d", times.map((time) => `M${across(time).toFixed(1)} 0V${HEIGHT}`).join(""));
  }
}

/** All tiles, in groups by structure. */
export class Tiles {
  constructor(choose) {
    this.choose = choose;
    this.tiles = new Map();
    this.node = make("div", "tiles");
  }

  update(history, current, range, marks, chosen) {
    const wanted = listed(current);
    const key = ({ structure, derivative }) => `${structure}/${derivative}`;
    if (wanted.map(key).join() !== [...this.tiles.keys()].join()) this.#build(wanted, key);
    for (const [name, tile] of this.tiles) tile.update(history, current, range, marks, chosen !== null && name === key(chosen));
  }

  #build(wanted, key) {
    this.tiles = new Map(wanted.map((one) => [key(one), new Tile(one, this.choose)]));
    const groups = [...new Set(wanted.map((one) => one.structure))];
    this.node.replaceChildren(...groups.map((structure) => make("div", "tile-group",
      { role: "group", "aria-label": GROUPS[structure] ?? structure }, make("p", "soft", GROUPS[structure] ?? structure),
      make("div", "tile-row", { data: { structure } }, ...[...this.tiles.values()].filter((tile) => tile.chosen.structure === structure).map((tile) => tile.node)))));
  }
}
