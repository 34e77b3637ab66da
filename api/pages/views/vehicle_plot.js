/* Draws with plotly.js, which is loaded when the first picture comes into sight, and draws nothing that nobody sees. */

const SCRIPT = "/pages/plotly.js";
const LEAST_MS = 1000;

/** Where an element of these names is there, plotly.js and the map library in it add no style of their own, which the
    service's policy forbids; vehicle.css has what the pictures need of it. The second name changes with plotly.js, and
    the tests notice by the browser's complaint. */
const NO_STYLES = ["plotly.js-style-global", "9f215cf04c5486422605d13261cb87401f4e7763b6296af81e98efbc0130da53"];
const CONFIG = { displayModeBar: false, scrollZoom: false, doubleClick: false, responsive: false, displaylogo: false, showTips: false };

let loading = null;

/** plotly.js, loaded once. */
function plotly() {
  loading ??= new Promise((resolve, reject) => {
    for (const id of NO_STYLES) {
      const place = document.createElement("meta");
      place.id = id;
      place.className = "no-inline-styles";
      document.head.append(place);
    }
    const script = document.createElement("script");
    script.src = SCRIPT;
    script.onload = () => resolve(window.Plotly);
    script.onerror = () => {
      loading = null;
      reject(new Error("plotly.js could not be loaded"));
    };
    document.head.append(script);
  });
  return loading;
}

/** A picture at a node. `make()` gives data and layout, `onRange([from, to])` hears of a range that a person chose. */
export class Plot {
  constructor(node, make, onRange) {
    this.node = node;
    this.make = make;
    this.onRange = onRange;
    this.drawnAt = -Infinity;
    this.timer = 0;
    this.drawn = this.closed = this.seen = this.busy = false;
    this.sight = new IntersectionObserver((entries) => {
      this.seen = entries.at(-1).isIntersecting;
      if (this.seen) this.draw();
    }, { rootMargin: "200px" });
    this.sight.observe(node);
    this.size = new ResizeObserver(() => this.draw());
    this.size.observe(node);
    this.onVisible = () => this.draw();
    document.addEventListener("visibilitychange", this.onVisible);
  }

  /** Draw what there is now, at most once a second; `atOnce` when a person waits for it. */
  draw(atOnce = false) {
    if (this.closed || this.timer && !atOnce) return;
    clearTimeout(this.timer);
    const wait = atOnce ? 0 : Math.max(0, this.drawnAt + LEAST_MS - performance.now());
    this.timer = setTimeout(() => {
      this.timer = 0;
      this.#drawNow();
    }, wait);
  }

  async #drawNow() {
    if (this.closed || this.busy || !this.seen || document.hidden) return;
    const picture = this.make();
    if (!picture) return;
    this.busy = true;
    this.drawnAt = performance.now();
    try {
      const Plotly = await plotly();
      if (this.closed) return;
      await Plotly.react(this.node, picture.data, { ...picture.layout, width: this.node.clientWidth }, CONFIG);
      if (!this.drawn) this.node.on("plotly_relayout", (change) => this.#heard(change));
      this.drawn = true;
      this.node.dataset.drawn = String(Number(this.node.dataset.drawn ?? 0) + 1);
    } catch (error) {
      console.warn(String(error));
    } finally {
      this.busy = false;
    }
  }

  #heard(change) {
    const from = change["xaxis.range[0]"], to = change["xaxis.range[1]"];
    if (from !== undefined && to !== undefined) this.onRange([from, to]);
  }

  close() {
    this.closed = true;
    clearTimeout(this.timer);
    this.sight.disconnect();
    this.size.disconnect();
    document.removeEventListener("visibilitychange", this.onVisible);
    if (this.drawn) window.Plotly.purge(this.node);
  }
}
