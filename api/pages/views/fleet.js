/* The fleet: counts by state, alerts on top, then the vehicles, worst first. */

import { get } from "../api.js";
import { alertCard, alertEntries, groupCard } from "../alert_card.js";
import { make, setText, sync } from "../dom.js";
import { vehicleName, vehiclePath, words } from "../format.js";
import { STATES, dial, tag } from "../parts.js";

function countItem([state, count]) {
  return make("li", "", { data: count ? { tone: state } : { tone: state, none: "" } },
    make("b", "", String(count)), make("span", "", words(state)));
}

function vehicleItem(vehicle) {
  const kind = [vehicle.aircraft ?? "aircraft not announced", vehicle.configuration].filter(Boolean).join(", ");
  return make("li", "card",
    make("div", "head", make("h3", "", make("a", "", { href: vehiclePath(vehicle) }, vehicleName(vehicle))),
      tag(vehicle.state, words(vehicle.state))),
    make("p", "soft", kind), make("p", "reason", vehicle.reason), dial(vehicle.worst, vehicle.state));
}

export function view({ store }) {
  const counts = make("ul", "counts", { "aria-label": "Aircraft by state", id: "counts" });
  const alerts = make("ol", "alerts", { id: "alerts" });
  const noAlerts = make("p", "quiet", { id: "no-alerts" }, "Waiting for the first answer.");
  const vehicles = make("ol", "vehicles", { id: "vehicles" });
  const noVehicles = make("p", "quiet", { id: "no-vehicles", hidden: true }, "No aircraft has been heard yet.");
  const cleared = make("ol", "alerts", { id: "cleared" });
  const pastCount = make("span", "", { id: "past-count" });
  const past = make("details", "past", { id: "past", hidden: true }, make("summary", "", "Cleared alerts ", pastCount), cleared);
  const node = make("div", "",
    make("h1", "hidden", "Fleet"), counts,
    make("section", "", { "aria-labelledby": "alerts-title" }, make("h2", "", { id: "alerts-title" }, "Alerts"), noAlerts, alerts),
    make("section", "", { "aria-labelledby": "vehicles-title" }, make("h2", "", { id: "vehicles-title" }, "Aircraft"), noVehicles, vehicles),
    past);

  let open = true;
  async function showCleared() {
    try {
      const { items } = await get("/v1/alerts?state=cleared&limit=50");
      if (!open) return;
      sync(cleared, items, (alert) => alert.id, (alert) => alertCard(alert));
      past.hidden = items.length === 0;
      setText(pastCount, `(${items.length})`);
    } catch (error) {
      console.warn(String(error));
    }
  }
  const ends = ["alert", "resync"].map((kind) => store.on(kind, showCleared));
  showCleared();

  function update({ status }) {
    if (!status) return;
    sync(counts, STATES.map((state) => [state, status.counts[state] ?? 0]), ([state]) => state, countItem);
    sync(alerts, alertEntries(status.alerts, status.groups), (one) => one.id, (one) => (one.members ? groupCard(one) : alertCard(one)));
    sync(vehicles, status.vehicles, (vehicle) => `${vehicle.fleet}/${vehicle.vehicle}`, vehicleItem);
    noAlerts.hidden = status.alerts.length > 0;
    setText(noAlerts, "No alert stands.");
    noVehicles.hidden = status.vehicles.length > 0;
  }

  function close() {
    open = false;
    ends.forEach((end) => end());
  }

  return { node, update, close };
}
