// The page of a guided collection: the next grasp, the countdown, the glove's readings, and the keys.
import { drawHand } from "./hand.js";
import { keys, leaving } from "./keys.js";
import { counted, State } from "./state.js";
import { connect, say } from "./wire.js";

const $ = (id) => document.getElementById(id);
const LETTERS = { accept: "Enter", redo: "r", undo: "u", skip: "s", pause: "p", quit: "q" };
const SHOWN = 5;

let names = { switches: [], sensors: [], taxels: [] };
const current = new State();
let glove = null, pose = null, now = null, shown = "", ended = false, read = "";

function percent(share) {
  return (100 * share).toFixed(0);
}

function listed(words, most = SHOWN) {
  return words.length > most ? `${words.slice(0, most).join(", ")} and ${words.length - most} more` : words.join(", ");
}

const send = connect({
  open: () => current.link(true),
  closed: () => {
    current.link(false, ended);
    offer({});
  },
  collection: (received) => {
    names = received;
    say($("subject"), received.subject);
  },
  hands: (received) => {
    glove = drawHand($("glove"), received.glove);
    pose = drawHand($("pose"), received.pose);
    shown = "";
    if (now) show(now);
  },
  guide: (received) => show((now = received)),
  study: studied,
});

const press = (key) => now && send({ do: key, step: now.step });
const offer = keys($("keys"), LETTERS, (key) => (key === "quit" ? $("leaving").showModal() : press(key)));
leaving($("leaving"), $("leave"), $("stay"), () => press("quit"));

function show(guide) {
  ended = guide.stage === "over";
  current.data(guide.time_us, guide.age_us);
  current.devices(guide.devices);
  const skipped = guide.skipped ? `, ${guide.skipped} skipped` : "";
  say($("count"), `${guide.done} of ${guide.total} trials done${skipped}`);
  $("progress").max = guide.total;
  $("progress").value = guide.done;
  $("task").dataset.step = guide.step;
  task(guide);
  const doing = guide.trial?.none ? "move so" : "hold it";
  const stages = {
    ready: guide.lost ? `the countdown waits: ${guide.lost}` : "Enter starts the countdown",
    countdown: `take the grasp: ${doing} in`,
    moving: "move so for",
    review: "captured: keep it?",
    paused: `paused; nothing is recorded meanwhile${guide.lost ? `; the countdown waits: ${guide.lost}` : ""}`,
    done: "all trials are done",
    over: "the collection has ended",
  };
  if (guide.trial?.none) stages.countdown = "move so in";
  say($("stage"), guide.stage === "done" && guide.skipped ? "no trial is left; the skipped ones come another time" : stages[guide.stage]);
  const counts = guide.stage === "countdown" || guide.stage === "moving";
  say($("number"), counts ? String(Math.ceil(guide.left_s)) : "✓");
  $("number").hidden = !counts && guide.stage !== "review";
  say($("problem"), guide.problem ? `not captured: ${guide.problem}` : "");
  tell(guide, stages[guide.stage]);
  sees(guide);
  offer(guide.offered);
  $("task").dataset.stage = guide.stage;
}

// Read out once per stage of each trial.
function tell(guide, stage) {
  const what = guide.stage === "countdown" || guide.stage === "ready" ? `${$("title").textContent}, ${$("detail").textContent}: ` : "";
  const time = guide.stage === "countdown" ? ` ${Math.ceil(guide.left_s)} s` : "";
  if (read === `${guide.step}`) return;
  read = `${guide.step}`;
  say($("spoken"), `${what}${stage}${time}`);
}

function task(guide) {
  const key = JSON.stringify(guide.trial);
  if (key === shown) return;
  shown = key;
  const trial = guide.trial;
  say($("title"), trial ? trial.title : "No trial is left");
  say($("detail"), trial ? trial.detail : "");
  const picture = trial?.pose ?? null;
  $("pose").toggleAttribute("hidden", picture === null);
  if (picture !== null && pose) {
    pose.setPose(picture);
    $("pose").setAttribute("aria-label", `picture of the hand: ${trial.title}`);
  }
}

function sees(guide) {
  const closed = [...guide.closed], parts = [];
  if (glove) {
    glove.setClosed(closed.map((letter) => letter === "1"), closed.map((letter) => letter === "x"));
    glove.setTaxels(guide.taxels);
    glove.setPose(guide.joints);
  }
  if (names.switches.length) {
    const lost = names.switches.filter((_, bit) => (closed[bit] ?? "x") === "x");
    parts.push(readings(closed.filter((letter) => letter === "1").length, names.switches, lost, "switches closed"));
  }
  if (names.taxels.length) {
    const pressed = guide.taxels.filter((share) => share !== null && share >= 0.5).length;
    const lost = names.taxels.filter((_, at) => (guide.taxels[at] ?? null) === null);
    parts.push(readings(pressed, names.taxels, lost, "taxels pressed"));
  }
  if (names.sensors.length) {
    const lost = names.sensors.filter((_, at) => (guide.joints[at] ?? null) === null);
    parts.push(readings(names.sensors.length - lost.length, names.sensors, lost, "joints measured"));
  }
  say($("sees"), parts.join("; "));
  while ($("devices").children.length > guide.devices.length) $("devices").lastChild.remove();
  guide.devices.forEach((device, at) => {
    const row = $("devices").children[at] ?? $("devices").appendChild(document.createElement("li"));
    row.dataset.is = device.connected ? "good" : "bad";
    say(row, `${device.connected ? "✓" : "✗"} ${device.name}${device.connected ? "" : `: ${device.error}`}`);
  });
}

function readings(count, all, lost, verb) {
  return `${counted(count, all.length, lost.length, verb)}${lost.length ? ` (${listed(lost)})` : ""}`;
}

function studied(received) {
  if (received.problem) {
    say($("study"), received.problem);
    return;
  }
  const ends = `${percent(received.low)} to ${percent(received.high)} %`;
  const single = received.types.filter((type) => type.total === 1).length;
  const rest = single ? `; ${single} type${single > 1 ? "s" : ""} with one trial not counted` : "";
  const share = `${received.correct} of ${received.total} trials (${percent(received.correct / received.total)} %; 95 % interval ${ends}), each from all others, by a quick model`;
  say($("study"), received.total ? `${share}${rest}` : "no accuracy yet: no grasp type has two trials");
  const weak = received.types.filter((type) => type.correct < type.total).slice(0, 3);
  const why = weak.length ? weak : received.types.slice(0, 1);
  say($("more"), `More trials help most with: ${why.map((type) => type.grasp).join(", ")}`);
  $("study-table").hidden = false;
  $("types").replaceChildren(
    ...received.types.map((type) => {
      const row = document.createElement("tr");
      const judged = [`${type.correct} of ${type.total}`, `${percent(type.low)} to ${percent(type.high)} %`, type.taken_for];
      const cells = [type.grasp, ...(type.total > 1 ? judged : ["one trial: not counted", "", ""])];
      cells.forEach((text, at) => {
        const cell = document.createElement(at ? "td" : "th");
        if (!at) cell.scope = "row";
        cell.textContent = text;
        row.append(cell);
      });
      return row;
    }),
  );
}
