/* The large picture as plotly takes it: one derivative with 95 % bands of both estimators over the band of what is
   expected, and below it, on the same time axis, innovation, excitation and the test's statistic of the blocks. */

import { fixed, tail, words } from "../format.js";
import { ESTIMATORS, keyOf } from "./vehicle_series.js";
import { faint } from "./vehicle_colours.js";

const BAND = 1.96;  // standard errors on either side that hold 95 % of a normal distribution
const STANDS = new Set(["converged", "settling"]);
const LEAST_RATIO = 0.05, MOST_RATIO = 100;  // of an innovation to its limit, as far as the strip reaches
const MOST_THRESHOLDS = 4;  // of the test's statistic, as far as its strip reaches
const DOMAINS = { value: [0.5, 1], innovation: [0.325, 0.435], excitation: [0.165, 0.265], statistic: [0, 0.105] };
const DASHES = { fourier: "solid", ekf: "solid" };

/** Outlines of a band, one closed line for each run of points that have one. */
export function outline(times, low, high) {
  const x = [], y = [];
  let start = 0;
  for (let end = 0; end <= times.length; end++) {
    const gap = end === times.length || low[end] === null || high[end] === null;
    if (!gap) continue;
    if (end > start) {
      if (x.length) { x.push(null); y.push(null); }
      const back = (list) => list.slice(start, end).reverse();
      x.push(...times.slice(start, end), ...back(times));
      y.push(...high.slice(start, end), ...back(low));
    }
    start = end + 1;
  }
  return { x, y };
}

function edge(series, value, error, sign) {
  return series[value].map((one, k) => (one === null || series[error][k] === null ? null : one + sign * BAND * series[error][k]));
}

function bandOf(series, value, error) {
  return outline(series.time_s, edge(series, value, error, -1), edge(series, value, error, 1));
}

function band(shape, colour, name, group, yaxis = "y") {
  return { type: "scatter", mode: "lines", ...shape, fill: "toself", fillcolor: colour, line: { width: 0 }, name, legendgroup: group,
    hoverinfo: "skip", showlegend: false, yaxis };
}

/** Values while the mode is known; others are null, and the line breaks there. */
function standing(series) {
  return series.value.map((value, k) => (STANDS.has(series.outcome[k]) ? value : null));
}

function estimatorTraces(series, label, colour) {
  const unit = tail(series.unit);
  const errors = series.standard_error.map((error) => (error === null ? "" : ` ± ${error.toPrecision(2)}`));
  const known = { ...series, value: standing(series) };
  return [
    band(bandOf(known, "value", "standard_error"), faint(colour, 0.2), `${label}, 95 %`, label),
    { type: "scatter", mode: "lines", x: series.time_s, y: series.value, line: { width: 1, color: faint(colour, 0.45), dash: "dot" },
      legendgroup: label, showlegend: false, hoverinfo: "skip", name: `${label}, not observable` },
    { type: "scatter", mode: "lines", x: series.time_s, y: known.value, text: errors,
      line: { width: 1.8, color: colour, dash: DASHES[series.estimator] }, name: label, legendgroup: label,
      hovertemplate: `${label} %{y:.4g}%{text}${unit}<extra></extra>` },
  ];
}

function expectedTraces(series, shades) {
  const errors = series.expected_standard_error.map((error) => (error === null ? "" : ` ± ${error.toPrecision(2)}`));
  return [
    band(bandOf(series, "expected", "expected_standard_error"), shades.expected, "Expected, 95 %", "Expected"),
    { type: "scatter", mode: "lines", x: series.time_s, y: series.expected, text: errors, name: "Expected", legendgroup: "Expected",
      line: { width: 1.2, color: shades["expected-line"], dash: "6px,3px" },
      hovertemplate: `Expected %{y:.4g}%{text}${tail(series.unit)}<extra></extra>` },
  ];
}

/** The range of the vertical axis: what is expected and what is known, without the errors of what is hardly known. */
export function valueRange(all) {
  const low = [], high = [];
  const take = (value, error) => {
    if (value === null || error === null) return;
    low.push(value - BAND * error);
    high.push(value + BAND * error);
  };
  const centres = all.flatMap((one) => [...standing(one), ...one.expected]).filter((value) => value !== null);
  const spread = centres.length ? Math.max(...centres) - Math.min(...centres) : 0;
  for (const one of all) {
    one.time_s.forEach((_, k) => {
      take(one.expected[k], one.expected_standard_error[k]);
      if (!STANDS.has(one.outcome[k])) return;
      const most = Math.max(spread, BAND * (one.expected_standard_error[k] ?? 0)) / BAND;
      take(one.value[k], most > 0 ? Math.min(one.standard_error[k] ?? 0, most) : one.standard_error[k]);
    });
  }
  if (!low.length) return null;
  const [least, most] = [Math.min(...low), Math.max(...high)];
  const margin = 0.06 * (most - least) || Math.abs(most) * 0.1 || 1;
  return [least - margin, most + margin];
}

/** A step from block to block, at its level from its start to its end. */
function steps(blocks, value) {
  const x = [], y = [];
  for (const block of blocks) {
    const level = value(block);
    x.push(block.start_s, block.end_s, null);
    y.push(level, level, null);
  }
  return { x, y };
}

function innovationTraces(blocks, structure, shades) {
  return ESTIMATORS.map(([estimator, label]) => {
    const ratio = (block) => {
      const mode = block.modes[structure]?.[estimator];
      if (!mode || mode.innovation === null) return null;
      return Math.min(Math.max(mode.innovation / mode.limit, LEAST_RATIO), MOST_RATIO);
    };
    return { type: "scatter", mode: "lines", ...steps(blocks, ratio), yaxis: "y2", showlegend: false, legendgroup: label,
      line: { width: 2.4, color: shades[estimator] }, name: `Innovation, ${label}`,
      hovertemplate: `Innovation ${label} %{y:.2g} of its 95 % limit<extra></extra>` };
  });
}

function excitationTraces(blocks, structure, shades) {
  const middle = blocks.map((block) => (block.start_s + block.end_s) / 2);
  return ESTIMATORS.map(([estimator, label], place) => ({
    type: "bar", x: middle, y: blocks.map((block) => block.modes[structure]?.[estimator]?.information_bit ?? null), yaxis: "y3",
    width: blocks.map((block) => 0.38 * (block.end_s - block.start_s)),
    offset: blocks.map((block) => (place - 1) * 0.4 * (block.end_s - block.start_s) + 0.01), showlegend: false, legendgroup: label,
    marker: { color: faint(shades[estimator], 0.75), line: { width: 0 } }, name: `Information, ${label}`,
    hovertemplate: `Information ${label} %{y:.1f} bit<extra></extra>`,
  }));
}

/** The test's statistic; far above the threshold it is drawn at the upper edge. */
function statisticTrace(blocks, most, shades) {
  const shown = (block) => (block.statistic === null ? null : Math.min(block.statistic, most));
  return { type: "scatter", mode: "lines", ...steps(blocks, shown), yaxis: "y4", showlegend: false,
    customdata: blocks.flatMap((block) => [block.statistic, block.statistic, null]),
    line: { width: 2.4, color: shades.ink }, name: "Test", hovertemplate: "Test %{customdata:.1f}<extra></extra>" };
}

function across(yref, y, shades) {
  return { type: "line", xref: "paper", x0: 0, x1: 1, yref, y0: y, y1: y, line: { width: 1, color: shades.bad, dash: "4px,3px" } };
}

function upright(time, colour, dash) {
  return { type: "line", xref: "x", x0: time, x1: time, yref: "paper", y0: 0, y1: 1, line: { width: 1.2, color: colour, dash } };
}

function label(time, text, colour, row) {
  return { xref: "x", x: time, yref: "paper", y: 1, yanchor: "bottom", yshift: 2 + 14 * row, xanchor: "left", showarrow: false, text,
    font: { size: 11, color: colour } };
}

/** Onset and alert of each mark inside the range: lines over all panels, words above. */
function marked(marks, [from, to], shades) {
  const shapes = [], annotations = [];
  const inside = (time) => time !== null && time >= from && time <= to;
  let row = 0;
  for (const mark of [...marks].reverse()) {
    const colour = mark.state === "cleared" ? shades.soft : mark.level === "watch" ? shades.blind : mark.level === "warning" ? shades.watch : shades.bad;
    const what = words(mark.cause) + (mark.channel ? ` (${mark.channel})` : "");
    const onset = inside(mark.onset_s), raised = inside(mark.raised_s);
    if (onset) shapes.push(upright(mark.onset_s, colour, "3px,3px"));
    if (raised) shapes.push(upright(mark.raised_s, colour, "solid"));
    if (onset) annotations.push(label(mark.onset_s, `${what} began ${fixed(mark.onset_s, 0)} s${raised ? `, alert ${fixed(mark.raised_s, 0)} s` : ""}`, colour, row));
    else if (raised) annotations.push(label(mark.raised_s, `${what}: alert ${fixed(mark.raised_s, 0)} s`, colour, row));
    if (inside(mark.cleared_s)) shapes.push(upright(mark.cleared_s, shades.soft, "1px,4px"));
    if (onset || raised) row += 1;
  }
  return { shapes, annotations, rows: Math.max(row, 1) };
}

/** Blocks in rough air, and manoeuvres: shaded where they were. */
function shaded(blocks, structure, manoeuvres, shades) {
  const bar = (from, to, [y0, y1], fillcolor) => ({ type: "rect", xref: "x", x0: from, x1: to, yref: "paper", y0, y1, fillcolor,
    line: { width: 0 }, layer: "below" });
  return [
    ...blocks.filter((block) => block.rough.includes(structure))
      .map((block) => bar(block.start_s, block.end_s, DOMAINS.innovation, faint(shades.soft, 0.12))),
    ...manoeuvres.map((one) => bar(one.begin_s, one.end_s, DOMAINS.excitation, faint(shades.watch, 0.16))),
  ];
}

function axis(shades, domain, more = {}) {
  return { domain, gridcolor: faint(shades.line, 0.7), zeroline: false, tickfont: { size: 11, color: shades.soft }, fixedrange: true, nticks: 5,
    automargin: false, linecolor: shades.line, showline: false, ...more };
}

/** What a panel shows, in words at its upper left. */
function heading(shades, text, [, top]) {
  return { xref: "paper", x: 0, xanchor: "left", yref: "paper", y: top, yanchor: "bottom", yshift: 1, showarrow: false, text,
    font: { size: 11, color: shades.soft } };
}

/** A series as it is now: points are added to the one that is shown, and plotly keeps what it was given. */
function copied(series) {
  return series && Object.fromEntries(Object.entries(series).map(([name, value]) => [name, Array.isArray(value) ? [...value] : value]));
}

/** Data and layout for plotly.

    `shown`: series of the chosen derivative by key; `chosen`: its structure and derivative; `range`: times; `blocks`,
    `marks`, `threshold` of the evidence; `manoeuvres`; `shades`: colours; `narrow`: a phone's width. */
export function figure({ shown, chosen, range, blocks, marks, threshold, manoeuvres, shades, narrow }) {
  const series = ESTIMATORS.map(([estimator, label]) => [copied(shown.get(keyOf({ ...chosen, estimator }))), label, shades[estimator]])
    .filter(([one]) => one);
  const [first] = series[0] ?? [];
  const inside = blocks.filter((block) => block.end_s >= range[0] && block.start_s <= range[1]);
  const most = MOST_THRESHOLDS * (threshold ?? 1);
  const data = [
    ...(first ? expectedTraces(first, shades) : []),
    ...series.flatMap(([one, label, colour]) => estimatorTraces(one, label, colour)),
    ...innovationTraces(inside, chosen.structure, shades), ...excitationTraces(inside, chosen.structure, shades),
    statisticTrace(inside, most, shades),
  ];
  const { shapes, annotations, rows } = marked(marks, range, shades);
  const limits = [across("y2", 1, shades), ...(threshold === null ? [] : [across("y4", threshold, shades)])];
  const headings = [
    heading(shades, narrow ? "innovation over its 95 % limit" : "normalised innovation of each block, over its 95 % limit", DOMAINS.innovation),
    heading(shades, narrow ? "excitation, bit" : "excitation: information of each block, bit; manoeuvres shaded", DOMAINS.excitation),
    heading(shades, narrow ? "test statistic" : "test statistic (log), alert at the dashed line", DOMAINS.statistic),
  ];
  const layout = {
    autosize: true, height: narrow ? 500 : 570, margin: { l: narrow ? 40 : 50, r: 12, t: 10 + 14 * rows, b: 38 },
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { family: "inherit", size: 12, color: shades.ink },
    hovermode: "x unified", hoverlabel: { bgcolor: shades.card, bordercolor: shades.line, font: { size: 12, color: shades.ink } },
    dragmode: "pan", bargap: 0, barmode: "overlay", uirevision: "vehicle", showlegend: false, hoversubplots: "axis",
    xaxis: { range, anchor: "y4", gridcolor: faint(shades.line, 0.7), zeroline: false, tickfont: { size: 11, color: shades.soft },
      title: { text: "s on the vehicle's clock", font: { size: 11, color: shades.soft }, standoff: 6 }, linecolor: shades.line,
      hoverformat: ".1f", ticksuffix: "", showspikes: true, spikemode: "across", spikethickness: 1, spikedash: "solid", spikecolor: shades.line },
    yaxis: axis(shades, DOMAINS.value, { range: valueRange(series.map(([one]) => one)) ?? undefined, nticks: 7 }),
    yaxis2: axis(shades, DOMAINS.innovation, { type: "log", range: [Math.log10(LEAST_RATIO), 2], tickvals: [0.1, 1, 10, 100],
      ticktext: ["0.1", "1", "10", "100"] }),
    yaxis3: axis(shades, DOMAINS.excitation, { rangemode: "tozero", nticks: 3 }),
    yaxis4: axis(shades, DOMAINS.statistic, { range: [-0.25 * most, 1.08 * most], nticks: 3 }),
    shapes: [...shaded(inside, chosen.structure, manoeuvres, shades), ...limits, ...shapes], annotations: [...annotations, ...headings],
  };
  return { data, layout };
}
