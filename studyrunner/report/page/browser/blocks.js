// Missions: the response of each block over the missions, in place of the response over an axis of the study.
"use strict";

// Values of a block of the picked point over the missions, in the units of the file.
function blockCourse(name, block) {
  const { values } = blocks.variables[name];
  const inner = name === "response_error" ? 1 : data.responses.length;
  const response = name === "response_error" ? 0 : state.response;
  return cycles.map((_, cycle) => values[((state.point * cycles.length + cycle) * blocks.names.length + block) * inner + response]);
}

function drawBlocks() {
  const { response_amplitude: end, response_amplitude_begin: begin, response_error: error } = blocks.variables;
  byId("response-title").textContent = `Response${data.responses.length > 1 ? ` of ${data.responses[state.response]}` : ""} of the blocks`;
  byId("response-hint").textContent = `Full: at the end of a block${begin ? "; dotted: at its begin" : ""}.${error ? " Bands: estimated errors." : ""}`;
  if (!known(state.point, 0)) {
    sayInstead("response-plot", sentence(state.point));
    return;
  }
  const traces = [];
  blocks.names.forEach((name, block) => {
    const colour = data.colours[block % data.colours.length];
    const wrong = error ? blockCourse("response_error", block) : [];
    for (const [entry, key, when, dash] of [[begin, "response_amplitude_begin", "begin", "dot"], [end, "response_amplitude", "end", block < data.colours.length ? "solid" : "dash"]]) {
      if (!entry) continue;
      const values = blockCourse(key, block).map((value) => value * end.factor);
      const told = cycles.map((_, i) => i).filter((i) => Number.isFinite(values[i] * wrong[i]));
      const edge = (sign) => told.map((i) => values[i] * (1 + sign * wrong[i]));
      const at = told.map((i) => cycles[i]);
      traces.push({
        x: [...at, ...at.slice().reverse()], y: [...edge(1), ...edge(-1).reverse()], mode: "lines", fill: "toself",
        fillcolor: `${colour}33`, line: { width: 0 }, hoverinfo: "skip", showlegend: false, meta: `error ${when}`,
      }, {
        x: cycles, y: values, mode: cycles.length > 1 ? "lines" : "markers", name: plain(name), showlegend: when === "end", meta: when,
        line: { color: colour, width: when === "end" ? 2 : 1.5, dash }, marker: { color: colour, size: 8 },
        hovertemplate: `${plain(name)}, at its ${when}<br>mission %{x}<br>amplitude %{y:.4~g} ${plain(end.unit)}<extra></extra>`,
      });
    }
  });
  const ends = traces.filter((trace) => trace.meta === "end");
  traces.push({
    x: ends.map(() => cycles[state.cycle]), y: ends.map((trace) => trace.y[state.cycle]), mode: "markers", hoverinfo: "skip",
    showlegend: false, marker: { symbol: "circle-open", size: 13, color: INK, line: { width: 2.5 } }, cliponaxis: false, meta: "picked",
  });
  Plotly.react("response-plot", traces, layout({
    height: 380, showlegend: true, uirevision: `${state.response}`, legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 },
    xaxis: axisLayout("missions"), yaxis: axisLayout("", { ...upright("amplitude", end.unit), rangemode: "tozero" }),
  }), CONFIG);
}
