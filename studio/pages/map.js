// The map of trials: thousands of marks, to hover over, click, or draw a line around.
import { draw } from "./hand.js";

const MARGIN = 14, REACH = 12; // pixels; the margin is its padding
const ARROWS = { ArrowRight: ["x", 1], ArrowLeft: ["x", -1], ArrowDown: ["y", 1], ArrowUp: ["y", -1] };

export class TrialMap {
  #svg;
  #on;
  #trials = []; // of each: its place on the map, 0 to 1, and its mark
  #pointed = -1;
  #line = null; // the lasso while it is drawn
  #lasso = draw("polyline", { transform: `translate(-${MARGIN} -${MARGIN})` });
  #closed = false; // whether the click to come ends a lasso

  /** on: { point(trial or -1), select(trials) } */
  constructor(svg, on) {
    [this.#svg, this.#on] = [svg, on];
    const at = (event) => [event.offsetX, event.offsetY];
    svg.addEventListener("pointerdown", (event) => {
      if (event.button) return;
      svg.setPointerCapture(event.pointerId);
      this.#line = [at(event)];
    });
    svg.addEventListener("pointermove", (event) => {
      if (this.#line) {
        this.#line.push(at(event));
        this.#lasso.setAttribute("points", this.#line.join(" "));
      } else this.#point(this.#nearest(at(event)));
    });
    svg.addEventListener("pointerup", () => this.#close());
    // A finger that moves up or down scrolls the page.
    svg.addEventListener("pointercancel", () => this.#drop());
    svg.addEventListener("click", (event) => {
      const trial = this.#nearest(at(event));
      if (trial >= 0 && !this.#closed) this.#on.select([trial]);
      this.#closed = false;
    });
    svg.addEventListener("keydown", (event) => this.#press(event));
  }

  /** places: [x, y] of each trial, 0 to 1; looks: { colour, wrong } of each; codes: of each type { code, trials } */
  show(places, looks, codes) {
    const share = (value) => `${100 * value}%`;
    this.#trials = looks.map(({ colour, wrong }, trial) => {
      const [x, y] = [places[trial][0], 1 - places[trial][1]];
      return { x, y, mark: draw("circle", { class: wrong ? "wrong" : "", fill: colour, cx: share(x), cy: share(y) }) };
    });
    const labels = codes.map(({ code, trials }) => {
      const mean = (axis) => trials.reduce((sum, trial) => sum + this.#trials[trial][axis], 0) / trials.length;
      return draw("text", { x: share(mean("x")), y: share(mean("y")) }, code);
    });
    this.#svg.replaceChildren(...this.#trials.map(({ mark }) => mark), ...labels, this.#lasso);
    this.#pointed = -1;
  }

  select(trials) {
    const selected = new Set(trials);
    this.#trials.forEach(({ mark }, trial) => mark.classList.toggle("selected", selected.has(trial)));
  }

  #pixels({ x, y }) {
    const { clientWidth, clientHeight } = this.#svg;
    return [MARGIN + x * (clientWidth - 2 * MARGIN), MARGIN + y * (clientHeight - 2 * MARGIN)];
  }

  #nearest([x, y]) {
    const away = this.#trials.map((trial) => {
      const [left, top] = this.#pixels(trial);
      return Math.hypot(left - x, top - y);
    });
    const least = Math.min(...away);
    return least < REACH ? away.indexOf(least) : -1;
  }

  #point(trial) {
    if (trial === this.#pointed) return;
    for (const [one, on] of [[this.#pointed, false], [trial, true]]) this.#trials[one]?.mark.classList.toggle("pointed", on);
    this.#pointed = trial;
    this.#on.point(trial);
  }

  /** Select what the line goes around, if it is more than a click. */
  #close() {
    const line = this.#line ?? [];
    this.#closed = line.some(([x, y]) => Math.hypot(x - line[0][0], y - line[0][1]) > REACH / 2);
    const inside = [...this.#trials.keys()].filter((number) => {
      const [x, y] = this.#pixels(this.#trials[number]);
      return this.#lasso.isPointInFill({ x, y });
    });
    this.#drop();
    if (this.#closed && inside.length) this.#on.select(inside);
  }

  #drop() {
    this.#line = null;
    this.#lasso.setAttribute("points", "");
  }

  /** Go to the next trial along an axis by an arrow, so that each can be reached, and select it by Enter. */
  #press(event) {
    if (event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      if (this.#pointed >= 0) this.#on.select([this.#pointed]);
    }
    if (!ARROWS[event.key] || !this.#trials.length) return;
    event.preventDefault();
    const [axis, step] = ARROWS[event.key];
    const order = [...this.#trials.keys()].sort((one, other) => this.#trials[one][axis] - this.#trials[other][axis]);
    const far = event.shiftKey ? Math.ceil(order.length / 20) : 1, at = order.indexOf(this.#pointed);
    this.#point(order[at < 0 ? 0 : Math.min(Math.max(at + step * far, 0), order.length - 1)]);
  }
}
