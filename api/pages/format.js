/* Numbers, errors, units and names as they are read. */

import { make } from "./dom.js";

const GREEK = { eta: "η", xi: "ξ", zeta: "ζ" };

/** A name of the vocabulary as words. */
export function words(name) {
  return String(name ?? "").replaceAll("_", " ");
}

/** The same with a capital letter in front. */
export function sentence(name) {
  const text = words(name);
  return text.charAt(0).toUpperCase() + text.slice(1);
}

export function fixed(value, digits) {
  return value.toFixed(Math.min(Math.max(digits, 0), 9)).replace("-", "−");
}

export function number(value, significant = 3) {
  if (value === null || value === undefined) return "unknown";
  return String(Number(value.toPrecision(significant))).replace("-", "−");
}

/** A value with its standard error, both to the error's second significant digit. */
export function plusMinus(value, error, unit = "", scale = 1) {
  if (value === null) return "unknown";
  if (error === null || !(error > 0)) return number(value * scale) + tail(unit);
  const digits = 1 - Math.floor(Math.log10(error * scale));
  return `${fixed(value * scale, digits)} ± ${fixed(error * scale, digits)}${tail(unit)}`;
}

export function signed(z) {
  if (z === null) return "unknown";
  const text = fixed(Math.abs(z), 1);
  return (text === "0.0" ? "" : z > 0 ? "+" : "−") + text;
}

/** A probability in per cent that never claims certainty. */
export function percent(probability) {
  if (probability > 0.999) return "above 99.9 %";
  return probability < 0.001 ? "below 0.1 %" : `${number(100 * probability)} %`;
}

/** A unit as it is printed behind a number; nothing for a fraction. */
export function tail(unit) {
  return unit ? ` ${unit.replace(/([a-z])2/g, "$1²")}` : "";
}

/** A duration in the largest unit that says enough: 0.4 s, 12 s, 3 min, 2 h, 5 d. */
export function duration(seconds) {
  if (seconds < 9.95) return `${fixed(Math.max(seconds, 0), 1)} s`;
  if (seconds < 119.5) return `${fixed(seconds, 0)} s`;
  if (seconds < 7170) return `${fixed(seconds / 60, 0)} min`;
  return seconds < 172800 ? `${fixed(seconds / 3600, 0)} h` : `${fixed(seconds / 86400, 0)} d`;
}

/** Wall-clock time of seconds since 1970, with the day where it is not today's. */
export function clockTime(seconds) {
  const at = new Date(1000 * seconds), time = at.toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });
  return at.toDateString() === new Date().toDateString() ? time : `${at.toLocaleDateString()} ${time}`;
}

/** A symbol such as m_w with its index below. */
export function symbol(name) {
  const [row, index] = String(name).split("_");
  const node = make("span", "symbol", row);
  if (index) node.append(make("sub", "", GREEK[index] ?? index));
  return node;
}

/** What a cause takes away as a fraction, which is shown in per cent; null for other causes. */
export function lost(cause) {
  if (cause.endsWith("_effectiveness")) return "Effectiveness lost";
  return cause === "thrust_loss" ? "Thrust lost" : null;
}

/** Causes that are there or not, and have no size. */
export const SIZELESS = ["surface_stuck", "sensor_freeze"];

/** An alert's size as its name and its figure; null where it is not known. */
export function sizeOf(alert) {
  const { value, standard_error: error } = alert.size;
  if (value === null) return null;
  if (SIZELESS.includes(alert.cause)) return ["Size", ""];
  if (lost(alert.cause)) return [lost(alert.cause), plusMinus(value, error, "%", 100)];
  return [alert.cause === "icing" ? "Icing severity η" : "Size", plusMinus(value, error)];
}

/** A vehicle as people name it: its fleet stands before it unless it is the default one. */
export function vehicleName({ fleet, vehicle }) {
  return fleet === "default" ? vehicle : `${fleet} / ${vehicle}`;
}

/** The path of a vehicle's view. */
export function vehiclePath({ fleet, vehicle }) {
  const query = fleet === "default" ? "" : `?fleet=${encodeURIComponent(fleet)}`;
  return `/vehicles/${encodeURIComponent(vehicle)}${query}`;
}
