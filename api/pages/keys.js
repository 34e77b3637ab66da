/* The keyboard: `?` says what there is. Keys without a modifier can be switched off, for speech input types them, too. */

import { make } from "./dom.js";
import { keep, kept } from "./settings.js";

const HELP = [
  ["/", "search"], ["j, k", "next and previous alert"], ["r", "to the rows; arrows, Page keys, Home, End go through them"],
  ["Enter", "open the aircraft of a row"], ["a", "acknowledge the alert (or the row's worst one)"], ["s", "shelve it for a time"],
  ["u", "take it back from the shelf"], ["c", "clear it, with a note"], ["1, 2, 3, 4", "fleet, alerts, diagnoses, studies"],
  ["?", "this help"],
];
const ACTIONS = { a: "acknowledge", s: "shelve", u: "unshelve", c: "clear" };
const VIEWS = { 1: "/", 2: "/alerts", 3: "/diagnoses", 4: "/studies" };

/** Listen to keys from now on. */
export function listenToKeys({ acting, navigate }) {
  const help = helpDialog();
  document.getElementById("help").addEventListener("click", () => help.showModal());
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
    if (event.target.closest("input, textarea, select, dialog[open]") || !kept("keys", true)) return;
    if (handled(event.key, { acting, navigate, help })) event.preventDefault();
  });
}

function handled(key, { acting, navigate, help }) {
  if (key === "?") help.showModal();
  else if (key === "/") return focused(document.querySelector("#view [data-search]"));
  else if (key === "r") return focused(document.querySelector("#view [role=row][tabindex='0']"));
  else if (key === "j" || key === "k") return stepped(key === "j" ? 1 : -1);
  else if (key in ACTIONS) return acted(acting, ACTIONS[key]);
  else if (key in VIEWS) navigate(VIEWS[key]);
  else return false;
  return true;
}

function focused(node) {
  node?.focus();
  return Boolean(node);
}

/** From one alert to the next, those of a folded group left out. */
function stepped(step) {
  const cards = [...document.querySelectorAll("#view .card[data-alert]")].filter((card) => card.checkVisibility());
  if (!cards.length) return false;
  const at = cards.indexOf(document.activeElement.closest(".card[data-alert]"));
  const card = cards[Math.min(Math.max(at < 0 ? 0 : at + step, 0), cards.length - 1)];
  card.tabIndex = -1;
  card.focus();
  card.scrollIntoView({ block: "nearest" });
  return true;
}

function acted(acting, action) {
  const id = document.activeElement.closest("[data-alert]")?.dataset.alert;
  if (id) acting.start(id, action);
  return Boolean(id);
}

function helpDialog() {
  const on = make("input", "", { type: "checkbox", id: "keys-on", checked: kept("keys", true) });
  on.addEventListener("change", () => keep("keys", on.checked));
  const dialog = make("dialog", "card", { "aria-labelledby": "keys-title" }, make("h2", "", { id: "keys-title" }, "Keyboard"),
    make("dl", "keys", ...HELP.flatMap(([key, what]) => [make("dt", "", ...key.split(", ").map((one) => make("kbd", "", one))), make("dd", "", what)])),
    make("p", "field line", on, make("label", "", { for: "keys-on" }, "Listen to single keys")),
    make("div", "acts", make("button", "main", { type: "button", onclick: () => dialog.close() }, "Close")));
  document.body.append(dialog);
  return dialog;
}
