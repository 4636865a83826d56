// The root in three dimensions: outer faces, the contact surfaces coloured by what their pairs do, the wear exaggerated.
"use strict";

const GREY_EDGE = "#555";
const DISTANCE = 1.45; // of the eye, over the longest side of what is seen
const MARGIN = 0.04;
const SCALE_WIDTH = 80; // px, of the scale of colours beside the root
const SCALE_HEIGHT = 70; // px, below it
const WHAT = root && root.mesh ? "The root" : "The contact pairs";
const DEPTH = maps && ["wear_depth", "wear_depth_last"].find((name) => maps.variables[name]);
const LIT = { ambient: 0.65, diffuse: 0.5, specular: 0.05, roughness: 0.9, fresnel: 0.05, facenormalsepsilon: 0 };

if (root) {
  for (const name of ["nodes", "faces", "body", "flank", "seen"]) root[name] = decode(root[name]);
  for (const name of ["nodes", "pairs", "weights", "normals"]) root.contact[name] = decode(root.contact[name]);
}

function hasWebGl() {
  try {
    return Boolean(document.createElement("canvas").getContext("webgl"));
  } catch {
    return false;
  }
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

// Edges of some faces as one line with gaps, each edge once.
function edges(chosen) {
  const known = new Set();
  const found = [];
  for (const face of chosen) {
    for (let corner = 0; corner < 4; corner++) {
      const a = root.faces[4 * face + corner], b = root.faces[4 * face + (corner + 1) % 4];
      const key = a < b ? a * 16777216 + b : b * 16777216 + a;
      if (a === b || known.has(key)) continue;
      known.add(key);
      found.push(a, b, -1);
    }
  }
  return found;
}

// What a view shows: its faces in contact, those of each body that are not, edges, and the box around them, mm.
const seenFaces = new Map();

function facesOf(view) {
  if (!seenFaces.has(view)) {
    const contact = [], others = root.bodies.map(() => []);
    for (let face = 0; face < root.body.length; face++) {
      if (!((root.seen[face] >> view) & 1)) continue;
      (root.flank[face] >= 0 ? contact : others[root.body[face]]).push(face);
    }
    const all = [...contact, ...others.flat()];
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (const face of all) {
      for (let corner = 4 * face; corner < 4 * face + 4; corner++) {
        for (let axis = 0; axis < 3; axis++) {
          const place = root.nodes[3 * root.faces[corner] + axis] * 1e3;
          low[axis] = Math.min(low[axis], place);
          high[axis] = Math.max(high[axis], place);
        }
      }
    }
    (root.views[view].leading || []).forEach((metres, axis) => {
      low[axis] = Math.min(low[axis], metres * 1e3);
      high[axis] = Math.max(high[axis], metres * 1e3);
    });
    // around the shape as it is before wear, so that nothing jumps from cycle to cycle
    const longest = Math.max(...high.map((each, axis) => each - low[axis]));
    const box = low.map((each, axis) => [each - MARGIN * longest, high[axis] + MARGIN * longest]);
    seenFaces.set(view, { contact: triangles(contact), others: others.map(triangles), edges: edges(all), box });
  }
  return seenFaces.get(view);
}

function factorOf(deepest) {
  if (!state.exaggerated || !(deepest > 0) || !(root.well_seen > 0)) return 1;
  const wanted = root.well_seen / deepest;
  const power = 10 ** Math.floor(Math.log10(wanted));
  return [5, 2, 1].find((factor) => factor * power <= wanted * (1 + 1e-9)) * power;
}

function atNodes(ofPairs) {
  const { pairs, weights, columns, nodes } = root.contact;
  return Array.from(nodes, (_, i) => {
    let sum = 0;
    for (let j = i * columns; j < (i + 1) * columns; j++) if (weights[j] > 0) sum += weights[j] * ofPairs[pairs[j]];
    return sum;
  });
}

function drawRoot() {
  if (!root || byId("root-plot").hidden) return;
  const entry = maps.variables[state.colour];
  const found = heldPairs(state.colour);
  const title = `${WHAT} at ${pairsText(state.colour, found)}`;
  const here = sceneOf(state.point) === sceneOf(data.shown);
  if (!found || !here || !knownPairs(state.colour)) {
    byId("root-title").textContent = title;
    byId("root-plot").dataset.factor = "";
    sayInstead("root-plot", !here ? `On this page in three dimensions is the scene of ${maps.scenes.map((axis) => `${axes[axis].label} ${axisText(axis, places(data.shown)[axis])}`).join(", ")} alone.` : knownPairs(state.colour) ? "The pairs of this point are not on this page." : lacking(state.point, state.cycle));
    return;
  }
  const coloured = pairValues(state.colour, found);
  const deep = DEPTH && heldPairs(DEPTH);
  const depth = deep ? pairValues(DEPTH, deep) : null;
  const factor = depth ? factorOf(depth.largest) : 1;
  byId("root-title").textContent = title + (depth && depth.largest > 0 ? `, worn shape exaggerated ${digits(factor)} times` : "");
  byId("root-plot").dataset.factor = String(factor);
  const [x, y, z] = [0, 1, 2].map((axis) => Array.from({ length: root.nodes.length / 3 }, (_, node) => root.nodes[3 * node + axis] * 1e3));
  const taken = depth ? atNodes(depth.at) : [];
  const shown = atNodes(coloured.at);
  const intensity = x.map(() => 0);
  const hover = x.map(() => "");
  const { nodes, normals, pairs, weights, columns } = root.contact;
  nodes.forEach((node, i) => {
    const moved = depth && Number.isFinite(taken[i]) ? factor * taken[i] * 1e3 : 0;
    x[node] -= moved * normals[3 * i]; y[node] -= moved * normals[3 * i + 1]; z[node] -= moved * normals[3 * i + 2];
    intensity[node] = shown[i] * entry.factor;
    const one = columns === 1 || !(weights[i * columns + 1] > 0);
    hover[node] = `${one ? `pair ${pairs[i * columns]}` : "between pairs"}<br>${plain(show(entry, shown[i]))}`;
  });
  const view = root.views[state.view];
  const parts = facesOf(state.view);
  const front = root.views[0].body;
  // Plotly keeps the colours of a trace for the next one in its place: each kind has its own.
  const line = (values) => parts.edges.map((node) => (node < 0 ? null : values[node]));
  // the light comes from where the eye is at first
  const [lightX, lightY, lightZ] = view.eye.map((each) => each * 1e5);
  const lightposition = { x: lightX, y: lightY, z: lightZ };
  const traces = [{
    type: "mesh3d", x, y, z, ...parts.contact, intensity, coloraxis: "coloraxis", hovertext: hover, hoverinfo: "text",
    lighting: { ...LIT, ambient: 0.95, diffuse: 0.1 }, lightposition, meta: "contact", flatshading: true,
  }, {
    type: "scatter3d", mode: "lines", hoverinfo: "skip", showlegend: false, meta: "edges",
    x: line(x), y: line(y), z: line(z), line: { color: GREY_EDGE, width: 1 },
  }];
  const mark = view.leading ? view.leading.map((each) => [each * 1e3]) : [[null], [null], [null]];
  traces.push({
    type: "scatter3d", mode: "text", x: mark[0], y: mark[1], z: mark[2], text: ["leading edge"], hoverinfo: "skip",
    textposition: "middle center", textfont: FONT, showlegend: false, meta: "leading",
  });
  parts.others.forEach((faces, body) => traces.push({
    type: "mesh3d", x, y, z, ...faces, color: root.colours[body], flatshading: true, hoverinfo: "skip", lighting: LIT, lightposition,
    // contact surfaces are seen through the bodies around the outer one
    opacity: view.body < 0 && body !== front ? 0.3 : 1, visible: faces.i.length > 0, meta: `body ${body}`,
  }));
  const longest = Math.max(...parts.box.map(([low, high]) => high - low));
  const ratio = parts.box.map(([low, high]) => (high - low) / longest);
  const axis = (number) => ({
    title: { text: `${"xyz"[number]} (mm)` }, range: parts.box[number], showbackground: false, showspikes: false,
    nticks: Math.max(2, Math.round(6 * ratio[number])), gridcolor: GRID, zeroline: false, linecolor: LINE,
  });
  // a narrow window shows as much as a wide one, from farther away and without the width of a scale beside it
  const wide = byId("root-plot").clientWidth;
  const height = Math.max(320, Math.min(560, wide));
  const narrow = wide < 600;
  const far = DISTANCE * Math.max(1, 1.15 * height / (narrow ? wide : wide - SCALE_WIDTH));
  const [ex, ey, ez] = view.eye.map((each) => each * far);
  const [ux, uy, uz] = view.up;
  Plotly.react("root-plot", traces, layout({
    height: height + (narrow ? SCALE_HEIGHT : 0), margin: { l: 0, r: 0, t: 0, b: narrow ? SCALE_HEIGHT : 0 }, showlegend: false,
    coloraxis: { colorscale: "Cividis", cmin: 0, cmax: state.colour === "open_fraction" ? 1 : coloured.largest * entry.factor || 1,
      colorbar: { title: { text: plain(entry.unit), side: "top" }, thickness: 14, outlinewidth: 0, ...(narrow ? { orientation: "h", y: -0.02, yanchor: "top", len: 0.95 } : { len: 0.8 }) } },
    scene: { domain: { x: [0, 1], y: [0, 1] }, dragmode: "orbit", aspectmode: "manual", aspectratio: { x: ratio[0], y: ratio[1], z: ratio[2] },
      xaxis: axis(0), yaxis: axis(1), zaxis: axis(2), uirevision: String(state.view),
      camera: { eye: { x: ex, y: ey, z: ez }, up: { x: ux, y: uy, z: uz }, center: { x: 0, y: 0, z: 0 } } },
  }), CONFIG);
}

function prepareRoot() {
  byId("root-part").hidden = !root;
  if (!root) return;
  const names = Object.keys(maps.variables);
  state.colour = DEPTH || names[0];
  if (!hasWebGl()) {
    byId("root-plot").hidden = true;
    byId("root-title").textContent = WHAT;
    byId("root-hint").textContent = "This browser does not draw in three dimensions (no WebGL); the figures below show the root.";
    return;
  }
  byId("root-hint").textContent = "Drag to rotate, scroll to zoom in. The wear depth, of both surfaces together, is taken off each surface.";
  addChoice("root-choice", "root colour", "colour", names.map((name) => maps.variables[name].label), names.indexOf(state.colour), (i) => { state.colour = names[i]; drawRoot(); });
  if (root.views.length > 1) {
    addChoice("root-choice", "root view", "view", root.views.map((view) => view.title), 0, (i) => { state.view = i; drawRoot(); });
  }
  if (DEPTH) {
    addChoice("root-choice", "root shape", "worn shape", ["exaggerated", "as it is"], 0, (i) => { state.exaggerated = i === 0; drawRoot(); });
  }
}
