// The interactive part of the page. Numbers stay in the units of the file until they are drawn or written.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("page-data").textContent);
  const byId = (id) => document.getElementById(id);
  const { axes, cycles, courses, maps, loops } = data;
  const sizes = axes.map((axis) => axis.values.length);
  const state = { point: data.shown, cycle: cycles.length - 1, response: 0, map: null, loop: 0, component: 0 };

  const DASHES = ["solid", "dash", "dot", "dashdot", "longdash", "longdashdot"];
  const SYMBOLS = ["circle", "square", "triangle-up", "diamond", "triangle-down", "cross"];
  const FONT = { family: "system-ui, Segoe UI, Roboto, Helvetica Neue, Arial, sans-serif", size: 12, color: "#1a1a1a" };
  const CONFIG = { responsive: true, displayModeBar: false };
  const TOUCH = window.matchMedia("(pointer: coarse)").matches;

  // ---- numbers

  function decode(text) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    return Float32Array.from({ length: bytes.length / 4 }, (_, i) => view.getFloat32(4 * i, true));
  }

  for (const group of [data.points, courses, maps && maps.variables, loops && loops.variables]) {
    for (const entry of Object.values(group || {})) entry.values = decode(entry.data);
  }

  function digits(value, count = 6) {
    if (value === null || !Number.isFinite(value)) return "–";
    if (Number.isInteger(value) && Math.abs(value) < 1e15) return String(value).replace(/\B(?=(\d{3})+$)/g, "\u00a0");
    const size = Math.abs(value);
    const text = size >= 1e-3 && size < 1e7 ? value.toPrecision(count) : value.toExponential(count - 1);
    const [head, power] = text.split("e");
    const short = head.includes(".") ? head.replace(/\.?0+$/, "") : head;
    return power === undefined ? short : `${short}e${power}`;
  }

  const withUnit = (text, unit) => (unit && text !== "–" ? `${text}\u00a0${unit}` : text);
  const show = (entry, value) => withUnit(digits(value * entry.factor), entry.unit);
  const titled = (text, unit) => (unit ? `${text} (${unit})` : text);
  // Texts of the file in a plot: plotly reads some HTML, of which nothing is wanted.
  const plain = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

  // ---- points

  function places(point) {
    const found = [];
    for (let axis = sizes.length - 1; axis >= 0; axis--) {
      found[axis] = point % sizes[axis];
      point = Math.floor(point / sizes[axis]);
    }
    return found;
  }

  const pointAt = (found) => found.reduce((point, place, axis) => point * sizes[axis] + place, 0);
  const varying = axes.map((_, axis) => axis).filter((axis) => sizes[axis] > 1);
  const converged = (point) => data.outcome[point] === 0;
  const sentence = (point) => data.endings[data.outcome[point]];

  function axisText(axis, place) {
    const value = axes[axis].values[place];
    return axes[axis].words ? value : withUnit(digits(value, 9), axes[axis].unit);
  }

  function pointText(point) {
    const found = places(point);
    const named = varying.length ? varying : [data.horizontal];
    return named.map((axis) => `${axes[axis].label} ${axisText(axis, found[axis])}`).join(", ");
  }

  // Value of a variable that the page holds at all points and cycles.
  function course(name, point, cycle, response = 0) {
    const entry = courses[name];
    const inner = name.includes("response") ? data.responses.length : 1;
    return entry.values[(point * cycles.length + cycle) * inner + response];
  }

  // Where a point and the cycle nearest to the wanted one are in a group that holds some of them only; null: nowhere.
  function held(group, point, cycle) {
    const row = group.points.indexOf(point);
    if (row < 0) return null;
    let nearest = 0;
    group.cycles.forEach((kept, i) => {
      const wanted = cycles[cycle];
      if (Math.abs(cycles[kept] - wanted) < Math.abs(cycles[group.cycles[nearest]] - wanted)) nearest = i;
    });
    return { row, column: nearest, cycle: group.cycles[nearest] };
  }

  const cycleText = (cycle) => `cycle ${digits(cycles[cycle])}`;

  // ---- plots

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

  // Lines of the response: every combination of the axes that are drawn as lines; the others are as in the picked point.
  function responseLines() {
    let lines = [places(state.point)];
    for (const axis of data.lines) {
      lines = lines.flatMap((line) => axes[axis].values.map((_, place) => line.with(axis, place)));
    }
    return lines.map((line, number) => {
      const values = axes[data.horizontal].values;
      const order = values.map((_, place) => place);
      if (!axes[data.horizontal].words) order.sort((a, b) => values[a] - values[b]);
      const name = data.lines.map((axis) => `${axes[axis].label} ${axisText(axis, line[axis])}`).join(", ");
      return { name, number, points: order.map((place) => pointAt(line.with(data.horizontal, place))) };
    });
  }

  function drawResponse() {
    const axis = axes[data.horizontal];
    const entry = courses.response_amplitude;
    const response = data.responses.length > 1 ? ` of ${data.responses[state.response]}` : "";
    byId("response-title").textContent = entry
      ? `Response${response} at ${cycleText(state.cycle)}`
      : "Points (the file holds no response_amplitude)";
    const at = (point) => axis.values[places(point)[data.horizontal]];
    const value = (point, cycle) => (entry ? course("response_amplitude", point, cycle, state.response) * entry.factor : 0);
    const traces = [];
    let ghosts = false;
    let failures = false;
    // The line of the picked point comes last, on top: where lines meet, a click stays on it.
    const lines = responseLines().sort((a, b) => a.points.includes(state.point) - b.points.includes(state.point));
    lines.forEach((line) => {
      const number = line.number;
      const colour = data.colours[number % data.colours.length];
      const good = line.points.filter(converged);
      const bad = line.points.filter((point) => !converged(point));
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
        text: line.points.map((point) => plain(pointText(point))), hovertemplate: "%{text}<br>%{y:.5~g}<extra></extra>",
        mode: line.points.length > 1 ? "lines+markers" : "markers", name: plain(line.name || cycleText(state.cycle)),
        line: { color: colour, width: 2, dash: DASHES[number % DASHES.length] },
        marker: { color: colour, size: good.length > 60 ? 5 : 8, symbol: SYMBOLS[number % SYMBOLS.length] },
        showlegend: good.length > 0, legendrank: 1000 + number, meta: "response",
      });
      if (bad.length) {
        traces.push({
          x: bad.map(at), y: bad.map(() => 0), customdata: bad, mode: "markers", name: "failed",
          text: bad.map((point) => plain(`${pointText(point)}: ${sentence(point)}`).replace(/(.{50,}?) /g, "$1<br>")),
          hovertemplate: "%{text}<extra></extra>", showlegend: !failures, legendrank: 3000, cliponaxis: false,
          marker: { color: "#000", size: 9, symbol: "x-thin", line: { color: "#000", width: 2 } }, meta: "failed",
        });
        failures = true;
      }
    });
    traces.push({
      x: [at(state.point)], y: [converged(state.point) ? value(state.point, state.cycle) : 0], mode: "markers",
      hoverinfo: "skip", name: "picked", legendrank: 1500, cliponaxis: false, meta: "picked",
      marker: { symbol: "circle-open", size: 17, color: "#000", line: { width: 2.5 } },
    });
    const words = axis.words ? { type: "category", categoryorder: "array", categoryarray: axis.values } : {};
    byId("response-hint").textContent = varying.length
      ? (TOUCH ? "Touch a point to pick it." : "Click a point to pick it; drag to zoom in, double-click to zoom out.") + (failures ? " Crosses on the zero line: points that failed." : "")
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
    if (!converged(state.point)) {
      sayInstead("course-plot", sentence(state.point));
      return;
    }
    const beside = byId("course-plot").clientWidth > 800;
    const domains = panels.length === 1 ? [[0, 1]] : beside ? [[0, 0.46], [0.54, 1]] : [[0.54, 1], [0, 0.46]];
    const traces = [];
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
      traces.push({
        ...place, x: cycles, y: values, mode: cycles.length > 1 ? "lines" : "markers", showlegend: false, meta: name, name: title,
        line: { color: data.colours[0], width: 2 }, hovertemplate: "cycle %{x}<br>%{y:.5~g}<extra></extra>",
      });
      if (name === "worn_volume" && courses.exact_worn_volume) {
        traces.push({ ...place, x: cycles, y: scaled("exact_worn_volume"), mode: "lines", name: "exact", meta: "exact",
          line: { color: "#000", width: 1.5, dash: "dot" }, hoverinfo: "skip" });
      }
      traces.push({
        ...place, x: [cycles[state.cycle]], y: [values[state.cycle]], mode: "markers", hoverinfo: "skip", showlegend: false,
        marker: { symbol: "circle-open", size: 13, color: "#000", line: { width: 2.5 } }, cliponaxis: false, meta: "picked",
      });
      const alone = beside || i === panels.length - 1;
      shape[`xaxis${suffix}`] = axisLayout(alone ? "cycles" : "", {
        anchor: `y${suffix}`, domain: beside ? domains[i] : [0, 1], showticklabels: alone, ...(i && !beside ? { matches: "x" } : {}),
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

  function drawMaps() {
    if (!maps) return;
    const entry = maps.variables[state.map];
    const found = held(maps, state.point, state.cycle);
    byId("map-title").textContent = `Contact pairs at ${cycleText(found ? found.cycle : state.cycle)}`;
    if (!found) {
      sayInstead("map-plot", converged(state.point) ? "The maps of this point are not on this page." : sentence(state.point));
      return;
    }
    const nPairs = entry.values.length / (maps.points.length * maps.cycles.length);
    const start = found.row * maps.cycles.length * nPairs;
    let largest = 0;
    for (let i = start; i < start + maps.cycles.length * nPairs; i++) {
      if (entry.values[i] > largest) largest = entry.values[i];
    }
    // One scale for all cycles of the point, so that the slider shows what changes.
    largest = state.map === "open_fraction" ? 1 : largest * entry.factor || 1;
    const value = (pair) => (pair === null ? NaN : entry.values[start + found.column * nPairs + pair] * entry.factor);
    const hover = `pair %{customdata}<br>%{PLACE:.5~g} ${plain(entry.unit)}<extra></extra>`;
    const gap = 0.17 / Math.max(maps.panels.length - 1, 1);
    const height = (1 - gap * (maps.panels.length - 1)) / maps.panels.length;
    const bars = maps.panels.every((panel) => panel.kind === "bars");
    const shape = layout({ height: 60 + 160 * Math.max(maps.panels.length, 2), annotations: [], showlegend: false, uirevision: "map" });
    if (!bars) {
      shape.coloraxis = { colorscale: "Cividis", cmin: 0, cmax: largest,
        colorbar: { title: { text: plain(entry.unit), side: "top" }, thickness: 14, outlinewidth: 0 } };
    }
    shape.margin.t = 28;
    const traces = maps.panels.map((panel, i) => {
      const suffix = i ? String(i + 1) : "";
      const top = 1 - i * (height + gap);
      const domain = [Math.max(top - height, 0), top];
      const place = { xaxis: `x${suffix}`, yaxis: `y${suffix}`, name: plain(panel.title), meta: "map" };
      const last = i === maps.panels.length - 1;
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
    if (!found) {
      sayInstead("loop-plot", converged(state.point) ? "The loops of this point are not on this page." : sentence(state.point));
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
        hovertemplate: "%{x:.4~g}, %{y:.4~g}<extra></extra>" };
    });
    const name = loops.components[state.component].replace("_", " ");
    Plotly.react("loop-plot", traces, layout({
      height: 340, uirevision: `${state.loop} ${state.component}`, showlegend: true, legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 },
      xaxis: axisLayout(titled(`${name} displacement`, displacement.unit)), yaxis: axisLayout("", upright(`${name} force`, force.unit)),
    }), CONFIG);
  }

  // ---- the list of numbers

  function readout() {
    const { point, cycle, response } = state;
    const found = places(point);
    const rows = [];
    // The other axes have one value, which the table of the study tells.
    varying.forEach((axis) => rows.push([`axis ${axes[axis].label}`, axes[axis].label, axisText(axis, found[axis])]));
    rows.push(["cycle", "cycle", digits(cycles[cycle])]);
    const of = data.responses.length > 1 ? `, ${data.responses[response]}` : "";
    for (const [name, entry] of Object.entries(courses)) {
      const label = name.includes("response") ? entry.label + of : entry.label;
      rows.push([name, label, show(entry, course(name, point, cycle, name.includes("response") ? response : 0))]);
    }
    for (const [name, entry] of Object.entries(data.points)) {
      // What never happened to the point has no number.
      if (Number.isFinite(entry.values[point])) rows.push([name, entry.label, show(entry, entry.values[point])]);
    }
    byId("readout").replaceChildren(...rows.map(([name, label, text]) => {
      const row = document.createElement("div");
      row.dataset.name = name;
      row.appendChild(document.createElement("dt")).textContent = label;
      row.appendChild(document.createElement("dd")).textContent = text;
      return row;
    }));
    byId("selected").textContent = `${pointText(point)}: ${sentence(point)}`;
  }

  // ---- choices

  function addChoice(parent, name, label, options, chosen, choose) {
    const frame = document.createElement("label");
    const select = document.createElement("select");
    frame.className = "choice";
    frame.append(label, select);
    select.name = name;
    options.forEach((text, value) => select.add(new Option(text, String(value))));
    select.value = String(chosen);
    select.addEventListener("change", () => choose(Number(select.value)));
    byId(parent).append(frame);
    return select;
  }

  const choices = varying.map((axis) => {
    const texts = axes[axis].values.map((_, place) => axisText(axis, place));
    return addChoice("choices", `axis ${axes[axis].label}`, axes[axis].label, texts, places(state.point)[axis], (place) => pick(pointAt(places(state.point).with(axis, place))));
  });

  function pick(point) {
    state.point = point;
    varying.forEach((axis, i) => { choices[i].value = String(places(point)[axis]); });
    drawResponse();
    drawCourse();
    drawMaps();
    drawLoop();
    readout();
  }

  function turnTo(cycle) {
    state.cycle = cycle;
    byId("cycle").value = String(cycle);
    const text = cycles.length > 1 ? `${digits(cycles[cycle])} of ${digits(cycles[cycles.length - 1])}` : digits(cycles[0]);
    byId("cycle-count").textContent = text;
    byId("cycle").setAttribute("aria-valuetext", text);
    pick(state.point);
  }

  function prepare() {
    if (data.responses.length > 1) {
      addChoice("choices", "response", "response", data.responses, 0, (response) => { state.response = response; pick(state.point); });
    }
    if (maps) {
      const names = Object.keys(maps.variables);
      state.map = names[0];
      addChoice("map-choice", "map", "variable", names.map((name) => maps.variables[name].label), 0, (i) => { state.map = names[i]; drawMaps(); });
    } else {
      byId("map-plot").parentElement.hidden = true;
    }
    if (loops) {
      state.component = Math.max(loops.components.indexOf("tangent_1"), 0);
      addChoice("loop-choice", "pair", "pair", loops.contacts.map(String), 0, (i) => { state.loop = i; drawLoop(); });
      addChoice("loop-choice", "component", "component", loops.components.map((name) => name.replace("_", " ")), state.component, (i) => { state.component = i; drawLoop(); });
    }
    byId("loop-part").hidden = !loops;
    byId("course-part").hidden = cycles.length < 2 || !data.outcome.includes(0) || !(courses.worn_volume || courses.wear_rate);
    byId("course-part").classList.toggle("wide", Boolean(maps) && !loops);
    const slider = byId("cycle");
    slider.max = String(cycles.length - 1);
    slider.hidden = cycles.length < 2;
    let waiting = false;
    slider.addEventListener("input", () => {
      if (waiting) return;
      waiting = true;
      requestAnimationFrame(() => { waiting = false; turnTo(Number(slider.value)); });
    });
    byId("explore").hidden = false;
    turnTo(state.cycle);
    byId("response-plot").on("plotly_click", (event) => {
      const point = event.points[0].customdata;
      if (Number.isInteger(point)) pick(point);
    });
    if (!byId("course-part").hidden) {
      byId("course-plot").on("plotly_click", (event) => turnTo(cycles.indexOf(event.points[0].x)));
    }
  }

  try {
    prepare();
  } catch (error) {
    byId("explore").hidden = true;
    byId("explore-failed").hidden = false;
    throw error;
  }
})();
