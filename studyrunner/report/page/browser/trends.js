// What comes out in the end along one axis of the study, and over two: the slider of the cycles changes nothing here.
"use strict";

const trends = data.trends || [];
const trend = { quantity: 0, axis: 0, mapped: 0, across: 0, up: 0, drawn: {} };
const LEFT = { align: "left" };
const DECADES = 30; // largest over smallest value from which an axis is logarithmic
const MOST_TICKS = 8;
const MOST_MARKERS = 2000; // of the other combinations: each takes time to draw

for (const entry of trends) {
  entry.values = decode(entry.data);
  entry.wrong = entry.errors && decode(entry.errors);
}

// Samples are no axis of a trend.
const trended = varying.filter((axis) => axes[axis].label !== "sample");
// Axes that a quantity is known over: not the frequency of a peak. First those that the response does not show already.
function axesOf(entry) {
  const shown = (axis) => axis === data.horizontal || data.lines.includes(axis);
  const found = trended.filter((axis) => entry.sizes[axis] > 1);
  return [...found.filter((axis) => !shown(axis)), ...found.filter(shown)];
}

const indexIn = (entry, found) => entry.sizes.reduce((index, size, axis) => index * size + (size > 1 ? found[axis] : 0), 0);
// Whether it was found by searching through the frequencies.
const isSearched = (entry) => entry.sizes.some((size, axis) => size !== sizes[axis]);
const mappable = trends.filter((entry) => axesOf(entry).length > 1);

function shortText(axis, place) {
  const value = axes[axis].values[place];
  return axes[axis].words ? value : digits(value, 9);
}

// The value with its error or why there is none, and what varies.
function trendText(entry, found) {
  const named = varying.filter((axis) => entry.sizes[axis] > 1)
    .map((axis) => plain(`${axes[axis].label} ${withUnit(shortText(axis, found[axis]), axes[axis].unit)}`));
  const index = indexIn(entry, found);
  const value = entry.values[index] * entry.factor;
  const wrong = entry.wrong ? entry.wrong[index] * entry.factor : NaN;
  const point = pointAt(found);
  const why = isSearched(entry) ? ": no peak inside the frequencies computed" : known(point, cycles.length - 1) ? "" : `: ${sentence(point)}`;
  const error = Number.isFinite(wrong) ? ` ± ${digits(wrong, 2)}` : "";
  const told = Number.isFinite(value) ? withUnit(`${digits(value, 4)}${error}`, entry.unit) : `not known${why}`;
  return [plain(told).replace(/(.{40,}?) /g, "$1<br>"), ...named].join("<br>");
}

// Lines of a quantity along an axis: places of their points, for every combination of the other axes.
function trendLines(entry, axis) {
  let lines = [places(state.point)];
  for (const other of axesOf(entry).filter((each) => each !== axis)) {
    lines = lines.flatMap((line) => axes[other].values.map((_, place) => line.with(other, place)));
  }
  return lines.map((line) => ordered(axis).map((place) => line.with(axis, place)));
}

function trendAxis(axis) {
  const { label, unit, values, words } = axes[axis];
  const least = Math.min(...values);
  const log = !words && label !== "frequency" && least > 0 && Math.max(...values) / least > DECADES;
  const named = words || values.length <= MOST_TICKS;
  return axisLayout(titled(label, unit), {
    type: log ? "log" : "linear",
    ...(words ? { range: [-0.4, values.length - 0.6] } : {}),
    ...(named ? { tickvals: words ? values.map((_, place) => place) : values, ticktext: values.map((_, place) => plain(shortText(axis, place))) } : {}),
  });
}

function drawTrend() {
  const entry = trends[trend.quantity];
  const { axis } = trend;
  const picked = places(state.point);
  const at = (found) => (axes[axis].words ? found[axis] : axes[axis].values[found[axis]]);
  const value = (found) => entry.values[indexIn(entry, found)] * entry.factor;
  const wrong = (found) => (entry.wrong ? entry.wrong[indexIn(entry, found)] * entry.factor : NaN);
  const own = ordered(axis).map((place) => picked.with(axis, place));
  const others = trendLines(entry, axis).filter((line) => indexIn(entry, line[0]) !== indexIn(entry, own[0]));
  const bad = own.filter((found) => !Number.isFinite(value(found)));
  // one trace of all the others, a gap after each line
  const gapped = (of) => others.flatMap((line) => [...line.map(of), null]);
  const drawn = (points) => ({ customdata: points.map(pointAt), text: points.map((found) => trendText(entry, found)), hovertemplate: "%{text}<extra></extra>", hoverlabel: LEFT });
  const low = Math.min(0, ...Array.from(entry.values).filter(Number.isFinite)) * entry.factor;
  const traces = [];
  if (others.length) {
    traces.push({
      x: gapped(at), y: gapped(value), customdata: gapped(pointAt), text: gapped((found) => trendText(entry, found)), mode: others.length * own.length > MOST_MARKERS ? "lines" : "lines+markers",
      hovertemplate: "%{text}<extra></extra>", hoverlabel: LEFT, name: "other combinations", meta: "others", line: { color: PALE, width: 1 }, marker: { color: PALE, size: 4 },
    });
  }
  traces.push({
    x: own.map(at), y: own.map(value), ...drawn(own), mode: "lines+markers", name: "as picked", meta: "trend",
    line: { color: data.colours[0], width: 2.5 }, marker: { color: data.colours[0], size: 8 },
    error_y: { type: "data", array: own.map((found) => wrong(found) || 0), visible: own.some((found) => wrong(found) > 0), color: data.colours[1], thickness: 1.5, width: 5 },
  });
  if (bad.length) {
    traces.push({
      x: bad.map(at), y: bad.map(() => low), ...drawn(bad), mode: "markers", name: "not known", cliponaxis: false, meta: "failed",
      marker: { color: INK, size: 9, symbol: "x-thin", line: { color: INK, width: 2 } },
    });
  }
  traces.push({
    x: [at(picked)], y: [Number.isFinite(value(picked)) ? value(picked) : low], mode: "markers", hoverinfo: "skip", name: "picked",
    showlegend: false, cliponaxis: false, meta: "picked", marker: { symbol: "circle-open", size: 17, color: INK, line: { width: 2.5 } },
  });
  Plotly.react("trend-plot", traces, layout({
    height: 380, uirevision: `${trend.quantity} ${axis}`, legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 }, showlegend: true,
    xaxis: trendAxis(axis), yaxis: axisLayout(titled(entry.label, entry.unit), { rangemode: "tozero" }),
  }), CONFIG);
  const bars = isSearched(entry) ? "Bars: distance of the peak from the nearest frequency computed." : "Bars: estimated error.";
  byId("trend-hint").textContent = [TOUCH ? "Touch a point to pick it." : "Click a point to pick it.", entry.wrong ? bars : ""].join(" ");
}

// Cells stand side by side, whatever the distances of their values.
function cellAxis(axis) {
  const order = ordered(axis);
  const step = Math.ceil(order.length / MOST_TICKS);
  const named = order.map((_, i) => i).filter((i) => i % step === 0);
  return axisLayout(titled(axes[axis].label, axes[axis].unit), {
    range: [-0.5, order.length - 0.5], showgrid: false, tickvals: named, ticktext: named.map((i) => plain(shortText(axis, order[i]))),
  });
}

function drawTrendMap() {
  const entry = mappable[trend.mapped];
  const { across, up } = trend;
  const picked = places(state.point);
  const columns = ordered(across);
  const rows = ordered(up);
  const cells = rows.map((row) => columns.map((column) => picked.with(across, column).with(up, row)));
  const value = (found) => entry.values[indexIn(entry, found)] * entry.factor;
  // One scale for all combinations of the other axes, so that the lists show what changes.
  const finite = Array.from(entry.values).filter(Number.isFinite).map((each) => each * entry.factor);
  const traces = [{
    type: "heatmap", z: cells.map((line) => line.map(value)), customdata: cells.map((line) => line.map(pointAt)), meta: "map",
    text: cells.map((line) => line.map((found) => trendText(entry, found))), hovertemplate: "%{text}<extra></extra>", hoverlabel: LEFT, xgap: 1, ygap: 1,
    zmin: Math.min(0, ...finite), zmax: Math.max(0, ...finite) || 1, colorscale: "Cividis",
    colorbar: { title: { text: plain(titled(entry.label, entry.unit)), side: "right" }, thickness: 14, outlinewidth: 0 },
  }];
  const bad = cells.flat().filter((found) => !Number.isFinite(value(found)));
  const place = (found) => ({ x: found.map((each) => columns.indexOf(each[across])), y: found.map((each) => rows.indexOf(each[up])) });
  if (bad.length) {
    traces.push({
      ...place(bad), mode: "markers", customdata: bad.map(pointAt), text: bad.map((found) => trendText(entry, found)),
      hovertemplate: "%{text}<extra></extra>", hoverlabel: LEFT, meta: "failed", marker: { color: INK, size: 9, symbol: "x-thin", line: { color: INK, width: 2 } },
    });
  }
  traces.push({
    ...place([picked]), mode: "markers", hoverinfo: "skip", meta: "picked",
    marker: { symbol: "circle", size: 11, color: PAPER, line: { color: INK, width: 2.5 } },
  });
  Plotly.react("trend-map-plot", traces, layout({
    height: 380, showlegend: false, uirevision: `${trend.mapped} ${across} ${up}`, xaxis: cellAxis(across), yaxis: cellAxis(up),
  }), CONFIG);
  const rest = axesOf(entry).filter((axis) => axis !== across && axis !== up);
  byId("trend-map-hint").textContent = rest.length ? `At ${rest.map((axis) => `${axes[axis].label} ${axisText(axis, picked[axis])}`).join(", ")}.` : "";
}

// What depends on the point alone is not drawn again for each cycle.
function drawTrends() {
  const draw = { trend: drawTrend, map: drawTrendMap };
  const key = { trend: [state.point, trend.quantity, trend.axis], map: [state.point, trend.mapped, trend.across, trend.up] };
  for (const name of ["trend", "map"]) {
    if (!(name === "trend" ? trends : mappable).length || trend.drawn[name] === String(key[name])) continue;
    trend.drawn[name] = String(key[name]);
    draw[name]();
  }
}

// List of axes; what the chosen quantity is not known over cannot be chosen.
function addAxisChoice(parent, name, label, choose) {
  const select = addChoice(parent, name, label, trended.map((axis) => axes[axis].label), 0, (i) => { choose(trended[i]); drawTrends(); });
  return (entry, axis) => {
    trended.forEach((each, i) => { select.options[i].disabled = entry.sizes[each] === 1; });
    select.value = String(trended.indexOf(axis));
  };
}

function prepareTrends() {
  byId("trend-part").hidden = !trends.length;
  byId("trend-map-part").hidden = !mappable.length;
  if (!trends.length) return;
  const showAxis = () => {
    const known = axesOf(trends[trend.quantity]);
    if (!known.includes(trend.axis)) trend.axis = known[0];
    setAxis(trends[trend.quantity], trend.axis);
  };
  addChoice("trend-choice", "trend quantity", "quantity", trends.map((entry) => entry.label), 0, (i) => { trend.quantity = i; showAxis(); drawTrends(); });
  const setAxis = addAxisChoice("trend-choice", "trend axis", "along", (axis) => { trend.axis = axis; });
  trend.axis = axesOf(trends[0])[0];
  showAxis();
  if (!mappable.length) return;
  const showAxes = () => {
    const known = axesOf(mappable[trend.mapped]);
    if (!known.includes(trend.across)) trend.across = known.find((axis) => axis !== trend.up);
    if (!known.includes(trend.up)) trend.up = known.find((axis) => axis !== trend.across);
    setAcross(mappable[trend.mapped], trend.across);
    setUp(mappable[trend.mapped], trend.up);
  };
  addChoice("trend-map-choice", "trend map", "map of", mappable.map((entry) => entry.label), 0, (i) => { trend.mapped = i; showAxes(); drawTrends(); });
  // the same axis in both lists: they change places
  const setAcross = addAxisChoice("trend-map-choice", "trend across", "across", (axis) => {
    if (axis === trend.up) trend.up = trend.across;
    trend.across = axis;
    showAxes();
  });
  const setUp = addAxisChoice("trend-map-choice", "trend up", "up", (axis) => {
    if (axis === trend.across) trend.across = trend.up;
    trend.up = axis;
    showAxes();
  });
  [trend.across, trend.up] = axesOf(mappable[0]);
  showAxes();
}
