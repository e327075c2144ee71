// The view of a run or a recording on their page.
import { drawHand } from "./hand.js";
import { chip, typeStyles } from "./types.js";
import { $, clock, fillTable, list, make, say, tell } from "./wire.js";

const WORDS_MS = 200; // numbers and words change five times a second, so that they can be read
const SETTLED_MS = 1000; // a text must be stable this long before it is read out
const QUIET_MS = 3000; // minimum time between two texts
const SHOWN = 8;
const LEAST_MS = 500, PERIODS = 3, INTERVALS = 9, LOOK_MS = 100;

// Of each health: its colour and sign, and what it means.
const HEALTHS = {
  ok: ["good", "everything is read"],
  changing: ["changing", "everything is read, and the hand changes"],
  degraded: ["warn", "means replace lost inputs, or a record is late"],
  unknown: ["bad", "too little can be read"],
  "no data": ["bad", ""],
};

export class View {
  constructor() {
    this.state = new State((old) => this.#aged(old));
    this.frame = null;
    this.shown = null;
    this.drawing = null;
    this.rows = new Map();
    this.quarantined = [];
    this.words = 0;
    this.later = null;
    this.drawn = true; // what came last
    this.said = { text: "", at: 0, since: 0, candidate: "" };
  }

  /** Take the grasp types, switches and joints of the build, and whether its moments are those of a run. */
  build(build, live) {
    this.state.live = live;
    this.switches = build.switches;
    this.joints = build.joints;
    const styles = typeStyles(build.grasps);
    this.rows = new Map(build.grasps.map((grasp) => {
      const full = make("span"), share = make("span", { class: "share" }), bar = make("div", { class: "bar" }, full);
      const row = make("li", {}, chip(styles.get(grasp)), make("span", { class: "name" }, grasp), bar, share);
      return [grasp, { row, full, share }];
    }));
    $("types").replaceChildren(...[...this.rows.values()].map(({ row }) => row));
    $("preshape").hidden = !build.preshapes;
    $("empty-hand").hidden = build.empty_hand;
  }

  /** Take the positions of the build's inputs on the hand. */
  setHand(hand) {
    this.hand = hand;
    this.drawing = drawHand($("hand"), hand, {});
  }

  /** Take a moment. */
  take(frame) {
    this.frame = frame;
    const ages = [frame.switch_age_us, frame.glove_age_us].filter((age) => age !== null);
    const age = ages.length ? Math.min(...ages) : null;
    if (this.state.live && age !== null) this.state.data(frame.time_us - age, age + (frame.late_us ?? 0));
    this.#later();
  }

  /** Take the health of devices and inputs. */
  health(report) {
    fillTable("devices", ["Device", "State", "Counted"], report.devices.map(({ name, error, connected, counts }) => {
      const counted = counts.filter(({ value }) => value).map((count) => `${count.name} ${count.value}`);
      return [name, error || (connected ? "connected" : "not connected"), counted.join(", ") || "nothing"];
    }));
    this.quarantined = report.quarantined.map(({ name, reason, used }) =>
      `${name}: ${reason}, ${used ? "still used" : "treated as lost"}`,
    );
    say($("read"), `${report.switch_hz.toFixed(0)}/s switches, ${report.glove_hz.toFixed(0)}/s glove`);
    this.#wrong();
  }

  /** Tell news, also to screen readers. */
  tell(words) {
    say($("news"), words);
    Object.assign(this.said, { text: words, at: performance.now() });
    say($("spoken"), words);
  }

  #aged(old) {
    this.shown = null; // everything is drawn again
    this.#later();
    this.#title();
    if (old) this.#announce("no data", performance.now(), true);
  }

  #title() {
    const words = this.state.old ? "no data" : this.frame?.grasp;
    document.title = words ? `${words} · thenar` : "thenar";
  }

  #later() {
    if (this.drawn) requestAnimationFrame(() => this.#draw());
    this.drawn = false;
  }

  #draw() {
    this.drawn = true;
    const { frame } = this, now = performance.now();
    if (frame === null || frame === this.shown) return;
    const news = this.shown?.grasp !== frame.grasp;
    this.shown = frame;
    this.#now(frame);
    this.#hand(frame);
    const wait = news ? 0 : WORDS_MS - (now - this.words);
    if (wait <= 0) this.#numbers(frame);
    else this.later ??= setTimeout(() => this.#numbers(this.frame), wait);
    this.#announce(this.state.old ? "no data" : frame.grasp, now);
  }

  #now(frame) {
    const grasp = $("grasp");
    if (grasp.textContent !== frame.grasp) {
      grasp.textContent = frame.grasp;
      grasp.style.setProperty("--letters", String([...frame.grasp].length));
      this.#title();
    }
    grasp.classList.toggle("unsure", frame.grasp === "unknown");
    const health = this.state.old ? "no data" : frame.health, [is, means] = HEALTHS[health] ?? ["bad", ""];
    $("health").dataset.is = is;
    tell("health", health);
    say($("why"), means);
  }

  #hand(frame) {
    if (!this.drawing) return;
    const lost = new Set(frame.lost), gone = this.switches.map((name) => lost.has(name));
    const closed = gone.map((missing, bit) => !missing && frame.closed[bit] === "1");
    if (this.switches.length) {
      const names = this.switches.filter((_, bit) => closed[bit]);
      const more = names.length > SHOWN ? ` and ${names.length - SHOWN} more` : "";
      const lacking = gone.filter(Boolean).length, readable = this.switches.length - lacking;
      const counted = lacking ? `${readable} readable switches closed; ${lacking} lost` : `${readable} switches closed`;
      const said = `${names.length} of ${counted}`;
      say($("hand-says"), `${said}${names.length ? ": " : ""}${names.slice(0, SHOWN).join(", ")}${more}`);
    }
    this.drawing.setClosed(closed, gone);
    this.drawing.setPose((frame.joints ?? this.joints.map(() => null)).map((value, at) => (lost.has(this.joints[at]) ? null : value)));
    this.drawing.setTaxels(this.hand.taxels.map(({ name }) => frame.taxels[name] ?? null));
  }

  #numbers(frame) {
    clearTimeout(this.later);
    this.later = null;
    this.words = performance.now();
    for (const [at, [grasp, { row, full, share }]] of [...this.rows].entries()) {
      const value = frame.probabilities?.[at] ?? (grasp === frame.grasp ? frame.probability : null);
      full.style.transform = `scaleX(${value ?? 0})`;
      if (grasp === frame.grasp) row.setAttribute("aria-current", "true");
      else row.removeAttribute("aria-current");
      say(share, value === null ? "–" : `${(100 * value).toFixed(value > 0.9995 || value < 0.0005 ? 0 : 1)} %`);
    }
    const sure = frame.grasp === "unknown" ? "" : `${(100 * frame.probability).toFixed(0)}\u00a0% in this frame`;
    const held = frame.segment_us === null ? "" : `segment ${frame.segment}, ${frame.state} for ${((frame.time_us - frame.segment_us) / 1e6).toFixed(1)}\u00a0s`;
    say($("segment"), [sure, held].filter(Boolean).join(" · "));
    if (!$("preshape").hidden) say($("preshape"), `Preshape: ${frame.preshape?.name ?? "none yet"}`);
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
  #announce(grasp, now, atOnce = false) {
    const { said } = this;
    if (said.candidate !== grasp) Object.assign(said, { candidate: grasp, since: now });
    const settled = now - said.since >= SETTLED_MS && now - said.at >= QUIET_MS;
    if (grasp !== said.text && (atOnce || settled)) {
      Object.assign(said, { text: grasp, at: now });
      say($("spoken"), grasp);
    }
  }
}

/**
 * Watches the age of the data, and says it in #age.
 *
 * Data is old after half a second, or after three periods of its source if these are longer. Old data, and all data while
 * the link is down, is greyed: the root element has the class "old".
 */
class State {
  #readAt = null;
  #dataUs = null;
  #intervals = [];
  #link = null;

  /** @param {function(boolean): void} changed called with whether the data is old, when that changes */
  constructor(changed = () => {}) {
    this.changed = changed;
    this.live = true; // moments of a recording have no age
    this.old = false;
    setInterval(() => this.#look(), LOOK_MS);
  }

  /**
   * Take the moment at which the newest data was read, on any clock, and its age now, both in microseconds; null: none
   * was read yet.
   */
  data(timeUs, ageUs) {
    if (timeUs === null) return;
    this.#readAt = performance.now() - ageUs / 1000;
    if (this.#dataUs !== null && timeUs > this.#dataUs) this.#intervals.push((timeUs - this.#dataUs) / 1000);
    if (this.#intervals.length > INTERVALS) this.#intervals.shift();
    this.#dataUs = timeUs;
    this.#look();
  }

  /** Take the state of the connection to the server. */
  link(up) {
    this.#link = up;
    this.#look();
  }

  #look() {
    const up = Boolean(this.#link), age = this.#readAt === null ? 0 : performance.now() - this.#readAt;
    const middle = [...this.#intervals].sort((one, other) => one - other)[this.#intervals.length >> 1] ?? 0;
    const silent = this.live && age > Math.max(LEAST_MS, PERIODS * middle), old = !up || silent;
    const since = this.#readAt === null ? "" : ` since ${clock(this.#readAt)}`;
    const words = this.#link === null ? "" : !up ? `no data${since || " yet"}` : silent ? `this is ${(age / 1000).toFixed(1)} s old` : "";
    say($("age"), words);
    document.documentElement.classList.toggle("old", old);
    if (old === this.old) return;
    this.old = old;
    this.changed(old);
  }
}
