/* What the page remembers of a reader's choices, in this browser; a browser that keeps nothing has the defaults. */

const PREFIX = "wingwatch.";

/** A choice as it was kept, or the default. */
export function kept(name, otherwise) {
  try {
    const text = localStorage.getItem(PREFIX + name);
    return text === null ? otherwise : JSON.parse(text);
  } catch {
    return otherwise;
  }
}

/** Keep a choice. */
export function keep(name, value) {
  try {
    localStorage.setItem(PREFIX + name, JSON.stringify(value));
  } catch {
    // it holds until the page is left
  }
}
