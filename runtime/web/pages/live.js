// The page of a run, or of its recording: shows messages and sends requests.
import { Replay } from "./replay.js";
import { View } from "./view.js";
import { connect, say } from "./wire.js";

const $ = (id) => document.getElementById(id);
const view = new View();
const replay = new Replay(view, (what, value) => ask({ do: what, value }));

const send = connect({
  open: () => view.state.link(true),
  closed: () => view.state.link(false),
  build: (build) => {
    view.build(build);
    $("record-panel").hidden = !build.records;
    $("replay-panel").hidden = $("truth").hidden = !build.replay;
    $("glove-state").hidden = Boolean(build.replay);
    $("main").classList.toggle("replay", Boolean(build.replay));
  },
  hand: (hand) => view.setHand(hand),
  past: (past) => view.past(past),
  frame: (frame) => {
    view.take(frame);
    replay.judge();
  },
  health: (report) => view.health(report),
  recording: show,
  overview: (overview) => replay.overview(overview),
  replay: (state) => replay.show(state),
  refused: ({ why }) => say($("refused"), why),
});

function show({ on, fixed, name, folder, since_s, messages, marks, failure }) {
  say($("refused"), "");
  $("recording").dataset.on = on ? "yes" : "no";
  const begun = new Date(1000 * since_s).toLocaleTimeString();
  const held = `${messages} messages, ${marks} ${marks === 1 ? "mark" : "marks"}`;
  const words = on ? `${name}, since ${begun}: ${held}` : name ? `${name} is complete: ${held}` : `none; goes to ${folder}`;
  say($("recording"), failure || words);
  const had = document.activeElement;
  $("record").disabled = on;
  $("record-name").disabled = on;
  $("mark").disabled = !on;
  $("stop").disabled = !on || fixed;
  // Keyboard focus stays where the next action is.
  if (had?.disabled) $(on ? "mark" : "record").focus();
}

$("record").addEventListener("click", () => {
  const name = $("record-name");
  if (name.reportValidity()) ask({ do: "record", name: name.value });
});
$("record-name").addEventListener("keydown", (event) => {
  if (event.key === "Enter") $("record").click();
});
$("mark").addEventListener("click", () => ask({ do: "mark" }));
$("stop").addEventListener("click", () => ask({ do: "stop" }));

function ask(asked) {
  say($("refused"), send(asked) ? "" : "not connected");
}
