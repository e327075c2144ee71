// The view of a run or a recording on their page.
import { drawHand } from "./hand.js";
import { counted, State } from "./state.js";
import { chip, typeStyles } from "./types.js";
import { cell, list, say } from "./wire.js";

const $ = (id) => document.getElementById(id);
const WORDS_MS = 200; // numbers and words change five times a second, so that they can be read
const SETTLED_MS = 1000; // a text must be stable this long before it is read out
const QUIET_MS = 3000; // minimum time between two texts
const SHOWN = 8;

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
    this.live = true;
    this.state = new State((old) => this.#aged(old));
    this.frame = null;
    this.shown = null;
    this.drawing = null;
    this.hand = null;
    this.bits = new Map();
    this.closed = [];
    this.joints = [];
    this.rows = new Map();
    this.quarantined = [];
    this.words = 0;
    this.later = null;
    this.drawn = true; // what came last
    this.said = { text: "", at: 0, since: 0, candidate: "" };
  }

  /** Take the grasp types, switches and joints of the build, and whether its moments are those of a run. */
  build(build, live) {
    this.live = this.state.live = live; // moments of a recording have no age
    this.bits = new Map(build.switches.map((name, bit) => [name, bit]));
    this.joints = build.joints;
    this.closed = build.switches.map(() => false);
    this.rows.clear();
    $("types").replaceChildren();
    const styles = typeStyles(build.grasps);
    for (const grasp of build.grasps) this.#row(grasp, styles.get(grasp));
    $("preshape").hidden = !build.preshapes;
    $("empty-hand").hidden = build.empty_hand;
    this.classes = build.grasps;
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
    if (this.live && age !== null) this.state.data(frame.time_us - age, age + (frame.late_us ?? 0));
    this.#later();
  }

  /** Take the health of devices and inputs. */
  health(report) {
    const rows = report.devices.map((device) => {
      const row = document.createElement("tr");
      const state = device.error || (device.connected ? "connected" : "not connected");
      const counted = device.counts.filter((count) => count.value).map((count) => `${count.name} ${count.value}`);
      row.append(cell("th", device.name), cell("td", state), cell("td", counted.join(", ") || "nothing"));
      return row;
    });
    $("devices").replaceChildren(...rows);
    this.quarantined = report.quarantined.map(({ name, reason, used }) =>
      `${name}: ${reason}, ${used ? "still used" : "treated as lost"}`,
    );
    this.rates = `${report.switch_hz.toFixed(0)}/s switches, ${report.glove_hz.toFixed(0)}/s glove`;
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

  #row(grasp, style) {
    const row = document.createElement("li"), bar = document.createElement("div"), full = document.createElement("span");
    const [name, share] = ["name", "share"].map((kind) => {
      const part = document.createElement("span");
      part.className = kind;
      return part;
    });
    name.textContent = grasp;
    bar.className = "bar";
    bar.append(full);
    row.append(chip(style), name, bar, share);
    $("types").append(row);
    this.rows.set(grasp, { row, full, share });
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
    say($("health"), health);
    say($("why"), means);
  }

  #hand(frame) {
    if (!this.drawing) return;
    const lost = new Set(frame.lost), gone = [];
    for (const [name, bit] of this.bits) {
      gone[bit] = lost.has(name);
      this.closed[bit] = !gone[bit] && frame.closed[bit] === "1";
    }
    if (this.bits.size) {
      const names = [...this.bits].filter(([, bit]) => this.closed[bit]).map(([name]) => name);
      const said = counted(names.length, this.bits.size, gone.filter(Boolean).length, "switches closed");
      say($("hand-says"), `${said}${listed(names)}`);
    }
    this.drawing.setClosed(this.closed, gone);
    this.drawing.setPose((frame.joints ?? this.joints.map(() => null)).map((value, at) => (lost.has(this.joints[at]) ? null : value)));
    this.drawing.setTaxels(this.hand.taxels.map(({ name }) => frame.taxels[name] ?? null));
  }

  #numbers(frame) {
    clearTimeout(this.later);
    this.later = null;
    this.words = performance.now();
    for (const [grasp, { row, full, share }] of this.rows) {
      const value = frame.probabilities?.[this.classes.indexOf(grasp)] ?? (grasp === frame.grasp ? frame.probability : null);
      full.style.transform = `scaleX(${value ?? 0})`;
      if (grasp === frame.grasp) row.setAttribute("aria-current", "true");
      else row.removeAttribute("aria-current");
      say(share, value === null ? "–" : `${(100 * value).toFixed(value > 0.9995 || value < 0.0005 ? 0 : 1)} %`);
    }
    const sure = frame.grasp === "unknown" ? "" : `${(100 * frame.probability).toFixed(0)}\u00a0% in this frame`;
    const held = frame.segment_us === null ? "" : `segment ${frame.segment}, ${frame.state} for ${((frame.time_us - frame.segment_us) / 1e6).toFixed(1)}\u00a0s`;
    say($("segment"), [sure, held].filter(Boolean).join(" · "));
    if (!$("preshape").hidden) say($("preshape"), `Preshape: ${frame.preshape?.name ?? "none yet"}`);
    pairs($("times"), {
      "latency": ms(frame.latency_us),
      "switches, age": ms(frame.switch_age_us),
      "glove, age": ms(frame.glove_age_us),
      ...(this.rates ? { "read": this.rates } : {}),
    });
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

const ms = (us) => (us === null || us === undefined ? "none yet" : `${(us / 1000).toFixed(1)} ms`);

function listed(names) {
  if (!names.length) return "";
  const more = names.length > SHOWN ? ` and ${names.length - SHOWN} more` : "";
  return `: ${names.slice(0, SHOWN).join(", ")}${more}`;
}

function pairs(element, values) {
  Object.entries(values).forEach(([name, value], at) => {
    const pair = element.children[at] ?? element.appendChild(document.createElement("div"));
    if (!pair.children.length) pair.append(cell("dt", name), cell("dd", value));
    say(pair.children[0], name);
    say(pair.children[1], value);
  });
}
