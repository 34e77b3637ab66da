/* A grid of rows of one height of which only those near the screen are built. Screen readers hear how many there
   are and which one each is; arrows, page keys, Home and End go through all of them, Enter opens one. */

import { make, move } from "./dom.js";

const BEYOND = 6, LEAST = 12; // rows built above and below the screen; rows built wherever the screen is

export class WindowList {
  /** `columns`: titles. `key(item)`; `row(item)` builds `{node, update(item)}`; `opened(item)`: Enter or a click. */
  constructor({ label, columns, key, row, opened }) {
    this.key = key;
    this.row = row;
    this.opened = opened;
    this.items = [];
    this.built = new Map();
    this.active = null;
    this.head = make("div", "row head", { role: "row", "aria-rowindex": 1 },
      ...columns.map(([name, title]) => make("span", `c-${name}`, { role: "columnheader" }, title)));
    this.body = make("div", "rows", { role: "rowgroup" });
    this.node = make("div", "grid", { role: "grid", "aria-label": label, "aria-colcount": columns.length },
      make("div", "", { role: "rowgroup" }, this.head), this.body);
    this.body.addEventListener("keydown", (event) => this.#keyed(event));
    this.body.addEventListener("click", (event) => this.#clicked(event));
    this.body.addEventListener("focusin", (event) => this.#focused(event));
    this.look = () => this.#ask();
    this.paper = matchMedia("print");
    this.print = () => this.#draw();
    this.paper.addEventListener("change", this.print);
    window.addEventListener("scroll", this.look, { passive: true });
    window.addEventListener("resize", this.look, { passive: true });
  }

  /** Show these items. */
  set(items) {
    this.items = items;
    if (!items.some((item) => this.key(item) === this.active)) this.active = items.length ? this.key(items[0]) : null;
    this.node.setAttribute("aria-rowcount", items.length + 1);
    this.#draw();
  }

  /** Move the focus into the list, to the row where it was last. */
  focus() {
    this.#goTo(Math.max(this.items.findIndex((item) => this.key(item) === this.active), 0));
  }

  close() {
    window.removeEventListener("scroll", this.look);
    window.removeEventListener("resize", this.look);
    this.paper.removeEventListener("change", this.print);
    cancelAnimationFrame(this.asked);
  }

  #ask() {
    cancelAnimationFrame(this.asked);
    this.asked = requestAnimationFrame(() => this.#draw());
  }

  #draw() {
    const height = this.height = parseFloat(getComputedStyle(this.node).getPropertyValue("--row")) || 44;
    const whole = `${this.items.length * height}px`;
    if (this.body.style.height !== whole) this.body.style.height = whole;
    const top = this.body.getBoundingClientRect().top;
    const [first, last] = this.paper.matches ? [0, this.items.length] : this.#near(top, height);
    const stale = new Set(this.built.keys());
    this.items.forEach((item, place) => {
      const key = this.key(item);
      if ((place < first || place >= last) && key !== this.active) return; // the keyboard must find it
      stale.delete(key);
      this.#place(key, item, place, height);
    });
    for (const key of stale) {
      this.built.get(key).node.remove();
      this.built.delete(key);
    }
    this.#order();
  }

  /** The first row that is built, and the one after the last. */
  #near(top, height) {
    const first = Math.max(Math.min(Math.floor(-top / height) - BEYOND, this.items.length - LEAST), 0);
    return [first, Math.min(Math.max(Math.ceil((window.innerHeight - top) / height) + BEYOND, first + LEAST), this.items.length)];
  }

  #place(key, item, place, height) {
    let built = this.built.get(key);
    if (!built) {
      built = this.row(item);
      built.node.dataset.key = key;
      built.node.setAttribute("role", "row");
      this.built.set(key, built);
    }
    if (built.item !== item) built.update(item);
    built.item = item;
    const tab = key === this.active ? 0 : -1;
    if (built.node.tabIndex !== tab || !built.node.hasAttribute("tabindex")) built.node.tabIndex = tab;
    if (built.place === place && built.height === height) return;
    [built.place, built.height] = [place, height];
    built.node.setAttribute("aria-rowindex", place + 2);
    built.node.style.transform = `translateY(${place * height}px)`;
  }

  /** Rows stand in the document as they are seen: the Tab key and screen readers go by that. */
  #order() {
    const wanted = [...this.built.values()].sort((a, b) => a.place - b.place);
    wanted.forEach(({ node }, place) => {
      if (this.body.children[place] !== node) move(this.body, node, this.body.children[place] ?? null);
    });
  }

  #clicked(event) {
    const row = event.target.closest("[data-key]");
    const plain = event.button === 0 && !(event.ctrlKey || event.metaKey || event.shiftKey || event.altKey);
    if (!row || !plain || event.target.closest("a, button") || getSelection()?.toString()) return;
    this.opened(this.built.get(row.dataset.key).item);
  }

  #focused(event) {
    const row = event.target.closest("[data-key]");
    if (!row || row.dataset.key === this.active) return;
    const before = this.built.get(this.active);
    if (before) before.node.tabIndex = -1;
    this.active = row.dataset.key;
    row.tabIndex = 0;
  }

  #keyed(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || !event.target.matches("[data-key]")) return;
    const at = this.items.findIndex((item) => this.key(item) === this.active);
    const page = Math.max(Math.floor(window.innerHeight / this.height) - 2, 1);
    const steps = { ArrowDown: at + 1, ArrowUp: at - 1, PageDown: at + page, PageUp: at - page, Home: 0, End: this.items.length - 1 };
    if (event.key in steps) this.#goTo(steps[event.key]);
    else if (event.key === "Enter" && at >= 0) this.opened(this.items[at]);
    else return;
    event.preventDefault();
  }

  #goTo(place) {
    const to = Math.min(Math.max(place, 0), this.items.length - 1);
    if (to < 0) return;
    const before = this.built.get(this.active);
    if (before) before.node.tabIndex = -1;
    this.active = this.key(this.items[to]);
    const top = this.body.getBoundingClientRect().top + to * this.height, above = this.head.offsetHeight;
    if (top < above) window.scrollBy(0, top - above);
    else if (top + this.height > window.innerHeight) window.scrollBy(0, top + this.height - window.innerHeight);
    this.#place(this.active, this.items[to], to, this.height);
    const { node } = this.built.get(this.active);
    if (!node.parentNode) this.body.append(node);
    node.focus({ preventScroll: true });
    this.#draw();
  }
}
