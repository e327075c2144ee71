// The view of a run or a recording on their page.
import { drawHand } from "./hand.js";
import { chip, typeStyles } from "./types.js";
import { $, clock, fillTable, list, make, paced, say, tell, WORDS_MS } from "./wire.js";

const SETTLED_MS = 1000; // a text must be stable this long before it is read out
const QUIET_MS = 3000; // minimum time between two texts
const SHOWN = 8;
const LOOK_MS = 100;

// Of each health: its colour and sign, and what it means.
const HEALTHS = {
  ok: ["good", "everything is read"],
  changing: ["changing", "everything is read, and the hand changes"],
  degraded: ["warn", "means replace lost inputs, or a record is late"],
  unknown: ["bad", "too little can be read"],
  "no data": ["bad", ""],
};

/** Shows moments. Old data, and all data while the link is down, is greyed, and #age says why. */
export class View {
  #link = null; // whether there is one; null before the first
  #readAt = null; // when the newest data was read
  #silent = Infinity; // how long a moment is current, in milliseconds: moments of a recording have no age
  #old = false;
  #next = ""; // the last words for screen readers, and when they were said
  #spokenAt = -Infinity;
  #timer = null;
  #draw = paced(() => this.frame && this.#show());
  #say = paced(() => this.frame && this.#words(), WORDS_MS);

  constructor() {
    this.frame = null;
    this.rows = new Map();
    this.quarantined = [];
    setInterval(() => this.#look(), LOOK_MS);
  }

  /** Take the grasp types, switches and hand of the build, and how long a moment of its run is current. */
  begin(build) {
    this.frame = null; // what comes next is drawn, even if it is the same
    this.#silent = (build.silent_us ?? Infinity) / 1000;
    this.switches = build.switches;
    this.hand = build.hand;
    this.drawing = drawHand($("hand"), build.hand);
    const styles = typeStyles(build.grasps);
    this.rows = new Map(build.grasps.map((grasp) => {
      const bar = make("progress", { "aria-hidden": "true", value: 0 }), share = make("span", { class: "share" });
      const row = make("li", {}, chip(styles.get(grasp)), make("span", { class: "name" }, grasp), bar, share);
      return [grasp, { row, bar, share }];
    }));
    $("types").replaceChildren(...[...this.rows.values()].map(({ row }) => row));
    $("preshape").hidden = !build.preshapes;
    $("empty-hand").hidden = build.empty_hand;
  }

  /** Take the state of the connection to the server. */
  link(up) {
    this.#link = up;
    this.#look();
  }

  /** Take a moment. */
  take(frame) {
    if (frame === this.frame) return;
    const news = frame.grasp !== this.frame?.grasp;
    this.frame = frame;
    const ages = [frame.switch_age_us, frame.glove_age_us].filter((age) => age !== null);
    if (ages.length && this.#silent < Infinity) this.#readAt = performance.now() - (Math.min(...ages) + frame.late_us) / 1000;
    this.#look();
    this.#draw();
    this.#say(news);
  }

  /** Take the health of devices and inputs. */
  health(report) {
    showDevices(report.devices);
    this.quarantined = report.quarantined.map(({ name, reason, used }) =>
      `${name}: ${reason}, ${used ? "still used" : "treated as lost"}`,
    );
    say($("read"), `${report.switch_hz.toFixed(0)}/s switches, ${report.glove_hz.toFixed(0)}/s glove`);
    this.#wrong();
  }

  /** Tell news, also to screen readers. */
  tell(words) {
    say($("news"), words);
    this.#announce(words, 0);
  }

  #look() {
    const age = this.#readAt === null ? 0 : performance.now() - this.#readAt, silent = age > this.#silent;
    const since = () => (this.#readAt === null ? "yet" : `since ${clock(Date.now() - age)}`), old = !this.#link || silent;
    say($("age"), this.#link === false ? `no data ${since()}` : silent ? `this is ${(age / 1000).toFixed(1)} s old` : "");
    if (old === this.#old) return;
    this.#old = old;
    document.documentElement.classList.toggle("old", old);
    this.#title();
    this.#draw();
    if (old) this.#announce("no data", 0);
  }

  #title() {
    const words = this.#old ? "no data" : this.frame?.grasp;
    document.title = words ? `${words} · thenar` : "thenar";
  }

  #show() {
    const { frame } = this, grasp = $("grasp"), [closed, gone] = this.#closed();
    if (grasp.textContent !== frame.grasp) {
      grasp.textContent = frame.grasp;
      grasp.style.setProperty("--letters", String([...frame.grasp].length));
      this.#title();
    }
    grasp.classList.toggle("unsure", frame.grasp === "unknown");
    const health = this.#old ? "no data" : frame.health, [is, means] = HEALTHS[health];
    $("health").dataset.is = is;
    tell("health", health);
    say($("why"), means);
    this.drawing.setClosed(closed, gone);
    this.drawing.setPose((frame.joints ?? []).map((value, at) => (frame.lost.includes(this.hand.joints[at].name) ? null : value)));
    this.drawing.setTaxels(this.hand.taxels.map(({ name }) => frame.taxels[name] ?? null));
    if (!this.#old) this.#announce(frame.grasp);
  }

  // Which switches are lost, and which of the others are closed.
  #closed() {
    const { closed, lost } = this.frame, gone = this.switches.map((name) => lost.includes(name));
    return [gone.map((missing, bit) => !missing && closed[bit] === "1"), gone];
  }

  #words() {
    const { frame } = this, [closed, gone] = this.#closed();
    if (this.switches.length) {
      const names = this.switches.filter((_, bit) => closed[bit]);
      const more = names.length > SHOWN ? ` and ${names.length - SHOWN} more` : "";
      const lacking = gone.filter(Boolean).length, readable = this.switches.length - lacking;
      const counted = lacking ? `${readable} readable switches closed; ${lacking} lost` : `${readable} switches closed`;
      const said = `${names.length} of ${counted}`;
      say($("hand-says"), `${said}${names.length ? ": " : ""}${names.slice(0, SHOWN).join(", ")}${more}`);
    }
    for (const [at, [grasp, { row, bar, share }]] of [...this.rows].entries()) {
      const value = frame.probabilities?.[at] ?? (grasp === frame.grasp ? frame.probability : null);
      bar.value = value ?? 0;
      if (grasp === frame.grasp) row.setAttribute("aria-current", "true");
      else row.removeAttribute("aria-current");
      say(share, value === null ? "–" : `${(100 * value).toFixed(value > 0.9995 || value < 0.0005 ? 0 : 1)} %`);
    }
    const sure = frame.grasp === "unknown" ? "" : `${(100 * frame.probability).toFixed(0)}\u00a0% in this frame`;
    const held = frame.segment_us === null ? "" : `segment ${frame.segment}, ${frame.state} for ${((frame.time_us - frame.segment_us) / 1e6).toFixed(1)}\u00a0s`;
    say($("segment"), [sure, held].filter(Boolean).join(" · "));
    if (!$("preshape").hidden) say($("preshape"), `Preshape: ${frame.preshape ?? "none yet"}`);
    for (const id of ["latency", "switch_age", "glove_age"]) {
      const us = frame[`${id}_us`] ?? null;
      say($(id), us === null ? "none yet" : `${(us / 1000).toFixed(1)} ms`);
    }
    this.#wrong();
  }

  #wrong() {
    const named = new Set(this.quarantined.map((text) => text.split(": ")[0]));
    const lost = (this.frame?.lost ?? []).filter((name) => !named.has(name)).map((name) => `${name}: lost`);
    const all = [...this.quarantined, ...lost];
    list($("wrong"), all.length ? all : ["nothing"]);
  }

  // For screen readers: a text that was stable for a second, at most every three seconds.
  #announce(text, wait = Math.max(SETTLED_MS, this.#spokenAt + QUIET_MS - performance.now())) {
    if (text === this.#next) return;
    this.#next = text;
    clearTimeout(this.#timer);
    const speak = () => {
      this.#spokenAt = performance.now();
      say($("spoken"), text);
    };
    if (wait) this.#timer = setTimeout(speak, wait);
    else speak(); // before another text can take its place
  }
}

/** Show devices in their table. Equal rows stay, so that one can select and copy what is said of a lost one. */
export function showDevices(devices) {
  const rows = devices.map(({ name, error, connected, counts }) => {
    const counted = counts.filter(({ value }) => value).map((count) => `${count.name} ${count.value}`);
    return [name, connected ? error || "connected" : `lost: ${error}`, counted.join(", ") || "nothing"];
  });
  if (JSON.stringify(rows) === $("devices-table").dataset.rows) return;
  $("devices-table").dataset.rows = JSON.stringify(rows);
  fillTable("devices", ["Device", "State", "Counted"], rows);
}
