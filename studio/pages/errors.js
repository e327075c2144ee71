// The page Errors: which trials are misread, in a matrix and on a map; the selected ones as small hands; and their edits.
import { interval, showLastEdit, storedChoice } from "./choice.js";
import { draw, drawHand } from "./hand.js";
import { TrialMap } from "./map.js";
import { openPage } from "./shell.js";
import { tag, typeStyles } from "./types.js";
import { $, box, button, fillMenu, fillTable, list, make, say, tell } from "./wire.js";

const percent = (share) => `${Math.round(100 * share)} %`;
const STEP = 24; // the number of trials that are shown at a time

let set = null; // the message on the set
let reply = null; // what the recogniser makes of every trial
let of = "chosen"; // and which recogniser that is
let styles = new Map();
let errors = []; // numbers of misread trials
let last = -1; // the last of them that was shown
let selected = []; // numbers of trials
let asked = []; // of these, those of the last request

const map = new TrialMap($("map"), {
  point: (trial) => say($("pointed"), trial < 0 ? "\u00a0" : named(trial)),
  select: (trials) => select(trials),
});

const ask = openPage({
  set: (message) => {
    if (set && set.numbering === message.numbering && set.why === message.why) return;
    // Where a trial was left out, the next one has its number.
    last -= 1;
    set = message;
    tell("empty", set.why);
    $("with-set").hidden = Boolean(set.why);
    if (set.why) return;
    list($("unused"), set.unused);
    fillMenu($("type"), set.types.map((name) => ({ id: name, name })));
    select([]);
    look();
  },
  project: ({ builds }) => {
    const { value } = $("of"), options = [...$("of").options].slice(0, 2).map((one) => ({ id: one.value, name: one.text }));
    fillMenu($("of"), [...options, ...builds.map(({ id, name }) => ({ id, name: `build ${name}` }))], options[0].id);
    if (set && !set.why && $("of").value !== value) look();
  },
  edits: ({ words }) => showLastEdit(words),
  work: ({ done, total, what }) => {
    const busy = done < total && what !== "reading";
    say($("busy"), busy ? "Edits are shown here when the work that goes on is finished." : "");
  },
  refused: ({ do: what }) => {
    if (what !== "errors") return;
    // What a build read before is of other recordings.
    const stale = reply?.numbering !== set.numbering && $("of").value !== "chosen";
    $("of").value = stale ? "chosen" : of;
    if (stale) look();
  },
  errors: (message) => {
    if (String(message.asked) === String(request()) && message.numbering === set.numbering) show(message);
  },
  trials: (message) => {
    // The same trials may have been asked for twice.
    if (!asked.length || String(message.asked) !== String(asked)) return;
    asked = [];
    showTrials(message);
  },
});

/** Return the id of the build, or "", and the numbers of the sensors that are to recognise. */
function request() {
  const { value } = $("of");
  if (value === "chosen") return ["", storedChoice(set.sensors)];
  return value === "all" ? ["", set.sensors.map((_, sensor) => sensor)] : [value, []];
}

function look() {
  const [id, sensors] = request();
  ask("errors", { id, sensors });
}

const type = (number) => reply.types[number];
const misread = (trial) => reply.truth[trial] !== reply.read[trial];

function named(trial) {
  const read = misread(trial) ? `, recognised as ${type(reply.read[trial])}` : "";
  return `${set.trials[trial]}: ${type(reply.truth[trial])}${read}`;
}

function show(message) {
  reply = message;
  of = $("of").value;
  errors = reply.truth.flatMap((_, trial) => (misread(trial) ? [trial] : []));
  say($("rate"), interval(reply));
  const using = reply.sensors.length ? `${reply.sensors.length} sensors` : "no sensor: choose some on the page Choose";
  const quick = reply.asked[0] ? "" : "; quick: not nested";
  say($("about"), `${reply.of}${quick}; ${using}; ${errors.length} of ${reply.truth.length} trials misread`);
  for (const id of ["next", "previous", "all-errors"]) $(id).disabled = !errors.length;
  const trials = reply.types.map(() => []);
  reply.truth.forEach((truth, trial) => trials[truth].push(trial));
  styles = typeStyles([...set.types, ...reply.types]);
  matrix(trials);
  const looks = reply.truth.map((truth, trial) => ({ colour: styles.get(type(truth)).colour ?? "#8a8a8a", wrong: misread(trial) }));
  const labels = trials.flatMap((those, kind) => (those.length ? [{ code: styles.get(type(kind)).code, trials: those }] : []));
  map.show(reply.places, looks, labels);
  const there = reply.types.filter((_, kind) => trials[kind].length);
  $("legend").replaceChildren(...there.map((name) => make("li", {}, tag(styles, name))));
  // A link of the page Compare names a trial and its type.
  const linked = decodeURIComponent(location.hash.slice(1));
  if (linked) {
    history.replaceState(null, "", location.pathname);
    selected = reply.truth.flatMap((truth, trial) => (`${set.trials[trial].replace(/, session .*/, "")}: ${type(truth)}` === linked ? [trial] : []));
  }
  select(selected.filter((trial) => trial < reply.truth.length));
}

/* ---- The matrix: its numbers and the names of its rows select trials ---- */

function matrix(trials) {
  const heads = reply.types.map((name) => {
    const label = tag(styles, name);
    label.lastChild.className = "unseen";
    label.title = name;
    return label;
  });
  const numbers = (some, label, kind) => {
    return button(some.length, () => select(some), { class: "plain", "aria-label": label, "data-is": kind });
  };
  fillTable("confusion", ["", ...heads], trials.flatMap((those, truth) => {
    if (!those.length) return [];
    const name = type(truth), wrong = those.filter(misread), title = numbers(wrong, `${name}: select its ${wrong.length} errors`, "");
    title.disabled = !wrong.length;
    title.replaceChildren(tag(styles, name));
    const cells = reply.types.map((other, read) => {
      const some = those.filter((trial) => reply.read[trial] === read), label = `${some.length} trials of ${name} recognised as ${other}`;
      return some.length ? numbers(some, label, truth === read ? "good" : "bad") : "";
    });
    return [[title, ...cells]];
  }));
}

/* ---- The selected trials ---- */

function select(trials) {
  selected = trials;
  $("selected").hidden = !trials.length;
  $("trials").replaceChildren();
  mark();
  if (!trials.length) return;
  const proposed = type(pairOf(trials)[1] ?? reply.truth[trials[0]]);
  $("type").value = set.types.includes(proposed) ? proposed : set.types[0];
  askFor(0);
  // On a phone they are further down.
  $("selection").scrollIntoView({ block: "nearest" });
}

function askFor(from) {
  asked = selected.slice(from, from + STEP);
  $("show-more").hidden = selected.length <= from + STEP;
  ask("trials", { id: reply.asked[0], sensors: reply.sensors, trials: asked });
}

/** Return the numbers of the selected trials whose box is checked, shown or not. */
function chosen() {
  const boxes = [...$("trials").querySelectorAll("input")];
  const left = new Set(boxes.filter((box) => !box.checked).map((box) => Number(box.value)));
  return selected.filter((trial) => !left.has(trial));
}

/** Show how many trials are selected, and offer what can be done with them. */
function mark() {
  const trials = chosen(), count = `${trials.length} ${trials.length === 1 ? "trial" : "trials"}`;
  map.select(trials);
  const what = selected.length === 1 ? named(selected[0]) : `${trials.length ? count : "No trial"} selected`;
  say($("selection-heading"), what);
  for (const id of ["relabel", "drop"]) $(id).disabled = !trials.length;
  say($("relabel"), `Relabel ${count}`);
  say($("drop"), `Leave out ${count}`);
  const pair = pairOf(selected);
  const query = new URLSearchParams([...pair.map((kind) => ["type", type(kind)]), ["repetitions", 5]]);
  $("more").href = `record.html?${query}`;
  tell("more", pair.length === 2 && `Record five more of ${pair.map(type).join(" and ")}`);
}

/** Return the true and the recognised type, if all these trials have the same two. */
function pairOf(trials) {
  const pairs = new Set(trials.map((trial) => `${reply.truth[trial]} ${reply.read[trial]}`));
  return pairs.size === 1 ? [...new Set([...pairs][0].split(" "))].map(Number) : [];
}

function showTrials({ trials }) {
  const { typical } = set, first = !$("trials").children.length, cards = trials.map(card);
  const usual = pairOf(selected).map(type).filter((name) => first && typical[name]).map((name) => {
    const caption = make("figcaption", {}, tag(styles, name), ", typically");
    return make("figure", { class: "boxed" }, caption, ...hand(typical[name], [], `${name}, typically`));
  });
  $("trials").append(...(cards.length === 1 ? [...cards, ...usual] : [...usual, ...cards]));
}

function card({ trial, shown, decisive }) {
  const { typical } = set, [truth, read] = [type(reply.truth[trial]), type(reply.read[trial])], words = set.trials[trial];
  const inputs = decisive.map((sensor) => {
    const usual = [truth, read].filter((name) => typical[name]).map((name) => `${name} ${percent(typical[name][sensor])}`).join(", ");
    return make("li", {}, `${set.sensors[sensor].name} ${percent(shown[sensor])} (${usual})`);
  });
  return make(
    "article",
    { class: "boxed" },
    box(words, mark, { checked: true, value: trial }),
    make("p", { "data-is": truth === read ? "good" : "bad" }, tag(styles, truth), " recognised as ", tag(styles, read)),
    ...hand(shown, decisive, words),
    ...(inputs.length ? ["Decided by", make("ul", {}, ...inputs)] : []),
  );
}

/** Return a picture of what sensors showed: those in use that were closed for more than half of the time, and joints. */
function hand(shown, decisive, words) {
  const used = new Set(reply.sensors), first = set.sensors.length - set.joints.length;
  const joints = set.joints.filter(({ joint }) => used.has(first + joint));
  const switches = set.hand.switches.filter(({ bit }) => used.has(bit));
  if (!switches.length && !joints.length) return [];
  const svg = draw("svg");
  const plain = joints.map((joint) => ({ ...joint, low: Math.min(joint.low, joint.high), high: Math.max(joint.low, joint.high) }));
  const outline = switches.length ? {} : { outline: [], strips: [], creases: [], labels: [] };
  const { spots, setClosed, setPose } = drawHand(svg, { ...set.hand, ...outline, switches, joints: plain });
  setClosed(shown.map((share) => share > 0.5));
  setPose(set.joints.map(({ joint, low, high }) => low + shown[first + joint] * (high - low)));
  for (const sensor of decisive) spots.get(set.sensors[sensor].name)?.classList.add("decisive");
  svg.setAttribute("aria-label", `hand: ${words}`);
  return [svg];
}

/* ---- What the page is asked for ---- */

function nextError(step) {
  if (!errors.length) return;
  const [after, before] = [errors.find((trial) => trial > last), errors.findLast((trial) => trial < last)];
  last = step > 0 ? (after ?? errors[0]) : (before ?? errors.at(-1));
  select([last]);
}

function edit(name) {
  ask("edit", { name, trials: chosen(), id: reply.numbering });
}

$("of").addEventListener("change", look);
$("next").addEventListener("click", () => nextError(1));
$("previous").addEventListener("click", () => nextError(-1));
$("all-errors").addEventListener("click", () => select(errors));
$("relabel").addEventListener("click", () => edit($("type").value));
$("drop").addEventListener("click", () => edit(""));
$("undo").addEventListener("click", () => ask("undo"));
$("show-more").addEventListener("click", () => askFor($("trials").querySelectorAll("article").length));
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.matches("select, input:not([type=checkbox])")) return;
  if (event.key === "n" || event.key === "p") nextError(event.key === "n" ? 1 : -1);
});
