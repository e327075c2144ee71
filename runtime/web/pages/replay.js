// The recording on its page: the position in it, and truth and predictions on one timeline.
import { drawLanes } from "./timeline.js";
import { say } from "./wire.js";

const $ = (id) => document.getElementById(id);

// "unknown" is no prediction, so it is not wrong.
const differs = (grasp, truth) => grasp !== truth && grasp !== "unknown";

const clock = (seconds) => {
  const whole = Math.max(seconds, 0), hours = Math.floor(whole / 3600), minutes = Math.floor(whole / 60) % 60;
  const rest = (whole % 60).toFixed(1).padStart(4, "0");
  return `${hours ? `${hours}:${String(minutes).padStart(2, "0")}` : minutes}:${rest}`;
};

export class Replay {
  #view;
  #ask;
  #state = null; // null: the page is of a run
  #spans = { truth: [], predictions: [], wrong: [] };
  #held = false; // while the slider is dragged, messages do not move it
  #wanted = null; // the requested moment, until the position has changed
  #timer = null;

  /** @param {function(string, *): void} ask sends a request and its value */
  constructor(view, ask) {
    this.#view = view;
    this.#ask = ask;
    $("at").addEventListener("pointerdown", () => (this.#held = true));
    for (const end of ["pointerup", "pointercancel", "blur"]) $("at").addEventListener(end, () => (this.#held = false));
    $("at").addEventListener("input", () => this.#seek(Number($("at").value)));
    $("play").addEventListener("click", () => this.#toggle());
    $("speed").addEventListener("change", () => ask("speed", Number($("speed").value)));
    $("whole").addEventListener("click", (event) => {
      const box = $("whole").getBoundingClientRect();
      this.#seek(((event.clientX - box.left) / box.width) * Number($("at").max));
    });
    addEventListener("resize", () => this.#draw());
    addEventListener("keydown", (event) => this.#key(event));
  }

  /** Take the predictions and labels of the whole recording. */
  overview({ predictions, truth }) {
    const span = ([from, to, name]) => ({ from, to, name });
    this.#spans.truth = truth.map(span);
    this.#spans.predictions = predictions.map(([from, name], at) => span([from, predictions[at + 1]?.[0] ?? Infinity, name]));
    this.#spans.wrong = this.#wrong();
    this.#draw();
  }

  /** Take the position in it. */
  show(state) {
    const { at_us, first_us, last_us, playing, speed, share, faults } = state;
    const moved = at_us !== this.#state?.at_us;
    this.#state = state;
    if (this.#timer === null && (moved || at_us === this.#wanted)) this.#wanted = null;
    const slider = $("at"), length = (last_us - first_us) / 1e6, at = (at_us - first_us) / 1e6;
    this.#view.state.data(at_us, 0);
    slider.max = String(length);
    if (!this.#held && this.#wanted === null) slider.value = String(at);
    slider.setAttribute("aria-valuetext", `${clock(at)} of ${clock(length)}`);
    say($("place"), `${clock(at)} of ${clock(length)}, ${new Date(at_us / 1000).toLocaleString()}`);
    say($("play"), playing ? "Pause" : "Play");
    $("speed").value = String(speed);
    this.judge();
    say($("scanned"), share < 1 ? `${Math.floor(100 * share)} % of the file is read` : "");
    say($("faults"), faults.join(" "));
    this.#draw();
  }

  /** Compare the prediction with the label, in words and by a sign. */
  judge() {
    const truth = this.#state?.truth ?? null, grasp = this.#view.frame?.grasp ?? "unknown";
    const bad = truth !== null && differs(grasp, truth);
    say($("truth"), truth === null ? "Truth: no label" : bad ? `✗ Truth: ${truth}, predicted: ${grasp}` : `Truth: ${truth}`);
    for (const id of ["truth", "grasp"]) $(id).classList.toggle("wrong", bad);
  }

  // The spans in which a label has another prediction.
  #wrong() {
    const { truth, predictions } = this.#spans, found = [];
    let first = 0;
    for (const { from, to, name } of truth) {
      while (predictions[first]?.to <= from) first++;
      for (let at = first; predictions[at]?.from < to; at++) {
        const one = predictions[at];
        const span = { from: Math.max(one.from, from), to: Math.min(one.to, to), name: "✗", colour: "bad" };
        if (differs(one.name, name)) found.push(span);
      }
    }
    return found;
  }

  #toggle() {
    this.#ask(this.#state?.playing ? "pause" : "play");
  }

  // Only the newest requested position matters: one request at a time is pending.
  #seek(seconds) {
    const state = this.#state;
    if (!state) return;
    this.#wanted = Math.min(Math.max(Math.round(state.first_us + 1e6 * seconds), state.first_us), state.last_us);
    this.#timer ??= setTimeout(() => {
      this.#timer = null;
      this.#ask("seek", this.#wanted);
    }, 60);
  }

  #step(seconds) {
    this.#seek(((this.#wanted ?? this.#state.at_us) - this.#state.first_us) / 1e6 + seconds);
  }

  // Go to the next label or prediction, or to the previous one.
  #jump(by) {
    const { at_us, first_us } = this.#state, { truth, predictions } = this.#spans;
    const places = (truth.length ? truth : predictions).map(({ from }) => from).sort((one, other) => one - other);
    const next = by > 0 ? places.find((from) => from > at_us + 1000) : places.findLast((from) => from < at_us - 1000);
    if (next !== undefined) this.#seek((next - first_us) / 1e6);
  }

  #key(event) {
    const typing = /^(SELECT|BUTTON)$/.test(event.target.tagName);
    if (!this.#state || event.ctrlKey || event.altKey || event.metaKey || typing) return;
    const keys = {
      " ": () => this.#toggle(),
      k: () => this.#toggle(),
      j: () => this.#step(-10),
      l: () => this.#step(10),
      ",": () => this.#step(-0.02),
      ".": () => this.#step(0.02),
      ArrowLeft: () => this.#step(-1),
      ArrowRight: () => this.#step(1),
      Home: () => this.#seek(0),
      End: () => this.#seek(Infinity),
      n: () => this.#jump(1),
      p: () => this.#jump(-1),
    };
    const found = keys[event.key];
    if (!found) return;
    event.preventDefault();
    if (event.target === $("at")) this.#held = false;
    found();
  }

  #draw() {
    if (!this.#state) return;
    const { at_us, first_us, last_us } = this.#state, { truth, predictions, wrong } = this.#spans;
    const names = [...new Set([...truth, ...predictions].map(({ name }) => name))];
    const types = (this.#view.timeline.types.length ? this.#view.timeline.types : names).filter((name) => name !== "none");
    const lanes = [
      { name: "truth", spans: truth },
      { name: "prediction", spans: predictions },
      { name: "wrong: another type than the truth", spans: wrong },
    ];
    const drawn = drawLanes($("whole"), lanes, first_us, Math.max(last_us, first_us + 1), types);
    if (drawn === null) return;
    const { pen, x, high, style } = drawn;
    pen.fillStyle = style.text;
    pen.fillRect(x(at_us) - 1, 0, 2, high);
    const counts = `${truth.length} labelled spans, ${predictions.length} predictions, wrong in ${wrong.length} spans`;
    $("whole").setAttribute("aria-label", `Truth and prediction of ${clock((last_us - first_us) / 1e6)}: ${counts}`);
  }
}
