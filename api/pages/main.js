/* The page: one shell, one store, one view at a time.

   A view is a file in views/ that exports `view(context)` and returns `{node, update(state), close()}`.

   context   params     of the path, decoded: `{id}` of /vehicles/{id}
             query      URLSearchParams of the address
             store      `on(kind, handler)`: events `alert`, `status`, `derivatives`, `manoeuvre`, `resync` with their data, as
                        docs/rest.md has them; returns the function that ends it. `derivatives` come of the vehicle of
                        the address alone, and of none on other views. `refresh()` asks for the fleet now
             session    `{name, scope, required}` of who looks; name is null without a token
             navigate   `navigate(path)`: another view; `navigate(path, {replace: true})` leaves no step back and, where
                        only the query differs, keeps the view
             announce   `announce(text)`: said by screen readers
   node      what is shown; its first h1 (or an element with data-title) gets the focus after a step to the view, and its
             text the title of the window
   update    called with the state at once, and whenever something is new:
             status      the answer of /v1/fleet: `counts`, `vehicles` (rows), `alerts` in force, `groups`, `kernels`, `problems`;
                         null before the first answer
             link        `live`, `polling`, `lost` or `waiting` (not logged in)
             answeredAt  Date of the answer, null before
             It must not throw, and must leave alone what has not changed: focus, selection and unfolded parts stay.
   close     called when another view is stepped to: end handlers, timers and requests here.

   A link to a path of the page is an ordinary <a href>; the router steps to it without loading the page anew.
   Requests go through api.js, DOM through dom.js, figures through format.js, small parts through parts.js. */

import { Acting } from "./acting.js";
import { Alarm } from "./alarm.js";
import { listenToKeys } from "./keys.js";
import { announce, announceNew, listenToLogin, showLink, showLogin, showService, showSession } from "./shell.js";
import { Store } from "./store.js";
import * as alerts from "./views/alerts.js";
import * as diagnoses from "./views/diagnoses.js";
import * as fleet from "./views/fleet.js";
import * as studies from "./views/studies.js";
import * as vehicle from "./views/vehicle.js";

const ROUTES = [
  [/^\/$/, fleet],
  [/^\/vehicles\/(?<id>[^/]+)$/, vehicle],
  [/^\/alerts$/, alerts],
  [/^\/diagnoses$/, diagnoses],
  [/^\/studies$/, studies],
];

const place = document.getElementById("view");
let session = { name: null, scope: null, required: false };
let current = null, currentPath = null;

const alarm = new Alarm((alert) => navigate(`/alerts?id=${encodeURIComponent(alert.id)}`));
const store = new Store(() => {
  leave();
  showLogin();
});

function found(path) {
  for (const [pattern, module] of ROUTES) {
    const match = pattern.exec(path);
    if (match) return { module, params: decoded(match.groups ?? {}) };
  }
  return { module: fleet, params: {} };
}

function decoded(groups) {
  return Object.fromEntries(Object.entries(groups).map(([name, value]) => {
    try {
      return [name, decodeURIComponent(value)];
    } catch {
      return [name, value];
    }
  }));
}

function leave() {
  current?.close();
  current = currentPath = null;
  place.replaceChildren();
  setTitle(null);
}

/** Show the view of the address; `stepped` tells that a person has come here from another view. */
function arrive(stepped) {
  leave();
  const { module, params } = found(location.pathname);
  const query = new URLSearchParams(location.search);
  currentPath = location.pathname;
  store.follow(params.id ? `${query.get("fleet") ?? "default"}/${params.id}` : null);
  store.keepUp(module === fleet);
  current = module.view({ params, query, store, session, navigate, announce });
  place.replaceChildren(current.node);
  current.update(store.state);
  for (const link of document.querySelectorAll("nav a")) {
    if (link.getAttribute("href") === location.pathname) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  setTitle(store.state.status);
  if (!stepped) return;
  const head = heading();
  head?.setAttribute("tabindex", "-1");
  head?.focus({ preventScroll: true });
  window.scrollTo(0, 0);
}

function navigate(path, { replace = false } = {}) {
  const target = new URL(path, location.href);
  history[replace ? "replaceState" : "pushState"](null, "", target);
  if (replace && target.pathname === currentPath) return;
  arrive(true);
}

function heading() {
  return place.querySelector("h1, [data-title]");
}

function setTitle(status) {
  const name = location.pathname === "/" ? "" : heading()?.textContent ?? "";
  const count = status?.alerts.length ? `(${status.alerts.length}) ` : "";
  const title = count + (name ? `${name} · wingwatch` : "wingwatch");
  if (document.title !== title) document.title = title;
}

document.addEventListener("click", (event) => {
  const link = event.target.closest?.("a[href]");
  const plain = event.button === 0 && !(event.ctrlKey || event.metaKey || event.shiftKey || event.altKey);
  if (!link || !plain || event.defaultPrevented || link.target || link.hasAttribute("download")) return;
  const target = new URL(link.href);
  if (target.origin !== location.origin || !ROUTES.some(([pattern]) => pattern.test(target.pathname))) return;
  event.preventDefault();
  navigate(target.pathname + target.search + target.hash);
});
window.addEventListener("popstate", () => {
  if (store.open) arrive(true);
});

store.subscribe((state) => {
  showLink(state);
  showService(state.status);
  announceNew(state.status?.alerts);
  alarm.look(state.status?.alerts);
  setTitle(state.status);
  current?.update(state);
});
setInterval(() => showLink(store.state), 1000);

async function begin() {
  const started = store.start();
  session = await showSession();
  if (store.open) arrive(false);
  await started;
}

listenToLogin(begin, () => store.refresh());
listenToKeys({ acting: new Acting(store, () => session), navigate });
begin();
