// The samples: what they draw against what is worn, bands, exceedance, and what decides; of the picked combination of the
// other axes. The slider of the cycles changes nothing here.
"use strict";

const { scatter } = data;
const scattered = { input: 0, along: 0, exceeded: 0, drawn: "" };
const GROUPS = ["samples", "lower group", "upper group", "between the groups"];
const GROUP_SYMBOLS = ["circle", "circle", "square", "diamond"];
const GROUP_COLOURS = [data.colours[0], data.colours[0], data.colours[1], GREY];
const SHADES = ["rgba(0, 114, 178, 0.18)", "rgba(0, 114, 178, 0.34)"];
const BAND = { mode: "lines", line: { width: 0 }, fill: "toself", hoverinfo: "skip" };
const N_QUANTILES = 5;
const LEGEND = { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 };

if (scatter) {
  for (const name of ["bands", "wrong", "gap"]) scatter[name] = decode(scatter[name]);
  for (const entry of scatter.measures) for (const name of ["data", "interval"]) entry[name] = decode(entry[name]);
  for (const entry of scatter.inputs) entry.values = decode(entry.data);
  for (const entry of scatter.exceedances) for (const name of ["at", "data", "interval"]) entry[name] = decode(entry[name]);
}

// Where the numbers of the combination of a point begin, counted in combinations; -1: not on this page.
const rowOf = (found) => scatter.held.indexOf(sizes.reduce((number, size, axis) => (axis === scatter.axis ? number : number * size + found[axis]), 0));

function drawnValue(entry, found) {
  const n = sizes[scatter.axis];
  const row = entry.values.length > n ? rowOf(found) : 0;
  return entry.values[row * n + found[scatter.axis]];
}

// What a sample has worn at the last count that it has reached, m3.
function wornOf(point) {
  for (let cycle = cycles.length - 1; cycle >= 0; cycle--) {
    const worn = course("worn_volume", point, cycle);
    if (Number.isFinite(worn)) return worn;
  }
  return NaN;
}

function groupOf(row, worn) {
  const [lower, upper] = scatter.gap.subarray(2 * row, 2 * row + 2);
  // a 32-bit number of the same sample is the same number
  return Number.isNaN(lower) ? 0 : worn <= lower ? 1 : worn >= upper ? 2 : 3;
}

function drawSamples(row, picked) {
  const entry = scatter.inputs[scattered.input];
  const points = axes[scatter.axis].values.map((_, place) => pointAt(picked.with(scatter.axis, place)));
  const across = (point) => drawnValue(entry, places(point)) * entry.factor;
  const error = data.points.error_estimate;
  const traces = GROUPS.map((name, number) => {
    const own = points.filter((point) => Number.isFinite(wornOf(point)) && groupOf(row, wornOf(point)) === number);
    const worn = own.map((point) => wornOf(point) * scatter.factor);
    const wrong = own.map((point, i) => (error && error.values[point] * worn[i]) || 0);
    return {
      x: own.map(across), y: worn, customdata: own, mode: "markers", name, meta: number ? `group ${number}` : "samples", showlegend: true,
      text: own.map((point, i) => plain(`${pointText(point)}: ${withUnit(digits(worn[i], 4), scatter.unit)}${wrong[i] ? ` ± ${digits(wrong[i], 2)}` : ""}`)),
      hovertemplate: "%{text}<extra></extra>", marker: { color: GROUP_COLOURS[number], symbol: GROUP_SYMBOLS[number], size: points.length > 300 ? 5 : 8 },
      error_y: { type: "data", array: wrong, visible: wrong.some((each) => each > 0) && points.length <= 300, color: PALE, thickness: 1, width: 0 },
    };
  }).filter((trace) => trace.x.length);
  traces.push({
    x: [across(state.point)], y: [wornOf(state.point) * scatter.factor], mode: "markers", hoverinfo: "skip", showlegend: false, meta: "picked",
    marker: { symbol: "circle-open", size: 17, color: INK, line: { width: 2.5 } }, cliponaxis: false,
  });
  Plotly.react("scatter-plot", traces, layout({
    height: 380, uirevision: `${row} ${scattered.input}`, legend: LEGEND, showlegend: traces.length > 2,
    xaxis: axisLayout(titled(entry.label, entry.unit)), yaxis: axisLayout("", { ...upright("worn volume", scatter.unit), rangemode: "tozero" }),
  }), CONFIG);
}

// Rows of bands that a plot over cycles or over the frequency shows: where each stands, and of what combination and count.
function bandRows(row, picked) {
  if (!scattered.along) return scatter.cycles.map((at, count) => ({ at, row, count }));
  const last = scatter.cycles.length - 1;
  return ordered(data.horizontal).map((place) => ({ at: axes[data.horizontal].values[place], row: rowOf(picked.with(data.horizontal, place)), count: last })).filter((each) => each.row >= 0);
}

function drawBands(row, picked) {
  const n = scatter.cycles.length;
  const rows = bandRows(row, picked);
  const value = (each, quantile, bound) => scatter.bands[((each.row * n + each.count) * N_QUANTILES + quantile) * 2 + bound] * scatter.factor;
  const wrong = (each, end) => scatter.wrong[(each.row * n + each.count) * 2 + end] * scatter.factor;
  const known = rows.flatMap((each) => [...Array(N_QUANTILES).keys()].map((quantile) => value(each, quantile, 0)));
  const worn = axes[scatter.axis].values.map((_, place) => wornOf(pointAt(picked.with(scatter.axis, place))) * scatter.factor).filter(Number.isFinite);
  const roof = 1.1 * Math.max(...known, ...worn) || 1;
  const at = rows.map((each) => each.at);
  const traces = [[0, 4, "5 to 95 %"], [1, 3, "25 to 75 %"]].map(([low, high, name], shade) => ({
    ...BAND, x: [...at, ...at.slice().reverse()], fillcolor: SHADES[shade], name, meta: name,
    y: [...rows.map((each) => value(each, low, 0)), ...rows.slice().reverse().map((each) => Math.min(value(each, high, 1), 2 * roof))],
  }));
  const line = { mode: at.length > 1 ? "lines" : "markers", hovertemplate: `%{y:.4~g} ${plain(scatter.unit)}<extra></extra>` };
  traces.push({ ...line, x: at, y: rows.map((each) => value(each, 2, 0)), name: "median", meta: "median", line: { color: data.colours[0], width: 2 } });
  [0, 1].forEach((end) => traces.push({
    ...line, x: at, y: rows.map((each) => (Number.isFinite(wrong(each, end)) ? wrong(each, end) : null)), name: "with numerical error", meta: "wrong",
    showlegend: end === 0, line: { color: data.colours[1], width: 1, dash: "dash" },
  }));
  const own = scattered.along ? ordered(data.horizontal).map((place) => pointAt(picked.with(data.horizontal, place))) : [];
  traces.push({
    ...line, name: "picked sample", meta: "picked", line: { color: INK, width: 1.5 },
    x: scattered.along ? at : cycles, y: scattered.along ? own.map((point) => wornOf(point) * scatter.factor) : cycles.map((_, cycle) => course("worn_volume", state.point, cycle) * scatter.factor),
  });
  const axis = axes[data.horizontal];
  Plotly.react("band-plot", traces, layout({
    height: 380, uirevision: `${row} ${scattered.along}`, legend: LEGEND, showlegend: true,
    xaxis: axisLayout(scattered.along ? titled(axis.label, axis.unit) : `${data.counted}s`), yaxis: axisLayout("", { ...upright("worn volume", scatter.unit), range: [0, roof] }),
  }), CONFIG);
}

function drawExceedance(row) {
  const entry = scatter.exceedances[scattered.exceeded];
  const n = entry.at.length;
  const at = Array.from(entry.at, (each) => each * entry.factor);
  const ends = (name, bound) => at.map((_, i) => entry[name][(row * n + i) * 2 + bound]);
  const line = { x: at, mode: "lines", showlegend: false, line: { color: data.colours[0], width: 2 }, hovertemplate: `more than %{x:.4~g} ${plain(entry.unit)}: %{y:.3~g}<extra></extra>` };
  const traces = [
    { ...BAND, x: [...at, ...at.slice().reverse()], y: [...ends("interval", 0), ...ends("interval", 1).reverse()], fillcolor: SHADES[0], name: `${100 * scatter.confidence} % confidence`, meta: "interval" },
    { ...line, y: ends("data", 0), meta: "exceedance" },
    { ...line, y: ends("data", 1), meta: "highest" },
  ];
  const depth = data.points.largest_wear_depth;
  const own = scattered.exceeded === 0 ? wornOf(state.point) : depth ? depth.values[state.point] : NaN;
  if (Number.isFinite(own)) traces.push({ x: [own * entry.factor, own * entry.factor], y: [0, 1], mode: "lines", name: "picked sample", meta: "picked", hoverinfo: "skip", line: { color: INK, width: 1.5 } });
  Plotly.react("exceedance-plot", traces, layout({
    height: 340, uirevision: `${row} ${scattered.exceeded}`, legend: LEGEND, showlegend: true,
    xaxis: axisLayout(titled(entry.label, entry.unit), { rangemode: "tozero" }), yaxis: axisLayout("", { ...upright("probability of more", ""), range: [0, 1.02] }),
  }), CONFIG);
}

function drawIndices(row) {
  const n = scatter.inputs.length;
  const names = scatter.inputs.map((entry) => plain(entry.label).replace(/(.{7,}?) /g, "$1<br>"));
  const shares = scatter.measures.length > 1;
  const traces = scatter.measures.map(({ name, words, data: values, interval }, colour) => {
    const end = (of, i, bound) => of[(row * n + i) * 2 + bound];
    const middle = names.map((_, i) => (end(values, i, 0) + end(values, i, 1)) / 2);
    return {
      type: "bar", x: names, y: middle, name: words, meta: name, marker: { color: data.colours[colour] }, hovertemplate: "%{y:.2f}<extra></extra>",
      error_y: { type: "data", symmetric: false, thickness: 1.2, width: 4, color: INK,
        array: middle.map((each, i) => Math.max(end(interval, i, 1) - each, 0) || 0), arrayminus: middle.map((each, i) => Math.max(each - end(interval, i, 0), 0) || 0) },
    };
  });
  Plotly.react("index-plot", traces, layout({
    height: 340, legend: LEGEND, showlegend: true, barmode: "group", xaxis: axisLayout("", { type: "category" }), yaxis: axisLayout("", { ...upright(shares ? "share of the variance" : "rank correlation", ""), range: [shares ? 0 : -1.02, 1.02] }),
  }), CONFIG);
}

function drawScatter() {
  if (!scatter || scattered.drawn === String([state.point, scattered.input, scattered.along, scattered.exceeded])) return;
  scattered.drawn = String([state.point, scattered.input, scattered.along, scattered.exceeded]);
  const picked = places(state.point);
  const row = rowOf(picked);
  byId("scatter-told").textContent = row < 0 ? "The scatter of this combination is not on this page." : scatter.told[row];
  byId("scatter-plots").hidden = row < 0;
  if (row < 0) return;
  drawSamples(row, picked);
  drawBands(row, picked);
  drawExceedance(row);
  drawIndices(row);
}

function prepareScatter() {
  byId("scatter-part").hidden = !scatter;
  if (!scatter) return;
  const choose = (name) => (i) => { scattered[name] = i; drawScatter(); };
  scattered.input = scatter.deciding[Math.max(rowOf(places(state.point)), 0)];
  addChoice("scatter-choice", "scatter input", "over", scatter.inputs.map((entry) => entry.label), scattered.input, choose("input"));
  const axis = axes[data.horizontal];
  const overCourse = sizes[data.horizontal] > 1 && data.horizontal !== scatter.axis && !axis.words;
  addChoice("band-choice", "band along", "over", [`${data.counted}s`, ...(overCourse ? [`${axis.label}, last count`] : [])], 0, choose("along"));
  addChoice("exceedance-choice", "exceedance of", "probability of more", scatter.exceedances.map((entry) => entry.label), 0, choose("exceeded"));
  byId("scatter-hint").textContent = TOUCH ? "Touch a sample to pick it." : "Click a sample to pick it: its root, its maps and its numbers are shown.";
}
