// What the joint does with another preload, friction, structure or amplitude: see whatif.py.
"use strict";
(() => {
const place = document.getElementById("whatif"), text = document.getElementById("whatif-data");
if (!place || !text) return;
const data = JSON.parse(text.textContent);
const PREFIX = { "-15": "f", "-12": "p", "-9": "n", "-6": "µ", "-3": "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T" };
const RAISED = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };
const SCALE = { K_m: 1e6, K_s: 1e6 };  // of a field: N/m in MN/m
function engineering(value, unit, digits = 4) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return `0 ${unit}`;
  const round = Number(value.toPrecision(digits));
  const power = Math.max(-15, Math.min(12, 3 * Math.floor(Math.log10(Math.abs(round)) / 3 + 1e-12)));
  return `${Number((round / 10 ** power).toPrecision(digits))} ${PREFIX[power]}${unit}`;
}

function plain(value, digits) {
  const [digit, power] = value.toExponential(digits - 1).split("e");
  if (value === 0 || Math.abs(power) < 4) return `${Number(value.toPrecision(digits))}`;
  return `${Number(digit)}·10${[...`${Number(power)}`].map((one) => RAISED[one]).join("")}`;
}

// --- the equations ----------------------------------------------------------------------------
const tables = data.tables.map((one) => {
  const all = new Float64Array(Uint8Array.from(atob(one.columns), (c) => c.charCodeAt(0)).buffer);
  const column = (i) => all.subarray(i * one.nodes, (i + 1) * one.nodes);
  return { preload: one.preload_N, n: one.nodes, columns: Array.from({ length: all.length / one.nodes }, (_, i) => column(i)) };
});
// The interval of growing numbers that holds x.
function find(xs, x) {
  let low = 0, high = xs.length - 1;
  while (high - low > 1) { const m = (low + high) >> 1; if (xs[m] <= x) low = m; else high = m; }
  return low;
}
function cubic(us, ys, slopes, u, i = find(us, u)) {
  const h = us[i + 1] - us[i], t = (u - us[i]) / h, s = 1 - t;
  return s * s * (1 + 2 * t) * ys[i] + t * t * (3 - 2 * t) * ys[i + 1] + h * t * s * (s * slopes[i] - t * slopes[i + 1]);
}
// y over x between growing rows, which it never leaves; as x^power outside.
function between(xs, ys, x, power = 1) {
  const n = xs.length;
  if (x <= xs[0]) return ys[0] * (x / xs[0]) ** power;
  if (x >= xs[n - 1]) return ys[n - 1];
  const i = find(xs, x), t = Math.log(x / xs[i]) / Math.log(xs[i + 1] / xs[i]);
  return Math.exp((1 - t) * Math.log(ys[i]) + t * Math.log(ys[i + 1]));
}
const joints = tables.map((one) => {
  const P = one.preload, last = one.n - 1;
  if (!data.cubic) {
    const [e, D, L] = one.columns;
    return { P, drop: (x) => x >= e[last] ? P : between(e, D, x), withdrawal: (drop) => between(D, e, drop), loss: (drop) => between(D, L, drop, 3) };
  }
  const [u, D, dD, L, dL] = one.columns;
  const least = u[0];
  function withdrawal(drop) {
    const y = Math.log(drop);
    if (y <= D[0]) return Math.exp(least + y - D[0]);
    if (y >= D[last]) return Math.exp(u[last]);
    const i = find(D, y);
    let low = u[i], high = u[i + 1];
    for (let k = 0; k < 60; k++) { const m = 0.5 * (low + high); if (cubic(u, D, dD, m, i) > y) high = m; else low = m; }
    return Math.exp(0.5 * (low + high));
  }
  return {
    P, withdrawal,
    drop: (e) => { const v = Math.log(e); return v >= u[last] ? P : v <= least ? Math.exp(D[0] + v - least) : Math.exp(cubic(u, D, dD, v)); },
    loss: (drop) => { const v = Math.log(withdrawal(drop)); return v <= least ? Math.exp(L[0] + 3 * (v - least)) : Math.exp(cubic(u, L, dL, v)); },
  };
});
// One state, as structure/answer.py; null beyond gross slip.
function answer({ table, friction, K_m, K_s, n, amplitude }) {
  const joint = joints[table], most = friction * joint.P;
  const force = K_s * amplitude;
  if (!(force > 0) || force > most * (1 + 1e-12)) return null;
  const drop = Math.min(force / friction, joint.P), e = joint.withdrawal(drop);
  const displacement = friction * data.kappa * e, energy = friction ** 2 * data.kappa * joint.loss(drop);
  const loss = n * energy / (Math.PI * K_m * amplitude ** 2), whole = amplitude + n * K_s / K_m * displacement;
  const light = (value) => value <= data.most_loss_factor ? value : null;
  return {
    force, displacement, energy, stiffness: force / displacement, joint_loss: energy / (Math.PI * force * displacement),
    loss: light(loss), total_loss: light(loss * amplitude / whole), shift: Math.sqrt(amplitude / whole) - 1,
  };
}
function forceAt(table, friction, displacement) {
  return displacement > 0 ? friction * joints[table].drop(displacement / (friction * data.kappa)) : 0;
}
// Masing's rule, as SlipCurve.loop.
function loop(table, friction, displacement, points = 121) {
  const tip = forceAt(table, friction, displacement), found = [];
  for (let i = 0; i < points; i++) {
    const angle = 2 * Math.PI * i / (points - 1), back = angle > Math.PI;
    const from = 2 * displacement * (back ? Math.cos(angle / 2) : Math.sin(angle / 2)) ** 2;
    const force = tip - 2 * forceAt(table, friction, from / 2), sign = back ? -1 : 1;
    found.push([sign * (displacement - from), sign * force]);
  }
  return found;
}

// --- the page ---------------------------------------------------------------------------------
const start = { table: tables.length - 1, friction: data.friction, K_m: data.modal_stiffness_N_per_m, K_s: data.joint_stiffness_N_per_m, n: data.joints };
const state = { ...start, amplitude: data.amplitude_m || 0.25 * data.friction * tables[tables.length - 1].preload / data.joint_stiffness_N_per_m };
place.innerHTML = `<div class="inputs">
<label>Preload <select data-name="table"></select></label>
<label>Friction coefficient <input data-name="friction" type="number" min="0" step="any"></label>
<label>Modal stiffness [MN/m] <input data-name="K_m" type="number" min="0.000001" step="any"></label>
<label>Joint stiffness [MN/m] <input data-name="K_s" type="number" min="0.000001" step="any"></label>
<label>Joints <input data-name="n" type="number" min="1" step="1"></label>
<label>Amplitude <output></output><input data-name="share" type="range" min="-3" max="0" step="0.002"></label>
<button type="button">as analysed</button></div>
<table class="facts"><caption class="hidden">What the joint does</caption><tbody></tbody></table>
<div class="curves"><figure><canvas class="loop" role="img"></canvas><figcaption>Loop: force over slip displacement</figcaption></figure>
<figure><canvas class="eta" role="img"></canvas><figcaption>Loss factor over amplitude, both logarithmic, to gross slip${data.unresolved > 0 ? "; pale: finer than the pixels resolve" : ""}</figcaption></figure></div>`;
const inputs = Object.fromEntries([...place.querySelectorAll("[data-name]")].map((e) => [e.dataset.name, e]));
tables.forEach((one, i) => inputs.table.add(new Option(engineering(one.preload, "N"), i)));
function gross() { return state.friction * joints[state.table].P / state.K_s; }
function put(name) { inputs[name].value = name in SCALE ? Number((state[name] / SCALE[name]).toPrecision(6)) : state[name]; }
function show() {
  for (const name of ["table", "friction", "K_m", "K_s", "n"]) if (document.activeElement !== inputs[name]) put(name);
  inputs.share.value = Math.log10(Math.min(1, state.amplitude / gross()));
  update();
}
for (const [name, element] of Object.entries(inputs)) element.addEventListener("input", () => {
  const number = Number(element.value) * (SCALE[name] || 1), value = name === "n" ? Math.round(number) : number;
  if (name === "share") state.amplitude = Math.min(1, 10 ** value) * gross();
  else if (name === "table" || value > 0) state[name] = value;
  if (name !== "share") inputs.share.value = Math.log10(Math.min(1, state.amplitude / gross()));
  update();
});
for (const name of ["friction", "K_m", "K_s", "n"]) inputs[name].addEventListener("change", () => put(name));  // what is no number above 0 was not taken
place.querySelector("button").addEventListener("click", () => { Object.assign(state, start, { amplitude: data.amplitude_m || 0.25 * start.friction * joints[start.table].P / start.K_s }); show(); });
function pen(canvas) {
  const scale = window.devicePixelRatio || 1, wide = canvas.width = canvas.clientWidth * scale, high = canvas.height = canvas.clientHeight * scale;
  const at = canvas.getContext("2d");
  at.clearRect(0, 0, wide, high);
  at.lineWidth = 1.6 * scale;
  at.font = `${11 * scale}px system-ui, sans-serif`;
  at.fillStyle = at.strokeStyle = getComputedStyle(place).color;
  return { at, wide, high, edge: 18 * scale };
}
function line(at, points, px, py) {
  at.beginPath();
  points.forEach(([x, y], i) => at[i ? "lineTo" : "moveTo"](px(x), py(y)));
  at.stroke();
}
function drawLoop(found) {
  const canvas = place.querySelector(".loop"), { at, wide, high, edge } = pen(canvas);
  if (!found) { at.fillText("beyond gross slip: no steady cycle", edge, high / 2); canvas.setAttribute("aria-label", "No loop: beyond gross slip."); return; }
  const x = found.displacement, y = found.force;
  const px = (v) => wide / 2 + v / x * (wide / 2 - edge), py = (v) => high / 2 - v / y * (high / 2 - edge);
  at.globalAlpha = 0.35;
  line(at, [[-x, 0], [x, 0]], px, py);
  line(at, [[0, -y], [0, y]], px, py);
  at.globalAlpha = 1;
  at.strokeStyle = "#0072B2";
  line(at, loop(state.table, state.friction, x), px, py);
  const size = `± ${engineering(x, "m", 3)}, ± ${engineering(y, "N", 3)}`;
  at.fillText(size, edge, edge * 0.8);
  canvas.setAttribute("aria-label", `Loop of ${size}, ${engineering(found.energy, "J", 3)} lost.`);
}
function drawEta(found) {
  const canvas = place.querySelector(".eta"), { at, wide, high, edge } = pen(canvas), most = gross(), points = [];
  for (let i = 0; i <= 90; i++) {
    const amplitude = most * 10 ** (-3 + 3 * i / 90), one = answer({ ...state, amplitude: Math.min(amplitude, most) });
    if (one && one.loss > 0) points.push([Math.log10(amplitude / most), Math.log10(one.loss)]);
  }
  if (points.length < 2) { at.fillText("no loss factor: not lightly damped", edge, high / 2); return; }
  const ys = points.map((p) => p[1]), low = Math.min(...ys), top = Math.max(...ys) + 0.1;
  const px = (v) => edge + (v + 3) / 3 * (wide - 2 * edge), py = (v) => high - edge - (v - low) / (top - low || 1) * (high - 2.5 * edge);
  at.strokeStyle = "#0072B2";
  const border = Math.log10(data.unresolved), pale = points.filter((p) => p[0] <= border);
  if (pale.length) { at.globalAlpha = 0.3; line(at, points.slice(0, pale.length + 1), px, py); at.globalAlpha = 1; }
  line(at, points.slice(pale.length), px, py);
  if (found && found.loss > 0) { at.beginPath(); at.arc(px(Math.log10(state.amplitude / most)), py(Math.log10(found.loss)), 0.3 * edge, 0, 7); at.fillStyle = "#D55E00"; at.fill(); }
  at.fillStyle = getComputedStyle(place).color;
  at.fillText(`${engineering(1e-3 * most, "m", 3)}`, edge, high - 3);
  const end = engineering(most, "m", 3);
  at.fillText(end, wide - edge - at.measureText(end).width, high - 3);
  const peak = `from ${plain(10 ** low, 2)} to ${plain(10 ** (top - 0.1), 3)}`;
  at.fillText(peak, edge, edge * 0.8);
  canvas.setAttribute("aria-label", `Loss factor, ${peak}, amplitudes from ${engineering(1e-3 * most, "m", 3)} to gross slip at ${end}.`);
}
function update() {
  const found = answer(state);
  place.querySelector("output").textContent = engineering(state.amplitude, "m");
  const factor = (value) => value === null ? "not defined: not lightly damped" : plain(value, 4);
  const rows = !found ? [["State", "beyond gross slip: nothing holds the joint"]] : [
    ["Tangential stiffness K (secant)", engineering(found.stiffness, "N/m")], ["Energy W lost per cycle, one joint", engineering(found.energy, "J")],
    ["Loss factor of the joint", plain(found.joint_loss, 4)], ["Loss factor of the structure with rigid joints", factor(found.loss)],
    ["With all that the joints move and store, as a decay shows it", factor(found.total_loss)],
    ["Slip force, displacement", `${engineering(found.force, "N")}, ${engineering(found.displacement, "m")}`], ["Frequency shift", `${Number((100 * found.shift).toPrecision(3))} %`],
  ];
  if (found && state.amplitude < data.unresolved * gross()) rows.push(["Energy and loss factors", "a guess: less slips than the pixels resolve"]);
  place.querySelector("tbody").replaceChildren(...rows.map(([name, value]) => {
    const row = document.createElement("tr"), head = document.createElement("th"), cell = document.createElement("td");
    head.scope = "row";
    head.textContent = name;
    cell.textContent = value;
    row.append(head, cell);
    return row;
  }));
  drawLoop(found);
  drawEta(found);
}
show();
addEventListener("resize", update);
const fold = place.closest("details");
if (fold) fold.addEventListener("toggle", update);
window.capslipWhatIf = { answer, loop, state, update, show, inputs };
})();
