/* The fleet: counts by state, which filter; alerts on top; then a row an aircraft, worst first, and where they are. */

import { actButtons } from "../acting.js";
import { alertCard, alertEntries, groupCard } from "../alert_card.js";
import { get } from "../api.js";
import { make, setText, sync } from "../dom.js";
import { vehiclePath, words } from "../format.js";
import { COLUMNS, builtRow, keyOf, rowsOf } from "../fleet_table.js";
import { STATES } from "../parts.js";
import { Plan } from "../plan.js";
import { WindowList } from "../window_list.js";

const MOST_CARDS = 50, MOST_OPEN = 1; // cards that are built; cards up to which the evidence stands open
const NARROW = window.matchMedia("(max-width: 42rem)"); // there evidence is folded: the aircraft must not be screens below
const NOBODY = "No aircraft has been heard yet. One appears with its first message: by wingwatch bridge from a MAVLink link, or from a publisher over Zenoh (help, docs/telemetry.md). wingwatch demo flies three.";
const ORDERS = [["worst", "worst first"], ["name", "by name"], ["z", "largest z first"]];

export function view({ query, store, session, navigate }) {
  const filter = { state: query.get("state") ?? "", fleet: query.get("fleet") ?? "", text: query.get("q") ?? "",
    order: query.get("order") ?? "worst", grouped: query.get("grouped") === "yes" };
  const counts = make("ul", "counts", { "aria-label": "Aircraft by state", id: "counts" });
  const alerts = alertsPart(session, store);
  const aircraft = aircraftPart(filter, navigate, session.scope !== "read");
  const node = make("div", "", make("h1", "hidden", "Fleet"), counts, alerts.node, aircraft.node, alerts.past);

  counts.addEventListener("click", (event) => {
    const state = event.target.closest("button")?.dataset.state;
    if (state) choose({ state: filter.state === state ? "" : state });
  });

  function choose(changes) {
    Object.assign(filter, changes);
    const { state, fleet, text: q, order, grouped } = filter;
    const chosen = Object.entries({ state, fleet, q, order: order === "worst" ? "" : order, grouped: grouped ? "yes" : "" });
    const search = new URLSearchParams(chosen.filter(([, value]) => value)).toString();
    navigate(search ? `/?${search}` : "/", { replace: true });
    update(store.state);
  }
  aircraft.listen(choose);

  function update({ status }) {
    if (!status) return;
    sync(counts, STATES.map((state) => ({ state, count: status.counts[state] ?? 0, chosen: filter.state === state })), ({ state }) => state, countItem);
    alerts.update(status);
    aircraft.update(status);
  }

  function close() {
    alerts.close();
    aircraft.close();
  }

  return { node, update, close };
}

function countItem({ state, count, chosen }) {
  return make("li", "", { data: count ? { tone: state } : { tone: state, none: "" } },
    make("button", "", { type: "button", "aria-pressed": String(chosen), data: { state } }, make("b", "", String(count)), " ", make("span", "", words(state))));
}

/** Alerts in force as cards, and the latest that were cleared, folded away. */
function alertsPart(session, store) {
  const list = make("ol", "alerts", { id: "alerts" });
  const none = make("p", "quiet", { id: "no-alerts" }, "Waiting for the first answer.");
  const more = make("p", "quiet", { hidden: true }, make("a", "", { href: "/alerts" }, ""));
  const cleared = make("ol", "alerts", { id: "cleared" }), count = make("span", "", { id: "past-count" });
  const past = make("details", "past", { id: "past", hidden: true }, make("summary", "", "Cleared alerts ", count), cleared);
  const buttons = (alert) => actButtons(alert, session);
  let open = true;

  async function showCleared() {
    try {
      const { items } = await get("/v1/alerts?state=cleared&limit=50");
      if (!open) return;
      sync(cleared, items, (alert) => alert.id, (alert) => alertCard(alert));
      past.hidden = items.length === 0;
      setText(count, `(${items.length})`);
    } catch (error) {
      console.warn(String(error));
    }
  }
  const ends = ["alert", "resync"].map((kind) => store.on(kind, showCleared));
  showCleared();

  function update({ alerts, groups }) {
    const all = alertEntries(alerts, groups), shown = all.slice(0, MOST_CARDS), many = NARROW.matches || all.length > MOST_OPEN;
    sync(list, shown.map((one) => ({ one, folded: many || one.state !== "active" })), ({ one }) => one.id,
      ({ one, folded }) => (one.members ? groupCard(one, buttons) : alertCard(one, buttons, folded)));
    none.hidden = all.length > 0;
    setText(none, "No alert is in force.");
    more.hidden = all.length <= MOST_CARDS;
    setText(more.firstChild, `${all.length - shown.length} more alerts`);
  }

  function close() {
    open = false;
    ends.forEach((end) => end());
  }

  const node = make("section", "", { "aria-labelledby": "alerts-title" }, make("h2", "", { id: "alerts-title" }, "Alerts"), none, list, more);
  return { node, past, update, close };
}

/** The rows with what filters them, and the plan view. */
function aircraftPart(filter, navigate, acts) {
  const opened = (row) => row.group === undefined && navigate(vehiclePath(row));
  const search = make("input", "", { type: "search", placeholder: "Search", "aria-label": "Search aircraft", value: filter.text, "data-search": "", id: "search" });
  const fleet = make("select", "", { "aria-label": "Fleet", id: "fleet" });
  const order = make("select", "", { "aria-label": "Order", id: "order" }, ...ORDERS.map(([value, text]) => make("option", "", { value, selected: value === filter.order }, text)));
  const grouped = make("input", "", { type: "checkbox", id: "grouped", checked: filter.grouped });
  const byFleet = make("label", "line", { hidden: true }, grouped, "by fleet");
  const shown = make("span", "soft", { id: "shown", "aria-live": "polite" });
  const none = make("p", "quiet", { id: "no-vehicles", hidden: true }, NOBODY);
  const rows = new WindowList({ label: "Aircraft", columns: COLUMNS, key: keyOf, row: (item) => builtRow(item, acts), opened });
  rows.node.id = "vehicles";
  const plan = new Plan(opened);
  const beside = make("div", "beside", rows.node, plan.node);
  const node = make("section", "", { "aria-labelledby": "vehicles-title" },
    make("div", "bar", make("h2", "", { id: "vehicles-title" }, "Aircraft"), shown, search, fleet, byFleet, order), none, beside);

  function listen(choose) {
    search.addEventListener("input", () => choose({ text: search.value.trim() }));
    fleet.addEventListener("change", () => choose({ fleet: fleet.value }));
    order.addEventListener("change", () => choose({ order: order.value }));
    grouped.addEventListener("change", () => choose({ grouped: grouped.checked }));
  }

  function update(status) {
    const fleets = [...new Set(status.vehicles.map((row) => row.fleet))].sort();
    sync(fleet, ["", ...fleets], (name) => name, (name) => make("option", "", { value: name, selected: name === filter.fleet }, name || "all fleets"));
    fleet.hidden = byFleet.hidden = fleets.length < 2;
    const wanted = rowsOf(status, { ...filter, grouped: filter.grouped && fleets.length > 1 });
    const number = wanted.filter((row) => row.group === undefined).length, all = status.vehicles.length;
    setText(shown, number === all ? String(all) : `${number} of ${all}`);
    rows.set(wanted);
    rows.node.hidden = wanted.length === 0;
    none.hidden = wanted.length > 0;
    setText(none, all ? "No aircraft fits the filter." : NOBODY);
    beside.classList.toggle("with-plan", plan.set(wanted));
  }

  return { node, listen, update, close: () => rows.close() };
}
