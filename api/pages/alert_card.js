/* An alert as a card: what, how sure, the evidence, what people did. Groups of alerts that are one event, too. */

import { make } from "./dom.js";
import { clockTime, percent, plusMinus, fixed, sentence, signed, sizeOf, symbol, vehicleName, vehiclePath, words } from "./format.js";
import { Z_BAND, alertTag, channelTag, facts, scale, tableHead, tag, urgency } from "./parts.js";

const LEAST_EVIDENCE = 3;

function evidenceRow(part) {
  return make("tr", "",
    make("th", "", { scope: "row" }, symbol(part.derivative), make("small", "", part.meaning)),
    make("td", "number", { data: { label: "measured" } }, plusMinus(part.estimate, part.standard_error, part.unit)),
    make("td", "number", { data: { label: "expected" } }, plusMinus(part.expected, part.expected_standard_error, part.unit)),
    make("td", "z", make("div", "", scale(part.z, false), make("span", "number", signed(part.z)))));
}

function evidenceTable(parts) {
  return make("table", "evidence", make("caption", "hidden", "Evidence"), tableHead(["Derivative", "Measured", "Expected", "z"]),
    make("tbody", "", ...parts.map(evidenceRow)));
}

/** The derivatives that speak for the alert stand open, the others fold away; at least the first three stand open. */
export function evidence(parts) {
  const speaks = (part, place) => place < LEAST_EVIDENCE || part.z === null || Math.abs(part.z) >= Z_BAND;
  const open = parts.filter(speaks), folded = parts.filter((part, place) => !speaks(part, place));
  const nodes = open.length ? [evidenceTable(open)] : [];
  if (folded.length) {
    const more = folded.length === 1 ? "1 more derivative is" : `${folded.length} more derivatives are`;
    nodes.push(make("details", "", make("summary", "", `${more} within ${Z_BAND} standard errors`), evidenceTable(folded)));
  }
  return nodes;
}

/** Causes that are possible, likeliest first. */
function candidates(all) {
  const items = all.map((one) => {
    const probability = make("b", "number", one.probability === null ? "unknown" : percent(one.probability));
    const cause = make("span", "", words(one.cause));
    if (one.channel !== null) cause.append(" ", channelTag(one.channel));
    return make("li", "", probability, cause);
  });
  return make("div", "candidates", make("p", "soft", "Possible causes"), make("ol", "", ...items));
}

/** What an alert says of itself: text, figures, possible causes, what people noted, the report of its diagnosis. */
export function alertAbout(alert) {
  const nodes = [
    make("p", "text", alert.text),
    facts("figures", [
      sizeOf(alert) ?? ["Size", "not known"],
      ["Probability", alert.probability === null ? "" : percent(alert.probability)],
      ["Kind", alert.kind === alert.cause ? "" : alert.kind],
      ["Raised, on its clock", `${fixed(alert.raised_s, 1)} s`],
      ["Cleared, on its clock", alert.cleared_s === null ? "" : `${fixed(alert.cleared_s, 1)} s`],
      ["Came back", alert.repeats ? (alert.repeats === 1 ? "once" : `${alert.repeats} times`) : ""],
      ["Shelved until", alert.shelved_until_at_s === null ? "" : clockTime(alert.shelved_until_at_s)],
      ["Compared with", `${alert.basis} expectation`],
    ])];
  if (alert.candidates.length) nodes.push(candidates(alert.candidates));
  if (alert.notes.length) nodes.push(make("ul", "notes", ...alert.notes.map((note) => make("li", "", note))));
  if (alert.diagnosis_id) {
    const path = `/v1/diagnoses/${encodeURIComponent(alert.diagnosis_id)}/report`;
    nodes.push(make("p", "soft", make("a", "", { href: path }, "Report of the diagnosis")));
  }
  return nodes;
}

/** The evidence in the open, or folded away where there are other things to look at first. */
function proof(alert, folded) {
  const nodes = evidence(alert.evidence);
  if (!folded || !nodes.length) return nodes;
  const count = alert.evidence.length === 1 ? "1 derivative" : `${alert.evidence.length} derivatives`;
  return [make("details", "", make("summary", "", `Evidence: ${count}`), ...nodes)];
}

/** One alert. `more` gives further nodes of an alert, such as what a person may do. */
export function alertCard(alert, more = () => [], folded = false) {
  const tone = alert.state === "cleared" ? "cleared" : alert.level;
  const heading = make("h3", "", `${sentence(alert.cause)} on `, make("a", "", { href: vehiclePath(alert) }, vehicleName(alert)));
  if (alert.channel !== null) heading.append(" ", channelTag(alert.channel));
  return make("li", "card", { data: { tone, alert: alert.id } },
    make("div", "head", heading, ...more(alert), alertTag(alert)),
    make("div", folded ? "" : "sides", make("div", "", ...alertAbout(alert)), make("div", "", ...proof(alert, folded))));
}

/** Alerts of several vehicles that are one event, theirs folded away. */
export function groupCard(group, more) {
  const names = group.vehicles.map((name) => name.replace(/^default\//, "").replace("/", " / "));
  const what = group.kind === "icing" ? "Ice" : words(group.kind);
  return make("li", "card group", { data: { tone: group.level } },
    make("div", "head", make("h3", "", `${what} on ${names.length} aircraft`), tag("degraded", group.level, group.level)),
    make("p", "text", group.text), make("p", "soft", names.join(", ")),
    make("details", "", make("summary", "", `${group.members.length} alerts`),
      make("ol", "alerts", ...group.members.map((alert) => alertCard(alert, more)))));
}

/** Alerts as they are listed, most urgent first and newest first among equals; those of a group stand in it, at the place
    of its most urgent one. */
export function alertEntries(alerts, groups) {
  const found = new Map(), inOrder = [...alerts].sort((a, b) => urgency(a) - urgency(b));
  for (const alert of inOrder) {
    const group = groups.find((one) => one.id === alert.group);
    if (!group) found.set(alert.id, alert);
    else if (found.has(group.id)) found.get(group.id).members.push(alert);
    else found.set(group.id, { ...group, members: [alert] });
  }
  return [...found.values()];
}
