// One axis of time for runs and recordings: lanes of spans on a canvas, a cursor, zoom, and keys. All times are in
// microseconds since 1970.
import { typeStyles } from "./types.js";
import { $, clock, paced, say, WORDS_MS } from "./wire.js";

const LETTERS = 14, LABEL = 20, BAR = 24, FOOT = 22; // pixels of a lane's name, of its spans, and of the axis
const LEAST_US = 100_000, USUAL_US = 30_000_000, TICK = 90; // shortest window, the first one of a run, pixels a tick
const KEPT_US = 1_200_000_000, MOST_SPANS = 20_000; // of a run, by lane
const DARK = matchMedia("(prefers-color-scheme: dark)");
const STEPS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 1800, 3600, 14_400]; // seconds

/** Spans {from, to, name} of what a build announced, of its segments, and of its troubles; the last one may be open. */
class Track {
  constructor(name = "") {
    this.name = name;
    this.announced = [];
    this.segments = [];
    this.health = [];
    this.errors = { wrong: [], early: [] };
    this.untilUs = null;
  }

  /** Take a change of the prediction; what is "" ends. */
  take([time, announced, health, type, began]) {
    extend(this.announced, announced, time);
    extend(this.health, health, time);
    extend(this.segments, type, time, began);
    this.untilUs = time;
  }

  /** End all spans at the last time of which something is known. */
  end() {
    this.take([this.untilUs, "", "", "", null]);
  }
}

function extend(lane, name, time, began = null) {
  const last = lane.at(-1), lasts = last?.to === Infinity;
  if (lasts && last.name === name && (began === null || last.from === began)) return;
  if (lasts) last.to = time;
  if (name) lane.push({ from: began ?? time, to: Infinity, name });
}

/** Return the span of a lane at a moment. */
export function spanAt(lane, us) {
  const span = lane[after(lane, us) - 1];
  return span && us < span.to ? span : null;
}

// The place of the first span that begins after a moment.
function after(lane, us) {
  let low = 0, high = lane.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (lane[middle].from > us) high = middle;
    else low = middle + 1;
  }
  return low;
}

/** Return the parts of a lane's spans from a moment to another. */
export function within(lane, from, to) {
  const spans = lane.slice(Math.max(after(lane, from) - 1, 0), after(lane, to));
  const inside = spans.filter((span) => span.to > from && span.from < to);
  return inside.map((span) => ({ name: span.name, from: Math.max(span.from, from), to: Math.min(span.to, to) }));
}

/** Return whether a prediction is wrong: "unknown" is none. */
export const differs = (announced, truth) => announced !== truth && announced !== "unknown";

/**
 * Return the spans in which a label has another prediction: the errors, and those before the type of the label was first
 * announced, while the hand moves to it.
 */
function errors(truth, announced) {
  const wrong = [], early = [];
  for (const { from, to, name } of truth) {
    const inside = within(announced, from, to), right = inside.find((span) => span.name === name)?.from ?? -Infinity;
    for (const span of inside.filter((one) => differs(one.name, name))) (span.from < right ? early : wrong).push(span);
  }
  return { wrong, early };
}

/** Return a duration as "1:02.3". */
function lasting(seconds, digits = 1) {
  const whole = Math.max(seconds, 0), hours = Math.floor(whole / 3600), minutes = Math.floor(whole / 60) % 60;
  const rest = (whole % 60).toFixed(digits).padStart(digits ? 3 + digits : 2, "0");
  return `${hours ? `${hours}:${String(minutes).padStart(2, "0")}` : minutes}:${rest}`;
}

export class Timeline {
  live = true;
  tracks = [new Track()];
  truth = []; // spans in order of time
  first = null;
  last = null;
  at = null; // the cursor; null follows now
  #silent = Infinity; // how long a moment of a run is current
  #from = 0;
  #span = USUAL_US;
  #wide = 0;
  #whole = false; // while a recording is read, the window has all of it, until somebody zooms
  #styles = typeStyles([]);
  #colours = null;
  #pointers = new Map();
  #moved = 0;
  #stale = true; // the lanes, and not just the cursor
  #paint = paced(() => this.#draw());
  #follow = paced(() => this.#draw(), WORDS_MS);
  #say = paced(() => this.#read(), WORDS_MS);

  /** @param {{moved: function(): void, toggle: function(): void}} on the cursor has moved; the key that plays was pressed */
  constructor(canvas, on) {
    this.canvas = canvas;
    this.on = on;
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const { left, width } = canvas.getBoundingClientRect(), across = event.shiftKey ? event.deltaY : event.deltaX;
      if (across) this.#pan((across / width) * this.#span);
      else this.#zoom(1.002 ** event.deltaY, this.#from + ((event.clientX - left) / width) * this.#span);
    }, { passive: false });
    for (const kind of ["down", "move", "up", "cancel"]) {
      canvas.addEventListener(`pointer${kind}`, (event) => this.#pointer(kind, event));
    }
    new ResizeObserver(() => this.draw()).observe(canvas);
    DARK.addEventListener("change", () => this.draw());
    const actions = { closer: "+", wider: "-", "next-error": "n", "last-error": "p", now: "End" };
    for (const [id, key] of Object.entries(actions)) $(id).addEventListener("click", () => this.#keys[key]());
    addEventListener("keydown", (event) => this.#key(event));
  }

  /** Take what is known of the build of a run, or of those of a recording. */
  begin({ grasps, builds, silent_us }) {
    this.#styles = typeStyles([...grasps, "none", "unknown"]);
    [this.live, this.#silent] = [silent_us !== null, silent_us];
    if (!this.live) this.tracks = builds.map((name) => new Track(builds.length > 1 ? name : ""));
  }

  /** Take changes of a run, of which some may be known already, and the time until which they are all. */
  follow(changes, until) {
    if (!changes.length) return;
    // A clock that goes back is another host's.
    if (this.tracks[0].untilUs - until > 1_000_000) [this.tracks, this.first, this.at] = [[new Track()], null, null];
    const [track] = this.tracks, known = track.untilUs ?? -1;
    if (until < known) return; // changes that were sent before passed it
    const before = track.announced.at(-1);
    if (known >= 0 && changes[0][0] - known > this.#silent) track.end();
    // A silence begins at the last moment before it.
    for (const change of changes) if (change[0] > known || (change[0] === known && !change[1])) track.take(change);
    track.untilUs = until;
    for (const lane of [track.announced, track.segments, track.health]) {
      const gone = lane.findIndex((span, at) => span.to > until - KEPT_US && at >= lane.length - MOST_SPANS);
      if (gone > 0) lane.splice(0, gone);
    }
    this.first = Math.max(this.first ?? changes[0][0], until - KEPT_US);
    this.last = until;
    if (this.at === null) this.#from = until - this.#span;
    this.#stale = true;
    this.#follow(track.announced.at(-1) !== before);
    this.#say();
  }

  /** Take the span of a recording and where its predictions differ from the labels. */
  recorded(first, last) {
    const fresh = this.last === null;
    [this.first, this.last] = [first, last];
    if (fresh || this.#whole) this.#show(first, last - first);
    this.#whole = fresh || this.#whole;
    for (const track of this.tracks) track.errors = errors(this.truth, track.announced);
    for (const id of ["next-error", "last-error"]) $(id).disabled = this.tracks.every(({ errors: { wrong } }) => !wrong.length);
    this.draw();
  }

  /** Put the cursor at a moment; null, and what is later than now, follows now. */
  seek(us) {
    if (this.last === null) return;
    const from = this.#from;
    this.at = us === null || (this.live && us >= this.last) ? null : Math.round(Math.min(Math.max(us, this.first), this.last));
    if (this.at === null) this.#from = this.last - this.#span;
    else if (this.at < this.#from || this.at > this.#from + this.#span) this.#show(this.at - this.#span / 4);
    this.on.moved();
    this.draw(from !== this.#from);
  }

  /** The lanes at the cursor, in words. */
  get reading() {
    if (this.last === null) return this.live ? "no frame yet" : "not read yet";
    const at = this.at ?? this.last, parts = [];
    if (this.live) parts.push(this.at === null ? "now" : `${lasting((this.last - at) / 1e6)} ago`, clock(at / 1000));
    else parts.push(`${lasting((at - this.first) / 1e6, 2)} of ${lasting((this.last - this.first) / 1e6)}`, clock(at / 1000));
    const truth = spanAt(this.truth, at);
    if (truth) parts.push(`truth ${truth.name}`);
    for (const track of this.tracks) {
      const announced = spanAt(track.announced, at)?.name ?? "nothing";
      parts.push(`${truth && differs(announced, truth.name) ? "✗ " : ""}${track.name && `${track.name} `}announced ${announced}`);
    }
    const segment = spanAt(this.tracks[0].segments, at), health = spanAt(this.tracks[0].health, at);
    if (segment) parts.push(`segment ${segment.name}, ${((Math.min(segment.to, this.last) - segment.from) / 1e6).toFixed(1)} s`);
    if (health) parts.push(`health ${health.name}`);
    return parts.join(" · ");
  }

  // Lanes of bars of a kind: types, troubles, or errors over what came before the right type, lower.
  #lanes() {
    const lanes = this.truth.length ? [["truth", ["type", this.truth]]] : [];
    for (const { name, announced, errors: { wrong, early } } of this.tracks) {
      lanes.push([`announced${name && ` by ${name}`}`, ["type", announced]]);
      if (this.truth.length) lanes.push([`error${name && ` of ${name}`}; low: not yet announced`, ["early", early], ["wrong", wrong]]);
    }
    const [{ name, segments, health }] = this.tracks, of = name && ` of ${name}`;
    return [...lanes, [`segments${of}`, ["type", segments]], [`health${of}, where it is not ok`, ["trouble", health]]];
  }

  /** Draw soon: the lanes, or just the cursor. */
  draw(stale = true) {
    this.#stale ||= stale;
    this.#paint();
    this.#say();
  }

  #draw() {
    const cursor = $("cursor"), share = this.at === null ? -1 : (this.at - this.#from) / this.#span;
    if (this.#stale) this.#drawLanes();
    this.#stale = false;
    cursor.hidden = share < 0 || share > 1;
    cursor.style.transform = `translateX(${(share * this.#wide).toFixed(1)}px)`;
  }

  #drawLanes() {
    const lanes = this.#lanes(), high = lanes.length * (LABEL + BAR) + FOOT, wide = this.canvas.clientWidth;
    if (this.canvas.style.height !== `${high}px`) this.canvas.style.height = `${high}px`;
    if (!wide) return;
    this.#wide = wide;
    // The page's style has each colour twice: for light and for dark pages.
    const css = getComputedStyle(document.body), colour = (name) => css.getPropertyValue(`--${name}`).match(/#\w+/g)[DARK.matches ? 1 : 0];
    this.#colours = Object.fromEntries(["text", "soft", "page", "line", "warn", "bad"].map((name) => [name, colour(name)]));
    // A new size clears it.
    [this.canvas.width, this.canvas.height] = [wide, high].map((size) => Math.round(size * devicePixelRatio));
    const pen = this.canvas.getContext("2d"), x = (us) => ((us - this.#from) / this.#span) * wide;
    pen.scale(devicePixelRatio, devicePixelRatio);
    pen.font = `${LETTERS}px system-ui, sans-serif`;
    pen.textBaseline = "middle";
    lanes.forEach(([name, ...bars], number) => this.#lane(pen, x, wide, name, bars, number * (LABEL + BAR)));
    this.#axis(pen, x, wide, high);
  }

  #lane(pen, x, wide, name, bars, top) {
    pen.fillStyle = this.#colours.soft;
    pen.fillText(name, 0, top + LABEL / 2 + 1);
    pen.fillStyle = this.#colours.page;
    pen.fillRect(0, top + LABEL, wide, BAR);
    for (const [kind, spans] of bars) {
      let inked = -1;
      for (let at = Math.max(after(spans, this.#from) - 1, 0); at < spans.length && spans[at].from < this.#from + this.#span; at++) {
        const left = Math.max(x(spans[at].from), 0), right = Math.min(x(Math.min(spans[at].to, this.last)), wide);
        // Of many spans in one pixel, one is drawn.
        if (right <= 0 || right < inked + 0.5) continue;
        this.#bar(pen, kind, spans[at].name, left, top + LABEL, Math.max(right - left, kind === "wrong" ? 2 : 1));
        inked = right;
      }
    }
  }

  #bar(pen, kind, name, left, top, wide) {
    const { code = name, colour, ink } = kind === "trouble" ? {} : this.#styles.get(name) ?? {}, sign = kind === "wrong" ? "✗ " : "";
    const { page, text: letters, soft, line, warn, bad } = this.#colours;
    const fill = { wrong: bad, early: soft, trouble: name === "degraded" ? warn : bad }[kind] ?? colour;
    const high = kind === "early" ? BAR / 3 : BAR;
    pen.fillStyle = fill ?? page;
    pen.fillRect(left, top + BAR - high, wide, high);
    if (!fill) {
      pen.strokeStyle = line;
      pen.strokeRect(left + 0.5, top + 0.5, Math.max(wide - 1, 0), BAR - 1);
    }
    if (kind === "early" || wide < LETTERS) return;
    const text = [name, code].map((one) => sign + one).find((one) => pen.measureText(one).width + 6 <= wide);
    pen.fillStyle = kind !== "type" ? page : ink ?? letters;
    if (text) pen.fillText(text, left + 3, top + BAR / 2 + 1);
  }

  #axis(pen, x, wide, high) {
    const least = (this.#span / 1e6 / wide) * TICK, step = STEPS.find((one) => one >= least) ?? 86_400;
    const base = this.live ? 0 : this.first ?? 0, digits = step < 0.1 ? 2 : step < 1 ? 1 : 0;
    pen.fillStyle = this.#colours.soft;
    for (let tick = Math.ceil((this.#from - base) / 1e6 / step) * step; base + tick * 1e6 <= this.#from + this.#span; tick += step) {
      const left = x(base + tick * 1e6), text = this.live ? clock(tick * 1000) : lasting(tick, digits);
      if (tick < 0) continue;
      pen.fillRect(left, high - FOOT, 1, 5);
      pen.fillText(text, Math.min(Math.max(left - pen.measureText(text).width / 2, 0), wide - pen.measureText(text).width), high - FOOT / 2 + 3);
    }
  }

  #read() {
    const { canvas, reading, last, first } = this, moved = this.at !== null || !this.live;
    say($("place"), reading);
    $("now").hidden = !this.live || this.at === null;
    // While it follows now, only its end moves: nothing to be read out.
    canvas.setAttribute("aria-valuetext", moved ? reading : "now");
    canvas.setAttribute("aria-valuemax", ((moved && last !== null ? last - first : 0) / 1e6).toFixed(2));
    canvas.setAttribute("aria-valuenow", ((this.at === null ? 0 : this.at - first) / 1e6).toFixed(2));
  }

  #show(from, span = this.#span) {
    const whole = Math.max(this.live ? KEPT_US : this.last - this.first, 1_000_000);
    this.#span = Math.min(Math.max(span, LEAST_US), whole);
    this.#from = Math.min(Math.max(from, this.first - this.#span / 2), this.last - this.#span / 2);
  }

  #zoom(by, anchor = this.at ?? this.last) {
    if (this.last === null) return;
    this.#whole = false;
    const inside = anchor >= this.#from && anchor <= this.#from + this.#span ? anchor : this.#from + this.#span / 2;
    this.#show(inside - (inside - this.#from) * by, this.#span * by);
    if (this.live && this.at === null) this.#from = this.last - this.#span;
    this.draw();
  }

  #pan(us) {
    if (this.last === null) return;
    this.#whole = false;
    if (this.at === null) this.at = this.last; // it was dragged back: it stays there
    this.#show(this.#from + us);
    this.draw();
  }

  // One pointer drags, two pinch; one that did not move puts the cursor.
  #pointer(kind, event) {
    const { left, width } = this.canvas.getBoundingClientRect(), here = event.clientX - left, before = this.#pointers.get(event.pointerId);
    const us = (pixel) => this.#from + (pixel / width) * this.#span;
    if (kind === "down") {
      if (!this.#pointers.size) this.#moved = 0;
      this.canvas.setPointerCapture(event.pointerId);
      this.#pointers.set(event.pointerId, here);
    } else if (before !== undefined && kind === "move") {
      this.#pointers.set(event.pointerId, here);
      this.#moved += Math.abs(here - before);
      if (this.#moved < 4) return;
      const [other] = [...this.#pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
      if (other === undefined) this.#pan(((before - here) / width) * this.#span);
      else this.#zoom(Math.max(Math.abs(before - other), 8) / Math.max(Math.abs(here - other), 8), us(other));
    } else if (before !== undefined) {
      this.#pointers.delete(event.pointerId);
      if (kind === "up" && this.#moved < 4) this.seek(us(here));
    }
  }

  #step(seconds) {
    this.seek((this.at ?? this.last) + 1e6 * seconds);
  }

  #jump(by) {
    const places = this.tracks.flatMap(({ errors: { wrong } }) => wrong.map(({ from }) => from)).sort((one, other) => one - other);
    const at = this.at ?? this.last;
    const next = by > 0 ? places.find((from) => from > at) : places.findLast((from) => from < at);
    if (next !== undefined) this.seek(next);
  }

  #keys = {
    " ": () => this.on.toggle(),
    "+": () => this.#zoom(1 / 2),
    "-": () => this.#zoom(2),
    ArrowLeft: () => this.#step(-1),
    ArrowRight: () => this.#step(1),
    j: () => this.#step(-10),
    l: () => this.#step(10),
    ",": () => this.#step(-0.02),
    ".": () => this.#step(0.02),
    Home: () => this.seek(this.first),
    End: () => this.seek(this.live ? null : this.last),
    n: () => this.#jump(1),
    p: () => this.#jump(-1),
  };

  #key(event) {
    const { key, target } = event, typing = /^(SELECT|INPUT|TEXTAREA)$/.test(target.tagName);
    const presses = key === " " && target.closest("button, a, summary");
    if (event.ctrlKey || event.altKey || event.metaKey || typing || presses || !Object.hasOwn(this.#keys, key)) return;
    event.preventDefault();
    if (this.last !== null) this.#keys[key]();
  }
}
