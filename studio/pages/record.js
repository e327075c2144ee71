// The page Record: a collection is begun, led key by key, and ends with a set.
import { interval, onSubmit, showKeys, showLastEdit, trained } from "./choice.js";
import { drawGrasp } from "./grasps.js";
import { drawHand } from "./hand.js";
import { openPage } from "./shell.js";
import { tag, typeStyles } from "./types.js";
import { $, button, fillMenu, list, make, say, tell } from "./wire.js";

const LETTERS = { accept: "Enter", redo: "r", undo: "u", skip: "s", pause: "p", quit: "q" };

const query = new URLSearchParams(location.search);
const only = query.getAll("type"); // types of which the page Errors asks for more; none: all are recorded

let stage = "over";
let adapts = false; // whether a build is adapted to the collection
let sensors = 0; // of the project's set, for Train
let drawn = null; // the message on the glove's hand
let hand = null;
let pictured = null; // the grasp type that is drawn
let listed = false; // whether the project has an objects.toml
let shown = { set: "", trials: [] }; // the message on the trials so far
let seen = null; // the number of the trial that is shown
let edits = new Map(); // what trials were made, by set and number; "": left out
let edited = false; // whether the person's name was typed here

const ask = openPage({
  shell: ({ wearer }) => {
    if (!edited) $("subject").value = wearer;
  },
  recordings: ({ unfinished, objects, glove }) => {
    $("no-glove").hidden = glove;
    $("start").disabled = !glove;
    say($("objects"), objects ? "Objects are those of objects.toml." : "");
    if (objects && !listed) $("taxonomy").value = "own";
    listed = objects;
    askTypes();
    $("unfinished").hidden = !unfinished.length;
    $("recordings").replaceChildren(...unfinished.map(({ id, name, subject, done, total }) => {
      const words = `Continue ${name} of ${subject}: ${done} of ${total} trials are done`;
      return make("li", {}, button(words, () => ask("continue", { id })));
    }));
  },
  closed: () => say($("standing"), "this page is not connected"),
  collecting: (state) => show(state),
  trials: (message) => showTrials(message),
  "glove-hand": (message) => {
    drawn = message.hand;
    hand = null;
  },
  recorded: ({ trial, grasp, thing, closed, pressed, values }) => {
    seen = trial;
    $("type").value = grasp;
    $("seen").hidden = false;
    // Of the empty hand there is no type to correct.
    $("relabel").hidden = grasp === "none";
    say($("seen-heading"), `Trial ${trial}: ${grasp}, ${thing}`);
    if (drawn) hand ??= drawHand($("hand"), drawn);
    hand?.setClosed(closed);
    const { length } = drawn?.switches ?? [], count = closed.slice(0, length).filter(Boolean).length;
    $("hand").setAttribute("aria-label", length ? `The hand: ${count} of ${length} switches closed` : "The hand");
    hand?.setTaxels(pressed);
    hand?.setPose(values);
  },
  edits: ({ words, made }) => {
    edits = new Map(made.map(([type, ...trial]) => [String(trial), type]));
    showLastEdit(words);
    markTrials();
  },
  set: ({ why, types, taxonomy, sensors: all }) => {
    sensors = all.length;
    $("train").disabled = Boolean(why);
    say($("lacking"), why ?? "");
    if (why || !only.length) return;
    // More of the same set.
    $("taxonomy").value = [...$("taxonomy").options].some(({ value }) => value === taxonomy) ? taxonomy : "own";
    $("types").value = types.join(", ");
    askTypes();
  },
  train: trained,
  station: ({ why }) => {
    if (why) say($("refused"), why);
  },
});

/** Ask for the person's own types, unless an objects.toml lists them. */
function askTypes() {
  $("own-types").hidden = $("taxonomy").value !== "own" || listed;
}

function show(state) {
  const { prompt, thing, standing, keys, done, total, skipped, number, grasp, waits } = state;
  const before = stage;
  stage = state.stage;
  const over = stage === "over";
  // The page Wearer shows what becomes of the build.
  if (over && adapts) location.href = "wearer.html";
  adapts = state.adapts;
  $("begin").hidden = !over;
  $("leading").hidden = over;
  $("end").hidden = !over || !state.set;
  if (over) {
    if (state.set) showEnd(state);
    return;
  }
  if (before === "over") say($("refused"), "");
  if (stage === "waiting" || stage === "writing") {
    say($("prompt"), stage === "waiting" ? "Waiting for the glove …" : "Writing the set …");
    for (const id of ["thing", "standing", "place"]) say($(id), "");
    leadBy({});
    return;
  }
  say($("place"), `${Math.min(number, total)} of ${total}; ${done} done${skipped ? `, ${skipped} skipped` : ""}`);
  say($("prompt"), prompt);
  say($("thing"), thing);
  say($("standing"), standing);
  $("standing").dataset.is = waits ? "bad" : stage === "review" ? "good" : stage === "countdown" ? "changing" : "";
  // Seconds that are counted down are not read out.
  if (stage !== before || waits) say($("spoken"), `${prompt}, ${thing}. ${stage === "countdown" ? "" : standing}`);
  if (grasp !== pictured) {
    pictured = grasp;
    const known = drawGrasp($("drawing"), grasp);
    $("drawn").hidden = !grasp;
    $("drawing").hidden = !known;
    say($("drawing-says"), known ? "" : `No picture of ${grasp}: hold the ${thing.replace(/^object /, "")} as you agreed.`);
  }
  leadBy(keys);
}

/** Show what was recorded. */
function showEnd({ set, size, warnings, done, total }) {
  say($("end-heading"), `Recorded: ${set}`);
  say($("size"), `${size}; ${done} of ${total} trials are done`);
  list($("warnings"), warnings.length ? warnings : ["The import has no warning."]);
}

/** Show the keys that count now; the first is the one that Enter presses, and has the focus. */
function leadBy(keys) {
  const focused = !document.activeElement || document.activeElement === document.body || $("leading").contains(document.activeElement);
  const first = showKeys(keys, ask, LETTERS);
  // During the countdown Enter is expected next, not now: no button takes it by accident.
  if (focused && "accept" in keys) first?.focus();
}

document.addEventListener("keydown", (event) => {
  if (stage === "over" || event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.target.closest?.("input, select")) return;
  const presses = event.target.closest?.("button, a");
  const found = Object.entries(LETTERS).find(([, letter]) => letter === event.key || letter === event.key.toLowerCase());
  if (!found || (event.key === "Enter" && presses)) return;
  event.preventDefault();
  ask("key", { name: found[0] });
});

function showTrials(message) {
  shown = message;
  const { trials, types, accuracy, command } = shown, styles = typeStyles(types);
  say($("record-command"), command);
  fillMenu($("type"), types.filter((type) => type !== "none").map((type) => ({ id: type, name: type })));
  $("so-far").hidden = !trials.length;
  if (!trials.some(([trial]) => trial === seen)) $("seen").hidden = true;
  say($("accuracy"), accuracyWords(accuracy));
  // Trials that stay keep the focus.
  const strip = $("strip"), same = [...strip.children].findIndex((item, at) => item.dataset.trial !== String(trials[at]?.[0]));
  const keep = same < 0 ? Math.min(strip.children.length, trials.length) : same;
  while (strip.children.length > keep) strip.lastChild.remove();
  for (const [trial, grasp, thing] of trials.slice(keep)) {
    const show = button(`${trial} `, () => ask("recorded", { trial }), { class: "plain", title: thing });
    show.append(tag(styles, grasp), make("span"));
    strip.append(make("li", { "data-trial": trial }, show));
    $("strip-scroll").scrollLeft = strip.scrollWidth;
  }
  markTrials();
}

/** Say what became of the trials. */
function markTrials() {
  shown.trials.forEach(([trial], at) => {
    const change = edits.get(String([shown.set, trial]));
    say($("strip").children[at].firstChild.lastChild, change === undefined ? "" : change ? ` → ${change}` : ", left out");
  });
}

function accuracyWords(accuracy) {
  if (!accuracy) return "An accuracy is shown from two trials of every type on.";
  if (accuracy.why) return `No accuracy: ${accuracy.why}`;
  return `All sensors tell these trials apart in ${interval(accuracy)}, ${accuracy.of}; quick: not nested`;
}

$("repetitions").value = query.get("repetitions") ?? $("repetitions").value;
tell("only", only.length && `Only of ${only.join(" and ")}.`);
if (only.length) $("none").checked = false;
$("subject").addEventListener("input", () => (edited = true));
$("taxonomy").addEventListener("change", askTypes);
onSubmit("form", () => {
  ask("record", {
    name: $("subject").value.trim(),
    id: $("taxonomy").value,
    names: $("own-types").hidden ? [] : $("types").value.split(",").map((name) => name.trim()),
    value: Number($("repetitions").value),
    trial: Number($("none").checked),
    ids: only,
  });
});
onSubmit("relabel", () => ask("relabel", { trial: seen, name: $("type").value }));
$("drop").addEventListener("click", () => ask("relabel", { trial: seen, name: "" }));
$("undo").addEventListener("click", () => ask("undo"));
// After a click of the mouse, Enter is the key of the recording again.
$("so-far").addEventListener("click", ({ target, detail }) => {
  if (stage !== "over" && detail) target.closest("button")?.blur();
});
$("train").addEventListener("click", () => ask("train", { sensors: [...Array(sensors).keys()] }));
