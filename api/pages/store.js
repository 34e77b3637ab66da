/* What the page knows, and how it stays true: one event stream says that something is new, and the fleet is then asked
   for again; where the stream is down it is asked for every 2 s. After a restart of the service the stream comes back by
   itself, says `resync`, and everything is asked for again. */

import { NotLoggedIn, get, withQuery } from "./api.js";

const REFRESH_MS = 500, POLL_LIVE_MS = 5000, POLL_ALONE_MS = 2000, BACK_MS = 2000;
const MANY = 200;
const KINDS = ["alert", "status", "derivatives", "manoeuvre", "resync"];

export class Store {
  /** `onLoggedOut` is called when the service asks for a token. */
  constructor(onLoggedOut) {
    this.state = { status: null, link: "waiting", answeredAt: null };
    this.onLoggedOut = onLoggedOut;
    this.listeners = new Set();
    this.handlers = new Map(KINDS.map((kind) => [kind, new Set()]));
    this.stream = this.lastEventId = this.followed = null;
    this.pace = POLL_LIVE_MS;
    this.streaming = this.asking = this.askAgain = this.soon = this.open = false;
    this.timer = this.reopening = 0;
    this.hidden = null;
    document.addEventListener("visibilitychange", () => this.#seen(!document.hidden));
  }

  /** Call `listener(state)` whenever the state has changed; returns the function that ends it. */
  subscribe(listener) {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  }

  /** Call `handler(data)` at each event of a kind; returns the function that ends it. */
  on(kind, handler) {
    this.handlers.get(kind).add(handler);
    return () => this.handlers.get(kind).delete(handler);
  }

  /** From now on events `derivatives` come of this vehicle alone (`fleet/vehicle`), or of none. */
  follow(followed) {
    if (followed === this.followed) return;
    this.followed = followed;
    if (!this.stream) return;
    this.stream.close();
    this.#listen();
  }

  /** Whether what is shown is to be as new as the fleet's solutions are, twice a second, or as new as its events. */
  keepUp(often) {
    this.pace = often ? REFRESH_MS : POLL_LIVE_MS;
    if (this.open && this.state.status) this.#plan(this.#pause());
  }

  /** Ask and listen, from now on. */
  async start() {
    this.open = true;
    await this.refresh();
    this.#seen(!document.hidden);
  }

  /** Ask and listen no more; what was known is forgotten. */
  stop() {
    this.open = false;
    clearTimeout(this.timer);
    this.#hang();
    this.#set({ status: null, link: "waiting" });
  }

  /** Ask for the status now. */
  async refresh() {
    if (this.asking) {
      this.askAgain = true;
      return;
    }
    this.asking = true;
    this.askAgain = false;
    let answer = {};
    try {
      answer = { status: await get("/v1/fleet"), answeredAt: new Date() };
    } catch (error) {
      answer = { failed: error };
    }
    this.asking = false;
    if (!this.open) return;
    if (answer.failed instanceof NotLoggedIn) {
      this.stop();
      this.onLoggedOut();
      return;
    }
    if (answer.failed) console.warn(String(answer.failed));
    const { failed, ...news } = answer;
    this.#set({ ...news, link: failed ? "lost" : this.streaming ? "live" : "polling" });
    this.#plan(this.askAgain ? REFRESH_MS : this.#pause());
  }

  /** Nobody sees a hidden page, and large fleets are asked for less often: a list is not read faster for being longer. */
  #pause() {
    const { status } = this.state;
    if (document.hidden) return POLL_LIVE_MS;
    if (!this.streaming || status?.kernels) return POLL_ALONE_MS;
    if (!status?.vehicles.length) return POLL_LIVE_MS;
    return status.vehicles.length > MANY ? Math.max(this.pace, 2 * REFRESH_MS) : this.pace;
  }

  #plan(delay) {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.refresh(), delay);
  }

  #set(changes) {
    this.state = { ...this.state, ...changes };
    for (const listener of this.listeners) {
      try {
        listener(this.state);
      } catch (error) {
        console.error(error); // what one part cannot show must not stop the page from asking
      }
    }
  }

  /** Browsers allow six connections to a host, so pages that nobody sees listen one at a time: the one that does can still
      sound and notify. A page that is seen listens in any case. */
  #seen(visible) {
    this.hidden?.abort();
    this.hidden = null;
    if (!this.open) return;
    if (visible || !navigator.locks) {
      this.#listen();
      if (visible && this.state.status) this.refresh();
      return;
    }
    this.#hang();
    this.hidden = new AbortController();
    const { signal } = this.hidden;
    navigator.locks.request("wingwatch listens unseen", { signal }, () => {
      this.#listen();
      return new Promise((over) => signal.addEventListener("abort", over));
    }).catch(() => {}); // seen before its turn came
  }

  /** End the stream; a new one goes on after the last event. */
  #hang() {
    clearTimeout(this.reopening);
    this.stream?.close();
    this.stream = null;
    this.streaming = false;
  }

  #somethingNew() {
    if (document.hidden) this.refresh(); // timers of hidden pages come late
    if (this.soon) return;
    this.soon = true;
    setTimeout(() => {
      this.soon = false;
      if (this.open) this.refresh();
    }, REFRESH_MS);
  }

  /** The browser itself comes back with `Last-Event-ID` after a stream that broke off, but not after a refusal. */
  #listen() {
    if (!this.open || (this.stream && this.stream.readyState !== EventSource.CLOSED)) return;
    const kinds = this.followed ? "alert,status,manoeuvre,derivatives" : "alert,status,manoeuvre";
    const stream = new EventSource(withQuery("/v1/events",
      { kinds, derivatives_of: this.followed, last_event_id: this.lastEventId }));
    this.stream = stream;
    stream.onopen = () => {
      this.streaming = true;
      this.refresh();
    };
    stream.onerror = () => {
      if (stream !== this.stream) return;
      this.streaming = false;
      if (!this.open) return;
      this.#plan(POLL_ALONE_MS);
      if (stream.readyState === EventSource.CLOSED) this.reopening = setTimeout(() => this.#listen(), BACK_MS);
    };
    for (const kind of KINDS) {
      stream.addEventListener(kind, (event) => {
        if (event.lastEventId) this.lastEventId = event.lastEventId;
        this.#somethingNew();
        const handlers = this.handlers.get(kind);
        if (handlers.size) {
          const data = JSON.parse(event.data);
          for (const handler of handlers) handler(data);
        }
      });
    }
  }
}
