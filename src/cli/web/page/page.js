// The page of `magsteer web`: draws what /events tells, and sends what the user asks by POST /command.
import { COIL_COLOURS, MAGNET_COLOURS, number, rodView, scene, timePlot } from "./draw.js";

const byId = (id) => document.getElementById(id);
const meta = (name) => document.querySelector(`meta[name="magsteer-${name}"]`).content;
// Printed with the address; after the # it goes to no server.
const token = new URLSearchParams(location.hash.slice(1)).get("key") ?? "";
const HISTORY_S = 60;      // as far as the server remembers
const FRAME_AGE_MAX_MS = 1500; // frames come ten times a second
const RETRY_MS = 2000;     // after the server refused the stream
const ECHO_MS = 400;       // a target takes this long to come back, and no longer
const ANSWER_MS = 6000;    // how long a request that was done is talked of
const SURE_MS = 3000;      // how long the emergency stop waits for its second press

let mayCommand = false;
let answerTimer = 0;
let sentAt = -Infinity;    // performance.now() of the last target
let heardAt = 0;           // performance.now() of the last frame
const sliders = [];        // of magnet and angle: {magnet, angle, range, number, held}
const plots = [];          // functions that draw

function make(tag, parent, properties = {}) {
  const element = Object.assign(document.createElement(tag), properties);
  parent.append(element);
  return element;
}

// ---- what comes -----------------------------------------------------------------------------------------------------

function listen() {
  const source = new EventSource("/events");
  source.addEventListener("hello", (event) => {
    const hello = JSON.parse(event.data);
    if (hello.boot !== meta("boot")) {
      // Another life of the server: its page may be another, too.
      location.reload();
      return;
    }
    mayCommand = hello.commands && token !== "";
    byId("locked").hidden = mayCommand || !hello.commands;
    document.body.classList.toggle("remote", !mayCommand);
    build(hello.rig);
    scene.samples = hello.samples;
    showEvents(hello.events);
    take(hello.figures);
  });
  source.addEventListener("frame", (event) => {
    const frame = JSON.parse(event.data);
    const last = scene.samples.length ? scene.samples[scene.samples.length - 1].time_s : -Infinity;
    scene.samples.push(...frame.samples.filter((sample) => sample.time_s > last));
    const begin = scene.samples.length ? scene.samples[scene.samples.length - 1].time_s - HISTORY_S : 0;
    while (scene.samples.length && scene.samples[0].time_s < begin) scene.samples.shift();
    if (frame.events) showEvents(frame.events);
    take(frame.figures);
  });
  source.addEventListener("error", () => {
    // Broken streams are taken up again by the browser; closed ones are not.
    if (source.readyState === EventSource.CLOSED) setTimeout(listen, RETRY_MS);
  });
}

function take(newest) {
  scene.figures = newest;
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
  clearTimeout(answerTimer);
  if (!refused) answerTimer = setTimeout(() => { box.textContent = ""; }, ANSWER_MS);
}

function setTarget() {
  const angles = scene.rig.magnets.map(() => []);
  for (const slider of sliders) angles[slider.magnet][slider.angle] = Number(slider.range.value);
  for (const slider of sliders) slider.held = false;
  sentAt = performance.now();
  command({ verb: "set-target", angles_deg: angles });
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
      scene.spanS = Number(button.dataset.span);
      for (const other of document.querySelectorAll("button[data-span]")) other.classList.toggle("on", other === button);
      requestAnimationFrame(draw);
    });
  }
}

// ---- the parts of the page ------------------------------------------------------------------------------------------

function build(facts) {
  if (scene.rig) return;
  scene.rig = facts;
  byId("rig").textContent = scene.rig.name;
  document.title = `${scene.rig.name} \u2013 magsteer`;
  buildTargets();
  buildPlots();
  for (const view of scene.rig.views) plots.push(rodView(make("canvas", byId("views")), view));
  buildCurrents();
}

function angleNames() {
  return scene.rig.angles === "planar" ? [""] : ["from z", "azimuth"];
}

function buildTargets() {
  const names = angleNames();
  scene.rig.magnets.forEach((magnet, index) => {
    const box = make("div", byId("targets"), { className: "target" });
    const head = make("div", box, { className: "name" });
    const title = make("span", head, { textContent: magnet });
    title.style.color = MAGNET_COLOURS[index % MAGNET_COLOURS.length];
    make("span", head, { className: "error number", id: `error-${index}` });
    names.forEach((name, angle) => {
      const row = make("div", box, { className: names.length === 1 ? "angle sole" : "angle" });
      const id = `target-${index}-${angle}`;
      make("label", row, { htmlFor: id, textContent: name });
      const planar = scene.rig.angles === "planar";
      const base = Math.round(scene.rig.base_angles_deg[0]);
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
  byId("coils").classList.toggle("many", scene.rig.coils.length > 8);
  scene.rig.coils.forEach((name, index) => {
    const coil = make("div", byId("coils"), { className: "coil", id: `coil-${index}` });
    const title = make("span", coil, { className: "name", title: `${name}, at most ${scene.rig.current_max_a[index]} A` });
    make("i", title).style.background = COIL_COLOURS[index % COIL_COLOURS.length];
    title.append(`${index} ${name}`);
    make("span", coil, { className: "number" });
    const track = make("div", coil, { className: "track" });
    make("div", track, { className: "fill" });
    make("div", track, { className: "tick" });
  });
  scene.rig.frames.forEach((name, index) => {
    const frame = make("div", byId("frames"), { className: "frame", id: `frame-${index}` });
    make("span", frame, { textContent: `frame ${name}` });
    make("span", frame, { className: "number" });
  });
}

function buildPlots() {
  const names = angleNames();
  const count = names.length;
  scene.rig.magnets.forEach((magnet, index) => names.forEach((name, angle) => {
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
  const limit = Math.max(...scene.rig.current_max_a);
  plots.push(timePlot(make("canvas", byId("currenttime")), {
    title: "", unit: "", height: 260, range: [-1.08 * limit, 1.08 * limit], marks: [-limit, limit],
    lines: scene.rig.coils.map((_, coil) => (
      { value: (sample) => sample.currents_a[coil], colour: COIL_COLOURS[coil % COIL_COLOURS.length], width: 1.5,
        dash: coil < COIL_COLOURS.length ? [] : [5, 3] })),
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

// ---- showing --------------------------------------------------------------------------------------------------------

function draw() {
  if (!scene.rig || !scene.figures) return;
  drawHead();
  drawTargets();
  drawCurrents();
  drawTiming();
  for (const plot of plots) plot();
}

function linkText() {
  if (performance.now() - heardAt > FRAME_AGE_MAX_MS) return "page server does not answer";
  const age = scene.figures.age_s;
  if (scene.figures.link === "attached") return "attached";
  return age === null ? { absent: "no daemon", waiting: "no status yet" }[scene.figures.link] || scene.figures.link
    : `no daemon for ${age.toFixed(0)} s`;
}

function isPresent() {
  return scene.figures && scene.figures.link === "attached" && performance.now() - heardAt <= FRAME_AGE_MAX_MS;
}

function drawHead() {
  const present = isPresent();
  document.body.classList.toggle("old", !present);
  const state = byId("state");
  state.textContent = scene.figures.state;
  state.className = `pill ${scene.figures.state}`;
  byId("link").textContent = linkText();
  const heard = (text) => (scene.figures.heard ? text : "\u2013");
  byId("rate").textContent = heard(`${number(scene.figures.rate_measured_hz, 0)} Hz`);
  byId("cycle").textContent = heard(scene.figures.cycle.toLocaleString("en-GB").replaceAll(",", "\u202f"));
  byId("missed").textContent = heard(scene.figures.missed);
  byId("margin").textContent = heard(number(scene.figures.stability_margin, 2));
  byId("margin").classList.toggle("low", scene.figures.stability_low);
  byId("poses").textContent = scene.figures.pose_age_ms === null ? "none" : `${number(scene.figures.pose_age_ms, 1)} ms`;
  const alerts = byId("alerts");
  const wanted = scene.figures.alerts.map((alert) => `${alert.level} ${alert.text}`).join("\n");
  if (alerts.dataset.shown !== wanted) {
    alerts.dataset.shown = wanted;
    alerts.replaceChildren();
    for (const alert of scene.figures.alerts) make("li", alerts, { className: alert.level, textContent: alert.text });
  }
  const enabled = { arm: ["idle"], go: ["armed", "holding"], hold: ["active"], retreat: ["holding"], reset: ["fault"] };
  for (const [id, states] of Object.entries(enabled)) {
    byId(id).disabled = !(present && mayCommand && states.includes(scene.figures.state));
  }
}

function drawTargets() {
  const usable = isPresent() && mayCommand;
  for (const slider of sliders) {
    const magnet = scene.figures.magnets[slider.magnet];
    slider.range.disabled = slider.number.disabled = !usable;
    const angles = magnet.target_deg.length ? magnet.target_deg : magnet.measured_deg;
    const busy = slider.held || performance.now() - sentAt < ECHO_MS || document.activeElement === slider.number;
    if (!busy && angles.length) {
      slider.range.value = angles[slider.angle];
      slider.number.value = angles[slider.angle].toFixed(1);
    }
  }
  scene.figures.magnets.forEach((magnet, index) => {
    const measured = magnet.measured_deg.map((angle) => `${number(angle, 1)}\u00b0`).join(", ") || "not seen";
    const error = magnet.error_deg === null ? "" : `, off by ${number(magnet.error_deg, 2)}\u00b0`;
    byId(`error-${index}`).textContent = measured + error;
  });
  const verdict = { checking: "looking at the way to the target", clear: "the way to the target is clear" };
  byId("verdict").textContent = verdict[scene.figures.target_verdict] || "";
  const sources = { model: "model at the measured currents", measured: "curve through measured magnets", none: "not known" };
  byId("source").textContent = sources[scene.figures.rod.source];
}

function drawCurrents() {
  scene.figures.coils.forEach((coil, index) => {
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
  scene.figures.frames.forEach((frame, index) => {
    byId(`frame-${index}`).children[1].textContent =
      `${number(frame.measured_deg, 1)}\u00b0 of ${number(frame.commanded_deg, 1)}\u00b0`;
  });
}

function drawTiming() {
  const timing = scene.figures.last_minute || scene.figures.timing;
  byId("timingspan").textContent = scene.figures.last_minute ? "last minute" : "since the start";
  if (!scene.figures.heard) return;
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
  const lost = scene.figures.recorder_lost ? `, ${scene.figures.recorder_lost} lost` : "";
  byId("recorder").textContent =
    `recorder ${scene.figures.recorder}, ${scene.figures.flights} flights${lost}; coil heat ${(100 * scene.figures.coil_heat).toFixed(0)} %; a trip would ${scene.figures.safe_action}`;
}

wireButtons();
listen();
window.addEventListener("resize", () => requestAnimationFrame(draw));
// A server that fell silent sends no frame that would say so.
setInterval(() => { if (!isPresent()) draw(); }, 500);
