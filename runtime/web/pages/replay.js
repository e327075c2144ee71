// The page of a recording: the position in it, and truth and predictions on one timeline.
import { COLOURS, DARK_ON } from "./timeline.js";
import { View } from "./view.js";
import { connect, say } from "./wire.js";

const $ = (id) => document.getElementById(id);
const view = new View({ live: false });
const LANES = [["truth", "truth"], ["prediction", "predictions"], ["wrong: another type than the truth", "wrong"]];
const LETTERS = 14;
let state = null;
let overview = { predictions: [], truth: [], marks: [], wrong: [] };
let held = false; // while the slider is dragged, messages do not move it
let wanted = null;

const send = connect({
  open: () => view.state.link(true),
  closed: () => view.state.link(false),
  build: (build) => view.build(build),
  hand: (hand) => view.setHand(hand),
  past: (past) => view.past(past),
  frame: (frame) => {
    view.take(frame);
    judge();
  },
  overview: (whole) => {
    overview = { ...whole, wrong: wrong(whole) };
    draw();
  },
  replay: show,
  refused: ({ why }) => say($("refused"), why),
});

function show(received) {
  state = received;
  const { at_us, first_us, last_us, playing, speed, share, faults } = received;
  const slider = $("at"), length = (last_us - first_us) / 1e6;
  slider.max = String(length);
  if (!held) slider.value = String((at_us - first_us) / 1e6);
  slider.setAttribute("aria-valuetext", `${clock((at_us - first_us) / 1e6)} of ${clock(length)}`);
  say($("place"), `${clock((at_us - first_us) / 1e6)} of ${clock(length)}, ${new Date(at_us / 1000).toLocaleString()}`);
  say($("play"), playing ? "Pause" : "Play");
  $("speed").value = String(speed);
  judge();
  say($("scanned"), share < 1 ? `${Math.floor(100 * share)} % of the file is read` : "");
  if ($("faults").textContent !== faults.join(" ")) say($("faults"), faults.join(" "));
  draw();
}

// "unknown" is no prediction, so it is not wrong.
const differs = (grasp, truth) => grasp !== truth && grasp !== "unknown";

// Compare the prediction with the label, in words and by a sign.
function judge() {
  const truth = state?.truth ?? null, grasp = view.frame?.grasp ?? "unknown", bad = truth !== null && differs(grasp, truth);
  say($("truth"), truth === null ? "Truth: no label" : bad ? `✗ Truth: ${truth}, predicted: ${grasp}` : `Truth: ${truth}`);
  for (const id of ["truth", "grasp"]) $(id).classList.toggle("wrong", bad);
}

// The spans in which a label has another prediction.
function wrong({ predictions, truth }) {
  const found = [];
  let first = 0;
  for (const [from, to, name] of truth) {
    while (predictions[first + 1]?.[0] <= from) first++;
    for (let at = first; predictions[at]?.[0] < to; at++) {
      const [begin, grasp] = predictions[at], end = Math.min(predictions[at + 1]?.[0] ?? to, to);
      if (differs(grasp, name)) found.push([Math.max(begin, from), end, "✗"]);
    }
  }
  return found;
}

const clock = (seconds) => {
  const whole = Math.max(seconds, 0), hours = Math.floor(whole / 3600), minutes = Math.floor(whole / 60) % 60;
  const rest = (whole % 60).toFixed(1).padStart(4, "0");
  return `${hours ? `${hours}:${String(minutes).padStart(2, "0")}` : minutes}:${rest}`;
};

// Only the newest requested position matters: one request at a time is pending.
function seek(seconds) {
  if (!state) return;
  const value = Math.round(state.first_us + 1e6 * seconds);
  const due = wanted === null;
  wanted = Math.min(Math.max(value, state.first_us), state.last_us);
  if (due) {
    setTimeout(() => {
      ask("seek", wanted);
      wanted = null;
    }, 60);
  }
}

function ask(what, value) {
  if (!send({ do: what, value })) say($("refused"), "not connected");
  else say($("refused"), "");
}

const toggle = () => ask(state?.playing ? "pause" : "play");
const step = (seconds) => seek(((wanted ?? state?.at_us ?? 0) - (state?.first_us ?? 0)) / 1e6 + seconds);

$("at").addEventListener("pointerdown", () => (held = true));
for (const end of ["pointerup", "pointercancel", "blur"]) $("at").addEventListener(end, () => (held = false));
$("at").addEventListener("input", () => seek(Number($("at").value)));
$("play").addEventListener("click", toggle);
$("speed").addEventListener("change", () => ask("speed", Number($("speed").value)));
$("span").addEventListener("change", draw);
$("whole").addEventListener("click", (event) => {
  const [from, to] = span(), box = $("whole").getBoundingClientRect();
  if (state) seek((from + ((event.clientX - box.left) / box.width) * (to - from) - state.first_us) / 1e6);
});
addEventListener("resize", draw);
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || /^(SELECT|BUTTON)$/.test(event.target.tagName)) return;
  const onSlider = event.target === $("at");
  const keys = {
    " ": toggle,
    k: toggle,
    j: () => step(-10),
    l: () => step(10),
    ",": () => step(-0.02),
    ".": () => step(0.02),
    ArrowLeft: () => step(-1),
    ArrowRight: () => step(1),
    Home: () => seek(0),
    End: () => seek(Infinity),
    n: () => jump(1),
    p: () => jump(-1),
  };
  const found = keys[event.key];
  if (!found) return;
  event.preventDefault();
  if (onSlider) held = false;
  found();
});

// Go to the next label or prediction, or to the previous one.
function jump(by) {
  if (!state) return;
  const marks = [...overview.truth.map(([from]) => from), ...(overview.truth.length ? [] : overview.predictions.map(([from]) => from))];
  const there = marks.sort((a, b) => a - b).filter((us) => (by > 0 ? us > state.at_us + 1000 : us < state.at_us - 1000));
  if (there.length) seek((there.at(by > 0 ? 0 : -1) - state.first_us) / 1e6);
}

function span() {
  const seconds = Number($("span").value), { first_us, last_us, at_us } = state;
  if (!seconds || 1e6 * seconds >= last_us - first_us) return [first_us, Math.max(last_us, first_us + 1)];
  const from = Math.min(Math.max(at_us - 5e5 * seconds, first_us), last_us - 1e6 * seconds);
  return [from, from + 1e6 * seconds];
}

function spans(kind) {
  if (kind !== "predictions") return overview[kind];
  return overview.predictions.map(([from, name], at) => [from, overview.predictions[at + 1]?.[0] ?? state.last_us, name]);
}

function draw() {
  const canvas = $("whole"), dense = devicePixelRatio || 1, wide = canvas.clientWidth, high = canvas.clientHeight;
  if (!state || !wide) return;
  canvas.width = Math.round(wide * dense);
  canvas.height = Math.round(high * dense);
  const pen = canvas.getContext("2d"), css = getComputedStyle(canvas);
  const colour = (name) => css.getPropertyValue(name).trim();
  const [from, to] = span(), x = (us) => ((us - from) / (to - from)) * wide, tall = high / LANES.length;
  const names = [...new Set([...overview.truth.map(([, , name]) => name), ...overview.predictions.map(([, name]) => name)])];
  const types = (view.classes?.length ? view.classes : names).filter((name) => name !== "none");
  pen.setTransform(dense, 0, 0, dense, 0, 0);
  pen.font = `${LETTERS}px system-ui, sans-serif`;
  pen.textBaseline = "middle";
  LANES.forEach(([label, kind], at) => {
    const top = at * tall + LETTERS + 4, deep = tall - LETTERS - 8;
    pen.fillStyle = colour("--soft");
    pen.fillText(label, 0, at * tall + LETTERS / 2 + 2);
    pen.fillStyle = colour("--page");
    pen.fillRect(0, top, wide, deep);
    for (const [begin, end, name] of spans(kind)) {
      const left = Math.max(x(begin), 0), right = Math.min(x(end), wide), number = types.indexOf(name);
      if (right <= 0 || left >= wide) continue;
      const fill = kind === "wrong" ? colour("--bad") : number < 0 ? colour("--line") : COLOURS[number % COLOURS.length];
      pen.fillStyle = fill;
      pen.fillRect(left, top, Math.max(right - left, 1), deep);
      if (pen.measureText(name).width + 8 > right - left) continue;
      pen.fillStyle = kind === "wrong" ? colour("--page") : number < 0 ? colour("--text") : DARK_ON.has(fill) ? "#000000" : "#ffffff";
      pen.fillText(name, left + 4, top + deep / 2);
    }
  });
  pen.fillStyle = colour("--focus");
  for (const [us] of overview.marks) pen.fillRect(x(us) - 1, 0, 2, 6);
  pen.fillStyle = colour("--text");
  pen.fillRect(x(state.at_us) - 1, 0, 2, high);
  const counts = `${overview.truth.length} labelled spans, ${overview.predictions.length} predictions, wrong in ${overview.wrong.length} spans`;
  canvas.setAttribute("aria-label", `Truth and prediction from ${clock((from - state.first_us) / 1e6)} to ${clock((to - state.first_us) / 1e6)}: ${counts}`);
}
