// The switch-scanner board on a serial line: drivers/scanner_protocol.py and scanner_state.py in JavaScript.

const MAX_PAYLOAD = 250, OVERHEAD = 6, PROTOCOL = 1, UNREAD = 0xffff;
const WITHOUT_DIODES = 0x01, ANALOG_FLAG = 0x02;
const KIND = { HELLO: 1, STATE: 2, EVENT: 3, HEARTBEAT: 4, LOST: 7, CHANNELS: 8, ANALOG: 9 };
const ASK = { RATE: 0x11, STATE: 0x13, PING: 0x14, CHANNELS: 0x15 };
const BEAT_US = 20_000, ANALOG_US = 20_000;

function crc(bytes) {
  let sum = 0xffff;
  for (const byte of bytes) {
    sum ^= byte << 8;
    for (let bit = 0; bit < 8; bit++) sum = sum & 0x8000 ? ((sum << 1) ^ 0x1021) & 0xffff : (sum << 1) & 0xffff;
  }
  return sum;
}

function stuffed(bytes) {
  const out = [];
  let block = [], open = true;
  const flush = () => {
    out.push(block.length + 1, ...block);
    block = [];
  };
  for (const byte of bytes) {
    open = true;
    if (byte) block.push(byte);
    if (!byte || block.length === 254) {
      flush();
      open = !byte;
    }
  }
  if (open || block.length) flush();
  return out;
}

function unstuffed(piece) {
  const out = [];
  let at = 0;
  while (at < piece.length) {
    const code = piece[at], end = at + code;
    if (!code || end > piece.length) return null;
    for (at++; at < end; at++) {
      if (!piece[at]) return null;
      out.push(piece[at]);
    }
    if (code < 255 && at < piece.length) out.push(0);
  }
  return out;
}

/** Return a frame as sent on the wire, its end included. */
export function encodeFrame(kind, sequence, payload) {
  const body = [kind, sequence & 0xff, ...payload], sum = crc(body);
  return Uint8Array.from([...stuffed([...body, sum >> 8, sum & 0xff]), 0]);
}

/** Converts bytes to frames {kind, sequence, payload}, null for invalid ones; no input throws. */
export class FrameDecoder {
  constructor() {
    this.rest = [];
    this.frames = 0;
    this.bad = 0;
  }

  feed(chunk) {
    const found = [];
    for (const byte of chunk) {
      if (byte) {
        if (this.rest.length < MAX_PAYLOAD + OVERHEAD) this.rest.push(byte);
      } else if (this.rest.length) {
        found.push(this.#frame(this.rest));
        this.rest = [];
      }
    }
    return found;
  }

  #frame(piece) {
    const body = piece.length >= MAX_PAYLOAD + OVERHEAD ? null : unstuffed(piece);
    if (!body || body.length < 4 || crc(body)) {
      this.bad++;
      return null;
    }
    this.frames++;
    return { kind: body[0], sequence: body[1], payload: Uint8Array.from(body.slice(2, -2)) };
  }
}

const little = (value, size) => Array.from({ length: size }, (_, at) => Math.floor(value / 256 ** at) & 0xff);
const flagsOf = (bytes, count) => Array.from({ length: count }, (_, at) => Boolean((bytes[at >> 3] >> (at & 7)) & 1));

// Keys of a matrix without diodes that read closed but may be ghosts of others.
function doubtful(closed, rows, columns) {
  const found = closed.map(() => false);
  for (let one = 0; one < rows; one++) {
    for (let other = one + 1; other < rows; other++) {
      const common = [];
      for (let column = 0; column < columns; column++) {
        if (closed[one * columns + column] && closed[other * columns + column]) common.push(column);
      }
      if (common.length < 2) continue;
      for (const column of common) found[one * columns + column] = found[other * columns + column] = true;
    }
  }
  return found;
}

/**
 * A scanner board: `received(bytes)` takes the bytes received and returns the newest reading or null: {closed, known}, by
 * key, and {codes}, by channel. `send` is called with bytes for the board. channels: the requested ones. Throws Error if
 * the board uses another protocol.
 */
export class ScannerBoard {
  constructor(send, channels = []) {
    this.send = (kind, payload) => send(encodeFrame(kind, this.sequence++, payload));
    this.raw = send;
    this.channels = channels;
    this.sequence = 0;
    this.decoder = new FrameDecoder();
    this.hello = null;
    this.misfits = 0;
    this.#restarted();
  }

  #restarted() {
    this.hasBitmap = this.hasLost = false;
    this.analog = null;
    this.codes = null;
  }

  get trusted() {
    return this.hasBitmap && this.hasLost;
  }

  /** Greet the board, or repeat the requests without a reply; call it every 0.3 s. */
  ask() {
    if (!this.hello) {
      this.raw(Uint8Array.of(0));
      this.send(ASK.PING, little(1, 2));
      return;
    }
    if (!this.trusted) this.send(ASK.STATE, []);
    if (this.channels.length && this.hello.flags & ANALOG_FLAG && !this.analog) this.#askChannels();
  }

  #askChannels() {
    const most = Math.max(...this.channels), wanted = new Uint8Array((most >> 3) + 1);
    for (const channel of this.channels) wanted[channel >> 3] |= 1 << (channel & 7);
    this.send(ASK.CHANNELS, [1, ...little(ANALOG_US, 4), ...wanted]);
  }

  received(chunk) {
    let news = false;
    for (const frame of this.decoder.feed(chunk)) news = this.#take(frame) || news;
    if (!news || !this.hello) return null;
    const { rows, columns, flags } = this.hello, { closed } = this, codes = this.codes;
    const ghosts = flags & WITHOUT_DIODES ? doubtful(closed, rows, columns) : [];
    const known = closed.map((_, key) => this.trusted && !this.lost[key] && !ghosts[key]);
    return { closed: closed.map((shut, key) => shut && known[key]), known, codes };
  }

  #take(frame) {
    if (!frame) {
      const was = this.trusted;
      this.hasBitmap = false; // the lost frame may have been an EVENT
      return was;
    }
    const { kind, sequence, payload } = frame;
    if (kind === KIND.HELLO) return this.#greeted(sequence, payload);
    if (!this.hello) return false;
    const gap = sequence !== ((this.last + 1) & 0xff), follows = !gap && !this.unread, afterLost = this.wasLost;
    this.last = sequence;
    this.wasLost = this.unread = false;
    if (gap) this.hasBitmap = this.hasLost = false;
    if (!this.#read(kind, payload, follows, afterLost)) {
      this.misfits++;
      this.unread = true; // the lost frame may have been any message
      this.hasBitmap = this.hasLost = false;
    }
    return true;
  }

  // Return whether the board may have sent this.
  #read(kind, payload, follows, afterLost) {
    const { keys } = this.hello, size = (keys + 7) >> 3, view = new DataView(payload.buffer, payload.byteOffset);
    const bitmap = (from) => {
      if (payload.length !== from + size || flagsOf(payload.subarray(from), 8 * size).slice(keys).some(Boolean)) return null;
      return flagsOf(payload.subarray(from), keys);
    };
    switch (kind) {
      case KIND.STATE:
      case KIND.HEARTBEAT: {
        const found = bitmap(kind === KIND.STATE ? 0 : 4);
        if (!found) return false;
        [this.closed, this.hasBitmap] = [found, true];
        if (kind === KIND.HEARTBEAT && follows && !afterLost) [this.lost, this.hasLost] = [found.map(() => false), true];
        return true;
      }
      case KIND.LOST: {
        const found = bitmap(0);
        if (!found) return false;
        [this.lost, this.hasLost, this.wasLost] = [found, true, true];
        return true;
      }
      case KIND.EVENT: {
        if (payload.length !== 7 || view.getUint16(4, true) >= keys || payload[6] > 1) return false;
        if (this.hasBitmap) this.closed = this.closed.with(view.getUint16(4, true), payload[6] === 1);
        return true;
      }
      case KIND.CHANNELS: {
        if (payload.length < 8 || payload.length !== 8 + ((payload[7] + 7) >> 3)) return false;
        const wanted = flagsOf(payload.subarray(8), payload[7]).flatMap((flag, at) => (flag ? [at] : []));
        if (payload[1] === 1) this.analog = { bits: payload[2], wanted };
        return true;
      }
      case KIND.ANALOG: {
        if (payload.length < 5 || (payload.length - 5) % 2) return false;
        if (!this.analog || payload[4] !== 1 || payload.length !== 5 + 2 * this.analog.wanted.length) return true;
        this.codes = new Map(this.analog.wanted.map((channel, at) => {
          const code = view.getUint16(5 + 2 * at, true);
          return [channel, code === UNREAD ? null : code];
        }));
        return true;
      }
      default:
        return kind === 5 || kind === 6 || kind === 10; // FAULTS, GRASP, SEGMENT
    }
  }

  #greeted(sequence, payload) {
    if (payload[0] !== PROTOCOL) throw new Error(`the board uses protocol ${payload[0]}, this page ${PROTOCOL}: update the older of the two`);
    if (payload.length !== 35) throw new Error(`a HELLO of ${payload.length} bytes, not 35`);
    const view = new DataView(payload.buffer, payload.byteOffset), [rows, columns] = [view.getUint16(11, true), view.getUint16(13, true)];
    const first = !this.hello, booted = !first && sequence === 0 && view.getUint16(2, true) === 0;
    this.hello = { flags: payload[1], rows, columns, keys: rows * columns };
    if (first || booted) {
      this.closed = this.lost = Array.from({ length: rows * columns }, () => false);
      this.#restarted();
      // Request frequent heartbeats, and an event for every change.
      this.send(ASK.RATE, [...little(view.getUint32(15, true), 4), ...little(0, 4), ...little(BEAT_US, 4)]);
      this.send(ASK.STATE, []);
      if (this.channels.length && payload[1] & ANALOG_FLAG) this.#askChannels();
    }
    this.last = sequence;
    this.wasLost = this.unread = false;
    return first || booted;
  }
}
