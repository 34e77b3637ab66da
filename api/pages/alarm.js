/* Sound and the browser's notifications for alerts of level warning and above. Both are off until somebody switches them
   on, and stay as they were switched in this browser. */

import { drawn } from "./dom.js";
import { sentence, vehicleName } from "./format.js";
import { keep, kept } from "./settings.js";
import { notice } from "./shell.js";

const LOUD = { warning: 1, critical: 2 };
const TONES = { 1: [660, 660], 2: [880, 660, 880] }; // Hz, one after another
const TONE_S = 0.16, GAP_S = 0.08, VOLUME = 0.2;
const SOUND = "M3 6v4h2.5l3.5 3V3L5.5 6zM11.5 5.5a3.5 3.5 0 0 1 0 5M13 3.5a6.4 6.4 0 0 1 0 9";
const BELL = "M3.5 12h9l-1.2-1.8V7a3.3 3.3 0 0 0-6.6 0v3.2zM6.8 13.8a1.3 1.3 0 0 0 2.4 0M8 3.5V2";

export class Alarm {
  /** `opened(alert)`: a notification was clicked. */
  constructor(opened) {
    this.opened = opened;
    this.loud = null;
    this.audio = null;
    this.sound = this.#button("sound", SOUND, "Sound for warnings", (on) => on && this.#play(1));
    this.notify = this.#button("notify", BELL, "Notifications for warnings", (on) => on && this.#permit());
    // browsers make no sound before somebody has touched the page
    const wake = () => kept("sound", false) && this.#context().resume();
    for (const kind of ["pointerdown", "keydown"]) document.addEventListener(kind, wake, { once: true });
  }

  /** Look at the alerts in force: those that are loud now and were not before are sounded and notified. Those that were
      there at the first look are not. */
  look(alerts) {
    if (!alerts) {
      this.loud = null;
      return;
    }
    const now = new Map(alerts.filter((alert) => alert.state === "active" && LOUD[alert.level])
      .map((alert) => [alert.id, { alert, mark: `${LOUD[alert.level]} ${alert.repeats}` }]));
    const before = this.loud;
    this.loud = now;
    if (!before) return;
    const fresh = [...now.values()].filter(({ alert, mark }) => before.get(alert.id)?.mark !== mark && !this.#calmer(alert, before)).map(({ alert }) => alert);
    if (!fresh.length) return;
    if (kept("sound", false)) this.#play(Math.max(...fresh.map((alert) => LOUD[alert.level])));
    if (kept("notify", false)) fresh.forEach((alert) => this.#tell(alert));
  }

  /** One whose level has only fallen. */
  #calmer(alert, before) {
    const earlier = before.get(alert.id)?.alert;
    return earlier && earlier.repeats === alert.repeats && LOUD[earlier.level] > LOUD[alert.level];
  }

  #button(name, path, label, switched) {
    const button = document.getElementById(name);
    button.append(drawn("svg", { viewBox: "0 0 16 16", "aria-hidden": "true" }, drawn("path", { d: path, fill: "none", stroke: "currentColor",
      "stroke-width": 1.3, "stroke-linecap": "round", "stroke-linejoin": "round" })));
    const show = () => {
      const on = kept(name, false);
      button.setAttribute("aria-pressed", String(on));
      button.title = `${label}: ${on ? "on" : "off"}`;
    };
    button.setAttribute("aria-label", label);
    button.addEventListener("click", () => {
      keep(name, !kept(name, false));
      show();
      switched(kept(name, false));
    });
    window.addEventListener("storage", show);
    show();
    return { show };
  }

  async #permit() {
    const answer = "Notification" in window ? await Notification.requestPermission() : "denied";
    if (answer === "granted") return;
    keep("notify", false);
    this.notify.show();
    notice("This browser does not let the page notify you; its settings for this site say so.");
  }

  #tell(alert) {
    if (!("Notification" in window) || Notification.permission !== "granted") return;
    const shown = new Notification(`${sentence(alert.cause)} on ${vehicleName(alert)}`,
      { body: alert.text, tag: `wingwatch ${alert.id}`, icon: "/pages/icon.svg", requireInteraction: alert.level === "critical" });
    shown.onclick = () => {
      window.focus();
      this.opened(alert);
    };
  }

  #context() {
    this.audio ??= new AudioContext();
    return this.audio;
  }

  #play(loudness) {
    const audio = this.#context();
    if (audio.state === "suspended") audio.resume();
    TONES[loudness].forEach((frequency, place) => {
      const from = audio.currentTime + 0.02 + place * (TONE_S + GAP_S), tone = audio.createOscillator(), volume = audio.createGain();
      tone.frequency.value = frequency;
      volume.gain.setValueAtTime(0, from);
      volume.gain.linearRampToValueAtTime(VOLUME, from + 0.01);
      volume.gain.setValueAtTime(VOLUME, from + TONE_S - 0.03);
      volume.gain.linearRampToValueAtTime(0, from + TONE_S);
      tone.connect(volume).connect(audio.destination);
      tone.start(from);
      tone.stop(from + TONE_S);
    });
    document.documentElement.dataset.sounded = String(Number(document.documentElement.dataset.sounded ?? 0) + 1);
  }
}
