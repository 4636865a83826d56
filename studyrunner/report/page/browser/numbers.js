// What the page holds, as numbers and in words. Numbers stay in the units of the file until they are drawn or written.
"use strict";

const data = JSON.parse(document.getElementById("page-data").textContent);
const byId = (id) => document.getElementById(id);
const { axes, blocks, cycles, courses, maps, loops, root } = data;
const sizes = axes.map((axis) => axis.values.length);
const state = { point: data.shown, cycle: cycles.length - 1, response: 0, map: null, loop: 0, component: 0, colour: null, view: 0, exaggerated: true };

// ---- numbers

function decode(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  return Float32Array.from({ length: bytes.length / 4 }, (_, i) => view.getFloat32(4 * i, true));
}

for (const group of [data.points, courses, blocks && blocks.variables, maps && maps.variables, loops && loops.variables]) {
  for (const entry of Object.values(group || {})) entry.values = decode(entry.data);
}

const counts = data.counts ? decode(data.counts) : null;

// Thousands are set apart from five digits on, as in the figures.
function digits(value, count = 4) {
  if (value === null || !Number.isFinite(value)) return "–";
  if (Number.isInteger(value) && Math.abs(value) < 1e15) return Math.abs(value) < 1e4 ? String(value) : String(value).replace(/\B(?=(\d{3})+$)/g, "\u00a0");
  const size = Math.abs(value);
  // whole numbers of few known digits, as 2000, in full
  if (size >= 10 ** count && size < 1e7) return digits(Number(value.toPrecision(count)));
  const text = size >= 1e-3 && size < 1e7 ? value.toPrecision(count) : value.toExponential(count - 1);
  const [head, power] = text.split("e");
  const short = head.includes(".") ? head.replace(/\.?0+$/, "") : head;
  return power === undefined ? short : `${short}e${power}`;
}

const withUnit = (text, unit) => (unit && text !== "–" ? `${text}\u00a0${unit}` : text);
// As many digits as the error of a value allows, of which two digits are worth telling; at least two.
function digitsOf(value, error) {
  if (!(error > 0) || !Number.isFinite(error) || !(Math.abs(value) > 0)) return 4;
  const power = (number) => Math.floor(Math.log10(Math.abs(number)));
  return Math.min(6, Math.max(2, power(value) - power(error) + 1));
}
// error: of the value, in its unit.
const show = (entry, value, error) => withUnit(digits(value * entry.factor, entry.unit === "%" ? 2 : digitsOf(value * entry.factor, error)), entry.unit);
const full = (entry, value) => withUnit(digits(value * entry.factor, 7), entry.unit);
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
// Whether there are numbers of a point at this cycle: one that ended early has those of the first cycles.
const without = new Set(data.without);
// Cycle count of a point at an output: infinite of a final state that has none, NaN where the point has no such output.
const countAt = (point, cycle) => (counts ? counts[point * cycles.length + cycle] : cycles[cycle]);
const known = (point, cycle) => !without.has(point) && !Number.isNaN(countAt(point, cycle)) && !(cycles[cycle] > data.ends[point] * (1 + 1e-9));
const sentence = (point) => [data.endings[data.outcome[point]], data.remarks[point]].filter(Boolean).join(" ");

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

const countText = (point, cycle) => (countAt(point, cycle) === Infinity ? "final state" : digits(countAt(point, cycle)));
function cycleText(cycle) {
  const count = countAt(state.point, cycle);
  if (Number.isNaN(count)) return `output ${cycles[cycle]}`;
  return count === Infinity ? "the final state" : `${data.counted} ${digits(count)}`;
}

// Why nothing is known of a point at an output.
const lacking = (point, cycle) => (Number.isNaN(countAt(point, cycle)) && !without.has(point) ? "The final state was found without slow time: nothing is known between the unworn state and it." : sentence(point));
