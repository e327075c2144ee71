// The page of a guided calibration: the pose to hold, what each sensor says meanwhile, and the keys.
import { drawHand } from "./hand.js";
import { keys, leaving } from "./keys.js";
import { connect, say } from "./wire.js";

const $ = (id) => document.getElementById(id);
const LETTERS = { accept: "Enter", keep: "k", back: "b", quit: "q" };
const STAGES = {
  ready: "hold this pose, then press Enter",
  held: "hold still",
  doubted: "this pose is in doubt",
  done: "all poses are taken",
  over: "the calibration has ended",
};

let pose = null, now = null, rows = [], read = -1, end = "";

const send = connect({
  open: () => link("connected", "good"),
  closed: () => {
    if (end) link("ended", "good");
    else link("not connected", "bad");
    offer({});
  },
  sensors: (told) => {
    say($("subject"), told.subject);
    rows = told.names.map(row);
    $("sensors").replaceChildren(...rows.map((one) => one.row));
  },
  hand: (told) => {
    pose = drawHand($("pose"), told);
  },
  pose: show,
  end: (told) => {
    end = told.text;
    say($("stage"), end);
    say($("told"), end);
  },
});

const press = (key) => now && send({ do: key, step: now.step });
const offer = keys($("keys"), LETTERS, (key) => (key === "quit" ? $("leaving").showModal() : press(key)));
leaving($("leaving"), $("leave"), $("stay"), () => press("quit"));

function link(words, is) {
  say($("link"), words);
  $("link").dataset.is = is;
}

function row(name) {
  const made = document.createElement("tr"), head = document.createElement("th");
  head.scope = "row";
  head.textContent = name;
  const [byte, flat, state] = [0, 1, 2].map(() => document.createElement("td"));
  const meter = document.createElement("meter"), number = document.createElement("span");
  meter.max = 255;
  meter.setAttribute("aria-label", name);
  byte.className = "byte";
  byte.append(meter, " ", number);
  made.append(head, byte, flat, state);
  return { row: made, meter, number, flat, state };
}

function show(told) {
  now = told;
  const done = told.stage === "done" || told.stage === "over";
  say($("count"), done ? `${told.total} of ${told.total} poses taken` : `pose ${told.number} of ${told.total}`);
  $("progress").max = told.total;
  $("progress").value = done ? told.total : told.number - 1;
  $("task").dataset.step = told.step;
  say($("title"), done ? "All poses are taken" : told.name);
  say($("detail"), done ? "" : told.instruction);
  say($("stage"), end || STAGES[told.stage]);
  if (pose && told.picture) {
    pose.setPose(told.picture);
    $("pose").setAttribute("aria-label", `picture of the hand: ${told.name}`);
  }
  $("pose").toggleAttribute("hidden", !told.picture || done);
  if ($("problems").children.length !== told.problems.length) {
    $("problems").replaceChildren(...told.problems.map(() => document.createElement("li")));
  }
  told.problems.forEach((problem, at) => say($("problems").children[at], problem));
  if (read !== told.step) {
    read = told.step;
    say($("told"), told.stage === "ready" ? `${told.name}: ${told.instruction} ${STAGES.ready}` : STAGES[told.stage]);
  }
  rows.forEach(({ row: made, meter, number, flat, state }, at) => {
    made.classList.toggle("concerned", told.concerned[at]);
    meter.value = told.bytes[at] ?? 0;
    say(number, String(told.bytes[at] ?? "–"));
    say(flat, told.flat ? String(told.flat[at]) : "");
    say(state, told.states[at] || (told.concerned[at] ? "this pose's" : ""));
    state.dataset.is = told.states[at] ? "bad" : "";
  });
  const wrong = told.states.filter((state) => state).length;
  say($("sees"), wrong ? `${wrong} of ${rows.length} sensors: see State` : `all ${rows.length} sensors are measured`);
  offer(told.offered);
  $("task").dataset.stage = told.stage;
}
