/* The history of alerts: searched, paged, one opened with its evidence and with what people did. */

import { actButtons } from "../acting.js";
import { alertAbout, evidence } from "../alert_card.js";
import { NotLoggedIn, Refused, failure, get, withQuery } from "../api.js";
import { make, setText, sync } from "../dom.js";
import { duration, fixed, sentence, sizeOf, vehicleName, vehiclePath, words } from "../format.js";
import { alertTag, channelTag, tableHead } from "../parts.js";

const PAGE = 50;
const CHOICES = {
  state: ["active", "acknowledged", "shelved", "cleared"], level: ["critical", "warning", "watch"], kind: ["icing", "damage", "sensor", "unexplained"],
};
const TYPED = { vehicle: "Aircraft", fleet: "Fleet", cause: "Cause" };
const TIMES = { since: "Raised from, s", until: "to, s" };

export function view({ query, store, session, navigate }) {
  const asked = Object.fromEntries([...Object.keys({ ...TYPED, ...CHOICES, ...TIMES })].map((name) => [name, query.get(name) ?? ""]));
  let opened = query.get("id");
  const { form, fields } = searchForm(asked);
  const problem = make("p", "problem", { role: "alert" });
  const count = make("p", "soft", { "aria-live": "polite", id: "found" });
  const body = make("tbody", "", { id: "history" });
  const table = make("table", "history", make("caption", "hidden", "Alerts, newest first"),
    tableHead(["Alert", "Aircraft", "Size", "Raised", "Lasted", "Level and state"]), body);
  const more = make("button", "", { type: "button", hidden: true }, "Older ones");
  const node = make("div", "", make("h1", "", "Alerts"), form, problem, count, table, make("p", "acts", more));

  let items = [], next = null, open = true, asking = 0, seen = null;

  /** The first page, or the one after those that are shown. */
  async function ask(further) {
    const mine = ++asking;
    try {
      const chosen = { ...asked, cause: asked.cause.trim().toLowerCase().replaceAll(" ", "_"), vehicle: asked.vehicle.trim(), fleet: asked.fleet.trim() };
      const limit = further ? PAGE : Math.max(PAGE, Math.min(items.length, 1000));
      const page = await get(withQuery("/v1/alerts", { ...chosen, limit, cursor: further ? next : null }));
      if (!open || mine !== asking) return;
      items = further ? [...items, ...page.items] : page.items;
      next = page.next;
      problem.textContent = "";
      await addOpened();
      show();
    } catch (error) {
      if (open && mine === asking && !(error instanceof NotLoggedIn)) problem.textContent = failure(error);
    }
  }

  /** The one that the address names is shown though the search does not find it. */
  async function addOpened() {
    if (!opened || items.some((alert) => alert.id === opened)) return;
    try {
      items = [await get(`/v1/alerts/${encodeURIComponent(opened)}`), ...items];
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      problem.textContent = error.message;
      opened = null;
    }
  }

  function show() {
    const rows = items.flatMap((alert) => (alert.id === opened ? [{ alert, open: true }, { alert, detail: true }] : [{ alert, open: false }]));
    sync(body, rows, (row) => `${row.alert.id}${row.detail ? " detail" : ""}`, (row) => (row.detail ? detailRow(row.alert, session) : alertRow(row.alert, row.open)));
    setText(count, items.length ? `${items.length} shown${next ? ", newest first" : ""}` : "No alert fits the search.");
    table.hidden = items.length === 0;
    more.hidden = !next;
  }

  function address() {
    navigate(withQuery("/alerts", { ...asked, id: opened }), { replace: true });
  }

  let waiting = 0;
  form.addEventListener("input", () => {
    for (const [name, input] of Object.entries(fields)) asked[name] = input.value;
    opened = null;
    address();
    clearTimeout(waiting);
    waiting = setTimeout(() => ask(false), 250);
  });
  form.addEventListener("submit", (event) => event.preventDefault());
  more.addEventListener("click", () => ask(true));
  body.addEventListener("click", (event) => {
    const button = event.target.closest("button[data-open]");
    if (!button) return;
    opened = opened === button.dataset.open ? null : button.dataset.open;
    address();
    show();
  });
  const ends = ["alert", "resync"].map((kind) => store.on(kind, () => ask(false)));
  ask(false);

  /** An action is seen at once on this page, and alerts come and go where the event stream is down. */
  function update({ status }) {
    const now = JSON.stringify(status?.alerts.map((alert) => [alert.id, alert.state, alert.notes.length]));
    if (seen !== null && now !== seen) ask(false);
    seen = now;
  }

  function close() {
    open = false;
    clearTimeout(waiting);
    ends.forEach((end) => end());
  }

  return { node, update, close };
}

function searchForm(asked) {
  const fields = {};
  const field = (name, label, input) => {
    input.id = `find-${name}`;
    input.value = asked[name];
    fields[name] = input;
    return make("p", "field", make("label", "", { for: input.id }, label), input);
  };
  const choice = (name) => make("select", "", make("option", "", { value: "" }, "any"), ...CHOICES[name].map((value) => make("option", "", { value }, value)));
  const form = make("form", "find", { role: "search", "aria-label": "Alerts" },
    ...Object.entries(TYPED).map(([name, label]) => field(name, label, make("input", "", { type: "search", maxlength: 63, "data-search": name === "vehicle" ? "" : null }))),
    ...Object.keys(CHOICES).map((name) => field(name, sentence(name), choice(name))),
    ...Object.entries(TIMES).map(([name, label]) => field(name, label, make("input", "", { type: "number", step: "any" }))));
  return { form, fields };
}

function alertRow(alert, open) {
  const name = make("button", "plain", { type: "button", "aria-expanded": String(open), data: { open: alert.id } }, sentence(alert.cause));
  const title = make("th", "", { scope: "row" }, name);
  if (alert.channel !== null) title.append(" ", channelTag(alert.channel));
  const [, size] = sizeOf(alert) ?? ["", ""];
  return make("tr", open ? "opened" : "",
    title,
    make("td", "", { data: { label: "aircraft" } }, make("a", "", { href: vehiclePath(alert) }, vehicleName(alert))),
    make("td", "number", { data: { label: "size" } }, size || "none"),
    make("td", "number", { data: { label: "raised" } }, `${fixed(alert.raised_s, 1)} s`),
    make("td", "number", { data: { label: "lasted" } }, alert.cleared_s === null ? "in force" : duration(alert.cleared_s - alert.raised_s)),
    make("td", "", { data: { label: "level" } }, alertTag(alert)));
}

function detailRow(alert, session) {
  const log = alert.notes.length ? [] : [make("p", "notes", "Nobody has done anything to it.")];
  return make("tr", "detail", make("td", "", { colspan: 6, data: { alert: alert.id, tone: alert.state === "cleared" ? "cleared" : alert.level } },
    make("div", "sides", make("div", "", ...alertAbout(alert), ...log, ...actButtons(alert, session)), make("div", "", ...evidence(alert.evidence)))));
}
