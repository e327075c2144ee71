// Spans of time in lanes on a canvas, and the predictions of the last seconds in such lanes.

// Okabe and Ito's colours; spans of the same colour are distinguished by name, and by a line at the foot.
const COLOURS = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#999999"];
const DARK_ON = new Set(["#e69f00", "#56b4e9", "#f0e442", "#cc79a7", "#999999", "#009e73"]);
const LANES = [
  { name: "this frame", of: (entry) => entry.candidate },
  { name: "announced", of: (entry) => entry.grasp },
  { name: "segment", of: (entry) => (entry.segment_us === null ? null : entry.segment_type) },
  { name: "health", of: (entry) => entry.health, colours: { ok: "good", changing: "main", degraded: "warn", unknown: "bad" } },
];
const PARTS = ["candidate", "grasp", "health", "state", "segment", "segment_type", "segment_us"];
const SPAN_US = 30_000_000;
const GAP_US = 1_000_000;
const LETTERS = 14;

let style = null;
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => (style = null));

function styleOf(element) {
  const css = getComputedStyle(element), names = ["text", "soft", "page", "line", "good", "main", "warn", "bad", "focus"];
  return Object.fromEntries(names.map((name) => [name, css.getPropertyValue(`--${name}`).trim()]));
}

/**
 * Draw lanes of spans: each lane has a `name` and `spans`, whose `from` and `to` are moments, with a `name` that is
 * one of `types` or has a `colour` of the page.
 * @returns the canvas's pen, a function from a moment to its place, width and height; null if it is not shown
 */
export function drawLanes(canvas, lanes, from, to, types, foot = 0) {
  const dense = devicePixelRatio || 1, wide = canvas.clientWidth, high = canvas.clientHeight;
  if (!wide || !high) return null;
  const [across, down] = [Math.round(wide * dense), Math.round(high * dense)];
  if (canvas.width !== across || canvas.height !== down) [canvas.width, canvas.height] = [across, down];
  style ??= styleOf(canvas);
  const pen = canvas.getContext("2d"), lane = (high - foot) / lanes.length;
  const x = (us) => ((us - from) / (to - from)) * wide;
  pen.setTransform(dense, 0, 0, dense, 0, 0);
  pen.clearRect(0, 0, wide, high);
  pen.font = `${LETTERS}px system-ui, sans-serif`;
  pen.textBaseline = "middle";
  lanes.forEach(({ name, spans }, at) => {
    const top = at * lane + LETTERS + 4, tall = lane - LETTERS - 7;
    pen.fillStyle = style.soft;
    pen.fillText(name, 0, at * lane + LETTERS / 2 + 2);
    pen.fillStyle = style.page;
    pen.fillRect(0, top, wide, tall);
    for (const span of spans) {
      const left = Math.max(x(span.from), 0), right = Math.min(x(span.to), wide);
      if (right > 0 && left < wide) drawSpan(pen, span, types.indexOf(span.name), left, top, Math.max(right - left, 1), tall);
    }
  });
  return { pen, x, wide, high, style };
}

function drawSpan(pen, { name, colour }, number, left, top, wide, tall) {
  const plain = !colour && number < 0, fill = colour ? style[colour] : plain ? style.page : COLOURS[number % COLOURS.length];
  pen.fillStyle = fill;
  pen.fillRect(left, top, wide, tall);
  if (plain) {
    pen.strokeStyle = style.line;
    pen.strokeRect(left + 0.5, top + 0.5, Math.max(wide - 1, 0), tall - 1);
  }
  if (number >= COLOURS.length) {
    pen.fillStyle = style.text;
    pen.fillRect(left, top + tall - 4, wide, 4);
  }
  const long = pen.measureText(name).width + 8, flat = long <= wide;
  if (!flat && !(wide >= LETTERS + 2 && long <= tall)) return;
  pen.save();
  // A name that does not fit is written upwards.
  pen.translate(flat ? left : left + wide / 2, flat ? top + tall / 2 : top + tall);
  if (!flat) pen.rotate(-Math.PI / 2);
  pen.fillStyle = colour ? style.page : plain ? style.text : DARK_ON.has(fill) ? "#000000" : "#ffffff";
  pen.fillText(name, 4, 1);
  pen.restore();
}

/** The changes of the prediction in order of time, and the canvas that shows the last of them. */
export class Timeline {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.entries = [];
    this.types = [];
    this.untilUs = 0;
    this.edge = "now"; // the name of its right end
  }

  clear() {
    this.entries = [];
    this.untilUs = 0;
  }

  /** Take the prediction at entry.time_us. */
  add(entry) {
    let last = this.entries.at(-1);
    if (last && entry.time_us < last.time_us) {
      // Another run has another clock; a moment that is only a little older was passed by the changes sent before it.
      if (last.time_us - entry.time_us < GAP_US) return;
      this.clear();
      last = undefined;
    }
    // A time without frames is unknown.
    const silent = last && entry.time_us - this.untilUs > GAP_US;
    if (silent) this.entries.push({ ...last, time_us: this.untilUs, over: true });
    this.untilUs = entry.time_us;
    if (last && !silent && !last.over && PARTS.every((part) => last[part] === entry[part])) return;
    const kept = Object.fromEntries(PARTS.map((part) => [part, entry[part]]));
    this.entries.push({ ...kept, time_us: entry.time_us, over: false });
    const gone = this.entries.findIndex((one, at) => at > 0 && one.time_us > this.untilUs - SPAN_US);
    if (gone > 1) this.entries.splice(0, gone - 1);
  }

  /** Return the segments that it shows: number, type, seconds, and whether it lasts; the newest first. */
  segments() {
    const found = new Map();
    this.entries.forEach((entry, at) => {
      if (entry.segment_us === null || entry.state === "forming" || entry.over) return;
      const end = this.entries[at + 1]?.time_us ?? this.untilUs;
      const seconds = (end - entry.segment_us) / 1e6;
      found.set(entry.segment, { number: entry.segment, type: entry.segment_type, seconds, lasts: !this.entries[at + 1] });
    });
    return [...found.values()].sort((one, other) => other.number - one.number);
  }

  draw() {
    const lanes = LANES.map(({ name, of, colours }) => ({ name, spans: this.#spans(of, colours) })), foot = LETTERS + 8;
    const drawn = drawLanes(this.canvas, lanes, this.untilUs - SPAN_US, this.untilUs, this.types, foot);
    if (drawn === null) return;
    const { pen, wide, high } = drawn, seconds = SPAN_US / 1e6, step = wide < 500 ? 10 : 5;
    pen.fillStyle = drawn.style.soft;
    for (let ago = seconds; ago >= 0; ago -= step) {
      const at = wide - (ago / seconds) * wide, text = ago ? `−${ago} s` : this.edge;
      const half = pen.measureText(text).width / 2;
      pen.fillText(text, Math.min(Math.max(at - half, 0), wide - 2 * half), high - foot / 2);
    }
  }

  // Spans of equal names.
  #spans(of, colours) {
    const found = [];
    let last = null;
    for (const entry of this.entries) {
      const name = entry.over ? null : of(entry);
      if (last && last.name === name) continue;
      if (last) last.to = entry.time_us;
      last = name === null ? null : { name, colour: colours?.[name], from: entry.time_us, to: this.untilUs };
      if (last) found.push(last);
    }
    return found;
  }
}
