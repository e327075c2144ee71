// The page Choose: sensors are clicked on and off, and the server replies with what they recognise.
import { button, interval, percent, storeChoice, storedChoice } from "./choice.js";
import { drawHand } from "./hand.js";
import { openPage } from "./shell.js";
import { cell, list, say } from "./wire.js";

const $ = (id) => document.getElementById(id);
const KINDS = { switch: "Switches", pad: "Pads", joint: "Joints" };
const WORK = { reading: "reading", measure: "measuring", curve: "measuring the curve", train: "training" };

let set = null; // the message on the set
let hand = null;
let boxes = [];
let chosen = []; // numbers of sensors, in the order in which they were chosen
let shown = null; // the last reply
let working = null; // what is done now, and when it will be finished
const measured = new Map(); // accuracies that were measured, by the sensors

const ask = openPage({
  open: () => set && !set.why && choose(chosen),
  project: ({ sets, state: { aside, took } }) => {
    listSets(sets, aside);
    const known = Object.keys(WORK).filter((what) => took[what] !== undefined);
    say($("times"), known.length ? `Last time, ${known.map((what) => `${WORK[what]} took ${duration(took[what])}`).join(", ")}.` : "");
  },
  set: (message) => {
    // What was measured of earlier recordings is not shown for these.
    if (set?.numbering !== message.numbering) {
      measured.clear();
      $("curve-panel").hidden = true;
    }
    set = message;
    $("empty").hidden = !set.why;
    say($("empty"), set.why);
    list($("unused"), set.unused ?? []);
    $("with-set").hidden = Boolean(set.why);
    if (set.why) return;
    listSensors();
    choose(storedChoice(set.sensors));
  },
  sensors: (drawn) => {
    $("drawn").hidden = !drawn.switches.length;
    hand = drawHand($("hand"), drawn, { onSwitch: (sensor) => toggle(sensor) });
    mark();
  },
  quick: (reply) => {
    if (isChosen(reply.sensors)) show(reply);
  },
  add: ({ sensor, sensors }) => {
    if (sensor !== null && isChosen(sensors)) choose([...chosen, sensor]);
  },
  drop: ({ sensor, sensors }) => {
    if (sensor !== null && isChosen(sensors)) choose(chosen.filter((one) => one !== sensor));
  },
  measure: ({ sensors, points, of, recipe, numbering }) => {
    if (numbering !== set.numbering) return;
    measured.set(key(sensors), { ...points[0], of, recipe });
    certify();
  },
  curve: (curve) => curve.numbering === set.numbering && drawCurve(curve),
  train: ({ folder, facts }) => {
    $("build").hidden = false;
    say($("build-heading"), `Trained: ${folder}`);
    list($("facts"), facts);
  },
  work: ({ done, total, what, why, left_s: left }) => {
    working = done < total ? { what, share: done / total, end: left == null ? null : performance.now() + 1000 * left } : null;
    $("cancel").hidden = !working || what === "reading";
    countDown(why ?? "");
  },
});

/** Say how far the work is, and how long it takes still. */
function countDown(why = "") {
  if (!working) {
    say($("work"), why);
    return;
  }
  const { what, share, end } = working, left = end === null ? null : (end - performance.now()) / 1000;
  const time = left === null ? "" : left > 1 ? `, about ${duration(left)} left` : ", any moment now";
  say($("work"), `${WORK[what] ?? what}: ${Math.round(100 * share)} %${time}`);
}

setInterval(() => working && countDown(), 1000);

function duration(seconds) {
  if (seconds < 10) return `${Math.max(1, Math.round(seconds))} s`;
  return seconds < 100 ? `${5 * Math.round(seconds / 5)} s` : `${Math.round(seconds / 60)} min`;
}

function listSets(sets, aside) {
  const rows = sets.map(({ id, name }) => {
    const label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox";
    box.checked = !aside.includes(name);
    box.addEventListener("change", () => ask("use", { id, value: Number(box.checked) }));
    label.append(box, name);
    return label;
  });
  // A box that stays keeps the focus.
  const same = String(rows.map((row) => row.textContent)) === String([...$("sets").children].map((row) => row.textContent));
  if (same) rows.forEach((row, place) => ($("sets").children[place].firstChild.checked = row.firstChild.checked));
  else $("sets").replaceChildren(...rows);
}

// A reply to an earlier choice comes too late.
const isChosen = (sensors) => String(sensors) === String(chosen);
const key = (sensors) => [...sensors].sort((a, b) => a - b).join(",");

function toggle(sensor) {
  choose(chosen.includes(sensor) ? chosen.filter((one) => one !== sensor) : [...chosen, sensor]);
}

function choose(sensors) {
  chosen = sensors;
  storeChoice(set.sensors, chosen);
  mark();
  ask("choose", { sensors });
}

/** Show which sensors are chosen, on the hand and in the list. */
function mark() {
  if (!set) return;
  const bits = set.sensors.map((_, sensor) => chosen.includes(sensor));
  hand?.setClosed(bits);
  boxes.forEach((box, sensor) => (box.checked = bits[sensor]));
}

function listSensors() {
  boxes = [];
  const groups = Object.entries(KINDS).map(([kind, title]) => {
    const group = document.createElement("fieldset"), legend = document.createElement("legend");
    const inside = document.createElement("div");
    legend.textContent = title;
    group.append(legend, inside);
    set.sensors.forEach(({ name, kind: own, price }, sensor) => {
      if (own !== kind) return;
      const label = document.createElement("label"), box = document.createElement("input");
      box.type = "checkbox";
      box.addEventListener("change", () => toggle(sensor));
      label.append(box, price === null ? name : `${name}, ${price.toFixed(2)}`);
      inside.append(label);
      boxes[sensor] = box;
    });
    return inside.children.length ? group : null;
  });
  $("list").replaceChildren(...groups.filter(Boolean));
}

function show(reply) {
  const before = shown;
  shown = reply;
  say($("rate"), interval(reply));
  say($("count"), `${chosen.length} of ${set.sensors.length}`);
  say($("scan"), scanTime(reply.scan_us));
  $("price").hidden = $("price-term").hidden = reply.price === null;
  if (reply.price !== null) say($("price"), reply.price.toFixed(2));
  const change = before && before.sensors.length !== chosen.length ? 100 * (reply.mean - before.mean) : null;
  const moved = change === null ? "" : `; ${change >= 0 ? "+" : ""}${change.toFixed(1)} points by the last click`;
  say($("change"), `trials, ${reply.of}; quick: not nested, and chosen while looking at it${moved}`);
  say($("weakest"), weakest(reply));
  say($("command"), reply.command || "choose a sensor");
  say($("spoken"), `${chosen.length} sensors, ${percent(reply.mean)} percent`);
  $("measure").disabled = $("train").disabled = !chosen.length;
  certify();
}

function scanTime(us) {
  if (us === null) return "unknown: they are more than the chips of one bus read";
  return us ? `${us.toFixed(0)} µs on the wire` : "none is read";
}

function weakest({ confusion: counts }) {
  let worst = null;
  counts.forEach((row, truth) =>
    row.forEach((count, read) => {
      if (truth !== read && count > (worst?.count ?? 0)) worst = { count, truth, read };
    }),
  );
  if (!worst) return "none";
  const total = counts[worst.truth].reduce((sum, count) => sum + count, 0);
  return `${set.grasps[worst.truth]} recognised as ${set.grasps[worst.read]}: ${worst.count} of ${total} trials`;
}

/** Show the accuracy that was measured for the chosen sensors, if it was. */
function certify() {
  const found = measured.get(key(chosen));
  say($("measured"), found ? `measured in folds: ${interval(found)} ${found.of}; ${found.recipe}` : "");
}

/* ---- The curve: what sensors are worth, as a table and as a front of points to click on ---- */

function drawCurve({ points, of, enough }) {
  $("curve-panel").hidden = false;
  say($("curve-of"), `${of}, %`);
  const rows = points.map((point) => {
    const row = document.createElement("tr"), last = cell("td", ""), number = point.sensors.length;
    if (number === enough) row.setAttribute("aria-current", "true");
    last.append(button(`Choose these ${number}`, () => choose(point.sensors)));
    row.append(
      cell("th", number === enough ? `${number}: more matter little` : String(number)),
      cell("td", `${percent(point.mean)} [${percent(point.low)}, ${percent(point.high)}]`),
      cell("td", point.worth || "–"),
      cell("td", point.adapted === null ? "–" : percent(point.adapted)),
      last,
    );
    return row;
  });
  $("points").replaceChildren(...rows);
  drawFront(points, of);
  detail(points.find(({ sensors }) => sensors.length === enough), of);
}

const SVG = "http://www.w3.org/2000/svg";
const BOX = { left: 46, right: 470, top: 10, bottom: 262 };

function element(name, attributes, parent, text = "") {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.textContent = text;
  parent.append(made);
  return made;
}

function drawFront(points, of) {
  const svg = $("front"), most = Math.max(...points.map(({ sensors }) => sensors.length));
  const x = (number) => BOX.left + (number / (most + 0.5)) * (BOX.right - BOX.left);
  const y = (share) => BOX.bottom - share * (BOX.bottom - BOX.top);
  svg.replaceChildren();
  for (const share of [0, 0.25, 0.5, 0.75, 1]) {
    element("path", { class: "grid", d: `M${BOX.left} ${y(share)}H${BOX.right}` }, svg);
    element("text", { x: BOX.left - 6, y: y(share) + 4, "text-anchor": "end" }, svg, `${100 * share} %`);
  }
  const step = Math.ceil(most / 8);
  for (let number = step; number <= most; number += step) {
    element("text", { x: x(number), y: BOX.bottom + 16, "text-anchor": "middle" }, svg, number);
  }
  element("text", { x: (BOX.left + BOX.right) / 2, y: BOX.bottom + 33, "text-anchor": "middle" }, svg, "number of sensors");
  const line = points.map(({ sensors, mean }) => `${x(sensors.length)} ${y(mean)}`).join("L");
  element("path", { class: "front", d: `M${line}` }, svg);
  for (const point of points) {
    const number = point.sensors.length, spot = element("g", { class: "point", role: "button", tabindex: 0 }, svg);
    spot.setAttribute("aria-label", `${number} sensors: ${interval(point)}`);
    element("path", { d: `M${x(number)} ${y(point.low)}V${y(point.high)}` }, spot);
    element("circle", { cx: x(number), cy: y(point.mean), r: 5 }, spot);
    element("rect", { x: x(number) - 12, y: BOX.top, width: 24, height: BOX.bottom - BOX.top }, spot);
    spot.addEventListener("click", () => detail(point, of));
    spot.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      detail(point, of);
    });
  }
}

/** Show what a point of the front is. */
function detail(point, of) {
  const number = point.sensors.length;
  [...$("front").querySelectorAll(".point")].forEach((spot) => {
    spot.setAttribute("aria-pressed", String(spot.getAttribute("aria-label").startsWith(`${number} sensors`)));
  });
  say($("point-heading"), `${number} ${number === 1 ? "sensor" : "sensors"}: ${interval(point)}, ${of}`);
  say($("point-about"), point.worth && `the last one is worth ${point.worth} points`);
  say($("point-sensors"), point.sensors.map((sensor) => set.sensors[sensor].name).join(", "));
  say($("point-choose"), number === 1 ? "Choose this sensor" : `Choose these ${number} sensors`);
  $("point-choose").onclick = () => choose(point.sensors);
}

$("add").addEventListener("click", () => ask("add", { sensors: chosen }));
$("drop").addEventListener("click", () => ask("drop", { sensors: chosen }));
$("clear").addEventListener("click", () => choose([]));
$("measure").addEventListener("click", () => ask("measure", { sensors: chosen }));
$("train").addEventListener("click", () => ask("train", { sensors: chosen }));
$("curve").addEventListener("click", () => ask("curve"));
$("cancel").addEventListener("click", () => ask("cancel"));
