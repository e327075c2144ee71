// The view of a run or a recording on their page.
import { drawHand } from "./hand.js";
import { counted, State } from "./state.js";
import { Timeline } from "./timeline.js";
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
    this.timeline = new Timeline($("past"));
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
    this.said = { text: "", at: 0, since: 0, candidate: "" };
    requestAnimationFrame(() => this.#draw());
  }

  /** Take the grasp types, switches and joints of the build, and whether its moments are those of a recording. */
  build(build) {
    this.live = this.state.live = !build.replay; // moments of a recording have no age
    this.timeline.types = build.grasps.filter((name) => name !== "none");
    this.bits = new Map(build.switches.map((name, bit) => [name, bit]));
    this.joints = build.joints;
    this.closed = build.switches.map(() => false);
    this.rows.clear();
    $("types").replaceChildren();
    for (const grasp of build.grasps) this.#row(grasp);
    $("preshape").hidden = !build.preshapes;
    $("empty-hand").hidden = build.empty_hand;
    this.classes = build.grasps;
  }

  /** Take the positions of the build's inputs on the hand. */
  setHand(hand) {
    this.hand = hand;
    this.drawing = drawHand($("hand"), hand, {});
  }

  /** Take the past predictions. */
  past({ changes, until_us }) {
    this.timeline.clear();
    for (const [time_us, candidate, grasp, health, state, segment, segment_type, segment_us] of changes) {
      this.timeline.untilUs = time_us; // an entry lasts until the next
      this.timeline.add({ time_us, candidate, grasp, health, state, segment, segment_type, segment_us });
    }
    this.timeline.untilUs = until_us;
  }

  /** Take a moment. */
  take(frame) {
    if (frame === null) return;
    this.frame = frame;
    const ages = [frame.switch_age_us, frame.glove_age_us].filter((age) => age !== null);
    const age = ages.length ? Math.min(...ages) : null;
    if (this.live && age !== null) this.state.data(frame.time_us - age, age + (frame.late_us ?? 0));
    this.timeline.add(frame);
  }

  /** Take the health of devices and inputs. */
  health(report) {
    this.state.devices(report.devices);
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

  #aged(old) {
    this.timeline.edge = old ? "last" : "now";
    this.shown = null; // everything is drawn again
    this.#title();
    if (old) this.#announce("no data", performance.now(), true);
  }

  #title() {
    const words = this.state.old ? "no data" : this.frame?.grasp;
    document.title = words ? `${words} · thenar` : "thenar";
  }

  #row(grasp) {
    const row = document.createElement("li"), bar = document.createElement("div"), full = document.createElement("span");
    const parts = ["sign", "name", "share"].map((name) => {
      const part = document.createElement("span");
      part.className = name;
      return part;
    });
    parts[1].textContent = grasp;
    bar.className = "bar";
    bar.append(full);
    row.append(...parts, bar);
    $("types").append(row);
    this.rows.set(grasp, { row, full, share: parts[2] });
    return this.rows.get(grasp);
  }

  #draw() {
    requestAnimationFrame(() => this.#draw());
    const { frame } = this, now = performance.now();
    if (frame === null || frame === this.shown) return;
    const news = this.shown?.grasp !== frame.grasp;
    this.shown = frame;
    this.#now(frame);
    this.#hand(frame);
    this.timeline.draw();
    if (news || now - this.words >= WORDS_MS) {
      this.words = now;
      this.#numbers(frame);
    }
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

  #bars(frame) {
    const { probabilities } = frame;
    for (const [grasp, { row, full }] of this.rows) {
      const share = probabilities?.[this.classes.indexOf(grasp)] ?? (grasp === frame.grasp ? frame.probability : 0);
      full.style.transform = `scaleX(${share})`;
      if (grasp === frame.grasp) row.setAttribute("aria-current", "true");
      else row.removeAttribute("aria-current");
    }
    if (!this.rows.has(frame.grasp) && frame.grasp !== "unknown") this.#row(frame.grasp);
  }

  #numbers(frame) {
    this.#bars(frame);
    for (const [grasp, { share }] of this.rows) {
      const at = this.classes.indexOf(grasp);
      const value = frame.probabilities?.[at] ?? (grasp === frame.grasp ? frame.probability : null);
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
    const segments = this.timeline.segments().slice(0, SHOWN);
    list($("segments"), segments.map(({ number, type, seconds, lasts }) => `${number}: ${type}, ${seconds.toFixed(1)} s${lasts && !this.state.old ? ", now" : ""}`));
    const types = segments.length ? segments.map(({ type }) => type).reverse().join(", ") : "none";
    const label = `Predictions of the last 30 seconds${this.state.old ? ", which have ended" : ""}: this frame ${frame.candidate}, announced ${frame.grasp}, segments: ${types}`;
    if ($("past").getAttribute("aria-label") !== label) $("past").setAttribute("aria-label", label);
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
