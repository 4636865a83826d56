// The root in three dimensions: the contact surfaces coloured by what their pairs do, the wear exaggerated.
"use strict";

const { root } = data;
const shape = { colour: null, view: 0, exaggerated: true };
const DISTANCE = 1.65; // of the eye, over the longest side of what is seen
const MARGIN = 0.04;
const LIT = { ambient: 0.65, diffuse: 0.5, specular: 0.05, roughness: 0.9, fresnel: 0.05, facenormalsepsilon: 0 };
const ofPairs = Object.values(variables).filter((entry) => entry.dims.includes("contact") && !entry.dims.includes("phase"));
const DEPTH = ["wear_depth", "wear_depth_last"].find((name) => variables[name]);

if (root) {
  for (const name of ["nodes", "faces", "body", "flank", "seen"]) root[name] = decode(root[name]);
  for (const name of ["nodes", "pairs", "normals"]) root.contact[name] = decode(root.contact[name]);
}

// Triangles of some faces: a face of four nodes is two, one that repeats its last node is one.
function triangles(chosen) {
  const found = { i: [], j: [], k: [] };
  for (const face of chosen) {
    const [a, b, c, d] = root.faces.subarray(4 * face, 4 * face + 4);
    found.i.push(a); found.j.push(b); found.k.push(c);
    if (d !== c) { found.i.push(a); found.j.push(c); found.k.push(d); }
  }
  return found;
}

// Faces of a view in contact, those of each body that are not, and the box around them before wear, mm.
const seenFaces = new Map();

function facesOf(view) {
  if (seenFaces.has(view)) return seenFaces.get(view);
  const chosen = Array.from(root.body, (_, face) => face).filter((face) => (root.seen[face] >> view) & 1);
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (const face of chosen) {
    for (const node of root.faces.subarray(4 * face, 4 * face + 4)) {
      for (let axis = 0; axis < 3; axis++) {
        low[axis] = Math.min(low[axis], root.nodes[3 * node + axis] * 1e3);
        high[axis] = Math.max(high[axis], root.nodes[3 * node + axis] * 1e3);
      }
    }
  }
  const longest = Math.max(...high.map((each, axis) => each - low[axis]));
  const found = {
    contact: triangles(chosen.filter((face) => root.flank[face] >= 0)),
    others: root.bodies.map((_, body) => triangles(chosen.filter((face) => root.flank[face] < 0 && root.body[face] === body))),
    box: low.map((each, axis) => [each - MARGIN * longest, high[axis] + MARGIN * longest]),
  };
  seenFaces.set(view, found);
  return found;
}

const pairValues = (entry) => dims.contact.values.map((_, contact) => valueAt(entry, { ...state.at, contact }));
const largestOf = (entry) => entry.values.reduce((most, each) => (each > most ? each : most), 0);

// One factor for all points and counts, so that the shapes can be compared: 1, 2 or 5 times a power of ten.
function exaggeration() {
  const deepest = DEPTH ? largestOf(variables[DEPTH]) : 0;
  if (!shape.exaggerated || !(deepest > 0) || !(root.well_seen > 0)) return 1;
  const wanted = root.well_seen / deepest;
  const power = 10 ** Math.floor(Math.log10(wanted));
  return [5, 2, 1].find((factor) => factor * power <= wanted * (1 + 1e-9)) * power;
}

// Values at the nodes in contact, from those of the pairs.
const atNodes = (values) => Array.from(root.contact.pairs, (pair) => values[pair]);

function drawRoot() {
  if (byId("root-part").hidden) return;
  const entry = variables[shape.colour];
  const other = Object.keys(root.scene).filter((name) => state.at[name] !== root.scene[name]);
  if (other.length) {
    byId("root-title").textContent = `The root is drawn for ${other.map((name) => `${dims[name].label} ${place(name, root.scene[name])}`).join(", ")} only`;
    return;
  }
  const factor = exaggeration();
  const when = dims.cycle && !data.axes.includes("cycle") ? `, ${dims.cycle.label} ${place("cycle", state.at.cycle)}` : "";
  byId("root-title").textContent = `The root: ${entry.label}${when}${factor > 1 ? `; wear drawn ${digits(factor)} times as deep` : ""}`;
  const [x, y, z] = [0, 1, 2].map((axis) => Array.from({ length: root.nodes.length / 3 }, (_, node) => root.nodes[3 * node + axis] * 1e3));
  const depth = DEPTH ? atNodes(pairValues(variables[DEPTH])) : [];
  const values = atNodes(pairValues(entry));
  const intensity = x.map(() => 0), hover = x.map(() => "");
  const { nodes, normals, pairs } = root.contact;
  nodes.forEach((node, i) => {
    const moved = Number.isFinite(depth[i]) ? factor * depth[i] * 1e3 : 0;
    x[node] -= moved * normals[3 * i]; y[node] -= moved * normals[3 * i + 1]; z[node] -= moved * normals[3 * i + 2];
    intensity[node] = values[i] * entry.factor;
    hover[node] = `at pair ${pairs[i]}<br>${plain(withUnit(digits(intensity[node]), entry.unit))}`;
  });
  const view = root.views[shape.view], parts = facesOf(shape.view), front = root.views[0].body;
  const lightposition = Object.fromEntries(["x", "y", "z"].map((name, axis) => [name, view.eye[axis] * 1e5]));
  const traces = [{
    type: "mesh3d", x, y, z, ...parts.contact, intensity, coloraxis: "coloraxis", hovertext: hover, hoverinfo: "text", meta: "contact", flatshading: true,
    lighting: { ...LIT, ambient: 0.95, diffuse: 0.1 }, lightposition,
  }];
  parts.others.forEach((faces, body) => traces.push({
    type: "mesh3d", x, y, z, ...faces, color: root.colours[body], flatshading: true, hoverinfo: "skip", lighting: LIT, lightposition, meta: `body ${body}`,
    // contact surfaces are seen through the bodies around the outer one
    opacity: view.body < 0 && body !== front ? 0.3 : 1, visible: faces.i.length > 0,
  }));
  const longest = Math.max(...parts.box.map(([low, high]) => high - low));
  const ratio = parts.box.map(([low, high]) => (high - low) / longest);
  const axis = (number) => ({ title: { text: `${"xyz"[number]} (mm)` }, range: parts.box[number], showbackground: false, showspikes: false, nticks: Math.max(2, Math.round(6 * ratio[number])), gridcolor: GRID, zeroline: false, linecolor: LINE });
  const wide = byId("root").clientWidth, narrow = wide < 600;
  const height = Math.max(320, Math.min(560, wide));
  const far = DISTANCE * Math.max(1, 1.15 * height / (narrow ? wide : wide - 80));
  const [eye, up] = [view.eye.map((each) => each * far), view.up].map(([a, b, c]) => ({ x: a, y: b, z: c }));
  Plotly.react("root", traces, layout({
    height: height + (narrow ? 70 : 0), margin: { l: 0, r: 0, t: 0, b: narrow ? 70 : 0 }, showlegend: false,
    coloraxis: { colorscale: "Cividis", cmin: 0, cmax: largestOf(entry) * entry.factor || 1,
      colorbar: { title: { text: plain(entry.unit), side: "top" }, thickness: 14, outlinewidth: 0, ...(narrow ? { orientation: "h", y: -0.02, yanchor: "top", len: 0.95 } : { len: 0.8 }) } },
    scene: { dragmode: "orbit", aspectmode: "manual", aspectratio: { x: ratio[0], y: ratio[1], z: ratio[2] }, xaxis: axis(0), yaxis: axis(1), zaxis: axis(2), uirevision: String(shape.view), camera: { eye, up, center: { x: 0, y: 0, z: 0 } } },
  }), CONFIG);
}

function prepareRoot() {
  if (!root || !ofPairs.length) return;
  byId("root-part").hidden = false;
  if (!document.createElement("canvas").getContext("webgl")) {
    byId("root-part").hidden = true;
    return;
  }
  const names = [...(DEPTH && largestOf(variables[DEPTH]) > 0 ? [DEPTH] : []), "mean_pressure", ofPairs[0].name];
  shape.colour = names.find((name) => variables[name]);
  addChoice("root-choices", "root colour", "colour", ofPairs.map(({ name, label }) => [name, label]), shape.colour, (name) => { shape.colour = name; drawRoot(); });
  addChoice("root-choices", "root view", "view", root.views.map(({ title }, i) => [String(i), title]), "0", (i) => { shape.view = Number(i); drawRoot(); });
  if (DEPTH) addChoice("root-choices", "root shape", "wear drawn", [["1", "exaggerated"], ["", "as it is"]], "1", (value) => { shape.exaggerated = Boolean(value); drawRoot(); });
}
