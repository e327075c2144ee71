// The page Glove: a glove is connected, watched and calibrated.
import { draw, drawHand } from "./hand.js";
import { onSubmit, showKeys } from "./choice.js";
import { openPage } from "./shell.js";
import { showDevices } from "./view.js";
import { $, button, clock, fillTable, list, make, say } from "./wire.js";

const PAST_S = 30, ASK_MS = 500, OLD_MS = 1000;
const KINDS = { joint: "joints", pad: "pads" };

let about = null; // the message on the glove
let hand = null;
let spots = []; // what is drawn of each sensor, by its number
let buttons = []; // and its button in the list
let states = [];
let chosen = null; // the number of the sensor whose past is shown
let problem = null;
let begun = false; // whether this page began to watch
let old = 0; // the timer after which the states are old

const ask = openPage({
  open: () => (begun = false),
  closed: () => stale(),
  "glove-hand": (message) => showGlove(message),
  station: ({ doing, why }) => {
    say($("watch"), doing === "watching" ? "Watch anew" : "Watch");
    if (why) say($("refused"), why);
    if (doing) begun = true;
    watchOnce(doing);
  },
  found: (message) => showFound(message),
  "glove-state": (message) => showState(message),
  shown: (message) => plot(message),
  calibrating: (message) => showStep(message),
});

/** A page that is opened while nothing uses the glove begins to watch it. */
function watchOnce(doing = "") {
  if (!about?.there || about.why || begun || doing) return;
  begun = true;
  ask("watch");
}

function showGlove(message) {
  about = message;
  $("connecting").hidden = about.there;
  $("with-glove").hidden = !about.there;
  if (about.why) say($("refused"), about.why);
  $("ports").replaceChildren(...about.ports.map((port) => new Option(port)));
  if (!about.hand) return;
  hand = drawHand($("hand"), about.hand, { onSwitch: (sensor) => choose(sensor) });
  $("hand").hidden = !about.hand.switches.length && !about.hand.taxels.length && !about.hand.joints.length;
  spots = about.names.map((name) => hand.spots.get(name));
  // A spot says its state, and is no switch to turn on.
  for (const spot of hand.spots.values()) spot.removeAttribute("aria-pressed");
  buttons = about.names.map((name, sensor) => button(name, () => choose(sensor), { class: "plain" }));
  $("sensors").replaceChildren(...buttons.map((one) => make("li", {}, one)));
  const kinds = Object.keys(KINDS).filter((kind) => about.kinds.includes(kind));
  $("calibrate").replaceChildren(...kinds.map((kind) => {
    const words = `Calibrate the ${KINDS[kind]}${about.lacks.includes(kind) ? "" : " anew"}`;
    const start = button(words, () => ask("calibrate", { name: kind }), { class: "plain" });
    return make("p", { class: "row" }, start, make("code", {}, about.commands[kind]));
  }));
  states = [];
  choose(null);
  watchOnce();
}

function showFound({ port, busy, columns, rows, remarks, text, wrong, command }) {
  $("found").hidden = false;
  say($("found-heading"), busy ? `Listening to ${port}: press every switch and pad, bend every finger` : `${rows} rows came from ${port}`);
  $("connect").hidden = $("proposal").hidden = busy || wrong.length > 0;
  $("columns-table").hidden = busy || !columns.length;
  list($("remarks"), busy ? [] : [...wrong, ...remarks]);
  if (busy) return;
  say($("proposal"), text);
  say($("find-command"), command);
  const sent = columns.map(({ column, least, greatest, taken_for }) => [column, least ?? "", greatest ?? "", taken_for ?? ""]);
  fillTable("columns", ["Column", "Least", "Greatest", "Taken for"], sent);
}

function showState(message) {
  clearTimeout(old);
  if (!message.states.length) stale();
  if (!about?.hand || message.states.length !== about.names.length) return;
  old = setTimeout(stale, OLD_MS);
  document.documentElement.classList.remove("old");
  hand.setClosed(message.closed, message.lost);
  hand.setTaxels(message.pressed);
  hand.setPose(message.values);
  message.states.forEach((state, sensor) => {
    if (state === states[sensor]) return;
    const words = `${about.names[sensor]}: ${state}`;
    for (const one of [spots[sensor], buttons[sensor]].filter(Boolean)) one.dataset.state = state;
    spots[sensor]?.setAttribute("aria-label", words);
    say(buttons[sensor], words);
  });
  states = message.states;
  const counts = ["ok", "stuck", "never seen", "lost"].map((state) => [states.filter((one) => one === state).length, state]);
  say($("counted"), counts.filter(([count]) => count).map(([count, state]) => `${count} ${state}`).join(", "));
  problem = message.problem;
  say($("problem"), problem?.words ?? "No problem: every sensor works.");
  $("problem").disabled = !problem;
  say($("rates"), Object.entries(message.rates).map(([what, rate]) => `${what}: ${rate.toFixed(1)} readings a second`).join("; "));
  showDevices(message.devices);
}

/** Grey what was seen before: nothing watches now. */
function stale() {
  document.documentElement.classList.add("old");
  $("problem").disabled = true;
  say($("problem"), "Watch to look for problems");
  say($("counted"), states.length ? `not watched since ${clock()}` : "not watched");
}

function choose(sensor) {
  chosen = sensor;
  buttons.forEach((one, at) => one.setAttribute("aria-pressed", at === sensor));
  $("one").hidden = sensor === null;
  if (sensor === null) return;
  say($("one-heading"), `${about.names[sensor]}, ${about.kinds[sensor]}`);
  ask("past", { trial: sensor });
}

setInterval(() => {
  if (chosen !== null && states.length && !document.hidden) ask("past", { trial: chosen });
}, ASK_MS);

/** Draw what a sensor showed: steps from change to change, and a gap while it was lost. */
function plot({ sensor, past, changes }) {
  if (sensor !== chosen) return;
  const values = past.map(([, value]) => value).filter((value) => value !== null);
  const low = Math.min(...values, about.kinds[sensor] === "switch" ? 0 : Infinity), high = Math.max(...values, low + 1);
  const y = (value) => (110 - (100 * (value - low)) / (high - low)).toFixed(1);
  const x = (ago) => (600 * (1 - ago / PAST_S)).toFixed(1);
  const steps = past.map(([ago, value], at) => {
    const until = past[at + 1]?.[0] ?? 0;
    const joined = at && past[at - 1][1] !== null ? "L" : "M";
    return value === null ? "" : `${joined}${x(ago)} ${y(value)}H${x(until)}`;
  });
  const line = $("plot").firstElementChild ?? $("plot").appendChild(draw("path"));
  line.setAttribute("d", steps.join(""));
  const now = past.at(-1)?.[1];
  const shown = now === null || now === undefined ? "not read" : about.kinds[sensor] === "switch" ? ["open", "closed"][now] : now;
  const range = values.length && about.kinds[sensor] !== "switch" ? `; ${Math.min(...values)} to ${Math.max(...values)}` : "";
  say($("one-says"), `${states[sensor] ?? ""}; now ${shown}; ${changes} changes in 30 s${range}`);
}

$("problem").addEventListener("click", () => {
  if (problem?.calibrate) ask("calibrate", { name: problem.calibrate });
  else if (problem && problem.sensor !== null) {
    choose(problem.sensor);
    buttons[problem.sensor].focus();
  } else ask("watch");
});

function showStep({ step, what, problems, faults, keys, said = "" }) {
  const open = Boolean(step);
  if (open && $("calibration").hidden) say($("refused"), "");
  $("calibration").hidden = !open;
  say($("calibrated"), said);
  if (!open) return;
  say($("step"), step);
  say($("what"), what);
  list($("problems"), problems);
  list($("faults"), faults);
  showKeys(keys, ask)?.focus();
}

onSubmit("form", () => ask("find", { name: $("address").value.trim() }));
$("connect").addEventListener("click", () => {
  begun = false;
  ask("connect");
});
$("watch").addEventListener("click", () => ask("watch"));
