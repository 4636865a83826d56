// Lists and sliders; the last of the scripts of the page.
"use strict";

function addChoice(parent, name, label, options, chosen, choose) {
  const frame = document.createElement("label");
  const select = document.createElement("select");
  frame.append(label, select);
  select.name = name;
  options.forEach(([value, text]) => select.add(new Option(text, value)));
  select.value = chosen;
  select.addEventListener("change", () => choose(select.value));
  byId(parent).append(frame);
  return select;
}

// Lists of what the variable has: dimensions of several values, and coordinates along them.
function fillLists() {
  const entry = variables[state.variable];
  const several = entry.dims.filter((name) => size(name) > 1);
  const across = several.length ? several : entry.dims.slice(0, 1);
  const coordinates = data.coords.filter(({ dim }) => across.includes(dim));
  if (![...across, ...coordinates.map(({ name }) => name)].includes(state.x)) [state.x] = across;
  const used = along(state.x).dim;
  if (!several.includes(state.colour) || state.colour === used) state.colour = "";
  byId("choices").replaceChildren();
  addChoice("choices", "variable", "variable", Object.values(variables).map(({ name, label }) => [name, label]), state.variable, (name) => { state.variable = name; refresh(); });
  addChoice("choices", "x", "over", [...across.map((name) => [name, dims[name].label]), ...coordinates.map(({ name, label }) => [name, label])], state.x, (name) => { state.x = name; refresh(); });
  addChoice("choices", "colour", "colour", [["", "none"], ...several.filter((name) => name !== used).map((name) => [name, dims[name].label])], state.colour, (name) => { state.colour = name; refresh(); });
  addChoice("choices", "scale", "scale", [["", "linear"], ["log", "logarithmic"]], state.log ? "log" : "", (value) => { state.log = Boolean(value); refresh(); });
}

function addSlider(name) {
  const frame = document.createElement("label"), slider = document.createElement("input"), text = document.createElement("output");
  Object.assign(slider, { type: "range", min: 0, max: size(name) - 1, step: 1, name });
  frame.append(dims[name].label, slider, text);
  byId("sliders").append(frame);
  let waiting = false;
  slider.addEventListener("input", () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; pick({ [name]: Number(slider.value) }); });
  });
}

// Sliders of the axes and of what the variable has beside them.
function fillSliders() {
  byId("sliders").replaceChildren();
  const slow = dims.cycle ? ["cycle"] : [];
  const names = new Set([...data.axes, ...slow, ...variables[state.variable].dims]);
  [...names].filter((name) => size(name) > 1).forEach(addSlider);
}

function update() {
  for (const slider of byId("sliders").querySelectorAll("input")) {
    slider.value = String(state.at[slider.name]);
    slider.nextSibling.textContent = place(slider.name, state.at[slider.name]);
  }
  drawPanel();
}

function pick(at) {
  Object.assign(state.at, at);
  update();
  describe();
  drawRoot();
}

function refresh() {
  fillLists();
  fillSliders();
  update();
}

// colours are those of the page when it was opened
DARK.addEventListener("change", () => location.reload());
prepareRoot();
refresh();
pick({});
byId("panel").on("plotly_click", (event) => {
  const found = event.points[0].customdata;
  if (!found) return;
  const [index, colour] = found;
  pick({ [along(state.x).dim]: index, ...(state.colour && colour !== null ? { [state.colour]: colour } : {}) });
});
