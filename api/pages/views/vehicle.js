/* One vehicle: what it is like now, its derivatives over time, its alerts, envelope, baseline, manoeuvres, telemetry. */

import { actButtons } from "../acting.js";
import { Refused, get, withQuery } from "../api.js";
import { alertCard } from "../alert_card.js";
import { make, setText, sync, takePlace } from "../dom.js";
import { fixed, signed, symbol, vehicleName, words } from "../format.js";
import { facts, tag } from "../parts.js";
import { envelope } from "./vehicle_envelope.js";
import { Pictures } from "./vehicle_pictures.js";
import { baselineTable, couldSeeTable, manoeuvreList, nowTable, proposal } from "./vehicle_tables.js";
import { telemetry } from "./vehicle_telemetry.js";

const TICK_MS = 1000, SLOW_MS = 5000, BASELINE_MS = 60000;

/** What it is, where it flies, and what it is compared with. */
function head(vehicle) {
  const kind = [vehicle.aircraft ?? "aircraft not announced", vehicle.configuration].filter(Boolean).join(", ");
  const { airspeed_true_m_s: speed, altitude_m: height } = vehicle.condition;
  const flight = [speed == null ? "" : `${fixed(speed, 1)} m/s`, height == null ? "" : `${fixed(height, 0)} m`].filter(Boolean);
  const last = vehicle.last_sample_time_s;
  const node = make("div", "vehicle-head",
    make("p", "reason", vehicle.reason),
    facts("facts", [
      ["Aircraft", kind + (vehicle.mass_kg === null ? "" : `, ${fixed(vehicle.mass_kg, 1)} kg`)],
      ["Flight", flight.join(", ")],
      ["Air", vehicle.air?.text ?? ""],
      ["Furthest off", worst(vehicle.worst)],
      ["Last sample", last === null ? "none" : `${fixed(last, 1)} s on its clock`],
      ["Basis", vehicle.basis_text || vehicle.basis || "nothing compared yet"],
      ...(vehicle.worker ? [["Watched by", `worker ${vehicle.worker}`]] : []),
    ]));
  if (vehicle.proposed_input) node.append(proposal(vehicle.proposed_input));
  return node;
}

/** The derivative that is furthest from its expectation, and which estimator says so; null before the first comparison. */
function worst(found) {
  if (!found) return null;
  const by = `${words(found.estimator === "ekf" ? "Kalman filter" : found.estimator)}, ${words(found.structure)}`;
  return make("span", "", symbol(found.derivative), ` ${found.meaning}, z `, make("b", "number", signed(found.z)), ` (${by})`);
}

/** A section whose content is made anew when what it shows has changed. */
class Section {
  constructor(title, id, fold = false) {
    this.place = make("div", "", { id });
    this.node = fold
      ? make("section", "", make("details", "fold", make("summary", "", make("h2", "", title)), this.place))
      : make("section", "", { "aria-label": title }, make("h2", "", title), this.place);
    this.fold = fold ? this.node.firstElementChild : null;
    this.shown = undefined;
  }

  /** Whether somebody can see it. */
  get open() {
    return this.fold === null || this.fold.open;
  }

  show(value, build) {
    const fingerprint = JSON.stringify(value);
    if (fingerprint === this.shown) return;
    this.shown = fingerprint;
    const fresh = make("div", "", { id: this.place.id }, build(value));
    takePlace(fresh, this.place);
    this.place = fresh;
  }
}

export function view(context) {
  const { params, query, session, store } = context;
  const owner = { fleet: query.get("fleet") ?? "default", vehicle: params.id };
  const path = `/v1/vehicles/${encodeURIComponent(owner.vehicle)}`;
  const ask = (below = "") => get(withQuery(path + below, { fleet: owner.fleet }));

  const state = make("span", "state"), problem = make("p", "quiet", { id: "vehicle-problem", hidden: true });
  const now = new Section("Now", "vehicle");
  const pictures = new Pictures(path, owner);
  const alerts = make("ol", "alerts", { id: "vehicle-alerts" });
  const alertSection = make("section", "", { "aria-label": "Alerts in force", hidden: true }, make("h2", "", "Alerts"), alerts);
  const numbers = new Section("Derivatives now", "vehicle-now", true);
  const sky = new Section("Envelope", "vehicle-envelope"), link = new Section("Telemetry", "vehicle-telemetry");
  const flown = new Section("Manoeuvres", "vehicle-manoeuvres");
  const baseline = new Section("Baseline at this condition", "vehicle-baseline", true);
  const seen = new Section("What this flight could have shown", "vehicle-could-see", true);
  now.node.querySelector("h2").className = "hidden";
  const title = make("div", "vehicle-title", make("h1", "", vehicleName(owner)), state);
  const body = make("div", "", now.node, pictures.node, alertSection, numbers.node,
    make("div", "two", sky.node, flown.node), link.node, baseline.node, seen.node);
  const node = make("div", "vehicle-view", title, problem, body);

  let open = true, ticking = false, again = false, timer = 0, tickedAt = -Infinity, slowAt = -Infinity, baselineAt = -Infinity;
  let vehicle = null;

  async function readNow() {
    vehicle = await ask();
    if (!open) return;
    state.replaceChildren(tag(vehicle.state, words(vehicle.state)));
    now.show({ ...vehicle, counts: null, could_see: null }, head);
    if (seen.open) seen.show(vehicle.could_see, couldSeeTable);
    const current = await ask("/derivatives");
    if (!open) return;
    if (numbers.open) numbers.show(current, nowTable);
    await pictures.tick(current);
  }

  async function readSlow() {
    const [evidence, flights, arrivals] = await Promise.all([ask("/evidence"), ask("/manoeuvres"), ask("/telemetry")]);
    if (!open) return;
    pictures.take(evidence, flights.items);
    flown.show(flights.items, manoeuvreList);
    link.show(arrivals, telemetry);
  }

  async function readBaseline() {
    const { airspeed_true_m_s: speed, altitude_m: height } = vehicle.condition;
    if (vehicle.aircraft === null || speed == null || height == null) return false;
    const round = { airspeed_true_m_s: speed.toFixed(1), altitude_m: height.toFixed(0) };
    const known = pictures.history.kept ? { fleet: owner.fleet, vehicle: owner.vehicle, configuration: vehicle.configuration, ...round } : null;
    let shown = { cells: [], at: null };  // where nothing is kept, nobody need be asked
    try {
      if (known) shown = await get(withQuery(`/v1/baselines/${encodeURIComponent(vehicle.aircraft)}`, known));
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
    }
    if (!open) return true;
    baseline.show(shown, baselineTable);
    sky.show({ cells: shown.cells ?? [], condition: { airspeed_true_m_s: speed, altitude_m: height } },
      (one) => envelope(one.cells, one.condition));
    return true;
  }

  /** Ask for what is due; never twice at once, and nothing while nobody looks. */
  async function tick() {
    if (!open || document.hidden) return;
    if (ticking) {
      again = true;
      return;
    }
    ticking = true;
    again = false;
    tickedAt = performance.now();
    try {
      await readNow();
      if (tickedAt - slowAt >= SLOW_MS) {
        slowAt = tickedAt;
        await readSlow();
      }
      if (tickedAt - baselineAt >= BASELINE_MS && await readBaseline()) baselineAt = tickedAt;
      problem.hidden = true;
      body.hidden = false;
    } catch (error) {
      if (open && error instanceof Refused) {
        problem.hidden = false;
        body.hidden = vehicle === null;
        setText(problem, error.message);
      } else if (open) console.warn(String(error));
    } finally {
      ticking = false;
    }
    if (again) soon();
  }

  /** Tick, but no more often than once a second. */
  function soon() {
    if (timer || !open) return;
    timer = setTimeout(() => {
      timer = 0;
      tick();
    }, Math.max(0, tickedAt + TICK_MS - performance.now()));
  }

  const mine = (data) => data.fleet === owner.fleet && data.vehicle === owner.vehicle;
  const ends = [
    store.on("derivatives", (data) => { if (mine(data)) soon(); }),
    store.on("status", (data) => { if (mine(data)) soon(); }),
    store.on("alert", (data) => { if (mine(data)) { slowAt = -Infinity; soon(); } }),
    store.on("manoeuvre", (data) => { if (mine(data)) { slowAt = -Infinity; soon(); } }),
  ];
  const onVisible = () => { if (!document.hidden) soon(); };
  document.addEventListener("visibilitychange", onVisible);
  for (const one of [numbers, seen, baseline]) one.fold.addEventListener("toggle", soon);

  function update({ status }) {
    if (!status) return;
    soon();
    const active = status.alerts.filter(mine);
    sync(alerts, active, (alert) => alert.id, (alert) => alertCard(alert, (one) => actButtons(one, session)));
    alertSection.hidden = active.length === 0;
    const parts = active.flatMap((alert) => alert.evidence).sort((a, b) => Math.abs(b.z ?? 0) - Math.abs(a.z ?? 0));
    pictures.suspect = parts[0]?.derivative ?? null;
  }

  function close() {
    open = false;
    clearTimeout(timer);
    for (const end of ends) end();
    document.removeEventListener("visibilitychange", onVisible);
    pictures.close();
  }

  return { node, update, close };
}
