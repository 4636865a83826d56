// The plots of what is picked: response, course of the wear, maps and loops.
"use strict";

const DASHES = ["solid", "dash", "dot", "dashdot", "longdash", "longdashdot"];
const SYMBOLS = ["circle", "square", "triangle-up", "diamond", "triangle-down", "cross"];
const FONT = { family: "system-ui, Segoe UI, Roboto, Helvetica Neue, Arial, sans-serif", size: 12, color: "#1a1a1a" };
const CONFIG = { responsive: true, displayModeBar: false };
const TOUCH = window.matchMedia("(pointer: coarse)").matches;

function layout(more) {
  return {
    font: FONT,
    margin: { l: 64, r: 14, t: 12, b: 46 },
    paper_bgcolor: "#fff",
    plot_bgcolor: "#fff",
    hovermode: "closest",
    separators: ".\u00a0",
    dragmode: TOUCH ? false : "zoom",
    ...more,
  };
}

function axisLayout(title, more) {
  return {
    title: { text: plain(title), standoff: 8 },
    gridcolor: "#e0e0e0",
    zeroline: false,
    linecolor: "#777",
    ticks: "outside",
    tickcolor: "#777",
    exponentformat: "power",
    minexponent: 6,
    separatethousands: true,
    automargin: true,
    ...more,
  };
}

// Beside an axis the unit stands below the name: the plots are low.
const upright = (text, unit) => ({ title: { text: plain(text) + (unit ? `<br>(${plain(unit)})` : ""), standoff: 8 } });

// Places of the values of an axis as they are drawn: numbers ascend, words stay as in the file.
function ordered(axis) {
  const { values, words } = axes[axis];
  const order = values.map((_, place) => place);
  return words ? order : order.sort((a, b) => values[a] - values[b]);
}

// Lines of the response: every combination of the axes that are drawn as lines; the others are as in the picked point.
function responseLines() {
  let lines = [places(state.point)];
  for (const axis of data.lines) {
    lines = lines.flatMap((line) => axes[axis].values.map((_, place) => line.with(axis, place)));
  }
  return lines.map((line, number) => {
    const name = data.lines.map((axis) => `${axes[axis].label} ${axisText(axis, line[axis])}`).join(", ");
    return { name, number, points: ordered(data.horizontal).map((place) => pointAt(line.with(data.horizontal, place))) };
  });
}

function drawResponse() {
  const axis = axes[data.horizontal];
  const entry = courses.response_amplitude;
  const response = data.responses.length > 1 ? ` of ${data.responses[state.response]}` : "";
  byId("response-title").textContent = entry
    ? `Response${response} at ${cycleText(state.cycle)}`
    : "Points (the file holds no response_amplitude)";
  const written = (value) => (axis.words ? plain(value) : value);
  const at = (point) => written(axis.values[places(point)[data.horizontal]]);
  const value = (point, cycle) => (entry ? course("response_amplitude", point, cycle, state.response) * entry.factor : 0);
  const traces = [];
  let ghosts = false;
  let failures = false;
  // The line of the picked point comes last, on top: where lines meet, a click stays on it.
  const lines = responseLines().sort((a, b) => a.points.includes(state.point) - b.points.includes(state.point));
  lines.forEach((line) => {
    const number = line.number;
    const colour = data.colours[number % data.colours.length];
    const good = line.points.filter((point) => known(point, state.cycle));
    const bad = line.points.filter((point) => !known(point, state.cycle));
    if (entry && cycles.length > 1 && good.length) {
      traces.push({
        x: line.points.map(at), y: line.points.map((point) => value(point, 0)),
        mode: line.points.length > 1 ? "lines" : "markers", hoverinfo: "skip", name: plain(cycleText(0)),
        line: { color: "#8c8c8c", width: 1.5, dash: DASHES[number % DASHES.length] },
        marker: { color: "#8c8c8c", size: 6 }, showlegend: !ghosts, legendrank: 2000, meta: "first",
      });
      ghosts = true;
    }
    traces.push({
      x: line.points.map(at), y: line.points.map((point) => value(point, state.cycle)), customdata: line.points,
      text: line.points.map((point) => plain(pointText(point))), hovertemplate: `%{text}<br>amplitude %{y:.4~g} ${plain(entry ? entry.unit : "")}<extra></extra>`,
      mode: line.points.length > 1 ? "lines+markers" : "markers", name: plain(line.name || cycleText(state.cycle)),
      line: { color: colour, width: 2, dash: DASHES[number % DASHES.length] },
      marker: { color: colour, size: good.length > 60 ? 5 : 8, symbol: SYMBOLS[number % SYMBOLS.length] },
      showlegend: good.length > 0, legendrank: 1000 + number, meta: "response",
    });
    if (bad.length) {
      traces.push({
        x: bad.map(at), y: bad.map(() => 0), customdata: bad, mode: "markers", name: "no result",
        text: bad.map((point) => plain(`${pointText(point)}: ${sentence(point)}`).replace(/(.{50,}?) /g, "$1<br>")),
        hovertemplate: "%{text}<extra></extra>", showlegend: !failures, legendrank: 3000, cliponaxis: false,
        marker: { color: "#000", size: 9, symbol: "x-thin", line: { color: "#000", width: 2 } }, meta: "failed",
      });
      failures = true;
    }
  });
  traces.push({
    x: [at(state.point)], y: [known(state.point, state.cycle) ? value(state.point, state.cycle) : 0], mode: "markers",
    hoverinfo: "skip", name: "picked", legendrank: 1500, cliponaxis: false, meta: "picked",
    marker: { symbol: "circle-open", size: 17, color: "#000", line: { width: 2.5 } },
  });
  const words = axis.words ? { type: "category", categoryorder: "array", categoryarray: axis.values.map(written) } : {};
  byId("response-hint").textContent = varying.length
    ? (TOUCH ? "Touch a point to pick it." : "Click a point to pick it; drag to zoom in, double-click to zoom out.") + (failures ? " Crosses on the zero line: points without a value there." : "")
    : "The study has a single point.";
  Plotly.react("response-plot", traces, layout({
    height: 380, uirevision: `${state.response}`, legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 },
    xaxis: axisLayout(titled(axis.label, axis.unit), words),
    yaxis: axisLayout("", { ...(entry ? upright("amplitude", entry.unit) : {}), rangemode: "tozero" }),
  }), CONFIG);
}

function drawCourse() {
  const panels = [["worn_volume", "worn volume"], ["wear_rate", "wear rate"]].filter(([name]) => courses[name]);
  if (byId("course-part").hidden) return;
  if (!known(state.point, 0)) {
    sayInstead("course-plot", sentence(state.point));
    return;
  }
  const beside = byId("course-plot").clientWidth > 800;
  const domains = panels.length === 1 ? [[0, 1]] : beside ? [[0, 0.46], [0.54, 1]] : [[0.54, 1], [0, 0.46]];
  const traces = [];
  const own = cycles.map((_, cycle) => countAt(state.point, cycle));
  // a final state without slow time has no count: two marks side by side in place of a history
  const leaps = own.includes(Infinity);
  const across = leaps ? own.map((count) => (count === Infinity ? 1 : count === 0 ? 0 : null)) : own;
  const ticks = leaps ? { tickvals: [0, 1], ticktext: ["unworn", "final state"], range: [-0.3, 1.3] } : {};
  const shape = layout({
    height: beside ? 300 : 380, showlegend: Boolean(courses.exact_worn_volume), uirevision: "course",
    legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 },
  });
  panels.forEach(([name, title], i) => {
    const entry = courses[name];
    const suffix = i ? "2" : "";
    const place = { xaxis: `x${suffix}`, yaxis: `y${suffix}` };
    const scaled = (kind) => Array.from(cycles, (_, cycle) => course(kind, state.point, cycle) * entry.factor);
    const values = scaled(name);
    if (name === "worn_volume" && courses.worn_volume_error && !leaps) {
      const wrong = Array.from(cycles, (_, cycle) => course("worn_volume_error", state.point, cycle));
      const told = cycles.map((_, i) => i).filter((i) => Number.isFinite(values[i] * wrong[i]));
      const edge = (sign) => told.map((i) => Math.max(values[i] * (1 + sign * wrong[i]), 0));
      const at = told.map((i) => across[i]);
      traces.push({
        ...place, x: [...at, ...at.slice().reverse()], y: [...edge(1), ...edge(-1).reverse()], mode: "lines",
        fill: "toself", fillcolor: "rgba(0, 114, 178, 0.18)", line: { width: 0 }, hoverinfo: "skip", showlegend: false,
        name: "estimated error", meta: "worn_volume_error",
      });
    }
    traces.push({
      ...place, x: across, y: values, mode: cycles.length > 1 && !leaps ? "lines" : "markers", showlegend: false, meta: name, name: title,
      line: { color: data.colours[0], width: 2 }, marker: { color: data.colours[0], size: 10 }, hovertemplate: `${leaps ? "" : `${data.counted} %{x}<br>`}${title} %{y:.4~g} ${plain(entry.unit)}<extra></extra>`,
    });
    if (name === "worn_volume" && courses.exact_worn_volume) {
      traces.push({ ...place, x: across, y: scaled("exact_worn_volume"), mode: "lines", name: "exact", meta: "exact",
        line: { color: "#000", width: 1.5, dash: "dot" }, hoverinfo: "skip" });
    }
    traces.push({
      ...place, x: [across[state.cycle]], y: [values[state.cycle]], mode: "markers", hoverinfo: "skip", showlegend: false,
      marker: { symbol: "circle-open", size: 13, color: "#000", line: { width: 2.5 } }, cliponaxis: false, meta: "picked",
    });
    const alone = beside || i === panels.length - 1;
    shape[`xaxis${suffix}`] = axisLayout(alone && !leaps ? `${data.counted}s` : "", {
      ...ticks, anchor: `y${suffix}`, domain: beside ? domains[i] : [0, 1], showticklabels: alone, ...(i && !beside ? { matches: "x" } : {}),
    });
    shape[`yaxis${suffix}`] = axisLayout("", {
      ...upright(title, entry.unit), anchor: `x${suffix}`, domain: beside ? [0, 1] : domains[i], rangemode: "tozero",
    });
  });
  Plotly.react("course-plot", traces, shape, CONFIG);
}

// What stands in the place of a plot that there are no numbers for.
function sayInstead(id, text) {
  Plotly.react(id, [], layout({
    height: 120, xaxis: { visible: false }, yaxis: { visible: false },
    annotations: [{ text: plain(text).replace(/(.{40,}?) /g, "$1<br>"), showarrow: false, xref: "paper", yref: "paper", x: 0, y: 0.5, align: "left" }],
  }), CONFIG);
}

// Which values of the pairs the page holds: most at many cycles, the depth of the last count at that alone.
const pairsOf = (name) => (maps.variables[name].points ? maps.variables[name] : maps);
const heldPairs = (name) => held(pairsOf(name), state.point, state.cycle);
const isLast = (name) => name === "wear_depth_last";
const knownPairs = (name) => (isLast(name) ? !without.has(state.point) : known(state.point, state.cycle));
const pairsText = (name, found) => (isLast(name) ? "the last count" : cycleText(found ? found.cycle : state.cycle));
const sceneOf = (point) => maps.scenes.reduce((number, axis) => number * sizes[axis] + places(point)[axis], 0);

// Values of the pairs of a point at a cycle, and the largest of all its cycles; in the units of the file.
function pairValues(name, found) {
  const { values } = maps.variables[name];
  const { points, cycles: kept } = pairsOf(name);
  const nPairs = values.length / (points.length * kept.length);
  const start = found.row * kept.length * nPairs;
  let largest = 0;
  for (let i = start; i < start + kept.length * nPairs; i++) if (values[i] > largest) largest = values[i];
  return { largest, at: values.subarray(start + found.column * nPairs, start + (found.column + 1) * nPairs) };
}

function drawMaps() {
  if (!maps) return;
  const entry = maps.variables[state.map];
  const found = heldPairs(state.map);
  const panels = maps.panels[sceneOf(state.point)];
  byId("map-title").textContent = `Contact pairs at ${pairsText(state.map, found)}`;
  if (!found || !panels.length || !knownPairs(state.map)) {
    sayInstead("map-plot", knownPairs(state.map) ? "The maps of this point are not on this page." : lacking(state.point, state.cycle));
    return;
  }
  const { largest: most, at } = pairValues(state.map, found);
  // One scale for all cycles of the point, so that the slider shows what changes.
  const largest = state.map === "open_fraction" ? 1 : most * entry.factor || 1;
  const value = (pair) => (pair === null ? NaN : at[pair] * entry.factor);
  const hover = `pair %{customdata}<br>%{PLACE:.5~g} ${plain(entry.unit)}<extra></extra>`;
  const gap = 0.17 / Math.max(panels.length - 1, 1);
  const height = (1 - gap * (panels.length - 1)) / panels.length;
  const bars = panels.every((panel) => panel.kind === "bars");
  const shape = layout({ height: 60 + 160 * Math.max(panels.length, 2), annotations: [], showlegend: false, uirevision: "map" });
  if (!bars) {
    shape.coloraxis = { colorscale: "Cividis", cmin: 0, cmax: largest,
      colorbar: { title: { text: plain(entry.unit), side: "top" }, thickness: 14, outlinewidth: 0 } };
  }
  shape.margin.t = 28;
  const traces = panels.map((panel, i) => {
    const suffix = i ? String(i + 1) : "";
    const top = 1 - i * (height + gap);
    const domain = [Math.max(top - height, 0), top];
    const place = { xaxis: `x${suffix}`, yaxis: `y${suffix}`, name: plain(panel.title), meta: "map" };
    const last = i === panels.length - 1;
    const milli = (values) => values.map((metres) => metres * 1e3);
    shape.annotations.push({ text: plain(panel.title), showarrow: false, xref: "paper", yref: "paper", x: 0, y: top,
      xanchor: "left", yanchor: "bottom", font: { ...FONT, size: 13 } });
    shape[`xaxis${suffix}`] = axisLayout(last ? "along (mm)" : "", { anchor: `y${suffix}`, showgrid: false });
    shape[`yaxis${suffix}`] = axisLayout("", { ...upright("across", "mm"), anchor: `x${suffix}`, domain, showgrid: false });
    if (panel.kind === "grid") {
      shape[`yaxis${suffix}`].autorange = "reversed";
      return { ...place, type: "heatmap", x: milli(panel.x), y: milli(panel.y), coloraxis: "coloraxis", customdata: panel.pairs,
        z: panel.pairs.map((row) => row.map(value)), hovertemplate: hover.replace("PLACE", "z"), xgap: 1, ygap: 1 };
    }
    if (panel.kind === "scatter") {
      return { ...place, mode: "markers", x: milli(panel.x), y: milli(panel.y), customdata: panel.pairs,
        marker: { size: 15, color: panel.pairs.map(value), coloraxis: "coloraxis" }, hovertemplate: hover.replace("PLACE", "marker.color") };
    }
    Object.assign(shape[`xaxis${suffix}`], { title: { text: last ? "contact pair" : "" }, type: "category" });
    Object.assign(shape[`yaxis${suffix}`], { title: { text: plain(entry.unit) }, range: [0, 1.05 * largest] });
    return { ...place, type: "bar", x: panel.pairs.map(String), y: panel.pairs.map(value), customdata: panel.pairs,
      marker: { color: data.colours[0] }, hovertemplate: hover.replace("PLACE", "y"), width: panel.pairs.length < 4 ? 0.3 : 0.8 };
  });
  Plotly.react("map-plot", traces, shape, CONFIG);
}

function drawLoop() {
  if (!loops) return;
  const { loop_displacement: displacement, loop_force: force } = loops.variables;
  const found = held(loops, state.point, state.cycle);
  byId("loop-title").textContent = `Loop of pair ${loops.contacts[state.loop]} at ${cycleText(found ? found.cycle : state.cycle)}`;
  if (!found || !known(state.point, state.cycle)) {
    sayInstead("loop-plot", known(state.point, state.cycle) ? "The loops of this point are not on this page." : lacking(state.point, state.cycle));
    return;
  }
  const parts = loops.components.length;
  const closed = (entry, column) => {
    const start = ((found.row * loops.cycles.length + column) * loops.contacts.length + state.loop) * loops.phases;
    const values = Array.from({ length: loops.phases }, (_, phase) => entry.values[(start + phase) * parts + state.component] * entry.factor);
    return values.concat(values.slice(0, 1));
  };
  const traces = [found.column ? 0 : null, found.column].filter((column) => column !== null).map((column) => {
    const now = column === found.column;
    return { x: closed(displacement, column), y: closed(force, column), mode: "lines", name: cycleText(loops.cycles[column]),
      line: { color: now ? data.colours[0] : "#8c8c8c", width: now ? 2 : 1.5, dash: now ? "solid" : "dash" }, meta: now ? "loop" : "first",
      hovertemplate: `%{x:.4~g} ${plain(displacement.unit)}, %{y:.4~g} ${plain(force.unit)}<extra></extra>` };
  });
  const name = (quantity) => loops.labels[state.component].replace("{}", quantity);
  // pairs that stick are upright lines, which may stand on the edge of the plot otherwise
  const room = (key) => {
    const values = traces.flatMap((trace) => trace[key]).filter(Number.isFinite);
    const [low, high] = [Math.min(...values), Math.max(...values)];
    return high > low ? { range: [low - 0.05 * (high - low), high + 0.05 * (high - low)] } : {};
  };
  Plotly.react("loop-plot", traces, layout({
    height: 340, uirevision: `${state.loop} ${state.component}`, showlegend: true, legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 },
    xaxis: { ...axisLayout(titled(name("displacement"), displacement.unit)), ...room("x") },
    yaxis: { ...axisLayout("", upright(name("force"), force.unit)), ...room("y") },
  }), CONFIG);
}
