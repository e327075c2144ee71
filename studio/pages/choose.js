// The page Choose: sensors are clicked on and off, and the server replies with what they recognise.
import { interval, listBoxes, percent, points, scanTime, storeChoice, storedChoice, trained } from "./choice.js";
import { draw, drawHand, pressable } from "./hand.js";
import { openPage } from "./shell.js";
import { $, box, button, fillTable, list, say, tell } from "./wire.js";

let set = null; // the message on the set
let hand = null;
let boxes = [];
let chosen = []; // numbers of sensors, in the order in which they were chosen
let shown = null; // the last reply
let front = []; // the points of the curve, and their spots
const measured = new Map(); // accuracies that were measured, by the sensors

const ask = openPage({
  project: ({ sets, state: { aside } }) => {
    listBoxes($("sets"), sets.map(({ id, name }) => ({ id, text: name })), ({ target }) => {
      ask("use", { id: target.value, value: Number(target.checked) });
    });
    sets.forEach(({ name }, at) => ($("sets").children[at].control.checked = !aside.includes(name)));
  },
  set: (message) => {
    // What was measured of earlier recordings is not shown for these.
    if (set?.numbering !== message.numbering) {
      measured.clear();
      $("curve-panel").hidden = true;
    }
    set = message;
    tell("empty", set.why);
    list($("unused"), set.unused ?? []);
    $("with-set").hidden = Boolean(set.why);
    if (set.why) return;
    listSensors();
    $("drawn").hidden = !set.hand.switches.length;
    hand = drawHand($("hand"), set.hand, { onSwitch: (sensor) => toggle(sensor) });
    choose(storedChoice(set.sensors));
  },
  quick: (reply) => {
    // A reply to an earlier choice comes too late.
    if (String(reply.sensors) === String(chosen)) show(reply);
  },
  measure: ({ sensors, points: [point], of, recipe, numbering }) => {
    if (numbering !== set.numbering) return;
    measured.set(key(sensors), { ...point, of, recipe });
    certify();
  },
  curve: (curve) => curve.numbering === set.numbering && drawCurve(curve),
  train: trained,
});

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
  const bits = set.sensors.map((_, sensor) => chosen.includes(sensor));
  hand.setClosed(bits);
  boxes.forEach(({ control }, sensor) => (control.checked = bits[sensor]));
  for (const { sensors, spot } of front) spot.setAttribute("aria-pressed", key(sensors) === key(chosen));
}

function listSensors() {
  boxes = set.sensors.map(({ name, kind, price }, sensor) => {
    return box(`${name}, ${kind}${price === null ? "" : `, ${price.toFixed(2)}`}`, () => toggle(sensor));
  });
  $("list").replaceChildren(...boxes);
}

function show(reply) {
  const before = shown;
  shown = reply;
  say($("rate"), interval(reply));
  say($("count"), `${chosen.length} of ${set.sensors.length}`);
  say($("scan"), scanTime(reply.scan_us));
  $("price").hidden = $("price-term").hidden = reply.price === null;
  if (reply.price !== null) say($("price"), reply.price.toFixed(2));
  const moved = before && before.sensors.length !== chosen.length ? `; ${points(reply.mean - before.mean)} points by the last click` : "";
  say($("change"), `trials, ${reply.of}; quick: not nested, and chosen while looking at it${moved}`);
  say($("weakest"), reply.weakest);
  for (const what of ["measure", "curve", "train"]) say($(`${what}-command`), reply.commands[what] ?? "choose a sensor");
  say($("spoken"), `${chosen.length} sensors, ${percent(reply.mean)} percent`);
  $("measure").disabled = $("train").disabled = !chosen.length;
  certify();
}

/** Show the accuracy that was measured for the chosen sensors, if it was. */
function certify() {
  const found = measured.get(key(chosen));
  say($("measured"), found ? `measured in folds: ${interval(found)} ${found.of}; ${found.recipe}` : "");
}

/* ---- The curve: what sensors are worth, as a table and as a front of points to click on ---- */

function drawCurve({ points: named, of, enough }) {
  $("curve-panel").hidden = false;
  const names = ({ sensors }) => sensors.map((sensor) => set.sensors[sensor].name).join(", ");
  const number = new Map(set.sensors.map(({ name }, sensor) => [name, sensor]));
  const found = named.map((point) => ({ ...point, sensors: point.sensors.map((name) => number.get(name)) }));
  const titles = ["Sensors", `${of}, %`, "Worth of the last, points", "After 2 own trials, %", ""];
  fillTable("points", titles, found.map((point) => {
    const { number, mean, low, high, adapted, worth } = point;
    return [
      number === enough ? `${number}: more matter little` : number,
      `${percent(mean)} [${percent(low)}, ${percent(high)}]`,
      worth ? `${points(worth.mean)} [${percent(worth.low)}, ${percent(worth.high)}]` : "–",
      adapted === null ? "–" : percent(adapted),
      button(`Choose these ${number}`, () => choose(point.sensors), { title: names(point) }),
    ];
  }));
  $("points").children[found.findIndex(({ number }) => number === enough)]?.setAttribute("aria-current", "true");
  drawFront(found);
  mark();
}

const BOX = { left: 52, right: 470, top: 10, bottom: 262 };

function drawFront(found) {
  const svg = $("front"), most = Math.max(...found.map(({ number }) => number));
  const x = (number) => BOX.left + (number / (most + 0.5)) * (BOX.right - BOX.left);
  const y = (share) => BOX.bottom - share * (BOX.bottom - BOX.top);
  const words = (left, top, text, anchor = "middle") => draw("text", { x: left, y: top, "text-anchor": anchor }, text);
  const parts = [0, 0.25, 0.5, 0.75, 1].flatMap((share) => [
    draw("path", { class: "grid", d: `M${BOX.left} ${y(share)}H${BOX.right}` }),
    words(BOX.left - 6, y(share) + 4, `${100 * share} %`, "end"),
  ]);
  const step = Math.ceil(most / 8);
  for (let number = step; number <= most; number += step) parts.push(words(x(number), BOX.bottom + 16, number));
  parts.push(words((BOX.left + BOX.right) / 2, BOX.bottom + 33, "number of sensors"));
  const line = found.map(({ number, mean }) => `${x(number)} ${y(mean)}`).join("L");
  parts.push(draw("path", { class: "front", d: `M${line}` }));
  svg.replaceChildren(...parts);
  front = found.map((point) => {
    const { number, sensors } = point;
    const spot = draw(
      "g",
      { class: "point" },
      draw("path", { d: `M${x(number)} ${y(point.low)}V${y(point.high)}` }),
      draw("circle", { class: "open", cx: x(number), cy: y(point.mean), r: 5 }),
      draw("rect", { class: "area", x: x(number) - 12, y: BOX.top, width: 24, height: BOX.bottom - BOX.top }),
    );
    svg.append(pressable(spot, `Choose these ${number}: ${interval(point)}`, () => choose(sensors)));
    return { sensors, spot };
  });
}

for (const what of ["measure", "train"]) $(what).addEventListener("click", () => ask(what, { sensors: chosen }));
$("curve").addEventListener("click", () => ask("curve"));
$("clear").addEventListener("click", () => choose([]));
