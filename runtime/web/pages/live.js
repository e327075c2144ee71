// The page of a run, or of a recording: hands messages on, and sends requests.
import { Replay } from "./replay.js";
import { openPage } from "./shell.js";
import { Timeline } from "./timeline.js";
import { View } from "./view.js";
import { $ } from "./wire.js";

// In the studio the address names a recording, and the builds to compare on it.
const ids = new URLSearchParams(location.search).getAll("id");
const view = new View();
const timeline = new Timeline($("timeline"), {
  moved: () => !timeline.live && replay.moved(),
  toggle: () => (timeline.live ? timeline.seek(timeline.at === null ? timeline.last - 1 : null) : replay.toggle()),
});
const replay = new Replay(view, timeline, (what, numbers) => ask(what, { numbers, ids }));
const run = {
  build: begin,
  past: ({ changes, until_us }) => timeline.follow(changes, until_us),
  frame: (frame) => {
    timeline.follow([frame.change], frame.change[0]);
    view.take(frame);
  },
  health: (report) => view.health(report),
};
let build = null;
let studio = null; // its controls

const ask = openPage({
  open: () => {
    view.link(true);
    if (ids.length) ask("replay", { ids });
  },
  closed: () => view.link(false),
  ...(ids.length ? {} : run),
  replay: (recording) => {
    for (const one of document.querySelectorAll("[data-of]")) one.hidden = one.dataset.of !== "recording";
    begin(recording);
    replay.begin();
  },
  overview: (overview) => replay.overview(overview),
  moments: (moments) => replay.moments(moments),
  project: (project) => steer((page) => page.project(project)),
  live: (commands) => steer((page) => page.commands(commands)),
  station: (station) => steer((page) => page.station(station)),
});

function begin(about) {
  if (build !== null && build !== about.name) view.tell(`The run goes on with ${about.name}, before it was ${build}.`);
  build = about.name;
  for (const section of document.querySelectorAll("section.data")) section.hidden = false;
  timeline.begin(about);
  view.begin(about);
}

// The studio has a file for its controls.
async function steer(use) {
  studio ??= import("./steer.js").then(({ Steer }) => new Steer($("steer"), ids, ask));
  use(await studio);
}
