/* The fleet's rows: which are wanted, in which order, and what a row shows. */

import { drawn, make, setText } from "./dom.js";
import { duration, fixed, lost, sentence, signed, sizeOf, symbol, vehicleName, vehiclePath, words } from "./format.js";
import { STATES, Z_BAND, shape, urgency } from "./parts.js";

const Z_RANGE = 8, LATE_S = 1.5, GONE_S = 5;

export const COLUMNS = [
  ["state", "State"], ["name", "Aircraft"], ["what", "What"], ["since", "For"], ["worst", "Worst derivative"],
  ["seen", "Surfaces"], ["link", "Link"],
];

export const keyOf = (row) => (row.group === undefined ? `${row.fleet}/${row.vehicle}` : `group ${row.group}`);

/** By `fleet/vehicle` the alerts in force, worst first. */
export function alertsByVehicle(alerts) {
  const found = new Map();
  for (const alert of alerts) {
    const key = `${alert.fleet}/${alert.vehicle}`;
    if (!found.has(key)) found.set(key, []);
    found.get(key).push(alert);
  }
  for (const some of found.values()) some.sort((a, b) => urgency(a) - urgency(b));
  return found;
}

function worstFirst(a, b) {
  const first = (row) => (row.alerts.length ? urgency(row.alerts[0]) : 99);
  return first(a) - first(b) || STATES.indexOf(a.state) - STATES.indexOf(b.state) || byName(a, b);
}

function byName(a, b) {
  return a.fleet < b.fleet ? -1 : a.fleet > b.fleet ? 1 : a.vehicle < b.vehicle ? -1 : a.vehicle > b.vehicle ? 1 : 0;
}

function byZ(a, b) {
  const z = (row) => (row.worst?.z == null ? -1 : Math.abs(row.worst.z));
  return z(b) - z(a) || byName(a, b);
}

const ORDERS = { worst: worstFirst, name: byName, z: byZ };

/** The rows that pass the filter, in order; where `grouped`, under a head of each fleet, the fleet with the worst first. */
export function rowsOf(status, { state = "", fleet = "", text = "", order = "worst", grouped = false }) {
  const alerts = alertsByVehicle(status.alerts);
  const parts = text.toLowerCase().split(/\s+/).filter(Boolean);
  const rows = status.vehicles
    .map((row) => ({ ...row, alerts: alerts.get(`${row.fleet}/${row.vehicle}`) ?? [] }))
    .filter((row) => (!state || row.state === state) && (!fleet || row.fleet === fleet) && parts.every((part) => found(row, part)))
    .sort(ORDERS[order] ?? worstFirst);
  return grouped ? underHeads(rows) : rows;
}

function found(row, part) {
  const causes = row.alerts.map((alert) => words(alert.cause)).join(" ");
  return `${row.fleet} ${row.vehicle} ${row.aircraft ?? ""} ${words(row.state)} ${causes} ${row.reason}`.toLowerCase().includes(part);
}

function underHeads(rows) {
  const fleets = new Map();
  for (const row of rows) {
    if (!fleets.has(row.fleet)) fleets.set(row.fleet, []);
    fleets.get(row.fleet).push(row);
  }
  return [...fleets].flatMap(([fleet, members]) => [{ group: fleet, members }, ...members]);
}

/** A row, or the head of a fleet; `acts` tells whether who looks may act. */
export function builtRow(item, acts) {
  return item.group === undefined ? vehicleRow(acts) : headRow();
}

function headRow() {
  const name = make("b", ""), counts = make("span", "soft");
  const node = make("div", "row fleet-head", make("span", "c-fleet", { role: "gridcell", "aria-colspan": COLUMNS.length }, name, counts));
  function update({ group, members }) {
    setText(name, group);
    const parts = STATES.map((state) => [members.filter((row) => row.state === state).length, state]).filter(([count]) => count);
    setText(counts, `${members.length} aircraft: ${parts.map(([count, state]) => `${count} ${words(state)}`).join(", ")}`);
  }
  return { node, update };
}

function cell(name, ...children) {
  return make("span", `c-${name}`, { role: "gridcell" }, ...children);
}

function vehicleRow(acts) {
  const icon = make("span", "icon"), state = make("span", "");
  const link = make("a", "", { tabindex: -1 }), kind = make("small", "soft");
  const what = make("span", "clamp"), acknowledge = make("button", "", { type: "button", tabindex: -1, data: { act: "acknowledge" } }, "Ack");
  const since = make("span", "number");
  const derivative = make("span", ""), z = make("span", "number"), strip = zStrip();
  const seen = make("span", "clamp"), age = make("span", "number");
  const linkCell = cell("link", make("span", "lamp", { "aria-hidden": "true" }), age);
  const node = make("div", "row", cell("state", icon, state), cell("name", link, kind), cell("what", what, acknowledge), cell("since", since),
    cell("worst", derivative, strip.node, z), cell("seen", seen), linkCell);
  let shownState = null, shownDerivative = null;

  function update(row) {
    if (row.state !== shownState) {
      shownState = row.state;
      icon.replaceChildren(shape(row.state));
      setText(state, words(row.state));
    }
    const [alert] = row.alerts, tone = alert ? alert.level : row.state;
    if (node.dataset.tone !== tone) node.dataset.tone = tone;
    if (alert) node.dataset.alert = alert.id;
    else delete node.dataset.alert;
    acknowledge.hidden = !acts || alert?.state !== "active";
    if (!acknowledge.hidden) acknowledge.setAttribute("aria-label", `Acknowledge ${words(alert.cause)} on ${vehicleName(row)}`);
    setText(link, row.vehicle);
    if (link.getAttribute("href") !== vehiclePath(row)) link.href = vehiclePath(row);
    const of = row.fleet === "default" ? "" : `${row.fleet}, `;
    setText(kind, of + (row.aircraft ?? "not announced"));
    setText(what, whatOf(row));
    what.classList.toggle("soft", row.alerts.length === 0);
    setText(since, sinceOf(row));
    if (row.worst?.derivative !== shownDerivative) {
      shownDerivative = row.worst?.derivative;
      derivative.replaceChildren(row.worst ? symbol(row.worst.derivative) : "");
    }
    setText(z, row.worst ? signed(row.worst.z) : "none");
    z.classList.toggle("soft", !row.worst);
    strip.update(row.worst?.z ?? null);
    setText(seen, seenOf(row));
    setText(age, row.sample_age_s === null ? "none" : duration(row.sample_age_s));
    linkCell.dataset.link = row.sample_age_s === null || row.sample_age_s > GONE_S ? "gone" : row.sample_age_s > LATE_S ? "late" : "live";
  }
  return { node, update };
}

/** Cause and size of the worst alert, and how many more there are; without one why the state is what it is. */
function whatOf(row) {
  if (!row.alerts.length) return row.reason;
  const [alert, ...more] = row.alerts;
  const figure = sizeOf(alert)?.[1], size = figure && lost(alert.cause) ? `${figure} lost` : figure;
  const parts = [size ? `${sentence(alert.cause)} ${size}` : sentence(alert.cause), alert.level, alert.state === "active" ? "" : alert.state];
  const part = alert.channel === null || alert.cause.endsWith("_effectiveness") ? "" : ` (${alert.channel})`;
  return `${parts.filter(Boolean).join(", ")}${part}${more.length ? `; ${more.length} more` : ""}`;
}

/** For how long, by the vehicle's own clock: of its worst alert, or of its state. */
function sinceOf(row) {
  const from = row.alerts.length ? row.alerts[0].raised_s : row.state_since_s;
  if (from === null || row.last_sample_time_s === null || row.last_sample_time_s < from) return "";
  return duration(row.last_sample_time_s - from);
}

/** What of the aircraft has moved enough to be seen, and whether the air is fit. */
function seenOf(row) {
  if (row.last_sample_time_s === null) return "";
  const unseen = row.unseen_surfaces.map((name) => words(name.replace(/_rad$/, ""))).join(", ");
  const parts = [unseen ? `${unseen} not moved` : row.worst ? "all moved" : ""];
  if (row.air_fit_for_estimating === false) parts.push("rough air");
  return parts.filter(Boolean).join("; ");
}

/** A small scale of z from -8 to 8 with the band of agreement and a mark. */
function zStrip() {
  const mark = drawn("path", { class: "mark" });
  const node = drawn("svg", { class: "scale", viewBox: "-50 -7 100 14", "aria-hidden": "true" },
    drawn("rect", { class: "band", x: -6 * Z_BAND, y: -5, width: 12 * Z_BAND, height: 10, rx: 1.5 }),
    drawn("line", { class: "axis", x1: -49, x2: 49, y1: 0, y2: 0 }), mark);
  let shown = null;
  function update(z) {
    const place = z === null ? null : fixed(Math.max(-Z_RANGE, Math.min(Z_RANGE, z)), 1).replace("−", "-");
    if (place === shown) return;
    shown = place;
    if (place === null) mark.removeAttribute("d");
    else mark.setAttribute("d", `M${6 * place} -6l4 6-4 6-4-6z`);
  }
  return { node, update };
}
