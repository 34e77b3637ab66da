/* Colours of the pictures, by the page's style sheet, so that dark, light and print follow it. */

const NAMES = ["ink", "soft", "line", "card", "band", "bad", "watch", "blind", "fourier", "ekf", "expected", "expected-line"];

/** The colours as they are now, by name. */
export function colours() {
  const style = getComputedStyle(document.documentElement);
  return Object.fromEntries(NAMES.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

/** A colour of six digits with a transparency. */
export function faint(colour, opacity) {
  const digits = /^#(..)(..)(..)$/.exec(colour);
  if (!digits) return colour;
  return `rgba(${digits.slice(1).map((two) => parseInt(two, 16)).join(",")},${opacity})`;
}

/** Call `listener` when light becomes dark or the other way round; returns the function that ends it. */
export function onColours(listener) {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  dark.addEventListener("change", listener);
  return () => dark.removeEventListener("change", listener);
}
