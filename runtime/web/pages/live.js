// The page of a run, or of its recording: shows messages and sends requests.
import { Replay } from "./replay.js";
import { openPage } from "./shell.js";
import { View } from "./view.js";


const $ = (id) => document.getElementById(id);
const view = new View();
const replay = new Replay(view, (what, value) => ask(what, { value }));

const ask = openPage({
  open: () => view.state.link(true),
  closed: () => view.state.link(false),
  build: (build) => {
    view.build(build);
    $("replay-panel").hidden = $("truth").hidden = !build.replay;
    $("main").classList.toggle("replay", Boolean(build.replay));
  },
  hand: (hand) => view.setHand(hand),
  past: (past) => view.past(past),
  frame: (frame) => {
    view.take(frame);
    replay.judge();
  },
  health: (report) => view.health(report),
  overview: (overview) => replay.overview(overview),
  replay: (state) => replay.show(state),
});
