// All variables of the file in one panel: which one, over which dimension, coloured by which; a click picks a point.
"use strict";

const data = JSON.parse(document.getElementById("page-data").textContent);
const byId = (id) => document.getElementById(id);
const DARK = window.matchMedia("(prefers-color-scheme: dark)");
const [INK, PAPER, GRID, LINE] = DARK.matches ? ["#e8e8e8", "#181818", "#3a3a3a", "#9a9a9a"] : ["#1a1a1a", "#fff", "#e0e0e0", "#777"];
const COLOURS = DARK.matches
  ? ["#4ba3dc", "#e8823c", "#2fbf93", "#e8e8e8", "#dc9cbf", "#f0b73c", "#8accf0", "#b0b0b0"]
  : ["#0072b2", "#d55e00", "#009e73", "#000000", "#cc79a7", "#e69f00", "#56b4e9", "#777777"];
const DASHES = ["solid", "dash", "dot", "dashdot", "longdash", "longdashdot"];
const SYMBOLS = ["circle", "square", "triangle-up", "diamond", "triangle-down", "cross"];
const FONT = { family: "system-ui, Segoe UI, Roboto, Helvetica Neue, Arial, sans-serif", size: 13, color: INK };
const CONFIG = { responsive: true, displayModeBar: false };
const MOST_LINES = 10; // of more colours there is a map
const DECADES = 30; // largest over smallest value from which an axis is logarithmic

const decode = (text) => new Float32Array(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
const dims = Object.fromEntries(data.dims.map((dim) => [dim.name, dim]));
const variables = Object.fromEntries(data.variables.map((entry) => [entry.name, { ...entry, values: decode(entry.data) }]));
const size = (name) => dims[name].values.length;
// at: index along each dimension of the point that is picked
const state = { ...data.start, at: { ...data.at }, log: false };

// ---- numbers and words

function digits(value, count = 4) {
  if (value === null || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const large = Math.abs(value) >= 1e7 || Math.abs(value) < 1e-3;
  return large ? value.toExponential(count - 1).replace(/\.?0+e/, "e") : String(Number(value.toPrecision(count)));
}

const withUnit = (text, unit) => (unit && text !== "–" ? `${text}\u00a0${unit}` : text);
const titled = (text, unit) => (unit ? `${text} (${unit})` : text);
// plotly reads some HTML in texts, of which nothing is wanted
const plain = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
const wrapped = (text) => plain(text).replace(/(.{34,}?) /g, "$1<br>");

function place(name, index) {
  const { values, words, unit } = dims[name];
  return words ? values[index] : values[index] === null ? "not finite" : withUnit(digits(values[index], 9), unit);
}

// Where a value stands, by the index along each dimension.
const position = (entry, at) => entry.dims.reduce((index, name) => index * size(name) + at[name], 0);
const valueAt = (entry, at) => entry.values[position(entry, at)];
// Absolute error in the unit that is shown; NaN where there is none.
function errorAt(entry, at) {
  if (!entry.error) return NaN;
  const error = valueAt(variables[entry.error], at);
  return entry.factor * (entry.relative ? error * Math.abs(valueAt(entry, at)) : error);
}

function describeValue(entry, at) {
  const value = valueAt(entry, at) * entry.factor;
  if (entry.words[value] !== undefined) return entry.words[value];
  const error = errorAt(entry, at);
  const wrong = Number.isFinite(error) && error > 0 ? ` ± ${digits(error, 2)}` : "";
  return withUnit(digits(value) + wrong, Number.isFinite(value) ? entry.unit : "");
}

// ---- the plot

function axisLayout(title, more) {
  return { title: { text: wrapped(title), standoff: 8 }, gridcolor: GRID, zeroline: false, linecolor: LINE, ticks: "outside", tickcolor: LINE, exponentformat: "power", minexponent: 5, automargin: true, ...more };
}

const layout = (more) => ({ font: FONT, margin: { l: 60, r: 14, t: 12, b: 46 }, paper_bgcolor: PAPER, plot_bgcolor: PAPER, hovermode: "closest", separators: ".\u00a0", ...more });

// What runs along the horizontal axis: a dimension, or a coordinate along one. Its places, ascending unless they are words.
function along(name) {
  const coordinate = data.coords.find((each) => each.name === name);
  const dim = dims[coordinate ? coordinate.dim : name];
  const values = coordinate ? Array.from(decode(coordinate.data)) : dim.words ? dim.values.map((_, i) => i) : dim.values;
  const order = values.map((_, i) => i).filter((i) => values[i] !== null && Number.isFinite(values[i])).sort((a, b) => values[a] - values[b]);
  const words = !coordinate && dim.words;
  const least = Math.min(...order.map((i) => values[i]));
  const log = !words && name !== "frequency" && least > 0 && Math.max(...order.map((i) => values[i])) / least > DECADES;
  const title = coordinate ? titled(coordinate.label, coordinate.unit) : titled(dim.label, dim.unit);
  const ticks = words ? { tickvals: order, ticktext: order.map((i) => plain(dim.values[i])) } : {};
  return { dim: dim.name, values, order, scattered: Boolean(coordinate) || dim.name === "contact", axis: axisLayout(title, { type: log ? "log" : "linear", ...ticks }) };
}

function lineTraces(entry, x) {
  const colours = state.colour ? dims[state.colour].values.map((_, i) => i) : [null];
  return colours.map((number, i) => {
    const at = x.order.map((index) => ({ ...state.at, [x.dim]: index, ...(number === null ? {} : { [state.colour]: number }) }));
    const errors = at.map((each) => errorAt(entry, each) || 0);
    const colour = COLOURS[i % COLOURS.length];
    return {
      x: x.order.map((index) => x.values[index]), y: at.map((each) => valueAt(entry, each) * entry.factor),
      customdata: x.order.map((index) => [index, number]), text: at.map((each) => plain(describeValue(entry, each))),
      hovertemplate: `%{text}<br>${plain(dims[x.dim].label)} %{x}<extra>${number === null ? "" : plain(place(state.colour, number))}</extra>`,
      mode: x.scattered ? "markers" : "lines+markers", name: number === null ? plain(entry.name) : plain(place(state.colour, number)), meta: "line",
      line: { color: colour, width: 2, dash: DASHES[i % DASHES.length] }, marker: { color: colour, size: x.order.length > 60 ? 4 : 7, symbol: SYMBOLS[i % SYMBOLS.length] },
      error_y: { type: "data", array: errors, visible: errors.some((each) => each > 0), color: colour, thickness: 1, width: 3 },
    };
  });
}

function mapTrace(entry, x, y) {
  const at = y.order.map((row) => x.order.map((column) => ({ ...state.at, [x.dim]: column, [y.dim]: row })));
  return {
    type: "heatmap", x: x.order.map((i) => x.values[i]), y: y.order.map((i) => y.values[i]), z: at.map((line) => line.map((each) => valueAt(entry, each) * entry.factor)),
    customdata: y.order.map((row) => x.order.map((column) => [column, row])), text: at.map((line) => line.map((each) => plain(describeValue(entry, each)))),
    hovertemplate: "%{text}<br>%{x}, %{y}<extra></extra>", colorscale: "Cividis", meta: "map",
    colorbar: { title: { text: plain(entry.unit), side: "top" }, thickness: 14, outlinewidth: 0 },
  };
}

function drawPanel() {
  const entry = variables[state.variable];
  const x = along(state.x);
  const narrow = byId("panel").clientWidth < 600;
  const upright = titled(entry.name.replaceAll("_", " "), entry.unit);
  const isMap = state.colour && size(state.colour) > MOST_LINES;
  const y = isMap ? along(state.colour) : null;
  const traces = isMap ? [mapTrace(entry, x, y)] : lineTraces(entry, x);
  const here = valueAt(entry, state.at) * entry.factor;
  traces.push({
    x: [x.values[state.at[x.dim]]], y: [isMap ? y.values[state.at[y.dim]] : here], mode: "markers", hoverinfo: "skip", showlegend: false, meta: "picked", cliponaxis: false,
    marker: { symbol: "circle-open", size: 17, color: isMap ? "#fff" : INK, line: { width: 3 } },
  });
  const words = Object.entries(entry.words);
  const ticks = words.length ? { tickvals: words.map(([value]) => Number(value)), ticktext: words.map(([, word]) => plain(word)) } : {};
  const values = traces.flatMap((trace) => (trace.meta === "line" ? trace.y : [])).filter(Number.isFinite);
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const reach = Math.max(...traces.map((trace) => (trace.error_y ? Math.max(...trace.y.map((each, i) => each + trace.error_y.array[i]).filter(Number.isFinite)) : 0)));
  // zero is shown where it is near; error bars that leave the values too little room are cut
  const zero = low >= 0 && low <= 0.5 * high;
  const cut = zero && (reach > 2 * high || high === 0) ? { range: [0, 2 * high || 1] } : zero ? { rangemode: "tozero" } : {};
  Plotly.react("panel", traces, layout({
    height: narrow ? 360 : 460, showlegend: !isMap && Boolean(state.colour), legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 }, xaxis: x.axis,
    yaxis: isMap ? y.axis : axisLayout(upright, { type: state.log ? "log" : "linear", ...(state.log ? {} : cut), ...ticks }),
    dragmode: window.matchMedia("(pointer: coarse)").matches ? false : "zoom", uirevision: `${state.variable} ${state.x} ${state.colour} ${state.log}`,
  }), CONFIG);
}

// ---- the picked point

function describe() {
  const named = data.axes.filter((name) => size(name) > 1);
  const point = data.axes.reduce((number, name) => number * size(name) + state.at[name], 0);
  const where = named.map((name) => `${dims[name].label} ${place(name, state.at[name])}`).join(", ");
  const outcome = variables.outcome ? data.sentences[valueAt(variables.outcome, state.at)] : "";
  const message = data.messages[point] || "";
  byId("picked").textContent = [where && `${where}:`, outcome, message].filter(Boolean).join(" ");
  const rows = Object.values(variables).map((entry) => {
    const others = entry.dims.filter((name) => !data.axes.includes(name) && size(name) > 1).map((name) => `${dims[name].label} ${place(name, state.at[name])}`);
    const row = document.createElement("div");
    row.dataset.name = entry.name;
    row.appendChild(document.createElement("dt")).textContent = [entry.label, ...others].join(", ");
    row.appendChild(document.createElement("dd")).textContent = describeValue(entry, state.at);
    return row;
  });
  byId("numbers").replaceChildren(...rows);
}
