// The page of a guided calibration: the pose to hold, the live value of each sensor, and the keys.
import { drawHand } from "./hand.js";
import { keys, leaving } from "./keys.js";
import { counted, State } from "./state.js";
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

const current = new State();
let pose = null, now = null, rows = [], read = -1, end = "";

const send = connect({
  open: () => current.link(true),
  closed: () => {
    current.link(false, Boolean(end));
    offer({});
  },
  sensors: (received) => {
    end = "";
    say($("subject"), received.subject);
    rows = received.names.map(row);
    $("sensors").replaceChildren(...rows.map((one) => one.row));
  },
  hand: (received) => {
    pose = drawHand($("pose"), received);
  },
  pose: show,
  end: (received) => {
    end = received.text;
    say($("stage"), end);
    say($("spoken"), end);
  },
});

const press = (key) => now && send({ do: key, step: now.step });
const offer = keys($("keys"), LETTERS, (key) => (key === "quit" ? $("leaving").showModal() : press(key)));
leaving($("leaving"), $("leave"), $("stay"), () => press("quit"));

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

function show(received) {
  now = received;
  current.data(received.time_us, received.age_us);
  current.devices([]);
  const done = received.stage === "done" || received.stage === "over";
  say($("count"), done ? `${received.total} of ${received.total} poses taken` : `pose ${received.number} of ${received.total}`);
  $("progress").max = received.total;
  $("progress").value = done ? received.total : received.number - 1;
  $("task").dataset.step = received.step;
  say($("title"), done ? "All poses are taken" : received.name);
  say($("detail"), done ? "" : received.instruction);
  const waits = received.stage === "ready" && received.silent;
  say($("stage"), end || (waits ? "the glove is silent: no pose can be taken until it sends" : STAGES[received.stage]));
  if (pose && received.picture) {
    pose.setPose(received.picture);
    $("pose").setAttribute("aria-label", `picture of the hand: ${received.name}`);
  }
  $("pose").toggleAttribute("hidden", !received.picture || done);
  if ($("problems").children.length !== received.problems.length) {
    $("problems").replaceChildren(...received.problems.map(() => document.createElement("li")));
  }
  received.problems.forEach((problem, at) => say($("problems").children[at], problem));
  if (read !== received.step) {
    read = received.step;
    say($("spoken"), received.stage === "ready" ? `${received.name}: ${received.instruction} ${STAGES.ready}` : STAGES[received.stage]);
  }
  rows.forEach(({ row: made, meter, number, flat, state }, at) => {
    made.classList.toggle("concerned", received.concerned[at]);
    meter.value = received.bytes[at] ?? 0;
    say(number, String(received.bytes[at] ?? "–"));
    say(flat, received.flat ? String(received.flat[at]) : "");
    say(state, received.states[at] || (received.concerned[at] ? "this pose's" : ""));
    state.dataset.is = received.states[at] ? "bad" : "";
  });
  const wrong = received.states.filter((state) => state).length;
  const all = rows.length, known = received.bytes.length && !received.silent;
  say($("sees"), !known ? counted(0, all, all, "sensors measured") : wrong ? `${wrong} of ${all} sensors: see State` : `all ${all} sensors are measured`);
  offer(received.offered);
  $("task").dataset.stage = received.stage;
}
