/* Makes DOM. Whatever was received goes in as text or as an attribute of ours: nothing received becomes markup. */

const SVG = "http://www.w3.org/2000/svg";

/** An element. A first child that is a plain object holds attributes: `on...` listens, `data` goes to the dataset,
    false and null leave an attribute out, true sets it empty. Strings become text. */
export function make(tag, className, ...children) {
  const node = document.createElement(tag);
  if (className) node.className = className;
  return fill(node, children);
}

/** The same in SVG; attributes come first. */
export function drawn(tag, attributes, ...children) {
  return fill(document.createElementNS(SVG, tag), [attributes, ...children]);
}

function fill(node, children) {
  const [first, ...rest] = children;
  const plain = first !== null && typeof first === "object" && Object.getPrototypeOf(first) === Object.prototype;
  if (plain) setAttributes(node, first);
  node.append(...(plain ? rest : children).filter((child) => child !== null && child !== undefined));
  return node;
}

/** Set attributes as `make` does. */
export function setAttributes(node, attributes) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (name === "data") Object.assign(node.dataset, value);
    else if (value === false || value === null || value === undefined) node.removeAttribute(name);
    else node.setAttribute(name, value === true ? "" : String(value));
  }
}

/** Text that is written only when it has changed. */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/** Bring a list's children in line with the items; a child is rebuilt only when what it shows has changed. */
export function sync(list, items, key, build) {
  const old = new Map([...list.children].map((node) => [node.dataset.key, node]));
  items.forEach((item, place) => {
    const fingerprint = JSON.stringify(item);
    let node = old.get(key(item));
    old.delete(key(item));
    if (!node || node.fingerprint !== fingerprint) {
      const fresh = build(item);
      fresh.dataset.key = key(item);
      fresh.fingerprint = fingerprint;
      if (node) takePlace(fresh, node);
      node = fresh;
    }
    if (list.children[place] !== node) move(list, node, list.children[place] ?? null);
  });
  old.forEach((node) => node.remove());
}

/** Put a node before another; one that had the focus keeps it. */
export function move(list, node, before) {
  const focused = node.contains(document.activeElement) ? document.activeElement : null;
  list.insertBefore(node, before);
  focused?.focus({ preventScroll: true });
}

/** Put a child in an older one's place; what the reader unfolded stays unfolded, and the focus stays where it was. */
export function takePlace(fresh, old) {
  const folds = fresh.querySelectorAll("details");
  old.querySelectorAll("details").forEach((fold, place) => {
    if (folds[place]) folds[place].open = fold.open;
  });
  const focused = old.contains(document.activeElement) ? pathTo(old, document.activeElement) : null;
  if (old.hasAttribute("tabindex")) fresh.tabIndex = old.tabIndex;
  old.replaceWith(fresh);
  if (focused === null) return;
  const target = at(fresh, focused) ?? fresh;
  if (target === fresh && !fresh.hasAttribute("tabindex")) fresh.tabIndex = -1;
  target.focus({ preventScroll: true });
}

const REACHED = "a[href], button, summary, input, select, textarea, [tabindex]";

function pathTo(root, node) {
  return root === node ? -1 : [...root.querySelectorAll(REACHED)].indexOf(node);
}

function at(root, place) {
  return place < 0 ? root : root.querySelectorAll(REACHED)[place];
}
