// What a reader picks, and the list of its numbers; the last of the scripts of the page.
"use strict";

const MOST_FRAMES = 50;
const FRAME = 150; // ms

// Relative errors that the page holds of what stands in the list: over the cycles, or the largest over them.
const ERRORS_OF = {
  worn_volume: "worn_volume_error", wear_rate: "wear_rate_error", wear_depth_max: "worn_volume_error", largest_wear_depth: "error_estimate",
  response_amplitude: "response_error", response_peak: "response_error", response_phase: "response_error",
};

const TWO_DIGITS = new Set(["residual", "run_time", "step_limit"]);

// Absolute error of a value; NaN where the page does not hold it. That of a phase, in rad, is the relative one of its amplitude.
function errorOf(name, value, point, cycle) {
  const other = ERRORS_OF[name];
  const relative = courses[other] ? course(other, point, cycle) : data.points[other] ? data.points[other].values[point] : NaN;
  if (TWO_DIGITS.has(name)) return 0.1 * Math.abs(value);
  return name === "response_phase" ? relative : relative * Math.abs(value);
}

function readout() {
  const { point, cycle, response } = state;
  const found = places(point);
  const rows = [];
  // The other axes have one value, which the table of the study tells.
  varying.forEach((axis) => rows.push([`axis ${axes[axis].label}`, axes[axis].label, axisText(axis, found[axis])]));
  rows.push(["cycle", data.counted, countText(point, cycle)]);
  for (const entry of scatter ? scatter.inputs : []) {
    if (entry.values.length === sizes[scatter.axis] || rowOf(found) >= 0) rows.push([`drawn ${entry.label}`, `${entry.label}, drawn`, show(entry, drawnValue(entry, found))]);
  }
  const of = data.responses.length > 1 ? `, ${data.responses[response]}` : "";
  for (const [name, entry] of Object.entries(courses)) {
    const label = name.includes("response") ? entry.label + of : entry.label;
    const value = course(name, point, cycle, name.includes("response") ? response : 0);
    rows.push([name, label, show(entry, value, entry.factor * errorOf(name, value, point, cycle)), full(entry, value)]);
  }
  for (const [name, entry] of Object.entries(data.points)) {
    // What never happened to the point has no number.
    if (Number.isFinite(entry.values[point])) rows.push([name, entry.label, show(entry, entry.values[point], entry.factor * errorOf(name, entry.values[point], point, cycle)), full(entry, entry.values[point])]);
  }
  byId("readout").replaceChildren(...rows.map(([name, label, text, all]) => {
    const row = document.createElement("div");
    row.dataset.name = name;
    row.appendChild(document.createElement("dt")).textContent = label;
    const told = row.appendChild(document.createElement("dd"));
    told.textContent = text;
    told.title = all || text; // all digits, where the mouse rests
    return row;
  }));
  byId("selected").textContent = `${pointText(point)}: ${sentence(point)}`;
}

// colours are those of the page when it was opened
DARK.addEventListener("change", () => location.reload());

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
  const last = cycles.length - 1;
  const now = countText(point, state.cycle);
  const text = last > 0 && Number.isFinite(countAt(point, last)) ? `${now} of ${countText(point, last)}` : now;
  byId("cycle-count").textContent = text;
  byId("cycle").setAttribute("aria-valuetext", text);
  if (blocks) drawBlocks();
  else drawResponse();
  drawCourse();
  drawMaps();
  drawLoop();
  drawTrends();
  drawScatter();
  drawRoot();
  readout();
}

function turnTo(cycle) {
  state.cycle = cycle;
  byId("cycle").value = String(cycle);
  pick(state.point);
}

// ---- playing

let playing = 0;

function play(on) {
  clearTimeout(playing);
  playing = 0;
  byId("play").textContent = on ? "Pause" : "Play";
  byId("play").setAttribute("aria-pressed", String(on));
  if (!on) return;
  const last = cycles.length - 1;
  if (state.cycle === last) turnTo(0);
  const step = Math.ceil(last / MOST_FRAMES);
  // the next frame waits until this one is drawn, however slow the machine is
  const advance = () => {
    turnTo(Math.min(state.cycle + step, last));
    if (state.cycle === last) play(false);
    else playing = setTimeout(() => requestAnimationFrame(advance), FRAME);
  };
  playing = setTimeout(advance, FRAME);
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
  prepareTrends();
  prepareScatter();
  prepareRoot();
  if (loops) {
    state.component = Math.max(loops.components.indexOf("tangent_1"), 0);
    state.loop = loops.widest;
    addChoice("loop-choice", "pair", "pair", loops.contacts.map(String), state.loop, (i) => { state.loop = i; drawLoop(); });
    addChoice("loop-choice", "component", "direction", loops.labels.map((label) => label.replace("{}", "").trim()), state.component, (i) => { state.component = i; drawLoop(); });
  }
  byId("loop-part").hidden = !loops;
  if (data.counted === "mission") {
    byId("explore-told").textContent = "Choose the values of a point in the lists; the slider runs through the missions.";
    byId("response-part").hidden = !blocks;
  }
  byId("course-part").hidden = cycles.length < 2 || data.without.length === data.outcome.length || !(courses.worn_volume || courses.wear_rate);
  byId("course-part").classList.toggle("wide", Boolean(maps) && !loops);
  document.querySelector("label[for=cycle]").textContent = data.counted;
  byId("course-title").textContent = `Wear over the ${data.counted}s`;
  const slider = byId("cycle");
  slider.max = String(cycles.length - 1);
  slider.hidden = cycles.length < 2;
  byId("play").hidden = cycles.length < 2;
  byId("play").addEventListener("click", () => play(!playing));
  slider.addEventListener("pointerdown", () => play(false));
  let waiting = false;
  slider.addEventListener("input", () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; turnTo(Number(slider.value)); });
  });
  byId("explore").hidden = false;
  turnTo(state.cycle);
  for (const id of [...(blocks ? [] : ["response-plot"]), "trend-plot", "trend-map-plot", "scatter-plot"]) {
    // a plot that was never drawn hears nothing
    byId(id).on?.("plotly_click", (event) => {
      const point = event.points[0].customdata;
      if (Number.isInteger(point)) pick(point);
    });
  }
  for (const id of [...(byId("course-part").hidden ? [] : ["course-plot"]), ...(blocks ? ["response-plot"] : [])]) {
    byId(id).on("plotly_click", (event) => turnTo(event.points[0].pointNumber));
  }
}

try {
  prepare();
} catch (error) {
  byId("explore").hidden = true;
  byId("explore-failed").hidden = false;
  throw error;
}
