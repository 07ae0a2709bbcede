// Canvases of the page: plots against time, and the rod in projections.

export const MAGNET_COLOURS = ["#39c5cf", "#f0b429", "#d671e8", "#6fd36f", "#7da8ff", "#ff8a7a", "#b8e04a", "#ffffff"];
export const COIL_COLOURS = ["#39c5cf", "#f0b429", "#d671e8", "#6fd36f", "#7da8ff", "#ff8a7a", "#b8e04a", "#c9d4de"];

/** What is drawn: facts that do not change, the present, the last minute, and how far plots reach back. */
export const scene = { rig: null, figures: null, samples: [], spanS: 30 };

/** A number as a person reads it. */
export function number(value, digits) {
  if (value === null || value === undefined) return "–";
  const text = value.toFixed(digits);
  // Nothing is less than nothing by a rounded zero.
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "\u2212");
}

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

/** A function that draws lines against time. */
export function timePlot(canvas, { title, unit, colour, height, lines, spanMin = 0, range = null, marks = [], wrap = 0 }) {
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", `${title || "currents"} against time`);
  return () => {
    const area = prepared(canvas, height);
    const { context, width } = area;
    const [left, right, top, bottom] = [40, width - 8, title ? 22 : 8, height - 20];
    const now = scene.samples.length ? scene.samples[scene.samples.length - 1].time_s : 0;
    const shown = scene.samples.filter((sample) => sample.time_s >= now - scene.spanS);
    let [low, high] = range || extremes(shown, lines, spanMin);
    const x = (time) => right + ((time - now) / scene.spanS) * (right - left);
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
    for (const value of ticks(-scene.spanS, 0, 6)) {
      line(context, x(now + value), top, x(now + value), bottom);
      if (width > 300 || value % (scene.spanS / 3) === 0) {
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
      const aim = target === null ? ", no target" : ` of ${number(target, 1)}\u00b0`;
      if (measured !== null) context.fillText(`${number(measured, 1)}\u00b0${aim}`, right, 14);
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
export function rodView(canvas, view) {
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", `rod, ${view.name}`);
  return () => {
    const radius = scene.rig.workspace_radius_mm;
    const { context, width, height } = prepared(canvas, Math.min(canvas.clientWidth * 0.72, 250));
    const scale = Math.min(width, height) / (2.16 * radius);
    const [cx, cy] = [scene.rig.workspace_center_mm[view.right], scene.rig.workspace_center_mm[view.up]];
    const at = (point) => [width / 2 + (point[view.right] - cx) * scale, height / 2 - (point[view.up] - cy) * scale];
    grid(context, width, height, scale, cx, cy, view);
    context.strokeStyle = "#35475a";
    context.lineWidth = 1;
    context.beginPath();
    context.arc(width / 2, height / 2, radius * scale, 0, 2 * Math.PI);
    context.stroke();
    const rod = scene.figures.rod;
    path(context, rod.line_mm.map(at), "#c9d4de", Math.max(2.5, 2 * scene.rig.section_radius_mm * scale));
    if (rod.line_mm.length) clamp(context, at(rod.line_mm[0]));
    rod.measured_mm.forEach((ends, magnet) => {
      if (!ends) return;
      const [start, end] = ends.map(at);
      const colour = MAGNET_COLOURS[magnet % MAGNET_COLOURS.length];
      targetArrow(context, ends, scene.figures.magnets[magnet].target_deg, at, radius);
      context.lineCap = "butt";
      path(context, [start, end], colour, Math.max(5, 2 * scene.rig.magnet_radius_mm[magnet] * scale));
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
  if (scene.rig.angles === "planar") [cos, sin] = scene.rig.in_plane;
  else [cos, sin] = [Math.cos((angles[1] * Math.PI) / 180), Math.sin((angles[1] * Math.PI) / 180)];
  return [Math.sin(fromZ) * cos, Math.sin(fromZ) * sin, Math.cos(fromZ)];
}
