"use strict";
/* The status page. It asks /v1/status and /v1/alerts, again whenever the event stream says that something is new,
   and every few seconds in any case. Everything shown goes through textContent: nothing received becomes markup. */

const REFRESH_MS = 500, POLL_LIVE_MS = 5000, POLL_ALONE_MS = 2000, TIMEOUT_MS = 8000;
const SEEN_AGAIN_MS = 10000;
const Z_RANGE = 8, Z_BAND = 2, LEAST_EVIDENCE = 3;
const STATES = ["degraded", "not_observable", "stale", "unknown", "healthy"];
const GREEK = { eta: "η", xi: "ξ", zeta: "ζ" };
const SHAPES = {
  healthy: "M8 1.5a6.5 6.5 0 1 0 0 13 6.5 6.5 0 0 0 0-13zM4.8 8.2l2.2 2.2 4.2-4.6",
  degraded: "M8 2l6.5 11.5h-13zM8 6.5v3.5M8 11.7v.3",
  not_observable: "M1 8s2.5-4.5 7-4.5S15 8 15 8s-2.5 4.5-7 4.5S1 8 1 8zM2.5 13.5l11-11",
  stale: "M8 1.5a6.5 6.5 0 1 0 0 13 6.5 6.5 0 0 0 0-13zM8 4.5V8l2.5 2",
  unknown: "M8 1.5a6.5 6.5 0 1 0 0 13 6.5 6.5 0 0 0 0-13zM6 6.3a2 2 0 1 1 2.6 1.9c-.4.1-.6.4-.6.9M8 11.4v.2",
  cleared: "M3 8h10",
};
const byId = (id) => document.getElementById(id);

/* ---- small parts ------------------------------------------------------------------------------------- */

function make(tag, className, ...children) {
  const node = document.createElement(tag);
  if (className) node.className = className;
  node.append(...children);
  return node;
}

function drawn(tag, attributes, ...children) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

function words(name) {
  return String(name ?? "").replaceAll("_", " ");
}

function fixed(value, digits) {
  return value.toFixed(Math.min(Math.max(digits, 0), 9)).replace("-", "−");
}

function number(value, significant = 3) {
  if (value === null || value === undefined) return "unknown";
  return String(Number(value.toPrecision(significant))).replace("-", "−");
}

/** A value with its standard error, both to the error's second significant digit. */
function plusMinus(value, error, unit = "", scale = 1) {
  if (value === null) return "unknown";
  if (error === null || !(error > 0)) return number(value * scale) + tail(unit);
  const digits = 1 - Math.floor(Math.log10(error * scale));
  return `${fixed(value * scale, digits)} ± ${fixed(error * scale, digits)}${tail(unit)}`;
}

function signed(z) {
  if (z === null) return "unknown";
  const text = fixed(Math.abs(z), 1);
  return (text === "0.0" ? "" : z > 0 ? "+" : "−") + text;
}

/** A probability in per cent that never claims certainty. */
function percent(probability) {
  if (probability > 0.999) return "above 99.9 %";
  return probability < 0.001 ? "below 0.1 %" : `${number(100 * probability)} %`;
}

/** A unit as it is printed behind a number; nothing for a fraction. */
function tail(unit) {
  return unit ? ` ${unit.replace(/([a-z])2/g, "$1²")}` : "";
}

function symbol(name) {
  const [row, index] = String(name).split("_");
  const node = make("span", "symbol", row);
  if (index) node.append(make("sub", "", GREEK[index] ?? index));
  return node;
}

function shape(state) {
  const path = { d: SHAPES[state] ?? SHAPES.unknown, fill: "none", stroke: "currentColor", "stroke-width": 1.4,
    "stroke-linecap": "round", "stroke-linejoin": "round" };
  return drawn("svg", { viewBox: "0 0 16 16", "aria-hidden": "true" }, drawn("path", path));
}

function tag(state, text) {
  const node = make("span", "tag", shape(state), text);
  node.dataset.tone = state;
  return node;
}

/** A part of the aircraft, by its column of the flight table. */
function channelTag(channel) {
  return make("code", "part", channel);
}

/** Where a z lies: the band where flight and expectation agree, and a mark; beyond the range the mark is a wedge. */
function scale(z, labelled) {
  const width = 320, middle = width / 2, y = labelled ? 12 : 8, unit = (middle - 12) / Z_RANGE;
  const svg = drawn("svg", { class: "scale", viewBox: `0 0 ${width} ${labelled ? 36 : 16}`, "aria-hidden": "true",
    preserveAspectRatio: labelled ? "xMidYMid meet" : "none" });
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

function facts(className, pairs) {
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
function tableHead(titles) {
  const cells = titles.map((title) => {
    const cell = make("th", "", title);
    cell.scope = "col";
    return cell;
  });
  return make("thead", "", make("tr", "", ...cells));
}

/** Put a child in an older one's place; what the reader unfolded stays unfolded, and so does the focus. */
function takePlace(fresh, old) {
  const folds = fresh.querySelectorAll("details");
  const focused = document.activeElement;
  old.querySelectorAll("details").forEach((fold, place) => {
    if (!folds[place]) return;
    folds[place].open = fold.open;
    if (fold.firstElementChild === focused) folds[place].dataset.focus = "";
  });
  old.replaceWith(fresh);
  fresh.querySelector("details[data-focus] > summary")?.focus();
}

/** Bring a list's children in line with the items; a child is rebuilt only when what it shows has changed. */
function sync(list, items, key, build) {
  const old = new Map([...list.children].map((node) => [node.dataset.key, node]));
  items.forEach((item, place) => {
    const fingerprint = JSON.stringify(item);
    let node = old.get(key(item));
    old.delete(key(item));
    if (!node || node.fingerprint !== fingerprint) {
      const fresh = build(item);
      fresh.dataset.key = key(item);
      fresh.fingerprint = fingerprint;
      if (node) takePlace(fresh, node);
      node = fresh;
    }
    if (list.children[place] !== node) list.insertBefore(node, list.children[place] ?? null);
  });
  old.forEach((node) => node.remove());
}

/* ---- what is shown ------------------------------------------------------------------------------------ */

function countItem([state, count]) {
  const item = make("li", "", make("b", "", String(count)), make("span", "", words(state)));
  item.dataset.tone = state;
  if (!count) item.dataset.none = "";
  return item;
}

function dial(worst, tone) {
  const node = make("div", "dial");
  node.dataset.tone = tone;
  if (!worst) {
    node.append(make("p", "soft", "No derivative compared yet."), scale(null, true));
    return node;
  }
  const name = make("span", "", symbol(worst.derivative), " ", make("small", "soft", worst.meaning));
  const reading = make("span", "number", make("span", "soft", "z "), make("b", "", signed(worst.z)));
  node.append(make("p", "", name, reading), scale(worst.z, true),
    make("p", "soft", make("small", "", `furthest from expectation, ${worst.estimator}, ${words(worst.structure)}`)));
  return node;
}

function rejections(counts) {
  const parts = Object.entries(counts).filter(([name, count]) => name !== "accepted" && count > 0);
  return parts.map(([name, count]) => `${count} ${words(name)}`).join(", ");
}

/** What a cause takes away as a fraction, which is shown in per cent; null for other causes. */
function lost(cause) {
  if (cause.endsWith("_effectiveness")) return "Effectiveness lost";
  return cause === "thrust_loss" ? "Thrust lost" : null;
}

/** Causes that are there or not, and have no size. */
const SIZELESS = ["surface_stuck", "sensor_freeze"];

/** The smallest size of a cause that a flight would have shown. */
function smallestSize({ cause, smallest_size: least, unit }) {
  if (least === null) return "not seen";
  if (SIZELESS.includes(cause)) return "seen";
  return lost(cause) ? `${number(100 * least)} %` : number(least) + tail(unit);
}

function couldSeeRow(one) {
  const row = make("tr", "");
  const name = make("th", "", words(one.cause), " ", one.channel === null ? make("span", "soft", "of the airframe") : channelTag(one.channel));
  name.scope = "row";
  const unseen = one.smallest_size === null;
  const smallest = make("td", unseen ? "soft" : "number", smallestSize(one));
  const input = make("td", "", one.input || (unseen ? "none known" : "none needed"));
  if (!one.input) input.className = "soft";
  smallest.dataset.label = "smallest size";
  input.dataset.label = "input that would help";
  row.append(name, smallest, input);
  return row;
}

function couldSeeTable(rows) {
  if (!rows.length) return make("p", "soft", "Nothing is known yet.");
  return make("table", "", make("caption", "hidden", SEEN_TITLE),
    tableHead(["Cause and part", "Smallest size", "Input that would help"]),
    make("tbody", "", ...rows.map(couldSeeRow)));
}

const SEEN_TITLE = "What this flight could have shown";
/** Rows by vehicle, and when they were asked for: they are asked for one vehicle at a time, while its fold is open. */
const seen = new Map();

/** What a flight could have shown, folded away. */
function couldSee({ fleet, vehicle }) {
  const key = `${fleet}/${vehicle}`;
  const place = make("div", "", couldSeeTable(seen.get(key)?.rows ?? []));
  const fold = make("details", "could-see", make("summary", "", SEEN_TITLE), place);
  fold.addEventListener("toggle", async () => {
    if (!fold.open || Date.now() - (seen.get(key)?.asked ?? 0) < SEEN_AGAIN_MS) return;
    seen.set(key, { rows: seen.get(key)?.rows ?? [], asked: Date.now() });
    try {
      const { could_see: rows } = await get(`/v1/vehicles/${vehicle}?fleet=${fleet}`);
      seen.get(key).rows = rows;
      const shown = document.contains(place) ? place : foldOf(key);
      shown?.replaceChildren(couldSeeTable(rows));
    } catch (error) {
      seen.delete(key);
      console.warn(error);
    }
  });
  return fold;
}

/** Where a vehicle's rows stand now; its card may have been built anew while they were on their way. */
function foldOf(key) {
  const card = [...byId("vehicles").children].find((node) => node.dataset.key === key);
  return card?.querySelector(".could-see > div");
}

/** An input that somebody may fly. */
function proposal(one) {
  const degrees = fixed((one.amplitude_rad * 180) / Math.PI, 1);
  const what = `${one.shape} of the ${words(one.surface.replace("_rad", ""))}, ±${degrees}°, ${fixed(one.duration_s, 2)} s`;
  return make("p", "proposal", make("b", "", "Proposed input: "), `${what}. ${one.why} `,
    make("span", "soft", `Valid until ${fixed(one.valid_until_s, 0)} s on its clock; wingwatch does not fly it.`));
}

function vehicleItem(vehicle) {
  const item = make("li", "card");
  const fleet = vehicle.fleet === "default" ? "" : `${vehicle.fleet} / `;
  const kind = [vehicle.aircraft ?? "aircraft not announced", vehicle.configuration].filter(Boolean).join(", ");
  const head = make("div", "head", make("h3", "", fleet + vehicle.vehicle), tag(vehicle.state, words(vehicle.state)));
  const sky = vehicle.condition;
  const speed = sky.airspeed_true_m_s, height = sky.altitude_m;
  const flight = [speed == null ? "" : `${fixed(speed, 1)} m/s`, height == null ? "" : `${fixed(height, 0)} m`];
  const last = vehicle.last_sample_time_s;
  item.append(make("div", "", head, make("p", "soft", kind)), make("p", "reason", vehicle.reason),
    dial(vehicle.worst, vehicle.state),
    facts("facts", [
      ["Basis", vehicle.basis_text || vehicle.basis || "nothing compared yet"],
      ["Flight", flight.filter(Boolean).join(", ")],
      ["Last sample", last === null ? "none" : `${fixed(last, 1)} s on its clock`],
      ["Samples", vehicle.counts.accepted === undefined ? "" : `${vehicle.counts.accepted} accepted`],
      ["Rejected", rejections(vehicle.counts)],
      ["Alerts", vehicle.active_alerts.length ? String(vehicle.active_alerts.length) : ""],
    ]));
  if (vehicle.proposed_input) item.append(proposal(vehicle.proposed_input));
  if (last !== null) item.append(couldSee(vehicle));
  return item;
}

function size(alert) {
  const { value, standard_error: error } = alert.size;
  if (value === null) return null;
  if (SIZELESS.includes(alert.cause)) return ["Size", ""];
  if (lost(alert.cause)) return [lost(alert.cause), plusMinus(value, error, "%", 100)];
  return [alert.cause === "icing" ? "Icing severity η" : "Size", plusMinus(value, error)];
}

function evidenceRow(part) {
  const row = make("tr", "");
  const measured = make("td", "number", plusMinus(part.estimate, part.standard_error, part.unit));
  const expected = make("td", "number", plusMinus(part.expected, part.expected_standard_error, part.unit));
  measured.dataset.label = "measured";
  expected.dataset.label = "expected";
  const z = make("td", "z", make("div", "", scale(part.z, false), make("span", "number", signed(part.z))));
  const name = make("th", "", symbol(part.derivative), make("small", "", part.meaning));
  name.scope = "row";
  row.append(name, measured, expected, z);
  return row;
}

function evidenceTable(parts) {
  return make("table", "", make("caption", "hidden", "Evidence"), tableHead(["Derivative", "Measured", "Expected", "z"]),
    make("tbody", "", ...parts.map(evidenceRow)));
}

/** A part of the numerical kernels, and where it stands. */
function kernelItem(part) {
  const item = make("li", "", make("span", "", part.name), make("span", "soft", part.first ? part.state : `${part.state}, in the background`));
  item.dataset.state = part.state;
  return item;
}

/** What a machine goes through once: its kernels are compiled, and how far that is. */
function showKernels(kernels) {
  byId("kernels").hidden = !kernels;
  if (!kernels) return;
  byId("kernels-text").textContent = kernels.text;
  const bar = byId("kernels-done");
  bar.max = kernels.parts.length;
  bar.value = kernels.parts.filter((part) => part.state === "compiled").length;
  sync(byId("kernels-parts"), kernels.parts, (part) => part.name, kernelItem);
}

/** Parts of the service that do not work; while kernels are compiled, their own card says what the estimators wait for. */
function showProblems(status) {
  const problems = Object.entries(status.problems ?? {}).filter(([part]) => !(part === "estimators" && status.kernels));
  byId("service-problems").hidden = problems.length === 0;
  sync(byId("service-problems-list"), problems, ([part]) => part,
    ([part, problem]) => make("li", "", `${words(part)}: ${problem}`));
}

/** The derivatives that speak for the alert stand open, the others fold away; at least the first three stand open. */
function evidence(parts) {
  const speaks = (part, place) => place < LEAST_EVIDENCE || part.z === null || Math.abs(part.z) >= Z_BAND;
  const open = parts.filter(speaks), folded = parts.filter((part, place) => !speaks(part, place));
  const nodes = open.length ? [evidenceTable(open)] : [];
  if (folded.length) {
    const words = folded.length === 1 ? "1 more derivative is" : `${folded.length} more derivatives are`;
    nodes.push(make("details", "", make("summary", "", `${words} within ${Z_BAND} standard errors`), evidenceTable(folded)));
  }
  return nodes;
}

/** Causes that are possible, likeliest first. */
function candidates(all) {
  const items = all.map((one) => {
    const probability = make("b", "number", one.probability === null ? "unknown" : percent(one.probability));
    const cause = make("span", "", words(one.cause));
    if (one.channel !== null) cause.append(" ", channelTag(one.channel));
    return make("li", "", probability, cause);
  });
  return make("div", "candidates", make("p", "soft", "Possible causes"), make("ol", "", ...items));
}

function alertItem(alert) {
  const item = make("li", "card");
  const cleared = alert.state === "cleared";
  item.dataset.tone = cleared ? "cleared" : alert.level;
  const fleet = alert.fleet === "default" ? "" : `${alert.fleet} / `;
  const cause = words(alert.cause), title = cause.charAt(0).toUpperCase() + cause.slice(1);
  const standing = alert.state === "active" ? alert.level : `${alert.level}, ${alert.state}`;
  const mark = tag(cleared ? "cleared" : "degraded", standing);
  mark.dataset.tone = item.dataset.tone;
  const heading = make("h3", "", `${title} on ${fleet}${alert.vehicle}`);
  if (alert.channel !== null) heading.append(" ", channelTag(alert.channel));
  item.append(make("div", "head", heading, mark),
    make("p", "text", alert.text),
    facts("figures", [
      size(alert) ?? ["Size", "not known"],
      ["Probability", alert.probability === null ? "" : percent(alert.probability)],
      ["Kind", alert.kind === alert.cause ? "" : alert.kind],
      ["Raised", `${fixed(alert.raised_s, 1)} s`],
      ["Cleared", alert.cleared_s === null ? "" : `${fixed(alert.cleared_s, 1)} s`],
      ["Came back", alert.repeats ? (alert.repeats === 1 ? "once" : `${alert.repeats} times`) : ""],
      ["Compared with", `${alert.basis} expectation`],
    ]));
  if (alert.candidates.length) item.append(candidates(alert.candidates));
  item.append(...evidence(alert.evidence));
  if (alert.notes.length) item.append(make("ul", "notes", ...alert.notes.map((note) => make("li", "", note))));
  if (alert.diagnosis_id) {
    const report = make("a", "", "Report of the diagnosis");
    report.href = `/v1/diagnoses/${encodeURIComponent(alert.diagnosis_id)}/report`;
    item.append(make("p", "soft", report));
  }
  return item;
}

/** Alerts of several vehicles that are one event, theirs folded away. */
function groupItem(group) {
  const item = make("li", "card group");
  item.dataset.tone = group.level;
  const mark = tag("degraded", group.level);
  mark.dataset.tone = group.level;
  const names = group.vehicles.map((name) => name.replace(/^default\//, "").replace("/", " / "));
  const members = make("ol", "alerts", ...group.members.map(alertItem));
  item.append(make("div", "head", make("h3", "", `${group.kind === "icing" ? "Ice" : words(group.kind)} on ${names.length} aircraft`), mark),
    make("p", "text", group.text), make("p", "soft", names.join(", ")),
    make("details", "", make("summary", "", `${group.members.length} alerts`), members));
  return item;
}

/** Alerts as they are listed: those of a group stand in it, at the place of its newest. */
function entries(active, groups) {
  const found = new Map();
  for (const alert of active) {
    const group = groups.find((one) => one.id === alert.group);
    if (!group) found.set(alert.id, alert);
    else if (found.has(group.id)) found.get(group.id).members.push(alert);
    else found.set(group.id, { ...group, members: [alert] });
  }
  return [...found.values()];
}

let known = null;

function announce(active) {
  const fresh = known === null ? [] : active.filter((alert) => !known.has(alert.id) && !alert.repeats);
  known = new Set(active.map((alert) => alert.id));
  if (fresh.length) {
    byId("announcer").textContent =
      fresh.map((alert) => `New ${alert.level}: ${words(alert.cause)} on ${alert.vehicle}.`).join(" ");
  }
}

function show(status, recent) {
  const active = status.alerts;
  const cleared = recent.items.filter((alert) => alert.state === "cleared");
  const counts = STATES.map((state) => [state, status.counts[state] ?? 0]);
  sync(byId("counts"), counts, ([state]) => state, countItem);
  sync(byId("alerts"), entries(active, status.groups), (one) => one.id, (one) => (one.members ? groupItem(one) : alertItem(one)));
  sync(byId("cleared"), cleared, (alert) => alert.id, alertItem);
  sync(byId("vehicles"), status.vehicles, (vehicle) => `${vehicle.fleet}/${vehicle.vehicle}`, vehicleItem);
  byId("no-alerts").hidden = active.length > 0;
  byId("no-alerts").textContent = "No alert stands.";
  byId("no-vehicles").hidden = status.vehicles.length > 0;
  showKernels(status.kernels);
  showProblems(status);
  byId("past").hidden = cleared.length === 0;
  byId("past-count").textContent = `(${cleared.length})`;
  byId("version").textContent = `wingwatch ${status.version}.`;
  document.title = active.length ? `(${active.length}) wingwatch` : "wingwatch";
  announce(active);
}

/* ---- logging in ------------------------------------------------------------------------------------------ */

/** Ask for a token; what an earlier one showed goes away. */
function askToken() {
  if (!byId("login").hidden) return;
  byId("login").hidden = false;
  byId("session").hidden = true;
  for (const list of ["counts", "alerts", "cleared", "vehicles"]) byId(list).replaceChildren();
  for (const part of ["no-alerts", "no-vehicles", "past", "kernels", "service-problems"]) byId(part).hidden = true;
  document.title = "wingwatch";
  known = null;
  if (stream) stream.close();
  byId("token").focus();
}

async function showSession() {
  try {
    const { name, scope } = await get("/v1/session");
    byId("session").hidden = name === null;
    byId("who").textContent = name === null ? "" : `Logged in as ${name} (${scope}).`;
  } catch (error) {
    console.warn(error);
  }
}

async function logIn(event) {
  event.preventDefault();
  const problem = byId("login-problem");
  problem.textContent = "";
  try {
    const answer = await fetch("/v1/session", { method: "POST", headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ token: byId("token").value }), signal: AbortSignal.timeout(TIMEOUT_MS) });
    if (!answer.ok) {
      problem.textContent = (await answer.json()).detail;
      return;
    }
    byId("token").value = "";
    byId("login").hidden = true;
    byId("no-alerts").hidden = false;
    begin();
  } catch (error) {
    console.warn(error);
    problem.textContent = "The service has not answered; try again.";
  }
}

async function logOut() {
  try {
    await fetch("/v1/session", { method: "DELETE", signal: AbortSignal.timeout(TIMEOUT_MS) });
  } catch (error) {
    console.warn(error);
  }
  refresh();
}

/* ---- keeping it true ------------------------------------------------------------------------------------ */

let streaming = false, asking = false, askAgain = false, compiling = false, timer = 0, lastAnswer = null;

function tellLink(lost) {
  const closed = !byId("login").hidden;
  const state = lost ? "lost" : closed ? "waiting" : streaming ? "live" : "polling";
  const texts = { live: "live", polling: "asking every 2 s", lost: "no answer", waiting: "not logged in" };
  byId("link").dataset.link = state;
  byId("link-text").textContent = texts[state] + (lastAnswer ? `, ${lastAnswer.toLocaleTimeString()}` : "");
  byId("banner").hidden = !lost;
  if (lost) {
    const since = lastAnswer ? ` since ${lastAnswer.toLocaleTimeString()}; what stands below is as old as that` : " yet";
    byId("banner").textContent = `The service has not answered${since}.`;
  }
}

class NotLoggedIn extends Error {}

async function get(path) {
  const answer = await fetch(path, { cache: "no-store", signal: AbortSignal.timeout(TIMEOUT_MS) });
  if (answer.status === 401) throw new NotLoggedIn();
  if (!answer.ok) throw new Error(`${path} answered ${answer.status}`);
  return answer.json();
}

async function refresh() {
  if (asking) {
    askAgain = true;
    return;
  }
  asking = true;
  askAgain = false;
  let lost = false;
  try {
    const [status, recent] = await Promise.all([get("/v1/status"), get("/v1/alerts?state=cleared&limit=50")]);
    lastAnswer = new Date();
    show(status, recent);
    compiling = Boolean(status.kernels);
  } catch (error) {
    if (error instanceof NotLoggedIn) {
      askToken();
    } else {
      console.warn(error);
      lost = true;
    }
  }
  asking = false;
  tellLink(lost);
  if (byId("login").hidden) plan(askAgain ? REFRESH_MS : streaming && !compiling ? POLL_LIVE_MS : POLL_ALONE_MS);
}

function plan(delay) {
  clearTimeout(timer);
  timer = setTimeout(refresh, delay);
}

let soon = false;

function somethingNew() {
  if (soon) return;
  soon = true;
  setTimeout(() => { soon = false; refresh(); }, REFRESH_MS);
}

let stream = null;

function follow() {
  if (!byId("login").hidden || (stream && stream.readyState !== EventSource.CLOSED)) return;
  stream = new EventSource("/v1/events");
  stream.onopen = () => { streaming = true; refresh(); };
  stream.onerror = () => {
    streaming = false;
    plan(POLL_ALONE_MS);
    if (stream.readyState === EventSource.CLOSED) setTimeout(follow, POLL_LIVE_MS);
  };
  for (const kind of ["alert", "status", "derivatives", "resync"]) stream.addEventListener(kind, somethingNew);
}

async function begin() {
  await refresh();
  follow();
  await showSession();
}

byId("login").addEventListener("submit", logIn);
byId("logout").addEventListener("click", logOut);
begin();
