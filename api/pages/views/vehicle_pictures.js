/* Derivatives over time: the large picture of one of them, small ones of all, and what moves and zooms them. */

import { withQuery } from "../api.js";
import { make, setAttributes, setText } from "../dom.js";
import { duration, fixed, symbol, tail } from "../format.js";
import { colours, onColours } from "./vehicle_colours.js";
import { figure } from "./vehicle_figure.js";
import { Plot } from "./vehicle_plot.js";
import { ESTIMATORS, History } from "./vehicle_series.js";
import { pictureTable } from "./vehicle_tables.js";
import { Tiles, listed, rowsOf, zOf } from "./vehicle_tiles.js";

const WINDOWS = [["2 min", 120], ["10 min", 600], ["1 h", 3600], ["Flight", Infinity]];
const FIRST_WINDOW_S = 600, LEAST_WINDOW_S = 5, ZOOM = 2, SHIFT = 0.5;
const READ_MS = 200;
const FIRST = ["m_q", "z_w", "l_p", "n_v"];  // shown first while nothing stands out
const PHONE_PX = 640;

function meaningOf(history, chosen) {
  return [...history.overview.values()].find((one) => one.derivative === chosen.derivative && one.structure === chosen.structure)?.meaning ?? "";
}

function unitOf(current, chosen) {
  const unit = rowsOf(current, chosen).find(Boolean)?.unit;
  return unit ? `, ${tail(unit).trim().replaceAll(" ", "\u00a0")}` : "";
}

export class Pictures {
  constructor(path, owner) {
    this.path = path;
    this.owner = owner;
    this.history = new History(path, owner.fleet);
    this.evidence = { blocks: [], marks: [], threshold: null };
    this.manoeuvres = [];
    this.current = null;
    this.chosen = null;
    this.picked = false;  // a person has chosen a derivative
    this.suspect = null;  // the derivative that an alert in force rests on most
    this.window = FIRST_WINDOW_S;
    this.follows = true;
    this.range = null;
    this.began = this.closed = false;
    this.readTimer = 0;
    this.tiles = new Tiles((chosen) => this.#choose(chosen));
    this.#build();
    this.plot = new Plot(this.canvas, () => this.#figure(), (range) => this.#moved(range));
    this.endColours = onColours(() => this.plot.draw(true));
  }

  #build() {
    const button = (text, label, onclick) => make("button", "", { type: "button", "aria-label": label, title: label, onclick }, text);
    this.windows = WINDOWS.map(([text, seconds]) => make("button", "", { type: "button", "aria-pressed": "false",
      onclick: () => this.#follow(seconds) }, text));
    this.flights = make("select", "", { "aria-label": "Flight", hidden: true, onchange: () => this.#chooseFlight() });
    this.csv = make("a", "csv", { download: true, href: "#" }, "CSV");
    this.title = make("h3", "", { id: "picture-title" });
    this.canvas = make("div", "plot", { id: "picture" });
    this.frame = make("div", "frame", { tabindex: "0", role: "img", "aria-labelledby": "picture-title picture-says", id: "picture-frame",
      onkeydown: (event) => this.#key(event) }, this.canvas);
    this.says = make("p", "soft says", { id: "picture-says" });
    this.table = make("details", "fold", { ontoggle: () => this.#tabulate() }, make("summary", "", "The picture's numbers as a table"), make("div", ""));
    const legend = make("ul", "legend", ...ESTIMATORS.map(([name, label]) => make("li", name, label)), make("li", "expected", "expected"),
      make("li", "bands", "bands hold 95 %"));
    this.nothing = make("p", "soft", "No derivative has been estimated yet.");
    this.shown = make("div", "", { hidden: true },
      make("div", "bar", make("div", "group", ...this.windows),
        make("div", "group", button("◀", "Earlier", () => this.#shift(-SHIFT)), button("▶", "Later", () => this.#shift(SHIFT)),
          button("−", "Zoom out", () => this.#zoom(ZOOM)), button("+", "Zoom in", () => this.#zoom(1 / ZOOM))),
        this.flights, this.csv),
      make("div", "card picture", make("div", "head", this.title, legend), this.frame, this.says, this.table),
      this.tiles.node);
    this.node = make("section", "pictures", { "aria-label": "Derivatives over time" }, make("h2", "", "Derivatives over time"),
      this.nothing, this.shown);
  }

  /** Take in what blocks, alerts and manoeuvres there were. */
  take(evidence, manoeuvres) {
    this.evidence = evidence;
    this.manoeuvres = manoeuvres;
    this.#show();
  }

  /** Take in the current derivatives, and read what is new of the history. */
  async tick(current) {
    this.current = current;
    if (this.history.begunAnew) {
      this.history.choose(null);
      this.began = false;
      this.follows = true;
    }
    if (!this.began) {
      this.#showFlights(await this.history.readFlights());
      this.#followOn();
      if (this.range) await this.history.readOverview(this.range[0]);
      this.began = true;
    } else if (this.history.live) await this.history.readNews(this.follows);
    this.history.take(current);
    if (this.closed) return;
    if (this.chosen === null || !this.picked) this.#chooseFirst();
    if (this.chosen === null) return;
    if (this.follows) this.#followOn();
    if (this.history.kept && (this.history.detail.size === 0 || (this.follows && this.history.crowded))) await this.#read();
    this.#show();
  }

  /** Until a person chooses: what an alert rests on most; else the derivative that is furthest off as both estimators
      have it, if one is; else a usual one. */
  #chooseFirst() {
    const all = listed(this.current);
    const size = (one) => Math.min(...rowsOf(this.current, one).map((row) => Math.abs(zOf(row) ?? 0)));
    const suspect = all.find((one) => one.derivative === this.suspect);
    const far = suspect ?? all.filter((one) => size(one) >= 3).sort((a, b) => size(b) - size(a))[0];
    const usual = FIRST.map((name) => all.find((one) => one.derivative === name)).find(Boolean);
    const best = far ?? this.chosen ?? usual ?? all[0] ?? null;
    if (far) this.picked = true;  // it stays: a picture that changes by itself cannot be read
    if (best && best.derivative !== this.chosen?.derivative) {
      this.chosen = best;
      this.history.detail.clear();
    }
  }

  #choose(chosen) {
    this.picked = true;
    this.chosen = chosen;
    this.history.detail.clear();
    this.#readDetail();
    this.#show(true);
  }

  #showFlights(flights) {
    this.flights.hidden = flights.length < 2;
    this.flights.replaceChildren(...flights.map((one, place) => {
      const began = one.began_at_s === null ? "" : `, ${new Date(1000 * one.began_at_s).toLocaleString()}`;
      const text = `${place === 0 ? "this flight" : `flight ${one.flight}`}${began}, ${duration(one.last_time_s - one.first_time_s)}`;
      return make("option", "", { value: String(one.flight) }, text);
    }));
  }

  async #chooseFlight() {
    const flight = Number(this.flights.value);
    this.history.choose(flight === this.history.flights[0]?.flight ? null : flight);
    this.window = this.history.live ? FIRST_WINDOW_S : Infinity;
    this.follows = true;
    this.#followOn();
    await this.#read();
  }

  /** The last so many seconds, and on with the flight. */
  #follow(seconds) {
    this.window = seconds;
    this.follows = true;
    this.#followOn();
    this.#read();
    this.#show(true);
  }

  #followOn() {
    const span = this.history.span;
    if (!span) return;
    const from = Math.max(span[0], span[1] - this.window);
    this.range = [from, Math.max(span[1], from + LEAST_WINDOW_S)];
  }

  #moved([from, to]) {
    this.follows = false;
    this.range = [Number(from), Number(to)];
    clearTimeout(this.readTimer);
    this.readTimer = setTimeout(() => this.#read(), READ_MS);
    this.#show(true);
  }

  #shift(part) {
    if (!this.range) return;
    const by = part * (this.range[1] - this.range[0]);
    this.#moved(this.range.map((edge) => edge + by));
  }

  #zoom(factor) {
    if (!this.range) return;
    const middle = (this.range[0] + this.range[1]) / 2;
    const half = Math.max(LEAST_WINDOW_S, (this.range[1] - this.range[0]) * factor) / 2;
    this.#moved([middle - half, middle + half]);
  }

  #key(event) {
    const does = { ArrowLeft: () => this.#shift(-SHIFT / 2), ArrowRight: () => this.#shift(SHIFT / 2), "+": () => this.#zoom(1 / ZOOM),
      "-": () => this.#zoom(ZOOM), Home: () => this.#follow(Infinity), End: () => this.#follow(FIRST_WINDOW_S) }[event.key];
    if (!does || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    does();
  }

  /** Read what the pictures show: the chosen derivative in detail, and thinly all of them. */
  async #read() {
    await this.#readDetail();
    if (!this.range || !this.history.kept) return;
    try {
      await this.history.readOverview(this.range[0], this.follows ? null : this.range[1]);
      this.#show();
    } catch (error) {
      console.warn(String(error));
    }
  }

  async #readDetail() {
    if (!this.chosen || !this.range || !this.history.kept) return;
    const { chosen, range } = this;
    const margin = (range[1] - range[0]) * SHIFT;
    try {
      const read = await this.history.readDetail(chosen.derivative, range[0] - margin, this.follows ? null : range[1] + margin);
      if (read && chosen === this.chosen) this.#show(true);
    } catch (error) {
      console.warn(String(error));
    }
  }

  #show(atOnce = false) {
    if (this.closed || !this.chosen || !this.range) return;
    const { chosen, range } = this;
    this.nothing.hidden = true;
    this.shown.hidden = false;
    this.windows.forEach((one, k) => setAttributes(one, { "aria-pressed": String(this.follows && WINDOWS[k][1] === this.window) }));
    const meaning = meaningOf(this.history, chosen), unit = unitOf(this.current, chosen);
    const fingerprint = `${chosen.structure}/${chosen.derivative}/${meaning}`;
    if (this.titled !== fingerprint) {
      this.titled = fingerprint;
      this.title.replaceChildren(symbol(chosen.derivative), " ", make("small", "soft", `${meaning}${unit}`));
    }
    setText(this.says, `${fixed(range[0], 0)} to ${fixed(range[1], 0)} s${this.follows && this.history.live ? ", going on" : ""}. Drag to move; − and + or the keys zoom.`);
    this.csv.href = withQuery(`${this.path}/derivatives/history.csv`, { fleet: this.owner.fleet, flight: this.history.shown?.flight,
      from: range[0], to: this.follows ? null : range[1] });
    this.csv.hidden = !this.history.kept;
    this.tiles.update(this.history, this.current, range, this.#marks(), chosen);
    this.#tabulate();
    this.plot.draw(atOnce);
  }

  /** Marks are of the newest flight's clock. */
  #marks() {
    return this.history.live ? this.evidence.marks : [];
  }

  #tabulate() {
    if (!this.table.open || !this.chosen || !this.range) return;
    this.table.lastElementChild.replaceChildren(pictureTable(this.history.detail, this.chosen, this.range));
  }

  #figure() {
    if (!this.chosen || !this.range) return null;
    const live = this.history.live;
    const shown = this.history.detail.size ? this.history.detail : this.history.overview;
    return figure({ shown, chosen: this.chosen, range: this.range, blocks: live ? this.evidence.blocks : [], marks: this.#marks(),
      threshold: this.evidence.threshold, manoeuvres: live ? this.manoeuvres : [], shades: colours(),
      narrow: this.canvas.clientWidth < PHONE_PX });
  }

  close() {
    this.closed = true;
    clearTimeout(this.readTimer);
    this.endColours();
    this.plot.close();
  }
}
