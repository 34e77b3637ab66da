/* What stands around every view: how old what is shown is, what does not work, the kernels, logging in, the announcer. */

import { get, send, failure } from "./api.js";
import { make, setText, sync } from "./dom.js";
import { duration, words } from "./format.js";

const byId = (id) => document.getElementById(id);
const OLD_MS = 6000, NOTICE_MS = 10000;
const LINKS = { live: "live", polling: "asking every 2 s", lost: "no answer", waiting: "not logged in" };

/** The lamp at the top and the banner below it. */
export function showLink({ link, answeredAt }) {
  const age = answeredAt ? Date.now() - answeredAt : 0;
  const old = answeredAt && (link === "lost" || age > OLD_MS) ? `, ${duration(age / 1000)} old` : "";
  byId("link").dataset.link = link;
  setText(byId("link-text"), LINKS[link] + old);
  byId("link").title = answeredAt ? `What is shown was answered at ${answeredAt.toLocaleTimeString()}.` : "";
  byId("banner").hidden = link !== "lost";
  const since = answeredAt ? ` since ${answeredAt.toLocaleTimeString()}; what stands below is as old as that` : " yet";
  setText(byId("banner"), link === "lost" ? `The service has not answered${since}.` : "");
}

/** A part of the numerical kernels, and where it stands. */
function kernelItem(part) {
  return make("li", "", { data: { state: part.state } }, make("span", "", part.name),
    make("span", "soft", part.first ? part.state : `${part.state}, in the background`));
}

/** What a machine goes through once: its kernels are compiled, and how far that is. */
function showKernels(kernels) {
  byId("kernels").hidden = !kernels;
  if (!kernels) return;
  setText(byId("kernels-text"), kernels.text);
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

let version = null;

/** What the service says about itself. */
export function showService(status) {
  if (!status) {
    byId("kernels").hidden = byId("service-problems").hidden = true;
    return;
  }
  showKernels(status.kernels);
  showProblems(status);
  setText(byId("version"), `wingwatch ${status.version}.`);
  if (version !== null && version !== status.version) notice(`The service is wingwatch ${status.version} now; load the page again to have its page.`);
  version = status.version;
}

/** Say something to who listens with a screen reader. */
export function announce(text) {
  byId("announcer").textContent = text;
}

let noticed = 0;

/** Say something to everybody for a while, such as why an action was refused. */
export function notice(text) {
  const node = byId("notice");
  node.textContent = text;
  node.hidden = false;
  clearTimeout(noticed);
  noticed = setTimeout(() => { node.hidden = true; }, NOTICE_MS);
}

let known = null;

/** Say which alerts are new; what was there at the first look is not. Returns the new ones. */
export function announceNew(alerts) {
  if (!alerts) {
    known = null;
    return [];
  }
  const fresh = known === null ? [] : alerts.filter((alert) => !known.has(alert.id) && !alert.repeats);
  known = new Set(alerts.map((alert) => alert.id));
  if (fresh.length) announce(fresh.map((one) => `New ${one.level}: ${words(one.cause)} on ${one.vehicle}.`).join(" "));
  return fresh;
}

/* ---- who looks ---------------------------------------------------------------------------------------- */

/** Who is logged in: `{name, scope, required}`. */
export async function showSession() {
  try {
    const session = await get("/v1/session");
    byId("session").hidden = session.name === null;
    setText(byId("who"), session.name === null ? "" : `Logged in as ${session.name} (${session.scope}).`);
    return session;
  } catch (error) {
    console.warn(String(error));
    return { name: null, scope: null, required: false };
  }
}

/** Ask for a token. */
export function showLogin() {
  byId("login").hidden = false;
  byId("session").hidden = true;
  byId("token").focus();
}

/** Set the form and the button up; `onLoggedIn` and `onLoggedOut` are called afterwards. */
export function listenToLogin(onLoggedIn, onLoggedOut) {
  byId("login").addEventListener("submit", async (event) => {
    event.preventDefault();
    const problem = byId("login-problem");
    problem.textContent = "";
    try {
      await send("POST", "/v1/session", { token: byId("token").value });
      byId("token").value = "";
      byId("login").hidden = true;
      onLoggedIn();
    } catch (error) {
      problem.textContent = failure(error);
    }
  });
  byId("logout").addEventListener("click", async () => {
    try {
      await send("DELETE", "/v1/session");
    } catch (error) {
      console.warn(String(error));
    }
    onLoggedOut();
  });
}
