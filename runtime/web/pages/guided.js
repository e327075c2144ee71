// The page of a guided collection or calibration: what to do now, what the glove reads, and the keys.
import { drawHand } from "./hand.js";
import { State } from "./state.js";
import { cell, connect, list, say } from "./wire.js";

const $ = (id) => document.getElementById(id);
// The same letters as on the terminal.
const LETTERS = { accept: "Enter", keep: "k", redo: "r", undo: "u", back: "b", skip: "s", pause: "p", quit: "q" };

const current = new State(), buttons = new Map();
let hands = {}, now = null, read = "", offered = {};

const send = connect({
  open: () => current.link(true),
  closed: () => {
    current.link(false, now?.stage === "over");
    offer({});
  },
  about: (about) => {
    document.title = `thenar: ${about.what} ${about.subject}`;
    for (const name of ["what", "subject"]) say($(name), about[name]);
    say($("leaving-says"), about.leave);
    $("study-panel").hidden = !about.study;
    $("sensors").replaceChildren(...about.table.map(row));
    $("sensors-table").hidden = !about.table.length;
  },
  hands: (drawings) => {
    $("glove").toggleAttribute("hidden", !drawings.glove);
    hands = { pose: drawHand($("pose"), drawings.pose), glove: drawings.glove && drawHand($("glove"), drawings.glove) };
    if (now) show(now);
  },
  guide: show,
  study: studied,
});

function row(name) {
  const made = document.createElement("tr"), byte = cell("td", "");
  const meter = document.createElement("meter"), number = document.createElement("span");
  meter.max = 255;
  meter.setAttribute("aria-label", name);
  byte.className = "byte";
  byte.append(meter, " ", number);
  made.append(cell("th", name), byte, cell("td", ""), cell("td", ""));
  return made;
}

function show(guide) {
  now = guide;
  current.data(guide.time_us, guide.age_us);
  current.devices(guide.devices);
  say($("count"), guide.count);
  $("progress").max = guide.total;
  $("progress").value = guide.done;
  $("task").dataset.step = guide.step;
  say($("title"), guide.title);
  say($("detail"), guide.detail);
  say($("stage"), guide.says);
  say($("number"), guide.number);
  $("number").hidden = !guide.number;
  $("pose").toggleAttribute("hidden", !guide.pose);
  if (guide.pose && hands.pose) {
    hands.pose.setPose(guide.pose);
    $("pose").setAttribute("aria-label", `picture of the hand: ${guide.title}`);
  }
  list($("problems"), guide.problems);
  // Read out once per stage of each step.
  if (read !== `${guide.step} ${guide.stage}`) {
    read = `${guide.step} ${guide.stage}`;
    const what = ["countdown", "ready"].includes(guide.stage) ? `${guide.title}, ${guide.detail}: ` : "";
    say($("spoken"), `${what}${guide.says}${guide.stage === "countdown" ? ` ${guide.number} s` : ""}`);
  }
  sees(guide);
  offer(guide.offered);
  $("task").dataset.stage = guide.stage;
}

function sees(guide) {
  say($("sees"), guide.sees);
  if (hands.glove) {
    const closed = [...guide.closed];
    hands.glove.setClosed(closed.map((letter) => letter === "1"), closed.map((letter) => letter === "x"));
    hands.glove.setTaxels(guide.taxels);
    hands.glove.setPose(guide.joints);
  }
  guide.rows.forEach(({ byte, flat, state, concerned, faulty }, at) => {
    const made = $("sensors").children[at], [, value, before, words] = made.children;
    made.classList.toggle("concerned", concerned);
    value.firstChild.value = byte ?? 0;
    say(value.lastChild, String(byte ?? "–"));
    say(before, String(flat ?? ""));
    say(words, state);
    words.dataset.is = faulty ? "bad" : "";
  });
  const words = guide.devices.map(({ name, connected, error }) => (connected ? `✓ ${name}` : `✗ ${name}: ${error}`));
  list($("devices"), words, (item, at) => (item.dataset.is = guide.devices[at].connected ? "good" : "bad"));
}

function studied(study) {
  const percent = (share) => (100 * share).toFixed(0);
  if (study.problem) {
    say($("study"), study.problem);
    return;
  }
  const ends = `${percent(study.low)} to ${percent(study.high)} %`;
  const single = study.types.filter((type) => type.total === 1).length;
  const rest = single ? `; ${single} type${single > 1 ? "s" : ""} with one trial not counted` : "";
  const share = `${study.correct} of ${study.total} trials (${percent(study.correct / study.total)} %; 95 % interval ${ends}), each from all others, by a quick model`;
  say($("study"), study.total ? `${share}${rest}` : "no accuracy yet: no grasp type has two trials");
  const weak = study.types.filter((type) => type.correct < type.total).slice(0, 3);
  const why = weak.length ? weak : study.types.slice(0, 1);
  say($("more"), `More trials help most with: ${why.map((type) => type.grasp).join(", ")}`);
  $("study-table").hidden = false;
  $("types").replaceChildren(
    ...study.types.map((type) => {
      const made = document.createElement("tr");
      const judged = [`${type.correct} of ${type.total}`, `${percent(type.low)} to ${percent(type.high)} %`, type.taken_for];
      const cells = type.total > 1 ? judged : ["one trial: not counted", "", ""];
      made.append(cell("th", type.grasp), ...cells.map((text) => cell("td", text)));
      return made;
    }),
  );
}

/* ---- The buttons of the actions available now, also by keys ---- */

for (const [key, letter] of Object.entries(LETTERS)) {
  const button = document.createElement("button"), words = document.createElement("span"), hint = document.createElement("kbd");
  button.type = "button";
  button.id = `key-${key}`;
  button.hidden = true;
  button.className = letter === "Enter" ? "" : "plain";
  hint.textContent = letter;
  button.setAttribute("aria-keyshortcuts", letter);
  button.append(words, " ", hint);
  button.addEventListener("click", () => press(key));
  $("keys").append(button);
  buttons.set(key, { button, words });
}

function offer(actions) {
  offered = actions;
  for (const [key, { button, words }] of buttons) {
    const gone = offered[key] === undefined;
    // Keyboard focus stays among the buttons.
    if (gone && button === document.activeElement) $("keys").focus();
    button.hidden = gone;
    if (!gone) say(words, offered[key]);
  }
}

function press(key) {
  if (key === "quit") $("leaving").showModal();
  else send({ do: key, step: now.step });
}

document.addEventListener("keydown", (event) => {
  if (event.repeat || event.ctrlKey || event.altKey || event.metaKey || $("leaving").open) return;
  const key = Object.keys(LETTERS).find((one) => LETTERS[one].toLowerCase() === event.key.toLowerCase());
  // Enter on a button presses that button.
  if (key === undefined || offered[key] === undefined || (event.key === "Enter" && event.target.closest("button"))) return;
  event.preventDefault();
  press(key);
});

$("leave").addEventListener("click", () => {
  $("leaving").close();
  send({ do: "quit", step: now.step });
});
$("stay").addEventListener("click", () => $("leaving").close());
