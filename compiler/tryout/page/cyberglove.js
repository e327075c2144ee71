// The CyberGlove's serial protocol: the part of drivers/cyberglove_protocol.py that streaming needs, in JavaScript.

const STOP = 3, STREAM = 0x53, POLL = 0x47;
const fingers = (digit) => ["mpj", "pij", "dij"].map((joint) => `${digit}_${joint}`);
const SLOTS = [
  "thumb_rotation", "thumb_mpj", "thumb_ij", "thumb_abduction", ...fingers("index"), "", ...fingers("middle"),
  "middle_index_abduction", ...fingers("ring"), "ring_middle_abduction", ...fingers("little"), "little_ring_abduction",
  "palm_arch", "wrist_pitch", "wrist_yaw", "",
];
const MASKS = { 18: [0x3f, 0xbb, 0x7b], 22: [0x7f, 0xff, 0x7f] };

/** Return the sensors that a mask of 3 bytes lets through, in wire order. */
export function maskedSensors(mask) {
  return SLOTS.filter((name, slot) => name && (mask[slot >> 3] >> (slot & 7)) & 1);
}

/** Converts bytes to records of `count` sensors; invalid ones are counted, and skipped to the next NUL. */
export class RecordDecoder {
  constructor(sensors) {
    this.sensors = sensors;
    this.records = 0;
    this.bad = 0;
    this.rest = [];
  }

  feed(chunk) {
    const found = [];
    for (const byte of chunk) {
      if (byte) {
        if (this.rest.length <= this.sensors + 4) this.rest.push(byte);
        continue;
      }
      if (this.rest.length) this.#record(found);
      this.rest = [];
    }
    return found;
  }

  #record(found) {
    const piece = this.rest, body = 1 + this.sensors, ending = String.fromCharCode(...piece.slice(body));
    if ((piece[0] !== STREAM && piece[0] !== POLL) || piece.length < body || !["", "es", "eg"].includes(ending)) {
      this.bad++;
      return;
    }
    this.records++;
    found.push({ sensors: piece.slice(1, body), unplugged: ending === "eg" });
  }
}

const latin = (text) => Uint8Array.from(text, (letter) => letter.charCodeAt(0));

/**
 * Query a glove and start its stream. `received(bytes)` takes the bytes received and returns records; `ask()`, called
 * every 0.3 s, starts, and repeats unanswered queries. names: its sensors in wire order, once known.
 */
export class CyberGlove {
  constructor(send, names = null) {
    this.send = send;
    this.own = names;
    this.names = null;
    this.steps = ["?N", "?M", "D\0", "U\0", "T\0\0\0\0"];
    this.heard = [];
    this.replies = {};
    this.silent = 0;
    this.decoder = null;
  }

  ask() {
    if (this.decoder) {
      // No record for a while: start again.
      if (this.silent++ < 3) return;
      this.decoder = null;
      this.steps = ["?N", "?M", "D\0", "U\0", "T\0\0\0\0"];
    }
    this.heard = [];
    this.send(Uint8Array.of(STOP));
    this.#next();
  }

  #next() {
    if (this.steps.length) this.send(latin(this.steps[0]));
    else this.#stream();
  }

  // Letters of the echo, values, and a NUL.
  #reply() {
    const step = this.steps[0], echo = latin(step[0] === "?" ? step : step[0]), size = step === "?N" ? 1 : step === "?M" ? 3 : 0;
    for (let at = 0; at < this.heard.length; at++) {
      if (at && this.heard[at - 1]) continue;
      const end = at + echo.length + size;
      if (echo.every((byte, place) => this.heard[at + place] === byte) && this.heard[end] === 0) return this.heard.slice(at + echo.length, end);
      // A box replies with an error to a command that it does not support.
      const text = String.fromCharCode(...this.heard.slice(at));
      if (/^(..?)?e[?nyg]\r?\n?\0/.test(text) && !(step === "?N")) return [];
    }
    return null;
  }

  received(chunk) {
    if (this.decoder) {
      const found = this.decoder.feed(chunk);
      if (found.length) this.silent = 0;
      return found;
    }
    this.heard.push(...chunk);
    const reply = this.steps.length ? this.#reply() : null;
    if (reply) {
      this.replies[this.steps.shift()] = reply;
      this.heard = [];
      this.#next();
    } else if (this.heard.length > 4096) this.heard = [];
    return [];
  }

  #stream() {
    const [count] = this.replies["?N"], masked = maskedSensors(this.replies["?M"] ?? []);
    if (this.own && this.own.length === count) this.names = this.own;
    else this.names = masked.length === count ? masked : MASKS[count] ? maskedSensors(MASKS[count]) : null;
    if (!this.names) throw new Error(`the CyberGlove sends ${count} sensors, but not which: switch its box off and on`);
    this.decoder = new RecordDecoder(count);
    this.silent = 0;
    this.send(Uint8Array.of(STREAM));
  }

  /** End the stream. */
  stop() {
    this.send(Uint8Array.of(STOP));
  }
}
