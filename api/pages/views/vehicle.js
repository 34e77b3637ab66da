/* One vehicle: its card as it is now, what its flight could have shown, its alerts with their evidence. */

import { actButtons } from "../acting.js";
import { Refused, get, withQuery } from "../api.js";
import { alertCard } from "../alert_card.js";
import { make, setText, sync } from "../dom.js";
import { SIZELESS, fixed, lost, number, tail, vehicleName, words } from "../format.js";
import { channelTag, dial, facts, tableHead, tag } from "../parts.js";

const SEEN_TITLE = "What this flight could have shown";

/** Samples and messages that were not taken in, by reason. */
function rejections(counts) {
  const parts = Object.entries(counts).filter(([name, count]) => name !== "accepted" && count > 0);
  return parts.map(([name, count]) => `${count} ${words(name)}`).join(", ");
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
    make("td", unseen ? "soft" : "number", { data: { label: "smallest size" } }, smallestSize(one)),
    make("td", one.input ? "" : "soft", { data: { label: "input that would help" } }, one.input || (unseen ? "none known" : "none needed")));
}

function couldSeeTable(rows) {
  if (!rows.length) return make("p", "soft", "Nothing is known yet.");
  return make("table", "", make("caption", "hidden", SEEN_TITLE),
    tableHead(["Cause and part", "Smallest size", "Input that would help"]),
    make("tbody", "", ...rows.map(couldSeeRow)));
}

/** An input that somebody may fly. */
function proposal(one) {
  const degrees = fixed((one.amplitude_rad * 180) / Math.PI, 1);
  const what = `${one.shape} of the ${words(one.surface.replace("_rad", ""))}, ±${degrees}°, ${fixed(one.duration_s, 2)} s`;
  return make("p", "proposal", make("b", "", "Proposed input: "), `${what}. ${one.why} `,
    make("span", "soft", `Valid until ${fixed(one.valid_until_s, 0)} s on its clock; wingwatch does not fly it.`));
}

function card(vehicle) {
  const kind = [vehicle.aircraft ?? "aircraft not announced", vehicle.configuration].filter(Boolean).join(", ");
  const { airspeed_true_m_s: speed, altitude_m: height } = vehicle.condition;
  const flight = [speed == null ? "" : `${fixed(speed, 1)} m/s`, height == null ? "" : `${fixed(height, 0)} m`];
  const last = vehicle.last_sample_time_s;
  const item = make("li", "card",
    make("div", "head", make("p", "soft", kind), tag(vehicle.state, words(vehicle.state))),
    make("p", "reason", vehicle.reason), dial(vehicle.worst, vehicle.state),
    facts("facts", [
      ["Basis", vehicle.basis_text || vehicle.basis || "nothing compared yet"],
      ["Flight", flight.filter(Boolean).join(", ")],
      ["Last sample", last === null ? "none" : `${fixed(last, 1)} s on its clock`],
      ["Samples", vehicle.counts.accepted === undefined ? "" : `${vehicle.counts.accepted} accepted`],
      ["Rejected", rejections(vehicle.counts)],
      ["Alerts", vehicle.active_alerts.length ? String(vehicle.active_alerts.length) : ""],
    ]));
  if (vehicle.proposed_input) item.append(proposal(vehicle.proposed_input));
  if (last !== null) {
    item.append(make("details", "could-see", make("summary", "", SEEN_TITLE), couldSeeTable(vehicle.could_see)));
  }
  return item;
}

export function view({ params, query, session }) {
  const owner = { fleet: query.get("fleet") ?? "default", vehicle: params.id };
  const path = withQuery(`/v1/vehicles/${encodeURIComponent(owner.vehicle)}`, { fleet: owner.fleet });
  const problem = make("p", "quiet", { id: "vehicle-problem", hidden: true });
  const now = make("ol", "", { id: "vehicle" }), alerts = make("ol", "alerts", { id: "vehicle-alerts" });
  const section = make("section", "", { "aria-label": "Alerts in force", hidden: true }, make("h2", "", "Alerts"), alerts);
  const node = make("div", "", make("h1", "", vehicleName(owner)), problem, now, section);

  let open = true, asking = false;
  async function show() {
    if (asking) return;
    asking = true;
    try {
      const vehicle = await get(path);
      if (!open) return;
      problem.hidden = true;
      sync(now, [vehicle], () => "now", card);
    } catch (error) {
      if (open && error instanceof Refused) {
        problem.hidden = false;
        setText(problem, error.message);
      }
    } finally {
      asking = false;
    }
  }

  function update({ status }) {
    if (!status) return;
    show();
    const mine = status.alerts.filter((alert) => alert.fleet === owner.fleet && alert.vehicle === owner.vehicle);
    sync(alerts, mine, (alert) => alert.id, (alert) => alertCard(alert, (one) => actButtons(one, session)));
    section.hidden = mine.length === 0;
  }

  return { node, update, close: () => { open = false; } };
}
