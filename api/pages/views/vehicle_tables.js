/* Tables of one vehicle: derivatives now, the picture's numbers, the baseline, manoeuvres, what could be seen. */

import { make } from "../dom.js";
import { SIZELESS, fixed, lost, number, plusMinus, signed, symbol, tail, words } from "../format.js";
import { channelTag, scale, tableHead } from "../parts.js";
import { ESTIMATORS, keyOf } from "./vehicle_series.js";
import { listed, milder, rowsOf } from "./vehicle_tiles.js";

const MOST_ROWS = 40, OPEN_MANOEUVRES = 4;

function cell(text, label, className = "number") {
  return make("td", className, { data: { label } }, text);
}

function estimate(one) {
  if (!one || one.value === null || one.value === undefined) return "unknown";
  return plusMinus(one.value, one.standard_error, one.unit);
}

/** Every derivative as it is now: both estimators beside what is expected. */
export function nowTable(current) {
  const rows = listed(current).map((chosen) => {
    const both = rowsOf(current, chosen);
    const some = both.find(Boolean);
    const found = milder(both);
    return make("tr", "",
      make("th", "", { scope: "row" }, symbol(chosen.derivative), make("small", "", words(chosen.structure))),
      ...both.map((one, k) => cell(estimate(one), ESTIMATORS[k][1], one && one.outcome !== "not_observable" ? "number" : "number soft")),
      cell(some?.expected == null ? "unknown" : plusMinus(some.expected, some.expected_standard_error, some.unit), "expected"),
      make("td", "z", make("div", "", scale(found?.z ?? null, false), make("span", "number", found ? signed(found.z) : "–"))));
  });
  return make("table", "evidence", make("caption", "", "Now, ± one standard error; soft where it is not observable; z is that of the milder estimator"),
    tableHead(["Derivative", ...ESTIMATORS.map(([, label]) => label), "Expected", "z"]), make("tbody", "", ...rows));
}

/** The numbers of the large picture, some forty rows of them. */
export function pictureTable(shown, chosen, [from, to]) {
  const series = ESTIMATORS.map(([estimator, label]) => [label, shown.get(keyOf({ ...chosen, estimator }))]).filter(([, one]) => one);
  if (!series.length) return make("p", "soft", "No estimate is kept of this time.");
  const times = [...new Set(series.flatMap(([, one]) => one.time_s))].filter((time) => time >= from && time <= to).sort((a, b) => a - b);
  const step = Math.max(1, Math.ceil(times.length / MOST_ROWS));
  const rows = times.filter((_, k) => (times.length - 1 - k) % step === 0).map((time) => {
    const at = series.map(([label, one]) => [label, one, one.time_s.indexOf(time)]);
    const first = at.find(([, , k]) => k >= 0);
    return make("tr", "",
      make("th", "number", { scope: "row" }, `${fixed(time, 1)} s`),
      ...at.map(([label, one, k]) => cell(k < 0 || one.value[k] === null ? "–" : plusMinus(one.value[k], one.standard_error[k], one.unit), label)),
      cell(first[1].expected[first[2]] === null ? "–"
        : plusMinus(first[1].expected[first[2]], first[1].expected_standard_error[first[2]], first[1].unit), "expected"));
  });
  return make("table", "", make("caption", "", `${chosen.derivative} over time, ± one standard error`),
    tableHead(["Time", ...series.map(([label]) => label), "Expected"]), make("tbody", "", ...rows));
}

const SOURCES = [["a_priori", "A priori"], ["stored", "Identified or empirical"], ["flights", "Own flights"], ["expected", "Expected"]];

/** What the baseline has at the flight condition, source beside source. */
export function baselineTable(shown) {
  const structures = Object.entries(shown.at?.structures ?? {});
  const rows = structures.flatMap(([structure, side]) => Object.entries(side.derivatives).map(([derivative, row]) => make("tr", "",
    make("th", "", { scope: "row" }, symbol(derivative), make("small", "", words(structure))),
    ...SOURCES.map(([key, label]) => cell(row[key] ? plusMinus(row[key].value, row[key].standard_error, row.unit) : "–", label,
      row[key] ? "number" : "number soft")),
    cell(row.z === null ? "–" : signed(row.z), "z, flights and expectation"))));
  if (!rows.length) return make("p", "soft", "The baseline has nothing of this aircraft at this condition.");
  return make("table", "", make("caption", "", "± one standard error; z says how far the own flights are from the stored or a-priori numbers"),
    tableHead(["Derivative", ...SOURCES.map(([, label]) => label), "z"]), make("tbody", "", ...rows));
}

function degrees(radians) {
  return `${fixed((radians * 180) / Math.PI, 1)}°`;
}

function manoeuvreItem(one) {
  const moved = Object.entries(one.surfaces).map(([column, size]) => `${words(column.replace("_rad", ""))} ±${degrees(size)}`);
  return make("li", "", { data: { tone: one.good ? "healthy" : "warning" } },
    make("span", "verdict", one.good ? "good" : "poor"),
    make("span", "number soft", `${fixed(one.begin_s, 0)}–${fixed(one.end_s, 0)} s`),
    make("span", "soft", moved.join(", ")), make("span", "", one.text));
}

/** The last manoeuvres, newest first; the older ones fold away. */
export function manoeuvreList(items) {
  if (!items.length) return make("p", "soft", "No manoeuvre has been flown yet.");
  const list = (some) => make("ol", "manoeuvres", ...some.map(manoeuvreItem));
  const older = items.slice(OPEN_MANOEUVRES);
  return make("div", "", list(items.slice(0, OPEN_MANOEUVRES)),
    older.length ? make("details", "", make("summary", "", `${older.length} more`), list(older)) : null);
}

/** The smallest size of a cause that a flight would have shown. */
function smallestSize({ cause, smallest_size: least, unit }) {
  if (least === null) return "not seen";
  if (SIZELESS.includes(cause)) return "seen";
  return lost(cause) ? `${number(100 * least)} %` : number(least) + tail(unit);
}

function couldSeeRow(one) {
  const unseen = one.smallest_size === null;
  const part = one.channel === null ? make("span", "soft", "of the airframe") : channelTag(one.channel);
  return make("tr", "",
    make("th", "", { scope: "row" }, words(one.cause), " ", part),
    cell(smallestSize(one), "smallest size", unseen ? "soft" : "number"),
    cell(one.input || (unseen ? "none known" : "none needed"), "input that would help", one.input ? "" : "soft"));
}

/** What the flight so far could have shown. */
export function couldSeeTable(rows) {
  if (!rows.length) return make("p", "soft", "Nothing is known yet.");
  return make("table", "", make("caption", "hidden", "What this flight could have shown"),
    tableHead(["Cause and part", "Smallest size", "Input that would help"]), make("tbody", "", ...rows.map(couldSeeRow)));
}

/** An input that somebody may fly. */
export function proposal(one) {
  const what = `${one.shape} of the ${words(one.surface.replace("_rad", ""))}, ±${degrees(one.amplitude_rad)}, ${fixed(one.duration_s, 2)} s`;
  return make("p", "proposal", make("b", "", "Proposed input: "), `${what}. ${one.why} `,
    make("span", "soft", `Valid until ${fixed(one.valid_until_s, 0)} s on its clock; wingwatch does not fly it.`));
}
