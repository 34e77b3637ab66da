/* Flights that are diagnosed: upload one, see how far each is, open its report, cancel or delete it. */

import { NotLoggedIn, Refused, failure, get, send, withQuery } from "../api.js";
import { make, setText, sync } from "../dom.js";
import { fixed, sentence, vehicleName } from "../format.js";

const BUSY_MS = 700, QUIET_MS = 5000, MOST_BYTES = 64 * 2 ** 20, MOST_MAP = 20000;
const OF_ALERT = /^alert (\S+) of ([^/\s]+)\/([^/\s]+)$/; // what the service calls the flight before an alert
const OPEN = ["queued", "running"];
const TONES = { done: "healthy", failed: "degraded", cancelled: "unknown", queued: "unknown", running: "watch" };

export function view({ session, announce }) {
  const acts = session.scope !== "read";
  const list = make("ol", "jobs", { id: "jobs" });
  const none = make("p", "quiet", { hidden: true }, "No flight has been diagnosed since the service started.");
  const problem = make("p", "problem", { role: "alert" });
  const { form, names } = uploadForm((job) => {
    announce(`${job.file} is uploaded.`);
    ask();
  });
  form.hidden = !acts;
  const node = make("div", "", make("h1", "", "Diagnoses"),
    make("p", "lead", "What the simulation of an aircraft gets wrong against a recorded flight. The service diagnoses alerts of the airframe on its own."),
    form, problem, none, list);
  let open = true, timer = 0, flying = [], alerts = [];

  async function ask() {
    clearTimeout(timer);
    let wait = QUIET_MS;
    try {
      const { items } = await get("/v1/diagnoses");
      if (!open) return;
      sync(list, items.map((job) => ({ ...job, alert: alertOf(job, alerts) })), (job) => job.id, (job) => jobItem(job, acts));
      none.hidden = items.length > 0;
      problem.textContent = "";
      const known = [...new Set([...flying, ...items.map((job) => job.aircraft)])].sort();
      sync(names, known, (name) => name, (name) => make("option", "", { value: name }));
      if (items.some((job) => OPEN.includes(job.state))) wait = BUSY_MS;
    } catch (error) {
      if (!open || error instanceof NotLoggedIn) return;
      if (error instanceof Refused && error.status === 404) {
        form.hidden = true; // this service takes none
        none.hidden = false;
        setText(none, error.message);
        return;
      }
      problem.textContent = failure(error);
    }
    clearTimeout(timer);
    timer = setTimeout(ask, wait);
  }

  list.addEventListener("click", async (event) => {
    const id = event.target.closest("button[data-remove]")?.dataset.remove;
    if (!id) return;
    try {
      await send("DELETE", `/v1/diagnoses/${encodeURIComponent(id)}`);
      await ask();
    } catch (error) {
      problem.textContent = failure(error);
    }
  });
  ask();

  function update({ status }) {
    flying = status?.vehicles.map((row) => row.aircraft).filter(Boolean) ?? [];
    alerts = status?.alerts ?? alerts;
  }

  function close() {
    open = false;
    clearTimeout(timer);
  }

  return { node, update, close };
}

/** The alert that a job looks into, as a person calls it: `{id, name}`; null for a flight that was uploaded. */
function alertOf(job, alerts) {
  const [, id, fleet, vehicle] = OF_ALERT.exec(job.file) ?? [];
  if (!id) return null;
  const cause = alerts.find((alert) => alert.id === id)?.cause;
  return { id, name: `${cause ? sentence(cause) : "Alert"} on ${vehicleName({ fleet, vehicle })}` };
}

function jobItem(job, acts) {
  const running = OPEN.includes(job.state);
  const doing = job.state === "queued" ? (job.ahead ? `${job.ahead} before it` : "next") : job.state === "running" ? job.doing : job.problem;
  const head = make("div", "head", make("h3", "", job.alert ? make("a", "", { href: `/alerts?id=${encodeURIComponent(job.alert.id)}` }, job.alert.name) : job.file), make("span", "tag", { data: { tone: TONES[job.state] } }, job.state));
  const item = make("li", "card", head, make("p", "soft", [job.aircraft, doing].filter(Boolean).join(": ")));
  if (running) {
    item.append(make("progress", "", { max: 1, value: job.progress ?? 0, "aria-label": `Progress of ${job.alert?.name ?? job.file}` }));
    if (job.state === "running") item.append(make("p", "soft number", `${fixed(100 * (job.progress ?? 0), 0)} %`));
  }
  const buttons = [];
  if (job.report) buttons.push(make("a", "button", { href: job.report, target: "_blank", rel: "noopener" }, "Open the report"));
  if (acts) buttons.push(make("button", "", { type: "button", data: { remove: job.id } }, running ? "Cancel" : "Delete"));
  if (buttons.length) item.append(make("div", "acts", ...buttons));
  return item;
}

/** The form, and the names of aircraft that it offers. `sent(job)` is called when the service has taken a flight. */
function uploadForm(sent) {
  const names = make("datalist", "", { id: "aircraft-names" });
  const file = make("input", "", { type: "file", id: "up-file", required: true });
  const aircraft = make("input", "", { id: "up-aircraft", list: "aircraft-names", maxlength: 63, required: true, autocomplete: "off" });
  const map = make("input", "", { type: "file", id: "up-map", accept: ".toml,text/plain" });
  const button = make("button", "main", { type: "submit" }, "Diagnose"), stop = make("button", "", { type: "button", hidden: true }, "Stop");
  const bar = make("progress", "", { max: 1, value: 0, hidden: true, "aria-label": "Upload" });
  const problem = make("p", "problem", { role: "alert" });
  const field = (label, input, hint) => make("p", "field", make("label", "", { for: input.id }, label), input, hint ? make("small", "soft", hint) : null);
  const form = make("form", "card upload", { "aria-label": "Upload a flight" },
    field("Flight", file, "CSV, Parquet, MATLAB or an autopilot's log, up to 64 MB"), field("Aircraft", aircraft, "a name of the library"),
    field("Channel map", map, "TOML, where the file's columns have other names"), names,
    make("div", "acts", button, stop), bar, problem);
  let request = null;

  stop.addEventListener("click", () => request?.abort());
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    problem.textContent = "";
    const [flight] = file.files, [mapFile] = map.files;
    if (flight.size > MOST_BYTES) {
      problem.textContent = `${flight.name} has ${fixed(flight.size / 2 ** 20, 0)} MB; at most 64 MB are taken. Use wingwatch diagnose for it.`;
      return;
    }
    busy(true);
    try {
      const text = mapFile ? await mapFile.text() : "";
      if (text.length > MOST_MAP) throw new Refused(`${mapFile.name} has ${text.length} characters; a channel map has at most ${MOST_MAP}.`, 422);
      const job = await upload(withQuery("/v1/diagnoses", { aircraft: aircraft.value.trim(), file: flight.name, map: text }), flight);
      file.value = "";
      sent(job);
    } catch (error) {
      problem.textContent = failure(error);
    }
    busy(false);
  });

  function busy(is) {
    button.disabled = is;
    bar.hidden = stop.hidden = !is;
    bar.value = 0;
  }

  /** XMLHttpRequest, for fetch does not tell how much has been sent. */
  function upload(path, flight) {
    return new Promise((resolve, reject) => {
      request = new XMLHttpRequest();
      request.open("POST", path);
      request.setRequestHeader("Content-Type", "application/octet-stream");
      request.responseType = "json";
      request.upload.addEventListener("progress", ({ loaded, total }) => { bar.value = total ? loaded / total : 0; });
      request.addEventListener("load", () => (request.status === 202 ? resolve(request.response)
        : reject(new Refused(request.response?.detail ?? `The service answered ${request.status}.`, request.status))));
      request.addEventListener("abort", () => reject(new Refused("The upload was stopped.", 0)));
      request.addEventListener("error", () => reject(new Error("no answer")));
      request.send(flight);
    });
  }

  return { form, names };
}
