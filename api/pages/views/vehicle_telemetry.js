/* Telemetry's health: rate, gaps and delay of the last ten minutes, and what was not used, by reason and by channel. */

import { drawn, make } from "../dom.js";
import { duration, fixed, number, words } from "../format.js";
import { channelTag, facts, tableHead } from "../parts.js";

const WIDTH = 600, HEIGHT = 46;

/** A time in milliseconds where it is short. */
function short(seconds) {
  if (seconds === null) return "";
  return seconds < 1 ? `${number(1000 * seconds, 3)} ms` : duration(seconds);
}

/** A bar a second: how much of something there was. */
function strip(seconds, value, title, text) {
  const most = Math.max(...seconds.map((one) => value(one) ?? 0), 1e-9);
  const wide = WIDTH / Math.max(seconds.length, 60);
  const shape = seconds.map((one, k) => {
    const tall = ((value(one) ?? 0) / most) * HEIGHT;
    return `M${(k * wide).toFixed(2)} ${HEIGHT}v${(-tall).toFixed(1)}h${(0.85 * wide).toFixed(2)}v${tall.toFixed(1)}z`;
  }).join("");
  return make("figure", "strip", make("figcaption", "", title, make("span", "number", text(most))),
    drawn("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none", "aria-hidden": "true" }, drawn("path", { d: shape })));
}

function rejectedTable(byChannel) {
  const rows = Object.entries(byChannel).filter(([, count]) => count > 0).sort((a, b) => b[1] - a[1]);
  if (!rows.length) return make("p", "soft", "No reading of a channel was refused.");
  return make("table", "", make("caption", "hidden", "Readings refused, by channel"), tableHead(["Channel", "Readings refused"]),
    make("tbody", "", ...rows.map(([name, count]) => make("tr", "", make("th", "", { scope: "row" }, channelTag(name)),
      make("td", "number", { data: { label: "readings refused" } }, String(count))))));
}

/** All of it. */
export function telemetry(document) {
  const refused = Object.entries(document.counts).filter(([name, count]) => name !== "accepted" && count > 0);
  const { seconds } = document;
  return make("div", "",
    facts("figures", [
      ["Rate", document.rate_hz === null ? "unknown" : `${fixed(document.rate_hz, 1)} Hz`],
      ["Usual step", short(document.step_s)],
      ["Gaps, last ten minutes", String(document.gaps)],
      ["Longest gap", document.gaps ? short(document.longest_gap_s) : ""],
      ["Delay beyond the fastest", short(document.delay_s)],
      ["Longest delay", short(document.longest_delay_s)],
      ["Silent for", document.silent_s !== null && document.silent_s > 2 ? duration(document.silent_s) : ""],
      ["Samples accepted", String(document.counts.accepted ?? 0)],
      ["Not used", refused.map(([name, count]) => `${count} ${words(name)}`).join(", ") || "nothing"],
    ]),
    seconds.length ? make("div", "strips",
      strip(seconds, (one) => one.samples, "Samples a second", (most) => `up to ${fixed(most, 0)}`),
      strip(seconds, (one) => one.longest_step_s, "Longest step", (most) => `up to ${short(most)}`),
      strip(seconds, (one) => one.delay_s, "Delay beyond the fastest", (most) => `up to ${short(most)}`)) : null,
    rejectedTable(document.rejected_by_channel));
}
