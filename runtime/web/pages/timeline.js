// The predictions of the last seconds on a canvas: lanes of spans, each from one change to the next.

const LANES = [
  { name: "this frame", of: (entry) => entry.candidate },
  { name: "announced", of: (entry) => entry.grasp },
  { name: "segment", of: (entry) => (entry.segment_us === null ? null : entry.segment_type) },
  { name: "health", of: (entry) => entry.health },
];
const HEALTH = { ok: "--good", changing: "--main", degraded: "--warn", unknown: "--bad" };
// Okabe and Ito's colours; spans of the same colour are distinguished by name, and by a line at the foot.
export const COLOURS = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#999999"];
export const DARK_ON = new Set(["#e69f00", "#56b4e9", "#f0e442", "#cc79a7", "#999999", "#009e73"]);
const GAP_US = 1_000_000;
const LETTERS = 14;

/** The changes of the prediction in order of time, and the canvas that shows the last of them. */
export class Timeline {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {number} spanS the number of seconds that it shows
   */
  constructor(canvas, spanS = 30) {
    this.canvas = canvas;
    this.spanUs = spanS * 1e6;
    this.entries = [];
    this.colours = new Map();
    this.untilUs = 0;
    this.edge = "now"; // the name of its right end
    this.style = null;
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => (this.style = null));
  }

  /** Give each of these names its own colour, as long as there are enough. */
  setNames(names) {
    this.colours.clear();
    names.filter((name) => name !== "none").forEach((name, at) => this.colours.set(name, at));
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
    if (last && !silent && same(last, entry)) return;
    const { time_us, candidate, grasp, health, state, segment, segment_type, segment_us } = entry;
    this.entries.push({ time_us, candidate, grasp, health, state, segment, segment_type, segment_us, over: false });
    const first = this.untilUs - this.spanUs;
    const gone = this.entries.findIndex((one, at) => at > 0 && one.time_us > first);
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

  draw(nowUs = this.untilUs) {
    const { canvas } = this, dense = devicePixelRatio || 1;
    const wide = canvas.clientWidth, high = canvas.clientHeight;
    if (!wide || !high) return;
    if (canvas.width !== Math.round(wide * dense) || canvas.height !== Math.round(high * dense)) {
      canvas.width = Math.round(wide * dense);
      canvas.height = Math.round(high * dense);
    }
    this.style ??= styleOf(canvas);
    const pen = canvas.getContext("2d"), { style } = this;
    pen.setTransform(dense, 0, 0, dense, 0, 0);
    pen.clearRect(0, 0, wide, high);
    pen.font = `${LETTERS}px system-ui, sans-serif`;
    pen.textBaseline = "middle";
    const foot = LETTERS + 8, lane = (high - foot) / LANES.length;
    const x = (us) => wide - ((nowUs - us) / this.spanUs) * wide;
    LANES.forEach(({ name, of }, at) => {
      const top = at * lane + LETTERS + 4, tall = lane - LETTERS - 7;
      pen.fillStyle = style.soft;
      pen.fillText(name, 0, at * lane + LETTERS / 2 + 2);
      pen.fillStyle = style.page;
      pen.fillRect(0, top, wide, tall);
      for (const span of spans(this.entries, of, this.untilUs)) {
        const left = Math.max(x(span.from), 0), right = Math.min(x(span.to), wide);
        if (right > 0 && left < wide) this.#span(pen, span, left, top, Math.max(right - left, 1), tall);
      }
    });
    this.#axis(pen, wide, high, foot);
  }

  #span(pen, { name, entry }, left, top, wide, tall) {
    const { style } = this;
    const number = this.colours.get(name) ?? -1;
    const health = HEALTH[name] && name === entry.health ? style.health[name] : null;
    const colour = health ?? (number < 0 ? style.page : COLOURS[number % COLOURS.length]);
    const striped = !health && entry.striped;
    pen.fillStyle = colour;
    pen.fillRect(left, top, wide, tall);
    if (number < 0 && !health) {
      pen.strokeStyle = style.line;
      pen.strokeRect(left + 0.5, top + 0.5, Math.max(wide - 1, 0), tall - 1);
    }
    if (striped) stripes(pen, style.page, left, top, wide, tall);
    const on = health ? style.page : number < 0 ? style.text : DARK_ON.has(colour) ? "#000000" : "#ffffff";
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
    if (striped) {
      pen.fillStyle = colour;
      pen.fillRect(0, -LETTERS / 2 - 2, long, LETTERS + 4);
    }
    pen.fillStyle = on;
    pen.fillText(name, 4, 1);
    pen.restore();
  }

  #axis(pen, wide, high, foot) {
    pen.fillStyle = this.style.soft;
    const seconds = this.spanUs / 1e6, step = wide < 500 ? 10 : 5;
    for (let ago = seconds; ago >= 0; ago -= step) {
      const at = wide - (ago / seconds) * wide, text = ago ? `−${ago} s` : this.edge;
      const half = pen.measureText(text).width / 2;
      pen.fillText(text, Math.min(Math.max(at - half, 0), wide - 2 * half), high - foot / 2);
    }
  }
}

function same(one, other) {
  return (
    !one.over &&
    one.candidate === other.candidate &&
    one.grasp === other.grasp &&
    one.health === other.health &&
    one.state === other.state &&
    one.segment === other.segment &&
    one.segment_type === other.segment_type &&
    one.segment_us === other.segment_us
  );
}

/** Yield spans of equal names; a segment that may still be revoked, or seems to end, is striped. */
function* spans(entries, of, untilUs) {
  let open = null;
  const isSegment = of === LANES[2].of;
  for (let at = 0; at < entries.length; at++) {
    const entry = entries[at], name = entry.over ? null : of(entry);
    const striped = isSegment && entry.state !== "held";
    if (open && (name !== open.name || striped !== open.entry.striped)) {
      yield { ...open, to: entry.time_us };
      open = null;
    }
    if (!open && name !== null) open = { name, entry: { ...entry, striped }, from: entry.time_us };
  }
  if (open) yield { ...open, to: untilUs };
}

function stripes(pen, colour, left, top, wide, tall) {
  pen.save();
  pen.beginPath();
  pen.rect(left, top, wide, tall);
  pen.clip();
  pen.strokeStyle = colour;
  pen.lineWidth = 3;
  pen.beginPath();
  for (let at = left - tall - (left % 9); at < left + wide; at += 9) {
    pen.moveTo(at, top + tall);
    pen.lineTo(at + tall, top);
  }
  pen.stroke();
  pen.restore();
}

function styleOf(element) {
  const found = getComputedStyle(element), of = (name) => found.getPropertyValue(name).trim();
  const health = Object.fromEntries(Object.entries(HEALTH).map(([name, colour]) => [name, of(colour)]));
  return { text: of("--text"), soft: of("--soft"), page: of("--page"), line: of("--line"), health };
}
