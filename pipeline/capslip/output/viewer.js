// The face and its caps, drawn with WebGL2 from the data beside this script.
"use strict";
(() => {
const data = JSON.parse(document.getElementById("viewer-data").textContent);
const place = document.getElementById("viewer");
const KINDS = { f4: Float32Array, i4: Int32Array, u2: Uint16Array };
const PREFIX = { "-12": "p", "-9": "n", "-6": "µ", "-3": "m", 0: "", 3: "k", 6: "M", 9: "G" };
const NONE = 65535;

function unpack(text, kind) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new KINDS[kind](bytes.buffer);
}
function levels(text, low, high) {
  return Float32Array.from(unpack(text, "u2"), (v) => v === NONE ? NaN : low + (high - low) * v / (NONE - 1));
}
function engineering(value, unit, digits = 3) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return `0 ${unit}`;
  const round = Number(value.toPrecision(digits));
  const power = Math.max(-12, Math.min(9, 3 * Math.floor(Math.log10(Math.abs(round)) / 3 + 1e-12)));
  return `${Number((round / 10 ** power).toPrecision(digits))} ${PREFIX[power]}${unit}`;
}

// --- the data ---------------------------------------------------------------------------------
const X = unpack(data.x, "f4"), Y = unpack(data.y, "f4");
const Z = levels(data.z, 0, data.high - data.low);
const second = data.second && { ...data.second, heights: levels(data.second.z, data.second.low, data.second.high) };
const [LY, LX] = data.side;
const caps = { ...data.caps };
for (const name of ["x", "y", "peak", "df", "D", "R", "a", "base", "load", "loss"]) caps[name] = unpack(data.caps[name], "f4");
const N = caps.number.length;
const zones = data.zones && {
  ...data.zones,
  compression: levels(data.zones.compression, 0, 1),
  load: unpack(data.zones.load, "f4"), cap: unpack(data.zones.cap, "i4"), radius: unpack(data.zones.radius, "f4"),
  px: levels(data.zones.pixel_x, 0, LX), py: levels(data.zones.pixel_y, 0, LY),
  pz: levels(data.zones.pixel_z, 0, data.high - data.low),
  contact: unpack(data.zones.pixel_contact, "i4"), reach: levels(data.zones.pixel_reach, 0, 1),
};
const state = { face: true, caps: true, ...data.first };
let turn = LX >= LY ? -0.42 : 1.15, tip = 0.62, zoom = 1, chosen = -1;

// Of two faces what lies on their sum comes down on the first, by the heights of the second.
const twoFaces = () => Boolean(second) && state.mate;
const lowest = () => twoFaces() ? second.first_low : data.low;
const span = () => twoFaces() ? second.first_high - second.first_low : data.high - data.low;
const roundFactor = () => twoFaces() ? second.factor : data.factor;
function between(line, value) {
  let low = 0, high = line.length - 1;
  while (high - low > 1) { const i = (low + high) >> 1; if (line[i] <= value) low = i; else high = i; }
  return [low, Math.min(1, Math.max(0, (value - line[low]) / (line[high] - line[low] || 1)))];
}
function secondAt(x, y) {
  const [i, u] = between(X, x), [j, v] = between(Y, y), nx = X.length, h = second.heights, k = j * nx + i;
  const right = Math.min(i + 1, nx - 1) - i, up = (Math.min(j + 1, Y.length - 1) - j) * nx;
  return (1 - v) * ((1 - u) * h[k] + u * h[k + right]) + v * ((1 - u) * h[k + up] + u * h[k + up + right]);
}
function placed(x, y, z) {
  return twoFaces() ? Math.min(span(), Math.max(0, z + data.low - secondAt(x, y) - lowest())) : z;
}

// Radii of contact and stick over those under the preload: the theorem of Ciavarella and Jaeger.
function table(share) {
  const at = Math.min(1, Math.max(0, share)) ** (2 / 3) * (zones.levels - 1);
  const i = Math.min(Math.floor(at), zones.levels - 2), w = at - i, n = zones.count;
  const found = new Float64Array(n);
  for (let c = 0; c < n; c++) found[c] = Math.sqrt((1 - w) * zones.compression[i * n + c] + w * zones.compression[(i + 1) * n + c]);
  return found;
}
function zoneAt(load, force) {
  const contact = table(load), stick = table(load * (1 - force));
  return { contact, stick: stick.map((s, c) => Math.min(s, contact[c])) };
}
function word(zone, c) {
  if (!(zone.contact[c] > 0)) return "apart";
  if (!(zone.stick[c] > 0)) return "slips";
  return zone.stick[c] < zone.contact[c] ? "slips in part" : "sticks";
}
function counts(load, force) {
  const zone = zoneAt(load, force), found = { apart: 0, sticks: 0, "slips in part": 0, slips: 0 };
  for (let c = 0; c < zones.count; c++) found[word(zone, c)]++;
  return found;
}

// --- the page ---------------------------------------------------------------------------------
place.innerHTML = `<canvas class="face" role="img" tabindex="0"></canvas>
<div class="side">
<label>Heights × <output data-of="factor"></output><input type="range" data-name="factor" min="0" max="1" step="0.001"></label>
<label class="of-zones">Load <output data-of="load"></output><input type="range" data-name="load" min="0" max="1" step="0.005"></label>
<label class="of-zones">Tangential force <output data-of="force"></output><input type="range" data-name="force" min="0" max="1" step="0.005"></label>
<label>Colour of the caps <select data-name="colour"></select></label>
<div class="legend"></div>
<label class="inline"><input type="checkbox" data-name="face"> face</label>
<label class="inline"><input type="checkbox" data-name="caps"> caps</label>
<label class="inline of-zones"><input type="checkbox" data-name="zones"> contact</label>
<label class="inline of-zones"><input type="checkbox" data-name="mate"> ${second ? "both faces, not their sum" : "flat mate"}</label>
<p class="row">Drag turns, Shift and the wheel zoom; a click on a cap shows its row and profile.</p>
<canvas class="profile" hidden></canvas>
</div>
<p class="state"></p>`;
const canvas = place.querySelector("canvas.face"), chart = place.querySelector("canvas.profile");
const row = place.querySelector(".row"), stateLine = place.querySelector(".state");
const MOST = 4 * Math.max(data.factor, second ? second.factor : 1);
const sliders = Object.fromEntries([...place.querySelectorAll("[data-name]")].map((e) => [e.dataset.name, e]));
if (!zones) for (const element of place.querySelectorAll(".of-zones")) element.hidden = true;
for (const by of Object.keys(data.colours)) sliders.colour.add(new Option(by === "loss" ? "share of the loss" : by, by));
// The slider is logarithmic from 1 to four times the round factor.
function setFactor(factor) {
  state.factor = factor;
  sliders.factor.value = MOST > 1 ? Math.log(factor) / Math.log(MOST) : 0;
}
setFactor(roundFactor());
for (const [name, element] of Object.entries(sliders)) {
  if (element.type === "checkbox") element.checked = state[name];
  else if (name !== "factor") element.value = state[name];
  element.addEventListener("input", () => {
    if (element.type === "checkbox") state[name] = element.checked;
    else if (name === "factor") state.factor = MOST ** Number(element.value);
    else state[name] = name === "colour" ? element.value : Number(element.value);
    if (name === "mate" && second) setFactor(roundFactor());
    if ((name === "force" || name === "load") && !state.zones) { state.zones = sliders.zones.checked = true; }
    update();
  });
}

// --- WebGL ------------------------------------------------------------------------------------
const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
if (!gl) {
  stateLine.textContent = "This browser shows no WebGL2, so the face does not turn here; the picture scene.png and caps.vtu hold the same.";
  canvas.hidden = true;
  return;
}
const VERTEX = `#version 300 es
layout(location=0) in vec3 at; layout(location=1) in vec2 slope; layout(location=2) in vec3 colour;
uniform mat3 turn; uniform vec3 middle; uniform vec2 scale; uniform float factor, bias, size;
out vec3 shade;
void main() {
  vec3 p = turn * (vec3(at.xy, at.z * factor) - middle);
  vec3 n = turn * normalize(vec3(-slope * factor, 1.0));
  float light = 0.35 + 0.65 * max(dot(n, normalize(vec3(-0.35, 0.55, 0.75))), 0.0);
  shade = colour * light;
  gl_Position = vec4(p.xy * scale, -0.4 * p.z * min(scale.x, scale.y) - bias, 1.0);
  gl_PointSize = size;
}`;
const FRAGMENT = `#version 300 es
precision mediump float; in vec3 shade; uniform float alpha; out vec4 pixel;
void main() { pixel = vec4(shade, alpha); }`;
function shader(kind, text) {
  const made = gl.createShader(kind);
  gl.shaderSource(made, text);
  gl.compileShader(made);
  if (!gl.getShaderParameter(made, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(made));
  return made;
}
const program = gl.createProgram();
gl.attachShader(program, shader(gl.VERTEX_SHADER, VERTEX));
gl.attachShader(program, shader(gl.FRAGMENT_SHADER, FRAGMENT));
gl.linkProgram(program);
gl.useProgram(program);
const at = Object.fromEntries(["turn", "middle", "scale", "factor", "bias", "size", "alpha"].map((n) => [n, gl.getUniformLocation(program, n)]));
const rgb = (text) => [1, 3, 5].map((i) => parseInt(text.slice(i, i + 2), 16) / 255);

// One part: eight numbers a vertex (place, slopes, colour), triangles or points.
function part() {
  const vertices = gl.createBuffer(), corners = gl.createBuffer(), array = gl.createVertexArray();
  gl.bindVertexArray(array);
  gl.bindBuffer(gl.ARRAY_BUFFER, vertices);
  for (const [i, n, from] of [[0, 3, 0], [1, 2, 3], [2, 3, 5]]) {
    gl.enableVertexAttribArray(i);
    gl.vertexAttribPointer(i, n, gl.FLOAT, false, 32, 4 * from);
  }
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, corners);
  return { array, vertices, corners, count: 0, points: 0 };
}
function fill(one, numbers, corners) {
  gl.bindVertexArray(one.array);
  gl.bindBuffer(gl.ARRAY_BUFFER, one.vertices);
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.DYNAMIC_DRAW);
  one.points = corners ? 0 : numbers.length / 8;
  one.count = corners ? corners.length : 0;
  if (corners) gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(corners), gl.DYNAMIC_DRAW);
}
const parts = { face: part(), caps: part(), zones: part(), mate: part() };

// Heights on the grid as a mesh, with a colour for each height.
function surface(one, heights, colour) {
  const nx = X.length, ny = Y.length, numbers = new Float32Array(8 * nx * ny), corners = [];
  for (let j = 0; j < ny; j++) for (let i = 0; i < nx; i++) {
    const k = j * nx + i;
    const i0 = Math.max(i - 1, 0), i1 = Math.min(i + 1, nx - 1), j0 = Math.max(j - 1, 0), j1 = Math.min(j + 1, ny - 1);
    const sx = (heights[j * nx + i1] - heights[j * nx + i0]) / (X[i1] - X[i0] || 1);
    const sy = (heights[j1 * nx + i] - heights[j0 * nx + i]) / (Y[j1] - Y[j0] || 1);
    numbers.set([X[i], Y[j], heights[k], sx || 0, sy || 0, ...colour(heights[k])], 8 * k);
    if (i + 1 < nx && j + 1 < ny && [k, k + 1, k + nx, k + nx + 1].every((c) => Number.isFinite(heights[c])))
      corners.push(k, k + 1, k + nx + 1, k, k + nx + 1, k + nx);
  }
  fill(one, numbers, corners);
}
function buildFace() {
  const nx = X.length, heights = Z.map((z, k) => placed(X[k % nx], Y[Math.floor(k / nx)], z));
  const sorted = heights.filter(Number.isFinite).sort();
  const low = sorted[Math.floor(0.01 * sorted.length)] || 0, high = sorted[Math.floor(0.99 * sorted.length)] || 1;
  surface(parts.face, heights, (z) => {
    const grey = 0.38 + 0.57 * Math.min(1, Math.max(0, (z - low) / (high - low || 1)));
    return [grey, grey, 0.99 * grey];
  });
}
// A ring of a sphere about an apex, cut at the edge of the face.
function ring(numbers, corners, c, inner, outer, colour) {
  const sectors = N > 800 ? 12 : 32, steps = N > 800 ? 2 : 5, first = numbers.length / 8;
  for (let s = 0; s <= steps; s++) for (let q = 0; q < sectors; q++) {
    const angle = 2 * Math.PI * q / sectors, u = Math.cos(angle), v = Math.sin(angle);
    const edge = Math.max(0, Math.min(u > 1e-9 ? (LX - caps.x[c]) / u : u < -1e-9 ? -caps.x[c] / u : Infinity,
      v > 1e-9 ? (LY - caps.y[c]) / v : v < -1e-9 ? -caps.y[c] / v : Infinity));
    const r = Math.min(inner + (outer - inner) * s / steps, edge), root = Math.sqrt(Math.max(0, caps.R[c] ** 2 - r * r));
    const slope = -r / Math.max(root, 1e-3 * caps.R[c]), x = caps.x[c] + r * u, y = caps.y[c] + r * v;
    numbers.push(x, y, placed(x, y, caps.peak[c] - data.low - r * r / (caps.R[c] + root)), slope * u, slope * v, ...colour);
    if (s < steps) {
      const a = first + s * sectors, q1 = (q + 1) % sectors;
      corners.push(a + q, a + sectors + q, a + sectors + q1, a + q, a + sectors + q1, a + q1);
    }
  }
}
const RAMP = ["#0d0887", "#7e03a8", "#cc4778", "#f89540", "#f0f921"].map(rgb);  // plasma
function ramp(t) {
  const x = Math.min(1, Math.max(0, t)) * (RAMP.length - 1), i = Math.min(Math.floor(x), RAMP.length - 2);
  return RAMP[i].map((v, k) => v + (x - i) * (RAMP[i + 1][k] - v));
}
function buildCaps() {
  const by = data.colours[state.colour], value = unpack(by.value, "f4"), numbers = [], corners = [];
  for (let c = 0; c < N; c++) {
    const colour = by.names.length ? rgb(by.names[value[c]][1]) : ramp((value[c] - by.limits[0]) / (by.limits[1] - by.limits[0]));
    ring(numbers, corners, c, 0, caps.base[c], colour);
  }
  fill(parts.caps, numbers, corners);
  const legend = place.querySelector(".legend");
  legend.replaceChildren();
  for (const [name, colour] of by.names) {
    const line = document.createElement("div"), key = document.createElement("span");
    key.className = "key";
    key.style.background = colour;
    line.append(key, name);
    legend.append(line);
  }
  if (!by.names.length && N) legend.innerHTML = `${by.title}<div class="ramp" style="background:linear-gradient(to right, #0d0887, #7e03a8, #cc4778, #f89540, #f0f921)"></div><div class="ends"><span>${by.limits[0]}</span><span>${by.limits[1]}</span></div>`;
}
let pixels = null;  // of a map, as many as are drawn
function buildZones() {
  const zone = zoneAt(state.load, state.force), stick = rgb(data.stick), slip = rgb(data.slip), numbers = [], corners = [];
  if (!zones.of_map) {
    for (let k = 0; k < zones.count; k++) {
      const c = zones.cap[k], inner = zones.radius[k] * zone.stick[k], outer = zones.radius[k] * zone.contact[k];
      if (c < 0) continue;
      if (inner > 0) ring(numbers, corners, c, 0, inner, stick);
      if (outer > inner) ring(numbers, corners, c, inner, outer, slip);
    }
    fill(parts.zones, numbers, corners);
    return;
  }
  const holds = (radius, p) => radius > 0 && zones.reach[p] <= radius + 1e-4;
  pixels = { touch: 0, stick: 0 };
  for (let p = 0; p < zones.px.length; p++) {
    const k = zones.contact[p];
    if (!holds(zone.contact[k], p)) continue;
    const sticks = holds(zone.stick[k], p);
    pixels.touch++;
    if (sticks) pixels.stick++;
    numbers.push(zones.px[p], zones.py[p], placed(zones.px[p], zones.py[p], zones.pz[p]), 0, 0, ...(sticks ? stick : slip));
  }
  fill(parts.zones, numbers, null);
}
// The mate as it lies at height zero; how high it is, it is drawn.
function buildMate() {
  const numbers = [], colour = [0.34, 0.71, 0.91];
  if (twoFaces()) {
    surface(parts.mate, Z.map((z, k) => Number.isFinite(z) ? -second.heights[k] : NaN), () => colour);
    return;
  }
  for (const [x, y] of [[0, 0], [LX, 0], [LX, LY], [0, LY]]) numbers.push(x, y, 0, 0, 0, ...colour);
  fill(parts.mate, numbers, [0, 1, 2, 0, 2, 3]);
}
let touch = -Infinity;  // where the mate first touches
if (zones && zones.of_map) for (const z of zones.pz) touch = Math.max(touch, z);
else for (const z of caps.peak) touch = Math.max(touch, z - data.low);
function mateHeight() {
  const at = state.load ** (2 / 3) * (zones.levels - 1), i = Math.min(Math.floor(at), zones.levels - 2);
  const approach = zones.approach[i] + (at - i) * (zones.approach[i + 1] - zones.approach[i]);
  return touch + data.low - lowest() - approach;
}

// --- drawing ----------------------------------------------------------------------------------
function turning() {
  const c = Math.cos(turn), s = Math.sin(turn), d = Math.sin(tip), e = Math.cos(tip);
  return [[c, s, 0], [-s * d, c * d, e], [s * e, -c * e, d]];  // rows: right, up, towards the eye
}
function fit() {
  const size = Math.hypot(LX, LY), wide = canvas.clientWidth, high = canvas.clientHeight;
  const unit = 2 * zoom * Math.min(1 / size, high / wide / size * 1.45);
  return [unit, unit * wide / high];
}
function middle() { return [LX / 2, LY / 2, 0.5 * span() * state.factor]; }
function draw() {
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.max(1, canvas.clientWidth * ratio);
  canvas.height = Math.max(1, canvas.clientHeight * ratio);
  gl.viewport(0, 0, canvas.width, canvas.height);
  gl.clearColor(0, 0, 0, 0);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.enable(gl.DEPTH_TEST);
  const [right, up, eye] = turning();
  gl.uniformMatrix3fv(at.turn, false, [0, 1, 2].flatMap((i) => [right[i], up[i], eye[i]]));
  gl.uniform2fv(at.scale, fit());
  gl.uniform1f(at.factor, state.factor);
  // The square of a contact point, as wide as its area on the screen has it
  if (zones) gl.uniform1f(at.size, Math.max(1, zones.point_side * Math.sqrt(Math.sin(tip)) * fit()[0] * canvas.width / 2));
  const shown = [["face", state.face, 0, 1], ["caps", state.caps, 0.02, 1], ["zones", zones && state.zones, 0.025, 1], ["mate", zones && state.mate, 0, 0.35]];
  for (const [name, on, bias, alpha] of shown) {
    const one = parts[name];
    if (!on || !(one.count || one.points)) continue;
    const [x, y, z] = middle();
    gl.uniform3fv(at.middle, [x, y, z - (name === "mate" ? mateHeight() * state.factor : 0)]);
    gl.uniform1f(at.bias, bias);
    gl.uniform1f(at.alpha, alpha);
    if (alpha < 1) { gl.enable(gl.BLEND); gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA); } else gl.disable(gl.BLEND);
    gl.bindVertexArray(one.array);
    if (one.points) gl.drawArrays(gl.POINTS, 0, one.points);
    else gl.drawElements(gl.TRIANGLES, one.count, gl.UNSIGNED_INT, 0);
  }
}
function say() {
  place.querySelector('[data-of="factor"]').textContent = Number(state.factor.toPrecision(2)).toLocaleString("en").replaceAll(",", " ");
  let text = `Heights × ${place.querySelector('[data-of="factor"]').textContent}; true scale ${engineering(LX, "m")} × ${engineering(LY, "m")}, about ${engineering(Number(span().toPrecision(2)), "m")} shown.`;
  if (twoFaces()) text += " Both faces, the second to be seen through; caps are those of their sum.";
  if (zones) {
    const load = engineering(state.load * data.preload_N, "N"), n = counts(state.load, state.force);
    place.querySelector('[data-of="load"]').textContent = `${load} on the scan`;
    place.querySelector('[data-of="force"]').textContent = `${Math.round(100 * state.force)} % of gross slip`;
    const some = n.sticks + n["slips in part"] + n.slips;
    // Regions of a map fall apart as the load falls, and what touches then is near what a solution has
    const touching = !pixels ? `of ${some} caps in contact` : `about ${Number((1e6 * zones.pixel_area * pixels.touch).toPrecision(3))} mm² touch, ${Math.round(100 * pixels.stick / Math.max(pixels.touch, 1))} % of it sticks; of ${zones.count} regions under the preload about ${some} touch:`;
    if (state.zones) text += ` ${load}, force ${Math.round(100 * state.force)} % of gross slip: ${touching} ${n.sticks} stick, ${n["slips in part"]} slip in part, ${n.slips} slip (green sticks, red slips).`;
    if (state.zones && zones.enlarged) text += ` C${zones.enlarged.slice(1)}.`;
    if (state.zones && zones.every > 1) text += ` One contact point of ${zones.every} is drawn.`;
  }
  stateLine.textContent = text;
  canvas.setAttribute("aria-label", `The face in three dimensions. ${text}`);
  if (chosen >= 0) tell(chosen);
}
function tell(c) {
  const lines = [`cap ${caps.number[c]}${caps.family[c] ? `, family ${caps.family[c]}` : ""}`,
    `R = ${engineering(caps.R[c], "m", 4)}, D = ${engineering(caps.D[c], "m")}`,
    `peak ${engineering(caps.peak[c], "m")}, df ${engineering(caps.df[c], "m")}`];
  if (caps.load[c] > 0) lines.push(`${data.load_name} ${engineering(caps.load[c], "N")}, ${Number((100 * caps.loss[c]).toPrecision(2))} % of the loss`);
  if (caps.a[c] > 0) lines.push(`contact radius ${engineering(caps.a[c], "m")}`);
  if (zones) {
    const zone = zoneAt(state.load, state.force), found = {};
    for (let k = 0; k < zones.count; k++) if (zones.cap[k] === c) found[word(zone, k)] = 1 + (found[word(zone, k)] || 0);
    const words = Object.entries(found);
    lines.push(!words.length ? (caps.load[c] > 0 ? "no contact of its own" : "touches nowhere") : words.length === 1 && words[0][1] === 1 ? `in the state shown: ${words[0][0]}` : `contacts on it: ${words.map(([w, n]) => `${n} ${w}`).join(", ")}`);
  }
  lines.push(caps.flags[c] || "no flags");
  row.textContent = lines.join("\n");
}
function profile(c) {
  const one = data.profiles[c];
  chart.hidden = !one;
  if (!one) return;
  const z = levels(one.z, one.low, one.high), [s0, s1] = one.s, ratio = window.devicePixelRatio || 1;
  const wide = chart.width = chart.clientWidth * ratio, high = chart.height = chart.clientHeight * ratio;
  const pen = chart.getContext("2d"), left = 4 * ratio, low = 30 * ratio, top = 6 * ratio;
  const most = Math.max(one.high, caps.peak[c]), least = Math.max(one.low, caps.peak[c] - 2.2 * caps.df[c]);
  const px = (s) => left + (s - s0) / (s1 - s0) * (wide - 2 * left), py = (h) => top + (most - h) / (most - least || 1) * (high - low - top);
  const ink = getComputedStyle(place).color;
  pen.clearRect(0, 0, wide, high);
  pen.save();
  pen.beginPath();
  pen.rect(0, 0, wide, high - low);
  pen.clip();
  pen.lineWidth = 1.5 * ratio;
  pen.strokeStyle = "#888";
  pen.beginPath();
  let on = false;
  z.forEach((h, i) => {
    if (!Number.isFinite(h)) { on = false; return; }
    pen[on ? "lineTo" : "moveTo"](px(s0 + (s1 - s0) * i / (z.length - 1)), py(h));
    on = true;
  });
  pen.stroke();
  pen.strokeStyle = "#D55E00";
  pen.beginPath();
  for (let i = 0; i <= 80; i++) {
    const s = (i / 40 - 1) * Math.min(caps.R[c], 0.6 * caps.D[c]), h = caps.peak[c] - s * s / (caps.R[c] + Math.sqrt(Math.max(0, caps.R[c] ** 2 - s * s)));
    pen[i ? "lineTo" : "moveTo"](px(s), py(h));
  }
  pen.stroke();
  pen.restore();
  pen.fillStyle = ink;
  pen.font = `${11 * ratio}px system-ui, sans-serif`;
  pen.fillText(`${engineering(s1 - s0, "m")} wide, ${engineering(most - least, "m")} high`, left, high - 18 * ratio);
  pen.fillStyle = "#888";
  pen.fillText("measured", left, high - 4 * ratio);
  pen.fillStyle = "#D55E00";
  pen.fillText("fitted sphere", left + 70 * ratio, high - 4 * ratio);
}
let built = {};
function update() {
  const faces = twoFaces(), caps_of = `${state.colour} ${faces}`, zones_of = `${state.load} ${state.force} ${faces}`;
  if (built.faces !== faces) { buildFace(); buildMate(); built.faces = faces; }
  if (built.caps !== caps_of) { buildCaps(); built.caps = caps_of; }
  if (zones && built.zones !== zones_of) { buildZones(); built.zones = zones_of; }
  draw();
  say();
}
function choose(c) {
  chosen = c;
  chart.hidden = c < 0;
  if (c < 0) row.textContent = "No cap there.";
  else { tell(c); profile(c); }
}

// --- hand and keys ----------------------------------------------------------------------------
function seen(x, y, z) {
  const [right, up] = turning(), m = middle(), [sx, sy] = fit(), p = [x - m[0], y - m[1], z * state.factor - m[2]];
  const dot = (a) => a[0] * p[0] + a[1] * p[1] + a[2] * p[2];
  return [(dot(right) * sx + 1) / 2 * canvas.clientWidth, (1 - dot(up) * sy) / 2 * canvas.clientHeight];
}
let held = null;
canvas.addEventListener("pointerdown", (e) => { held = { x: e.clientX, y: e.clientY, moved: 0 }; canvas.setPointerCapture(e.pointerId); });
canvas.addEventListener("pointermove", (e) => {
  if (!held) return;
  const dx = e.clientX - held.x, dy = e.clientY - held.y;
  held = { x: e.clientX, y: e.clientY, moved: held.moved + Math.abs(dx) + Math.abs(dy) };
  turn -= 0.008 * dx;
  tip = Math.min(Math.PI / 2, Math.max(0.02, tip + 0.008 * dy));
  draw();
});
canvas.addEventListener("pointerup", (e) => {
  const click = held && held.moved < 4;
  held = null;
  if (!click) return;
  const box = canvas.getBoundingClientRect();
  let best = -1, nearest = Infinity;
  for (let c = 0; c < N; c++) {
    const [x, y] = seen(caps.x[c], caps.y[c], placed(caps.x[c], caps.y[c], caps.peak[c] - data.low)), [sx] = fit();
    const away = Math.hypot(x - e.clientX + box.left, y - e.clientY + box.top);
    if (away < Math.max(9, 0.5 * caps.base[c] * sx * canvas.clientWidth) && away < nearest) { nearest = away; best = c; }
  }
  choose(best);
});
canvas.addEventListener("wheel", (e) => {
  if (!e.shiftKey) return;  // the wheel alone scrolls the page
  e.preventDefault();
  zoom = Math.min(20, Math.max(0.5, zoom * Math.exp(-0.0015 * (e.deltaY || e.deltaX))));
  draw();
}, { passive: false });
canvas.addEventListener("keydown", (e) => {
  const step = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[e.key];
  if (step) { turn += step[0]; tip = Math.min(Math.PI / 2, Math.max(0.02, tip + step[1])); }
  else if (e.key === "+" || e.key === "-") zoom = Math.min(20, Math.max(0.5, zoom * (e.key === "+" ? 1.2 : 1 / 1.2)));
  else return;
  e.preventDefault();
  draw();
});
new ResizeObserver(draw).observe(canvas);
update();
window.capslipViewer = { state, update, counts, choose, placed, seen, sliders };
})();
