// The map of trials: thousands of marks on a canvas, to hover over, click, or draw a line around.
import { clearedPen, colours, redraw } from "./wire.js";

const MARGIN = 14, REACH = 12; // pixels
const ARROWS = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowDown: [0, 1], ArrowUp: [0, -1] };

export class TrialMap {
  #canvas;
  #on;
  #trials = []; // of each: its place on the map, 0 to 1, and how it looks
  #labels = [];
  #selected = new Set();
  #pointed = -1;
  #line = null; // the lasso while it is drawn
  #touch = false;
  #closed = false; // whether the click to come ends a lasso

  /** on: { point(trial or -1), select(trials) } */
  constructor(canvas, on) {
    [this.#canvas, this.#on] = [canvas, on];
    const at = (event) => [event.offsetX, event.offsetY];
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button || (event.pointerType === "touch" && !this.#touch)) return;
      canvas.setPointerCapture(event.pointerId);
      this.#line = [at(event)];
    });
    canvas.addEventListener("pointermove", (event) => {
      if (this.#line) {
        this.#line.push(at(event));
        this.#draw();
      } else this.#point(this.#nearest(at(event)));
    });
    canvas.addEventListener("pointerup", () => this.#close());
    canvas.addEventListener("pointercancel", () => {
      this.#line = null;
      this.#draw();
    });
    canvas.addEventListener("click", (event) => {
      const trial = this.#nearest(at(event));
      if (trial >= 0 && !this.#closed) this.#on.select([trial]);
      this.#closed = false;
    });
    canvas.addEventListener("keydown", (event) => this.#press(event));
    redraw(canvas, () => this.#draw());
  }

  /** Let a finger draw the lasso instead of scrolling. */
  set touch(on) {
    this.#touch = on;
    this.#canvas.classList.toggle("lasso", on);
  }

  /** places: [x, y] of each trial, 0 to 1; looks: { colour, wrong } of each; codes: of each type { code, trials } */
  show(places, looks, codes) {
    this.#trials = looks.map((look, trial) => ({ ...look, x: places[trial][0], y: 1 - places[trial][1] }));
    this.#labels = codes.map(({ code, trials }) => {
      const mean = (axis) => trials.reduce((sum, trial) => sum + this.#trials[trial][axis], 0) / trials.length;
      return { code, x: mean("x"), y: mean("y") };
    });
    this.#pointed = -1;
    this.#draw();
  }

  select(trials) {
    this.#selected = new Set(trials);
    this.#draw();
  }

  #pixels({ x, y }) {
    const { clientWidth, clientHeight } = this.#canvas;
    return [MARGIN + x * (clientWidth - 2 * MARGIN), MARGIN + y * (clientHeight - 2 * MARGIN)];
  }

  #draw() {
    const pen = clearedPen(this.#canvas), { text, page, bad, soft } = colours();
    const ring = (place, radius, colour, width) => {
      pen.beginPath();
      pen.arc(...place, radius, 0, 2 * Math.PI);
      pen.strokeStyle = colour;
      pen.lineWidth = width;
      pen.stroke();
    };
    this.#trials.forEach((trial, number) => {
      const place = this.#pixels(trial);
      pen.fillStyle = trial.colour;
      ring(place, 3.5, soft, 0.5);
      pen.fill();
      if (this.#selected.has(number)) ring(place, 8, text, 3);
      else if (trial.wrong) ring(place, 5.5, bad, 1.5);
    });
    pen.font = "600 14px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    for (const label of this.#labels) {
      const [x, y] = this.#pixels(label);
      pen.strokeStyle = page;
      pen.lineWidth = 4;
      pen.strokeText(label.code, x, y);
      pen.fillStyle = text;
      pen.fillText(label.code, x, y);
    }
    if (this.#pointed >= 0) ring(this.#pixels(this.#trials[this.#pointed]), 11, text, 2);
    if (!this.#line) return;
    pen.strokeStyle = text;
    pen.lineWidth = 1.5;
    pen.beginPath();
    for (const place of this.#line) pen.lineTo(...place);
    pen.stroke();
  }

  // The trial of the least cost, which its place and number have; -1 if none is below the limit.
  #best(cost, limit) {
    let best = -1;
    this.#trials.forEach((trial, number) => {
      const found = cost(this.#pixels(trial), number);
      if (found < limit) [best, limit] = [number, found];
    });
    return best;
  }

  #nearest([x, y]) {
    return this.#best(([left, top]) => Math.hypot(left - x, top - y), REACH);
  }

  #point(trial) {
    if (trial === this.#pointed) return;
    this.#pointed = trial;
    this.#on.point(trial);
    this.#draw();
  }

  /** Select what the line goes around, if it is more than a click. */
  #close() {
    const line = this.#line ?? [];
    this.#line = null;
    this.#closed = line.some(([x, y]) => Math.hypot(x - line[0][0], y - line[0][1]) > REACH / 2);
    this.#draw();
    if (!this.#closed) return;
    const inside = this.#trials.map((trial, number) => (within(line, this.#pixels(trial)) ? number : -1)).filter((number) => number >= 0);
    if (inside.length) this.#on.select(inside);
  }

  /** Go to the nearest trial in the direction of an arrow, and select it by Enter. */
  #press(event) {
    if (event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      if (this.#pointed >= 0) this.#on.select([this.#pointed]);
    }
    const ahead = ARROWS[event.key];
    if (!ahead || !this.#trials.length) return;
    event.preventDefault();
    if (this.#pointed < 0) {
      this.#point(0);
      return;
    }
    const from = this.#pixels(this.#trials[this.#pointed]);
    const best = this.#best((to, number) => {
      const [right, down] = [to[0] - from[0], to[1] - from[1]], along = right * ahead[0] + down * ahead[1];
      const aside = Math.abs(right * ahead[1]) + Math.abs(down * ahead[0]);
      return number !== this.#pointed && along > 0 ? along + 2 * aside : Infinity;
    }, Infinity);
    if (best >= 0) this.#point(best);
  }
}

/** Return whether a place is inside a closed line: a ray from it crosses the line an odd number of times. */
function within(line, [x, y]) {
  let inside = false;
  line.forEach(([x1, y1], at) => {
    const [x2, y2] = line[(at + 1) % line.length];
    if (y1 > y !== y2 > y && x < x1 + ((y - y1) / (y2 - y1)) * (x2 - x1)) inside = !inside;
  });
  return inside;
}
