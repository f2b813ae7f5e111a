// Many scans: what is filtered is drawn and sorted whole, but only rows that are looked at are made.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const STATUSES = ["ok", "check", "failed", "to do"], STEP = 100;
  const [STATUS, SCAN, GROUP, ERROR, LINK, NUMBERS, CAUSES, CURVES, STAMP] = Array(9).keys();
  const at = (id) => document.getElementById(id);
  const make = (tag, text, kind) => {
    const one = document.createElement(tag);
    if (text) one.textContent = text;
    if (kind) one.className = kind;
    return one;
  };
  const part = (tag, text, kind) => { // a name or a path, which breaks after what parts it
    const one = make(tag, "", kind);
    for (const piece of text.split(/(?<=[-_./])/)) one.append(piece, make("wbr"));
    return one;
  };
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const PREFIX = { "-18": "a", "-15": "f", "-12": "p", "-9": "n", "-6": "µ", "-3": "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T" };
  const write = (value, isCount) => {
    if (isCount) return String(value);
    const text = String(Number(value.toPrecision(3)));
    return text.includes("e") || (value && Math.abs(value) < 1e-4) ? value.toExponential(2) : text;
  };
  const decade = (power, unit) => {
    if (!unit) return power < -3 || power > 4 ? `1e${power}` : String(Number(`1e${power}`));
    const three = Math.max(-18, Math.min(12, 3 * Math.floor(power / 3)));
    return `${Number(`1e${power - three}`)} ${PREFIX[three]}${unit}`;
  };
  const searched = data.rows.map((row) =>
    [row[SCAN], row[GROUP], row[ERROR], ...row[CAUSES].map((cause) => cause[1])].join(" ").toLowerCase());

  const state = { status: null, find: "", sort: null, down: false, curve: 0, shown: data.rows.map((_, i) => i), made: 0 };
  let mark = () => {};
  const some = data.curves.map((_, k) => data.rows.some((row) => (row[CURVES][k] || []).length));
  state.curve = Math.max(0, some.indexOf(true));

  function choose() {
    const words = state.find.toLowerCase().split(/\s+/).filter(Boolean);
    state.shown = [];
    for (let i = 0; i < data.rows.length; i++) {
      if (state.status && data.rows[i][STATUS] !== state.status) continue;
      if (words.every((word) => searched[i].includes(word))) state.shown.push(i);
    }
    if (state.sort !== null) {
      const key = (row) => state.sort < 0 ? row[SCAN] : row[NUMBERS][state.sort];
      const sign = state.down ? -1 : 1;
      state.shown.sort((i, j) => {
        const a = key(data.rows[i]), b = key(data.rows[j]);
        if (a === null || b === null) return (a === null) - (b === null); // absent ones last
        return sign * (typeof a === "string" ? (a < b ? -1 : a > b ? 1 : 0) : a - b);
      });
    }
    at("shown").textContent = `${state.shown.length} of ${data.rows.length}`;
    at("rows").replaceChildren();
    state.made = 0;
    more();
    draw();
  }

  function rowOf(i) {
    const row = data.rows[i], line = document.createElement("tr");
    const face = make("td", "", "face");
    if (row[STAMP]) {
      const image = make("img");
      image.src = `data:image/png;base64,${row[STAMP]}`;
      image.alt = `heights of ${row[SCAN]}`;
      face.append(image);
    }
    const scan = make("td", "", "scan");
    if (row[LINK]) {
      const link = part("a", row[SCAN]);
      link.href = row[LINK].split("/").map(encodeURIComponent).join("/");
      scan.append(link);
    } else scan.append(part("b", row[SCAN]));
    scan.append(make("span", row[STATUS] + (row[GROUP] ? `, ${row[GROUP]}` : ""), `is-${row[STATUS].replace(" ", "")}`));
    line.append(face, scan);
    row[NUMBERS].forEach((value, k) => {
      const [label, unit, scale, , isCount] = data.columns[k];
      const cell = make("td", value === null ? "" : write(value / scale, isCount), "number");
      cell.dataset.label = unit ? `${label} [${unit}]` : label;
      line.append(cell);
    });
    const why = make("td", "", "why");
    if (row[ERROR]) why.append(part("div", row[ERROR], "error"));
    for (const [severity, code, moved] of row[CAUSES]) {
      const cause = make("div", `${code.replaceAll("_", " ")}${moved ? `: ${moved.replaceAll(" %", "\u00a0%")}` : ""}`, severity);
      cause.title = data.effects[code] || "";
      if (severity !== "error" || !row[ERROR]) why.append(cause);
    }
    line.append(why);
    line.addEventListener("mouseenter", () => mark(i));
    line.addEventListener("mouseleave", () => mark(-1));
    return line;
  }

  function more() {
    const next = state.shown.slice(state.made, state.made + STEP);
    at("rows").append(...next.map(rowOf));
    state.made += next.length;
    at("more").hidden = state.made >= state.shown.length;
  }

  function sheet(canvas) {
    const box = canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(box.width * ratio);
    canvas.height = Math.round(box.height * ratio);
    const pen = canvas.getContext("2d", { willReadFrequently: true });
    pen.scale(ratio, ratio);
    pen.font = "11px system-ui, sans-serif";
    pen.lineJoin = "round";
    return [pen, box.width, box.height];
  }

  function ticks(low, high, most) { // whole decades, at most so many
    const step = Math.max(1, Math.ceil((high - low) / 1000 / most)), found = [];
    for (let power = Math.ceil(low / 1000); power * 1000 <= high; power += 1) if (power % step === 0) found.push(power);
    return found;
  }

  function usable(has) { // what is shown and has something, and how many more failed: their numbers are not to be used
    const known = state.shown.filter((i) => has(data.rows[i]));
    const found = known.filter((i) => data.rows[i][STATUS] !== "failed");
    return [found, known.length - found.length];
  }

  function curves() {
    const canvas = at("curves"), [pen, width, height] = sheet(canvas);
    const [unitX, unitY, title, over, most] = data.curves[state.curve];
    const [drawn, failed] = usable((row) => (row[CURVES][state.curve] || []).length > 2);
    canvas.setAttribute("aria-label", `${title} of ${drawn.length} scans`);
    const bound = most === null ? "" : ` Above ${most} it is not defined and not drawn.`;
    at("curve-note").textContent = drawn.length ? `${drawn.length} of ${state.shown.length} scans, over ${over}; both axes are logarithmic.${bound}${failed ? ` ${failed} failed, left out.` : ""}` : `None of the ${state.shown.length} scans has this curve${failed ? `, ${failed} failed left out` : ""}.`;
    mark = () => {};
    if (!drawn.length) return;
    let [x0, x1, y0, y1] = [Infinity, -Infinity, Infinity, -Infinity];
    for (const i of drawn) {
      const line = data.rows[i][CURVES][state.curve], n = line.length / 2;
      for (let k = 0; k < n; k++) {
        x0 = Math.min(x0, line[k]); x1 = Math.max(x1, line[k]);
        y0 = Math.min(y0, line[n + k]); y1 = Math.max(y1, line[n + k]);
      }
    }
    if (most !== null) y1 = Math.min(y1, 1000 * Math.log10(most));
    x1 = Math.max(x1, x0 + 1000); y0 = Math.max(y0, y1 - 8000); if (y1 < y0 + 1000) y0 = y1 - 1000;
    const left = 58, right = width - 10, top = 10, bottom = height - 24;
    const X = (x) => left + (right - left) * (x - x0) / (x1 - x0);
    const Y = (y) => bottom - (bottom - top) * (y - y0) / (y1 - y0);
    pen.fillStyle = colour("--faint"); pen.strokeStyle = colour("--line");
    pen.textAlign = "center"; pen.textBaseline = "top";
    for (const power of ticks(x0, x1, width / 75)) {
      pen.beginPath(); pen.moveTo(X(1000 * power), top); pen.lineTo(X(1000 * power), bottom); pen.stroke();
      pen.fillText(decade(power, unitX), Math.min(right - 14, X(1000 * power)), bottom + 6);
    }
    pen.textAlign = "right"; pen.textBaseline = "middle";
    for (const power of ticks(y0, y1, height / 32)) {
      pen.beginPath(); pen.moveTo(left, Y(1000 * power)); pen.lineTo(right, Y(1000 * power)); pen.stroke();
      pen.fillText(decade(power, unitY), left - 5, Y(1000 * power));
    }
    pen.beginPath(); pen.rect(left, top, right - left, bottom - top); pen.clip();
    const trace = (i) => {
      const line = data.rows[i][CURVES][state.curve], n = line.length / 2;
      pen.moveTo(X(line[0]), Y(line[n]));
      for (let k = 1; k < n; k++) pen.lineTo(X(line[k]), Y(line[n + k]));
    };
    pen.strokeStyle = colour("--info");
    pen.globalAlpha = Math.max(0.05, Math.min(0.9, 12 / drawn.length));
    for (let first = 0; first < drawn.length; first += 50) {
      pen.beginPath();
      drawn.slice(first, first + 50).forEach(trace);
      pen.stroke();
    }
    const all = make("canvas"); // a marked curve is drawn over a copy of the others
    [all.width, all.height] = [canvas.width, canvas.height];
    all.getContext("2d").drawImage(canvas, 0, 0);
    mark = (i) => {
      pen.globalAlpha = 1;
      pen.drawImage(all, 0, 0, width, height);
      if (!(data.rows[i]?.[CURVES][state.curve] || []).length) return;
      pen.lineWidth = 3; pen.strokeStyle = "#D55E00";
      pen.beginPath(); trace(i); pen.stroke();
    };
  }

  function histogram(canvas, k) {
    const [pen, width, height] = sheet(canvas), [label, unit, scale, , isCount] = data.columns[k];
    const [counted, failed] = usable((row) => row[NUMBERS][k] !== null);
    const values = counted.map((i) => data.rows[i][NUMBERS][k] / scale);
    values.sort((a, b) => a - b);
    const half = values.length >> 1, median = (values[half] + values[values.length - 1 - half]) / 2;
    const drawn = values.filter((value) => value > 0), out = values.length - drawn.length;
    const left = failed ? `; ${failed} failed left out` : "";
    const without = (out ? `; ${out} of ${values.length} at zero or below ${out === 1 ? "is" : "are"} not drawn` : "") + left;
    canvas.setAttribute("aria-label", values.length ? `${label} of ${values.length} scans: ${write(values[0], isCount)} to ${write(values.at(-1), isCount)} ${unit}, median ${write(median, isCount)} ${unit}${without}` : `${label}: no scan${left}`);
    canvas.parentElement.firstChild.textContent = values.length ? `${label}${unit ? ` [${unit}]` : ""}: median ${write(median, isCount)}${without}` : `${label}: none${left}`;
    if (!drawn.length) return;
    let low = Math.log10(drawn[0]), high = Math.log10(drawn.at(-1));
    if (high - low < 0.1) { low -= 0.05; high += 0.05; }
    const bins = Array(Math.max(8, Math.min(40, Math.ceil(2 * Math.cbrt(drawn.length))))).fill(0);
    for (const value of drawn) bins[Math.min(bins.length - 1, Math.floor(bins.length * (Math.log10(value) - low) / (high - low)))] += 1;
    const most = Math.max(...bins), bottom = height - 18, wide = (width - 8) / bins.length;
    pen.fillStyle = colour("--info");
    bins.forEach((count, b) => {
      const tall = count ? Math.max(1, (bottom - 4) * count / most) : 0;
      pen.fillRect(4 + b * wide, bottom - tall, Math.max(1, wide - 1), tall);
    });
    pen.fillStyle = colour("--faint"); pen.textBaseline = "top";
    pen.textAlign = "left"; pen.fillText(write(10 ** low), 4, bottom + 4);
    pen.textAlign = "right"; pen.fillText(write(10 ** high), width - 4, bottom + 4);
  }

  const spread = [];
  function draw() {
    curves();
    for (const [canvas, k] of spread) histogram(canvas, k);
  }

  for (const status of STATUSES) {
    const count = data.rows.filter((row) => row[STATUS] === status).length;
    if (!count) continue;
    const button = make("button", `${count} ${status}`, status.replace(" ", ""));
    button.type = "button";
    button.style.flexGrow = count;
    button.setAttribute("aria-pressed", "false");
    button.addEventListener("click", () => {
      state.status = state.status === status ? null : status;
      for (const other of at("strip").children) other.setAttribute("aria-pressed", String(other === button && state.status !== null));
      choose();
    });
    at("strip").append(button);
  }
  data.curves.forEach(([, , title], k) => {
    const button = make("button", title);
    button.type = "button";
    button.setAttribute("aria-pressed", String(k === state.curve));
    button.addEventListener("click", () => {
      state.curve = k;
      [...at("curve-title").children].forEach((other, j) => other.setAttribute("aria-pressed", String(j === k)));
      curves();
    });
    at("curve-title").append(button);
  });
  data.columns.forEach(([, , , shows], k) => {
    if (!shows) return;
    const figure = make("figure"), canvas = make("canvas");
    canvas.setAttribute("role", "img");
    figure.append(make("figcaption", " "), canvas);
    at("spread").append(figure);
    spread.push([canvas, k]);
  });
  const heads = [["scan", "", -1], ...data.columns.map(([label, unit], k) => [label, unit, k])];
  at("heads").append(make("th"));
  for (const [label, unit, k] of heads) {
    const head = make("th", "", k < 0 ? "text" : ""), button = make("button", unit ? `${label} [${unit}]` : label);
    head.scope = "col";
    button.type = "button";
    button.addEventListener("click", () => {
      state.down = state.sort === k ? !state.down : k >= 0;
      state.sort = k;
      for (const other of at("heads").children) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", state.down ? "descending" : "ascending");
      choose();
    });
    head.append(button);
    at("heads").append(head);
  }
  at("heads").append(make("th", "main causes", "text"));
  let waiting = 0;
  at("find").addEventListener("input", () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => { state.find = at("find").value; choose(); }, 120);
  });
  at("more").addEventListener("click", more);
  new IntersectionObserver((seen) => { if (seen.some((one) => one.isIntersecting)) more(); }, { rootMargin: "400px" }).observe(at("more"));
  addEventListener("resize", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  choose();
})();
