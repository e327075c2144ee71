// Whether what a page shows is current: the age of its data, and its link to the server.
import { $, say } from "./wire.js";

const LEAST_MS = 500, PERIODS = 3, INTERVALS = 9, LOOK_MS = 100;

/** Return the time of day of a moment of performance.now(): "10:24:07". */
export const clock = (at) => new Date(Date.now() - performance.now() + at).toTimeString().slice(0, 8);

/**
 * Watches the age of the data, and says it in #age.
 *
 * Data is old after half a second, or after three periods of its source if these are longer. Old data, and all data while
 * the link is down, is greyed: the root element has the class "old".
 */
export class State {
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
