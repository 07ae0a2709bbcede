// The page of `magsteer web`: draws what /events tells, and sends what the user asks by POST /command.
"use strict";

const byId = (id) => document.getElementById(id);
const meta = (name) => document.querySelector(`meta[name="magsteer-${name}"]`).content;
const token = meta("token");
const MAGNET_COLOURS = ["#39c5cf", "#f0b429", "#d671e8", "#6fd36f", "#7da8ff", "#ff8a7a", "#b8e04a", "#ffffff"];
const COIL_COLOURS = ["#39c5cf", "#f0b429", "#d671e8", "#6fd36f", "#7da8ff", "#ff8a7a", "#b8e04a", "#c9d4de"];
const HISTORY_S = 60;      // as far as the server remembers
const FRAME_AGE_MAX_MS = 1500; // frames come ten times a second
const SURE_MS = 3000;      // how long the emergency stop waits for its second press

let rig = null;            // facts that do not change
let figures = null;        // the present
let samples = [];          // the last minute
let mayCommand = false;
let heardAt = 0;           // performance.now() of the last frame
let spanS = 30;
const sliders = [];        // of magnet and angle: {magnet, angle, range, number, held}
const plots = [];          // functions that draw

function make(tag, parent, properties = {}) {
  const element = Object.assign(document.createElement(tag), properties);
  parent.append(element);
  return element;
}

function number(value, digits) {
  if (value === null || value === undefined) return "–";
  const text = value.toFixed(digits);
  // Nothing is less than nothing by a rounded zero.
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "\u2212");
}

// ---- what comes -----------------------------------------------------------------------------------------------------

function listen() {
  const source = new EventSource("/events");
  source.addEventListener("hello", (event) => {
    const hello = JSON.parse(event.data);
    if (hello.boot !== meta("boot")) {
      // Another life of the server: its token is another, too.
      location.reload();
      return;
    }
    mayCommand = hello.commands;
    document.body.classList.toggle("remote", !mayCommand);
    build(hello.rig);
    samples = hello.samples;
    showEvents(hello.events);
    take(hello.figures);
  });
  source.addEventListener("frame", (event) => {
    const frame = JSON.parse(event.data);
    const last = samples.length ? samples[samples.length - 1].time_s : -Infinity;
    samples.push(...frame.samples.filter((sample) => sample.time_s > last));
    const begin = samples.length ? samples[samples.length - 1].time_s - HISTORY_S : 0;
    while (samples.length && samples[0].time_s < begin) samples.shift();
    if (frame.events) showEvents(frame.events);
    take(frame.figures);
  });
}

function take(newest) {
  figures = newest;
  heardAt = performance.now();
  requestAnimationFrame(draw);
}

// ---- what is asked --------------------------------------------------------------------------------------------------

async function command(content) {
  const box = byId("answer");
  let text;
  let refused = true;
  try {
    const response = await fetch("/command", {
      method: "POST",
      headers: { "Content-Type": "application/json", "X-Magsteer-Token": token },
      body: JSON.stringify(content),
    });
    const answer = await response.json();
    refused = !answer.accepted;
    if (answer.error) text = `${content.verb}: not done: ${answer.error}`;
    else if (refused) text = `${content.verb} refused while ${answer.state}: ${answer.cause}`;
    else text = `${content.verb}: done, ${answer.state}`;
  } catch {
    text = `${content.verb}: NOT DONE: the server of this page does not answer`;
  }
  box.textContent = text;
  box.classList.toggle("refused", refused);
}

function setTarget() {
  const angles = rig.magnets.map(() => []);
  for (const slider of sliders) angles[slider.magnet][slider.angle] = Number(slider.range.value);
  command({ verb: "set-target", angles_deg: angles }).finally(() => {
    for (const slider of sliders) slider.held = false;
  });
}

function wireButtons() {
  for (const button of document.querySelectorAll("button[data-verb]")) {
    button.addEventListener("click", () => command({ verb: button.dataset.verb }));
  }
  const estop = byId("estop");
  let sure = 0;
  estop.addEventListener("click", () => {
    clearTimeout(sure);
    const asked = estop.classList.toggle("sure");
    byId("estoptext").textContent = asked ? "SURE?" : "E-STOP";
    byId("estopnote").textContent = asked ? "press again" : "cut amplifiers";
    if (asked) sure = setTimeout(() => estop.classList.contains("sure") && unask(), SURE_MS);
    else command({ verb: "estop" });
  });
  function unask() {
    estop.classList.remove("sure");
    byId("estoptext").textContent = "E-STOP";
    byId("estopnote").textContent = "cut amplifiers";
  }
  for (const button of document.querySelectorAll("button[data-span]")) {
    button.addEventListener("click", () => {
      spanS = Number(button.dataset.span);
      for (const other of document.querySelectorAll("button[data-span]")) other.classList.toggle("on", other === button);
      requestAnimationFrame(draw);
    });
  }
}

// ---- the parts of the page ------------------------------------------------------------------------------------------

function build(facts) {
  if (rig) return;
  rig = facts;
  byId("rig").textContent = rig.name;
  document.title = `${rig.name} \u2013 magsteer`;
  buildTargets();
  buildPlots();
  for (const view of rig.views) plots.push(rodView(make("canvas", byId("views")), view));
  buildCurrents();
}

function angleNames() {
  return rig.angles === "planar" ? [""] : ["from z", "azimuth"];
}

function buildTargets() {
  const names = angleNames();
  rig.magnets.forEach((magnet, index) => {
    const box = make("div", byId("targets"), { className: "target" });
    const head = make("div", box, { className: "name" });
    const title = make("span", head, { textContent: magnet });
    title.style.color = MAGNET_COLOURS[index % MAGNET_COLOURS.length];
    make("span", head, { className: "error number", id: `error-${index}` });
    names.forEach((name, angle) => {
      const row = make("div", box, { className: names.length === 1 ? "angle sole" : "angle" });
      const id = `target-${index}-${angle}`;
      make("label", row, { htmlFor: id, textContent: name });
      const planar = rig.angles === "planar";
      const base = Math.round(rig.base_angles_deg[0]);
      const [min, max] = planar ? [base - 120, base + 120] : angle === 0 ? [0, 180] : [-180, 180];
      const range = make("input", row, { type: "range", id, min, max, step: 0.5, disabled: true });
      range.setAttribute("aria-label", `target of ${magnet} ${name}, degrees`);
      range.style.accentColor = MAGNET_COLOURS[index % MAGNET_COLOURS.length];
      const box2 = make("input", row, { type: "number", id: `${id}-deg`, min, max, step: 0.5, disabled: true });
      box2.setAttribute("aria-label", `target of ${magnet} ${name}, degrees`);
      const slider = { magnet: index, angle, range, number: box2, held: false };
      range.addEventListener("input", () => { slider.held = true; box2.value = range.value; });
      range.addEventListener("change", setTarget);
      box2.addEventListener("input", () => { slider.held = true; });
      box2.addEventListener("change", () => {
        if (!box2.checkValidity() || box2.value === "") { slider.held = false; return; }
        range.value = box2.value;
        setTarget();
      });
      sliders.push(slider);
    });
  });
}

function buildCurrents() {
  byId("coils").classList.toggle("many", rig.coils.length > 8);
  rig.coils.forEach((name, index) => {
    const coil = make("div", byId("coils"), { className: "coil", id: `coil-${index}` });
    make("span", coil, { className: "name", textContent: name, title: `${name}, at most ${rig.current_max_a[index]} A` });
    make("span", coil, { className: "number" });
    const track = make("div", coil, { className: "track" });
    make("div", track, { className: "fill" });
    make("div", track, { className: "tick" });
  });
  rig.frames.forEach((name, index) => {
    const frame = make("div", byId("frames"), { className: "frame", id: `frame-${index}` });
    make("span", frame, { textContent: `frame ${name}` });
    make("span", frame, { className: "number" });
  });
}

function buildPlots() {
  const names = angleNames();
  const count = names.length;
  rig.magnets.forEach((magnet, index) => names.forEach((name, angle) => {
    const row = index * count + angle;
    const colour = MAGNET_COLOURS[index % MAGNET_COLOURS.length];
    const of = (key) => (sample) => sample.angles_deg[row][key];
    plots.push(timePlot(make("canvas", byId("angles")), {
      title: `${magnet} ${name}`.trim(), unit: "\u00b0", colour, height: count === 1 ? 240 : 150, spanMin: 10, wrap: 360,
      lines: [
        { value: of("predicted"), colour: "#5b9dff", dash: [2, 3], width: 1.6 },
        { value: of("desired"), colour: "#8fa1b3", width: 1.2 },
        { value: of("measured"), colour, width: 2 },
        { value: of("target"), colour: "#ffffff", dash: [7, 5], width: 1.2 },
      ],
    }));
  }));
  const limit = Math.max(...rig.current_max_a);
  plots.push(timePlot(make("canvas", byId("currenttime")), {
    title: "", unit: "", height: 260, range: [-1.08 * limit, 1.08 * limit], marks: [-limit, limit],
    lines: rig.coils.map((_, coil) => (
      { value: (sample) => sample.currents_a[coil], colour: COIL_COLOURS[coil % COIL_COLOURS.length], width: 1.5 })),
  }));
}

function showEvents(events) {
  const list = byId("lines");
  list.replaceChildren();
  for (const event of [...events].reverse()) {
    const line = make("li", list, { className: event.level });
    const time = new Date(event.time);
    make("time", line, { textContent: isNaN(time) ? event.time : time.toLocaleTimeString("en-GB"), title: event.time });
    make("span", line, { textContent: event.text.replaceAll("->", "\u2192") });
  }
}

// ---- drawing --------------------------------------------------------------------------------------------------------

/** The context of a canvas, cleared and scaled to the screen's dots, with its size in CSS pixels. */
function prepared(canvas, height) {
  const width = canvas.clientWidth;
  const dots = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * dots) || canvas.height !== Math.round(height * dots)) {
    canvas.width = Math.round(width * dots);
    canvas.height = Math.round(height * dots);
    canvas.style.height = `${height}px`;
  }
  const context = canvas.getContext("2d");
  context.setTransform(dots, 0, 0, dots, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "11px system-ui, 'DejaVu Sans', sans-serif";
  return { context, width, height };
}

/** Round steps for an axis. */
function ticks(low, high, count) {
  const raw = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((candidate) => candidate >= raw);
  const found = [];
  for (let at = Math.ceil(low / step); at * step <= high; at += 1) found.push(at * step);
  return found;
}

function timePlot(canvas, { title, unit, colour, height, lines, spanMin = 0, range = null, marks = [], wrap = 0 }) {
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", `${title || "currents"} against time`);
  return () => {
    const area = prepared(canvas, height);
    const { context, width } = area;
    const [left, right, top, bottom] = [40, width - 8, title ? 22 : 8, height - 20];
    const now = samples.length ? samples[samples.length - 1].time_s : 0;
    const shown = samples.filter((sample) => sample.time_s >= now - spanS);
    let [low, high] = range || extremes(shown, lines, spanMin);
    const x = (time) => right + ((time - now) / spanS) * (right - left);
    const y = (value) => bottom - ((value - low) / (high - low)) * (bottom - top);
    context.strokeStyle = "#26313d";
    context.fillStyle = "#93a3b3";
    context.lineWidth = 1;
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const value of ticks(low, high, height > 150 ? 5 : 3)) {
      line(context, left, y(value), right, y(value));
      context.fillText(`${Number(value.toFixed(3))}${unit}`.replace("-", "\u2212"), left - 5, y(value));
    }
    context.textAlign = "center";
    context.textBaseline = "top";
    for (const value of ticks(-spanS, 0, 6)) {
      line(context, x(now + value), top, x(now + value), bottom);
      if (width > 300 || value % (spanS / 3) === 0) {
        context.textAlign = value === 0 ? "right" : "center";
        context.fillText(value === 0 ? "now" : `\u2212${-value} s`, x(now + value) + (value === 0 ? 6 : 0), bottom + 5);
      }
    }
    context.strokeStyle = "#e5484d";
    context.setLineDash([3, 4]);
    for (const value of marks) line(context, left, y(value), right, y(value));
    context.save();
    context.beginPath();
    context.rect(left, top - 1, right - left, bottom - top + 2);
    context.clip();
    for (const { value, colour: stroke, dash = [], width: thick } of lines) {
      context.strokeStyle = stroke;
      context.lineWidth = thick;
      context.lineJoin = "round";
      context.setLineDash(dash);
      context.beginPath();
      let last = null;
      for (const sample of shown) {
        const present = value(sample);
        if (present === null || present === undefined) { last = null; continue; }
        const apart = last && (sample.time_s - last.time > 0.5 || (wrap && Math.abs(present - last.value) > wrap / 2));
        if (!last || apart) context.moveTo(x(sample.time_s), y(present));
        else context.lineTo(x(sample.time_s), y(present));
        last = { time: sample.time_s, value: present };
      }
      context.stroke();
    }
    context.restore();
    context.setLineDash([]);
    if (title) {
      context.textAlign = "left";
      context.textBaseline = "alphabetic";
      context.font = "600 13px system-ui, 'DejaVu Sans', sans-serif";
      context.fillStyle = colour;
      context.fillText(title, left, 14);
      const newest = shown[shown.length - 1];
      const measured = newest ? lines[2].value(newest) : null;
      const target = newest ? lines[3].value(newest) : null;
      context.fillStyle = "#e8eef4";
      context.textAlign = "right";
      context.fillText(`${number(measured, 1)}\u00b0 of ${number(target, 1)}\u00b0`, right, 14);
    }
  };
}

function line(context, x1, y1, x2, y2) {
  context.beginPath();
  context.moveTo(x1, y1);
  context.lineTo(x2, y2);
  context.stroke();
}

/** A little more than what is plotted. */
function extremes(shown, lines, spanMin) {
  let [low, high] = [Infinity, -Infinity];
  for (const sample of shown) {
    for (const { value } of lines) {
      const present = value(sample);
      if (present === null || present === undefined) continue;
      low = Math.min(low, present);
      high = Math.max(high, present);
    }
  }
  if (low > high) return [0, 180];
  const margin = Math.max(0.08 * (high - low), 0.5 * (spanMin - (high - low)));
  return [low - margin, high + margin];
}

/** The rod in a projection, true to scale. */
function rodView(canvas, view) {
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", `rod, ${view.name}`);
  return () => {
    const radius = rig.workspace_radius_mm;
    const { context, width, height } = prepared(canvas, Math.min(canvas.clientWidth * 0.72, 250));
    const scale = Math.min(width, height) / (2.16 * radius);
    const [cx, cy] = [rig.workspace_center_mm[view.right], rig.workspace_center_mm[view.up]];
    const at = (point) => [width / 2 + (point[view.right] - cx) * scale, height / 2 - (point[view.up] - cy) * scale];
    grid(context, width, height, scale, cx, cy, view);
    context.strokeStyle = "#35475a";
    context.lineWidth = 1;
    context.beginPath();
    context.arc(width / 2, height / 2, radius * scale, 0, 2 * Math.PI);
    context.stroke();
    const rod = figures.rod;
    path(context, rod.line_mm.map(at), "#c9d4de", Math.max(2.5, 2 * rig.section_radius_mm * scale));
    if (rod.line_mm.length) clamp(context, at(rod.line_mm[0]));
    rod.measured_mm.forEach((ends, magnet) => {
      if (!ends) return;
      const [start, end] = ends.map(at);
      const colour = MAGNET_COLOURS[magnet % MAGNET_COLOURS.length];
      targetArrow(context, ends, figures.magnets[magnet].target_deg, at, radius);
      context.lineCap = "butt";
      path(context, [start, end], colour, Math.max(5, 2 * rig.magnet_radius_mm[magnet] * scale));
    });
    context.fillStyle = "#93a3b3";
    context.textAlign = "left";
    context.textBaseline = "top";
    context.font = "600 13px system-ui, 'DejaVu Sans', sans-serif";
    context.fillText(view.name.replace("-", "\u2013"), 8, 6);
  };
}

/** Lines each 20 mm, and what they are. */
function grid(context, width, height, scale, cx, cy, view) {
  const axes = ["x", "y", "z"];
  context.strokeStyle = "#1d2630";
  context.lineWidth = 1;
  for (let x = Math.ceil((cx - width / 2 / scale) / 20) * 20; x <= cx + width / 2 / scale; x += 20) {
    line(context, width / 2 + (x - cx) * scale, 0, width / 2 + (x - cx) * scale, height);
  }
  for (let y = Math.ceil((cy - height / 2 / scale) / 20) * 20; y <= cy + height / 2 / scale; y += 20) {
    line(context, 0, height / 2 - (y - cy) * scale, width, height / 2 - (y - cy) * scale);
  }
  const [x0, y0] = [12, height - 12];
  context.strokeStyle = context.fillStyle = "#6d7e8e";
  line(context, x0, y0, x0 + 22, y0);
  line(context, x0, y0, x0, y0 - 22);
  context.textAlign = "left";
  context.textBaseline = "middle";
  context.fillText(axes[view.right], x0 + 26, y0);
  context.fillText(axes[view.up], x0 - 3, y0 - 30);
  context.strokeStyle = "#6d7e8e";
  line(context, width - 12 - 20 * scale, y0, width - 12, y0);
  context.textAlign = "right";
  context.fillText("20 mm", width - 12, y0 - 9);
}

function path(context, points, colour, width) {
  if (points.length < 2) return;
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.lineJoin = "round";
  context.beginPath();
  points.forEach(([x, y], index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.stroke();
}

function clamp(context, [x, y]) {
  context.fillStyle = "#6d7e8e";
  context.fillRect(x - 6, y - 9, 6, 18);
}

function targetArrow(context, ends, angles, at, radius) {
  if (!angles.length) return;
  const direction = directionOf(angles);
  const middle = ends[0].map((value, axis) => 0.5 * (value + ends[1][axis]));
  const tip = middle.map((value, axis) => value + 0.34 * radius * direction[axis]);
  const [[x1, y1], [x2, y2]] = [at(middle), at(tip)];
  const length = Math.hypot(x2 - x1, y2 - y1);
  context.strokeStyle = context.fillStyle = "#ffffff";
  context.lineWidth = 1.3;
  context.setLineDash([5, 4]);
  line(context, x1, y1, x2, y2);
  context.setLineDash([]);
  if (length < 8) return;
  const [ux, uy] = [(x2 - x1) / length, (y2 - y1) / length];
  context.beginPath();
  context.moveTo(x2 + 4 * ux, y2 + 4 * uy);
  context.lineTo(x2 - 4 * ux - 4 * uy, y2 - 4 * uy + 4 * ux);
  context.lineTo(x2 - 4 * ux + 4 * uy, y2 - 4 * uy - 4 * ux);
  context.fill();
}

/** The direction of a rig's angles, as the server has it. */
function directionOf(angles) {
  const fromZ = (angles[0] * Math.PI) / 180;
  let [cos, sin] = [1, 0];
  if (rig.angles === "planar") [cos, sin] = rig.in_plane;
  else [cos, sin] = [Math.cos((angles[1] * Math.PI) / 180), Math.sin((angles[1] * Math.PI) / 180)];
  return [Math.sin(fromZ) * cos, Math.sin(fromZ) * sin, Math.cos(fromZ)];
}

function draw() {
  if (!rig || !figures) return;
  drawHead();
  drawTargets();
  drawCurrents();
  drawTiming();
  for (const plot of plots) plot();
}

function linkText() {
  if (performance.now() - heardAt > FRAME_AGE_MAX_MS) return "page server does not answer";
  const age = figures.age_s;
  if (figures.link === "attached") return "attached";
  return age === null ? { absent: "no daemon", waiting: "no status yet" }[figures.link] || figures.link
    : `no daemon for ${age.toFixed(0)} s`;
}

function isPresent() {
  return figures && figures.link === "attached" && performance.now() - heardAt <= FRAME_AGE_MAX_MS;
}

function drawHead() {
  const present = isPresent();
  document.body.classList.toggle("old", !present);
  const state = byId("state");
  state.textContent = figures.state;
  state.className = `pill ${figures.state}`;
  byId("link").textContent = linkText();
  byId("rate").textContent = `${number(figures.rate_measured_hz, 0)} Hz`;
  byId("cycle").textContent = figures.cycle.toLocaleString("en-GB").replaceAll(",", "\u202f");
  byId("missed").textContent = figures.missed;
  byId("margin").textContent = number(figures.stability_margin, 2);
  byId("margin").classList.toggle("low", figures.stability_low);
  byId("poses").textContent = figures.pose_age_ms === null ? "none" : `${number(figures.pose_age_ms, 1)} ms`;
  const alerts = byId("alerts");
  const wanted = figures.alerts.map((alert) => `${alert.level} ${alert.text}`).join("\n");
  if (alerts.dataset.shown !== wanted) {
    alerts.dataset.shown = wanted;
    alerts.replaceChildren();
    for (const alert of figures.alerts) make("li", alerts, { className: alert.level, textContent: alert.text });
  }
  const enabled = { arm: ["idle"], go: ["armed", "holding"], hold: ["active"], reset: ["fault"] };
  for (const [id, states] of Object.entries(enabled)) {
    byId(id).disabled = !(present && mayCommand && states.includes(figures.state));
  }
}

function drawTargets() {
  const usable = isPresent() && mayCommand;
  for (const slider of sliders) {
    const magnet = figures.magnets[slider.magnet];
    slider.range.disabled = slider.number.disabled = !usable;
    const angles = magnet.target_deg.length ? magnet.target_deg : magnet.measured_deg;
    const busy = slider.held || document.activeElement === slider.number;
    if (!busy && angles.length) {
      slider.range.value = angles[slider.angle];
      slider.number.value = angles[slider.angle].toFixed(1);
    }
  }
  figures.magnets.forEach((magnet, index) => {
    const measured = magnet.measured_deg.map((angle) => `${number(angle, 1)}\u00b0`).join(", ") || "not seen";
    const error = magnet.error_deg === null ? "" : `, off by ${number(magnet.error_deg, 2)}\u00b0`;
    byId(`error-${index}`).textContent = measured + error;
  });
  const verdict = { checking: "looking at the way to the target", clear: "the way to the target is clear" };
  byId("verdict").textContent = verdict[figures.target_verdict] || "";
  const sources = { model: "model at the measured currents", measured: "curve through measured magnets", none: "not known" };
  byId("source").textContent = sources[figures.rod.source];
}

function drawCurrents() {
  figures.coils.forEach((coil, index) => {
    const element = byId(`coil-${index}`);
    const place = (current) => Math.min(1, Math.max(0, 0.5 + (0.5 * current) / coil.limit_a));
    const [from, to] = [Math.min(0.5, place(coil.measured_a)), Math.max(0.5, place(coil.measured_a))];
    const [, value, track] = element.children;
    value.textContent = `${number(coil.measured_a, 2)} A`;
    track.children[0].style.left = `${100 * from}%`;
    track.children[0].style.width = `${100 * (to - from)}%`;
    track.children[1].style.left = `${100 * place(coil.commanded_a)}%`;
    element.classList.toggle("saturated", coil.saturated);
  });
  figures.frames.forEach((frame, index) => {
    byId(`frame-${index}`).children[1].textContent =
      `${number(frame.measured_deg, 1)}\u00b0 of ${number(frame.commanded_deg, 1)}\u00b0`;
  });
}

function drawTiming() {
  const timing = figures.last_minute || figures.timing;
  byId("timingspan").textContent = figures.last_minute ? "last minute" : "since the start";
  const rows = [["lateness", timing.lateness_us], ["execution", timing.execution_us], ["pose age", timing.pose_age_us],
    ["pose to command", timing.pose_to_command_us], ["pose to driver", timing.pose_to_driver_us]];
  const body = byId("latencies");
  const wanted = JSON.stringify(rows);
  if (body.dataset.shown !== wanted) {
    body.dataset.shown = wanted;
    body.replaceChildren();
    for (const [name, latency] of rows) {
      const row = make("tr", body);
      make("td", row, { textContent: name });
      for (const key of ["p50", "p99", "p999", "max"]) make("td", row, { textContent: latency[key].toFixed(0) });
    }
  }
  const lost = figures.recorder_lost ? `, ${figures.recorder_lost} lost` : "";
  byId("recorder").textContent =
    `recorder ${figures.recorder}, ${figures.flights} flights${lost}; coil heat ${(100 * figures.coil_heat).toFixed(0)} %; a trip would ${figures.safe_action}`;
}

wireButtons();
listen();
window.addEventListener("resize", () => requestAnimationFrame(draw));
// A server that fell silent sends no frame that would say so.
setInterval(() => { if (!isPresent()) draw(); }, 500);
