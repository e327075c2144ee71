// The page of a run, or of a recording: hands messages on, sends requests, and plays.
import { openPage } from "./shell.js";
import { differs, spanAt, Timeline, within } from "./timeline.js";
import { View } from "./view.js";
import { $, say } from "./wire.js";

const ASK_MS = 80, LATER_MS = 500; // the server takes 20 requests a second
const FRAME_MS = 40; // while it plays
const AHEAD = 2, KEPT = 8; // seconds

// In the studio the address names a recording, and the builds to compare on it.
const ids = new URLSearchParams(location.search).getAll("id");
const view = new View();
const timeline = new Timeline($("timeline"), {
  moved: () => !timeline.live && replay.moved(),
  toggle: () => (timeline.live ? timeline.seek(timeline.at === null ? timeline.last - 1 : null) : replay.toggle()),
});
const secondOf = (us) => Math.floor(us / 1e6);

// The time in the address, in seconds from the recording's beginning: "#t=12.34".
function linked() {
  const seconds = Number(new URLSearchParams(location.hash.slice(1)).get("t") ?? NaN);
  return Number.isFinite(seconds) ? seconds : null;
}

function longest(announced, { from, to }) {
  const lengths = new Map();
  for (const span of within(announced, from, to)) {
    lengths.set(span.name, (lengths.get(span.name) ?? 0) + span.to - span.from);
  }
  return [...lengths].sort(([, one], [, other]) => other - one)[0]?.[0];
}

/** The recording: this page's position in it, which plays here, and what it asks the server for. */
class Replay {
  #labels = new Map(); // spans by the number of their trial
  #counts = [];
  #seconds = new Map(); // moments, by their second since 1970
  #asking = false; // for moments
  #asked = 0;
  #playing = false;
  #before = 0;
  #share = 0;
  #wanted = linked(); // the time of the address, until it was read

  constructor() {
    $("play").addEventListener("click", () => this.toggle());
    addEventListener("hashchange", () => this.#link(linked()));
  }

  /** Begin, or begin again after the server came back: the position stays. */
  begin() {
    this.#labels.clear();
    this.#counts = [...timeline.tracks, this.#labels].map(() => 0);
    this.#seconds.clear();
    this.#asking = false;
    this.#more();
    this.moved();
  }

  #more() {
    ask("overview", { numbers: this.#counts, ids });
  }

  /** Take what was read since. */
  overview({ have, changes, truth, first_us, last_us, share, faults }) {
    if (String(have) !== String(this.#counts)) return;
    const { tracks } = timeline, lists = [...changes, truth];
    changes.forEach((some, number) => some.forEach((change) => tracks[number].take(change)));
    for (const [trial, from, to, name] of truth) {
      if (name) this.#labels.set(trial, { from, to, name });
      else this.#labels.delete(trial);
    }
    timeline.truth = [...this.#labels.values()].sort((one, other) => one.from - other.from);
    this.#counts = have.map((count, number) => count + lists[number].length);
    this.#share = share;
    say($("scanned"), share < 1 ? `${Math.floor(100 * share)} % of the file is read` : "");
    say($("faults"), faults.join(" "));
    if (first_us !== null) {
      for (const track of tracks) track.untilUs = last_us;
      timeline.recorded(first_us, Math.max(last_us, first_us + 1));
      this.#link(this.#wanted);
      if (timeline.at === null) timeline.seek(first_us);
      else this.moved();
      this.#rate();
    }
    const more = lists.some((list) => list.length);
    if (share < 1 || more) setTimeout(() => this.#more(), more ? ASK_MS : LATER_MS);
  }

  /** Take the moments of a second; none were read yet if there are none. */
  moments({ second, frames }) {
    this.#asking = false;
    if (!frames.length) return;
    this.#seconds.set(second, frames);
    if (this.#seconds.size > KEPT) this.#seconds.delete(this.#seconds.keys().next().value);
    this.moved();
  }

  /** Play, or pause. */
  toggle() {
    const { at, last, first } = timeline;
    this.#playing = !this.#playing && at !== null;
    say($("play"), this.#playing ? "Pause" : "Play");
    if (!this.#playing) {
      this.#address();
      return;
    }
    if (at >= last) timeline.seek(first);
    this.#before = performance.now();
    this.#play();
  }

  /** The cursor was moved. */
  moved() {
    this.#show();
    this.#fetch();
    clearTimeout(this.settled);
    if (!this.#playing) this.settled = setTimeout(() => this.#address(), LATER_MS);
  }

  #play() {
    if (!this.#playing) return;
    setTimeout(() => this.#play(), FRAME_MS);
    const { at, last } = timeline, now = performance.now(), speed = Number($("speed").value);
    const us = Math.min(at + (now - this.#before) * 1000 * speed, last);
    this.#before = now;
    // It waits for moments that have not come yet.
    if (this.#seconds.has(secondOf(us))) timeline.seek(us);
    if (at >= last && this.#share === 1) this.toggle();
  }

  // Show the moment at the cursor, if it has come, and compare it with the label.
  #show() {
    const { at, truth, tracks: [, other] } = timeline, frames = this.#seconds.get(secondOf(at));
    if (!frames) return;
    const frame = frames.findLast(({ change: [us] }) => us <= at) ?? frames[0];
    const label = spanAt(truth, at)?.name ?? null;
    view.take(frame);
    const bad = label !== null && differs(frame.grasp, label);
    say($("truth"), label === null ? "Truth: no label" : bad ? `✗ Truth: ${label}, announced: ${frame.grasp}` : `Truth: ${label}`);
    for (const id of ["truth", "grasp"]) $(id).classList.toggle("wrong", bad);
    if (!other) return;
    const second = spanAt(other.announced, at)?.name ?? "nothing", wrong = label !== null && differs(second, label);
    say($("other"), `${wrong ? "✗ " : ""}${other.name}: ${second}`);
    $("other").classList.toggle("wrong", wrong);
  }

  // Ask for the moments of the next second that is missing at the cursor; one request at a time.
  #fetch() {
    const { at } = timeline, now = secondOf(at), ahead = this.#playing ? AHEAD : 0;
    const missing = Array.from({ length: ahead + 1 }, (_, more) => now + more).find((second) => !this.#seconds.has(second));
    if (at === null || this.#asking || missing === undefined) return;
    this.#asking = true;
    setTimeout(() => {
      this.#asked = performance.now();
      this.#asking = ask("moments", { numbers: [missing], ids });
    }, Math.max(ASK_MS - (performance.now() - this.#asked), 0));
  }

  // Say how many labelled trials each build recognises: a trial is right if its type was announced for longest.
  #rate() {
    const { truth, tracks } = timeline;
    const right = tracks.map(({ announced }) => truth.map((span) => longest(announced, span) === span.name));
    const words = right.map((found, number) => {
      const count = found.filter(Boolean).length, name = tracks[number].name || "This build";
      return `${name} recognises ${count} of ${truth.length} labelled trials, ${((100 * count) / truth.length).toFixed(0)} %.`;
    });
    if (right.length > 1) {
      const alone = right.map((found, number) => found.filter((one, trial) => one && !right[1 - number][trial]).length);
      words.push(`Of them ${alone.map((count, number) => `${count} by ${tracks[number].name} alone`).join(", ")}.`);
    }
    say($("rates"), truth.length ? `${words.join(" ")} A trial is recognised if its type was announced for longest.` : "");
  }

  #address() {
    const { at, first } = timeline;
    if (at !== null && this.#wanted === null) history.replaceState(null, "", `#t=${((at - first) / 1e6).toFixed(2)}`);
  }

  #link(seconds) {
    const { first, last } = timeline;
    this.#wanted = seconds;
    if (seconds === null || last === null || (this.#share < 1 && first + 1e6 * seconds > last)) return;
    this.#wanted = null;
    timeline.seek(first + 1e6 * seconds);
  }
}

const replay = new Replay();
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
    $("other").hidden = recording.builds.length < 2;
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
