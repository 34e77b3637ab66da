/* Derivatives of one flight over time, as the service has them: all of them thinly for the small pictures, and the chosen
   one in detail for the large one. New estimates are added as they come; what is there is not asked for again. */

import { get, withQuery } from "../api.js";

const OVERVIEW_POINTS = 240, DETAIL_POINTS = 1200, NEWS_POINTS = 5000;
const FULL = 1.5;  // times as many points as asked for, and a part is thinned anew
const KINDS = ["time_s", "value", "standard_error", "outcome", "expected", "expected_standard_error"];

export const ESTIMATORS = [["fourier", "Fourier"], ["ekf", "Kalman filter"]];

/** Of what a series is. */
export function keyOf({ estimator, structure, derivative }) {
  return `${estimator}/${structure}/${derivative}`;
}

/** Without values: a series to which points can be added. */
function empty(series) {
  return { ...series, ...Object.fromEntries(KINDS.map((kind) => [kind, []])) };
}

/** Add the points of `news` that are later than all of `series`. */
function append(series, news) {
  const last = series.time_s.at(-1) ?? -Infinity;
  const from = news.time_s.findIndex((time) => time > last);
  if (from < 0) return;
  for (const kind of KINDS) series[kind].push(...news[kind].slice(from));
}

export class History {
  /** `path` of the vehicle's REST object; `fleet` its fleet. */
  constructor(path, fleet) {
    this.path = path;
    this.fleet = fleet;
    this.flights = [];
    this.flight = null;  // the newest, while null
    this.newest = null;  // its number, once it is known
    this.begunAnew = false;  // another flight has begun since
    this.kept = true;  // whether the service keeps a history
    this.overview = new Map();
    this.detail = new Map();
    this.last = -Infinity;
    this.turn = 0;
  }

  /** The flights of which estimates are kept, newest first. */
  async readFlights() {
    const answer = await get(withQuery(`${this.path}/flights`, { fleet: this.fleet }));
    this.flights = answer.items;
    this.kept = answer.kept;
    return this.flights;
  }

  /** The flight that is shown. */
  get shown() {
    return this.flights.find((one) => one.flight === this.flight) ?? this.flights[0] ?? null;
  }

  /** Whether the newest flight is shown, which may go on. */
  get live() {
    return this.flight === null || this.flight === this.flights[0]?.flight;
  }

  /** Show another flight, or the newest one anew. */
  choose(flight) {
    this.flight = flight;
    this.newest = null;
    this.begunAnew = false;
    this.overview.clear();
    this.detail.clear();
    this.last = -Infinity;
    this.turn += 1;
  }

  /** First and last time of the flight as far as they are known. */
  get span() {
    let first = this.shown?.first_time_s ?? Infinity, last = this.shown?.last_time_s ?? -Infinity;
    for (const one of this.overview.values()) {
      first = Math.min(first, one.time_s[0] ?? Infinity);
      last = Math.max(last, one.time_s.at(-1) ?? -Infinity);
    }
    return first <= last ? [first, last] : null;
  }

  /** Read all derivatives between two times, thinned; without `to` as far as they go. */
  async readOverview(from, to = null) {
    const answer = await this.#series({ from, to, points: OVERVIEW_POINTS });
    if (!answer) return;
    this.overview = new Map(answer.map((one) => [keyOf(one), one]));
    this.last = this.span?.[1] ?? this.last;
  }

  /** Read the named derivative between two times, in detail. */
  async readDetail(name, from, to) {
    const answer = await this.#series({ names: name, from, to, points: DETAIL_POINTS });
    if (answer) this.detail = new Map(answer.map((one) => [keyOf(one), one]));
    return answer !== null;
  }

  /** Read what is new of all derivatives; whether there is something. `follows` adds it to the detail, too. */
  async readNews(follows) {
    const from = Number.isFinite(this.last) ? this.last : null;
    const answer = await this.#series({ from, points: NEWS_POINTS });
    if (!answer) return false;
    const before = this.last;
    for (const one of answer) this.#add(one, follows);
    this.last = this.span?.[1] ?? this.last;
    return this.last > before;
  }

  /** Whether so much has been added that both are better read anew. */
  get crowded() {
    const full = (all, points) => [...all.values()].some((one) => one.time_s.length > FULL * points);
    return full(this.detail, DETAIL_POINTS) || full(this.overview, OVERVIEW_POINTS);
  }

  /** Take in the current derivatives, where no history is kept: what the page has seen is all there is then. */
  take(current) {
    if (this.kept || current.time_s === null) return;
    for (const [estimator, modes] of Object.entries(current.estimators)) {
      for (const [structure, mode] of Object.entries(modes)) {
        for (const [derivative, one] of Object.entries(mode.derivatives)) {
          this.#add({ estimator, structure, derivative, unit: one.unit, meaning: "", time_s: [current.time_s], value: [one.value],
            standard_error: [one.standard_error], outcome: [mode.outcome], expected: [one.expected ?? null],
            expected_standard_error: [one.expected_standard_error ?? null] }, true);
        }
      }
    }
    this.last = this.span?.[1] ?? this.last;
  }

  #add(one, follows) {
    const key = keyOf(one);
    if (!this.overview.has(key)) this.overview.set(key, empty(one));
    append(this.overview.get(key), one);
    if (!this.kept) this.detail.set(key, this.overview.get(key));
    else if (follows && this.detail.has(key)) append(this.detail.get(key), one);
  }

  /** Series from the service; null where they are of no use any more, or none are kept. */
  async #series(query) {
    if (!this.kept) return null;
    const turn = this.turn;
    const path = withQuery(`${this.path}/derivatives/series`, { fleet: this.fleet, flight: this.flight, ...query });
    const answer = await get(path);
    if (turn !== this.turn) return null;
    if (this.flight === null) {
      this.begunAnew ||= this.newest !== null && answer.flight !== this.newest;
      this.newest = answer.flight;
    }
    return answer.series;
  }
}
