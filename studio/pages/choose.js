// The page Choose: sensors are clicked on and off, and the server replies with what they recognise.
import { drawHand } from "./hand.js";
import { openPage } from "./shell.js";
import { cell, list, say } from "./wire.js";

const $ = (id) => document.getElementById(id);
const percent = (share) => (100 * share).toFixed(1);
const interval = ({ mean, low, high }) => `${percent(mean)} % [${percent(low)}, ${percent(high)}]`;
const KINDS = { switch: "Switches", pad: "Pads", joint: "Joints" };

let set = null; // the message on the set
let drawn = null; // the message on the hand
let hand = null;
let error = -1; // the place among the misread trials of the one that is shown
let boxes = [];
let chosen = []; // numbers of sensors, in the order in which they were chosen
let shown = null; // the last reply
const measured = new Map(); // accuracies that were measured, by the sensors

const ask = openPage({
  open: () => set && !set.why && choose(chosen),
  set: (message) => {
    // Another server took the place of ours: its numbers are other sensors.
    if (set && JSON.stringify(set) !== JSON.stringify(message)) {
      chosen = [];
      measured.clear();
    }
    set = message;
    say($("recordings"), set.name);
    $("empty").hidden = !set.why;
    say($("empty"), set.why);
    $("with-set").hidden = Boolean(set.why);
    if (set.why) return;
    listSensors();
    choose(chosen);
  },
  sensors: (message) => {
    drawn = message;
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
  measure: ({ sensors, points, of, recipe }) => {
    measured.set(key(sensors), { ...points[0], of, recipe });
    certify();
  },
  curve: (curve) => drawCurve(curve),
  train: ({ folder, facts }) => {
    $("build").hidden = false;
    say($("build-heading"), `Trained: ${folder}`);
    list($("facts"), facts);
  },
  work: ({ done, total, what, why }) => {
    const busy = { reading: "reading", measure: "measuring", curve: "measuring the curve", train: "training" }[what];
    say($("work"), why ?? (done < total ? `${busy}: ${Math.round((100 * done) / total)} %` : ""));
  },
  trial: (seen) => showTrial(seen),
});

// A reply to an earlier choice comes too late.
const isChosen = (sensors) => String(sensors) === String(chosen);
const key = (sensors) => [...sensors].sort((a, b) => a - b).join(",");

function toggle(sensor) {
  choose(chosen.includes(sensor) ? chosen.filter((one) => one !== sensor) : [...chosen, sensor]);
}

function choose(sensors) {
  chosen = sensors;
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
  $("trial").hidden = true;
  $("trials").replaceChildren();
  error = -1;
  confusion(reply);
  certify();
  // After the accuracy is painted: a map may have thousands of marks.
  setTimeout(() => reply === shown && drawMap(reply));
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
  return `${set.grasps[worst.truth]} read as ${set.grasps[worst.read]}: ${worst.count} of ${total} trials`;
}

/** Show the accuracy that was measured for the chosen sensors, if it was. */
function certify() {
  const found = measured.get(key(chosen));
  say($("measured"), found ? `measured in folds: ${interval(found)} ${found.of}; ${found.recipe}` : "");
}

function confusion({ confusion: counts, misread }) {
  const head = document.createElement("tr");
  head.append(document.createElement("td"), ...set.grasps.map((name) => column(name)));
  const rows = counts.map((row, truth) => {
    const line = document.createElement("tr");
    line.append(cell("th", set.grasps[truth]));
    row.forEach((count, read) => {
      const made = cell("td", truth === read || !count ? String(count || "") : "");
      if (truth === read) made.dataset.is = "good";
      else if (count) {
        const button = document.createElement("button");
        button.type = "button";
        button.textContent = count;
        button.setAttribute("aria-label", `${count} trials of ${set.grasps[truth]} read as ${set.grasps[read]}`);
        button.addEventListener("click", () =>
          listTrials(misread.filter((one) => one.truth === set.grasps[truth] && one.read === set.grasps[read])),
        );
        made.append(button);
      }
      line.append(made);
    });
    return line;
  });
  const table = document.createElement("tbody");
  table.append(head, ...rows);
  $("confusion").replaceChildren(table);
}

/* ---- The map of trials ---- */

const SVG = "http://www.w3.org/2000/svg";
const SHAPES = ["M-4 0a4 4 0 1 0 8 0a4 4 0 1 0 -8 0Z", "M-4-4H4V4H-4Z", "M0-5L5 4H-5Z", "M0-5L5 0L0 5L-5 0Z"];
const COLOURS = 7;

function glyph(parent, kind) {
  const made = document.createElementNS(SVG, "path");
  made.setAttribute("d", SHAPES[Math.floor(kind / COLOURS) % SHAPES.length]);
  made.classList.add("trial", `kind-${kind % COLOURS}`);
  parent.append(made);
  return made;
}

function drawMap({ map, misread }) {
  const wrong = new Map(misread.map((one) => [one.trial, one]));
  const [xs, ys] = [1, 2].map((axis) => map.map((place) => place[axis]));
  const scale = (values, from, to) => {
    const low = Math.min(...values), wide = Math.max(...values) - low || 1;
    return (value) => from + ((value - low) / wide) * (to - from);
  };
  const across = scale(xs, 12, 588), down = scale(ys, 388, 12);
  const marks = map.map(([kind, x, y], trial) => {
    const group = document.createElementNS(SVG, "g"), title = document.createElementNS(SVG, "title");
    const error = wrong.get(trial), name = set.grasps[kind];
    group.setAttribute("transform", `translate(${across(x).toFixed(1)} ${down(y).toFixed(1)})`);
    title.textContent = `${set.trials[trial]}: ${name}${error ? `, read as ${error.read}` : ""}`;
    group.append(title);
    glyph(group, kind);
    if (error) {
      const ring = document.createElementNS(SVG, "circle");
      ring.setAttribute("r", 7);
      ring.classList.add("ring");
      group.append(ring);
    }
    group.addEventListener("click", () => ask("trial", { trial, sensors: chosen }));
    return group;
  });
  $("map").replaceChildren(...marks);
  const entries = set.grasps.map((name, kind) => {
    const item = document.createElement("li"), sign = document.createElementNS(SVG, "svg");
    sign.setAttribute("viewBox", "-7 -7 14 14");
    sign.setAttribute("aria-hidden", "true");
    glyph(sign, kind);
    item.append(sign, name);
    return item;
  });
  $("legend").replaceChildren(...entries);
}

function column(name) {
  const made = cell("th", name);
  made.scope = "col";
  return made;
}

function listTrials(trials) {
  const items = trials.map(({ trial }) => {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "plain";
    button.textContent = set.trials[trial];
    button.addEventListener("click", () => ask("trial", { trial, sensors: chosen }));
    return button;
  });
  const row = document.createElement("p");
  row.className = "row";
  row.append(...items);
  $("trials").replaceChildren(row);
  items[0]?.focus();
}

/** Show what the sensors saw in a trial, next to what they typically see in its true and in its recognised type. */
function showTrial({ trial, shown: values, truth, read, typical, decisive }) {
  const [name, other] = [set.grasps[truth], set.grasps[read]];
  say($("trial-heading"), `${set.trials[trial]}: ${name}${read === truth ? "" : `, read as ${other}`}`);
  const names = decisive.map((sensor) => set.sensors[sensor].name);
  say($("decisive"), names.length ? `decided by ${names.join(", ")}` : "");
  $("trial").hidden = false;
  const parts = [seen(set.trials[trial], values), seen(`${name}, typically`, typical[0])];
  if (read !== truth) parts.push(seen(`${other}, typically`, typical[1]));
  // Before it is on the page, a drawing has no width.
  $("hands").replaceChildren(...parts.map(({ figure }) => figure));
  for (const { draw } of parts) draw();
}

/** Return a figure of what sensors saw: a hand with those closed for more than half of the time, and all joints. */
function seen(words, values) {
  const figure = document.createElement("figure"), caption = document.createElement("figcaption");
  const svg = document.createElementNS(SVG, "svg"), joints = document.createElement("ul");
  caption.textContent = words;
  set.sensors.forEach(({ name, kind }, sensor) => {
    if (kind !== "joint") return;
    const item = document.createElement("li"), label = document.createElement("label");
    const meter = document.createElement("meter");
    meter.value = values[sensor];
    label.append(meter, `${name} ${Math.round(100 * values[sensor])} %`);
    item.append(label);
    joints.append(item);
  });
  figure.append(caption, ...(drawn.switches.length ? [svg] : []), joints);
  const draw = () => {
    if (!drawn.switches.length) return;
    drawHand(svg, drawn).setClosed(values.map((value) => value > 0.5));
    svg.setAttribute("aria-label", `hand: ${words}`);
  };
  return { figure, draw };
}

function nextError(step) {
  const errors = shown?.misread ?? [];
  if (!errors.length) return;
  error = (error + step + errors.length) % errors.length;
  ask("trial", { trial: errors[error].trial, sensors: chosen });
}

function drawCurve({ points, of, enough }) {
  $("curve-panel").hidden = false;
  say($("curve-of"), `${of}, %`);
  const rows = points.map((point) => {
    const row = document.createElement("tr"), button = document.createElement("button"), last = cell("td", "");
    const number = point.sensors.length;
    if (number === enough) row.setAttribute("aria-current", "true");
    button.type = "button";
    button.textContent = `Choose these ${number}`;
    button.addEventListener("click", () => choose(point.sensors));
    last.append(button);
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
}

$("add").addEventListener("click", () => ask("add", { sensors: chosen }));
$("drop").addEventListener("click", () => ask("drop", { sensors: chosen }));
$("clear").addEventListener("click", () => choose([]));
$("measure").addEventListener("click", () => ask("measure", { sensors: chosen }));
$("train").addEventListener("click", () => ask("train", { sensors: chosen }));
$("curve").addEventListener("click", () => ask("curve"));
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  if (event.key === "n" || event.key === "p") nextError(event.key === "n" ? 1 : -1);
});
