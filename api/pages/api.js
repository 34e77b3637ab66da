/* Questions to the service. A refusal becomes one sentence for people; the token is a cookie that no script sees. */

const TIMEOUT_MS = 8000;

/** The service asks for a token. */
export class NotLoggedIn extends Error {}

/** The service has refused; `message` is its sentence, `status` its code. */
export class Refused extends Error {
  constructor(message, status) {
    super(message);
    this.status = status;
  }
}

async function ask(path, options, timeout = TIMEOUT_MS) {
  const answer = await fetch(path, { cache: "no-store", signal: AbortSignal.timeout(timeout), ...options });
  if (answer.ok) return answer;
  const sentence = await problemSentence(answer);
  if (answer.status === 401) throw new NotLoggedIn(sentence);
  throw new Refused(sentence, answer.status);
}

/** What a problem document says, and its faults where there are several. */
async function problemSentence(answer) {
  try {
    const problem = await answer.json();
    const faults = (problem.errors ?? []).map((one) => one.message);
    return faults.length > 1 ? `${problem.detail} ${faults.join("; ")}` : problem.detail;
  } catch {
    return `The service answered ${answer.status} ${answer.statusText}.`;
  }
}

/** The object at a path of REST. */
export async function get(path) {
  return (await ask(path)).json();
}

/** Send an object; null where the answer has no content. */
export async function send(method, path, body, headers = {}) {
  const options = { method, headers: { ...headers } };
  if (body !== undefined) {
    options.headers["Content-Type"] = "application/json";
    options.body = JSON.stringify(body);
  }
  const answer = await ask(path, options);
  return answer.status === 204 ? null : answer.json();
}

/** One sentence about a failure, for people. */
export function failure(error) {
  if (error instanceof Refused || error instanceof NotLoggedIn) return error.message;
  return "The service has not answered; try again.";
}

/** A path with those of the parameters that have a value. */
export function withQuery(path, parameters) {
  const query = new URLSearchParams();
  for (const [name, value] of Object.entries(parameters)) {
    if (value !== null && value !== undefined && value !== "") query.set(name, value);
  }
  return query.size ? `${path}?${query}` : path;
}

/** What a person does to an alert: `acknowledge`, `shelve`, `unshelve` or `clear`. A repeated try is carried out once. */
export function actOnAlert(id, action, body) {
  const key = crypto.randomUUID ? crypto.randomUUID() : `${Date.now()}-${Math.random()}`;
  return send("POST", `/v1/alerts/${encodeURIComponent(id)}/${action}`, body, { "Idempotency-Key": key });
}
