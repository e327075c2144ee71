// A glove on Web Serial, as frames of the build: closed bits, codes of the joints, and lost inputs.

const AGAIN_MS = 300;

/** The last state of every input: {bits, codes, lostSwitches, lostJoints}; at first, all are lost. */
class Inputs {
  constructor(switches, joints) {
    this.bits = switches.map(() => false);
    this.lostSwitches = switches.map(() => true);
    this.codes = joints.map((joint) => joint.typical);
    this.lostJoints = joints.map(() => true);
  }

  bit(at, closed) {
    this.lostSwitches[at] = closed === null;
    this.bits[at] = Boolean(closed);
  }

  code(at, code) {
    this.lostJoints[at] = code === null;
    if (code !== null) this.codes[at] = code;
  }
}

/* Each reader: received(bytes) returns whether `inputs` changed; ask(); said: a sentence; stop(). */

class BoardReader {
  constructor(data, inputs, send) {
    const { keys, taxels } = data.wiring.scanner ?? {};
    this.inputs = inputs;
    // Without a wiring key k is the build's switch k.
    this.keys = keys ?? data.switches.flatMap((each, bit) => (each.taxel ? [] : [bit]));
    this.wired = Boolean(keys);
    this.levels = taxels ?? [];
    this.board = new ScannerBoard(send, [...new Set(this.levels.map(([channel]) => channel))].sort((a, b) => a - b));
  }

  ask() {
    this.board.ask();
  }

  received(bytes) {
    const reading = this.board.received(bytes);
    if (!reading) return false;
    this.keys.forEach((bit, key) => {
      if (bit !== null) this.inputs.bit(bit, reading.known[key] ? reading.closed[key] : null);
    });
    for (const [channel, limit, bit] of this.levels) {
      const code = reading.codes?.get(channel) ?? null;
      // A negative limit closes at counts below its complement: the taxel is wired inversely.
      this.inputs.bit(bit, code === null ? null : limit >= 0 ? code > limit : ~code > limit);
    }
    return true;
  }

  stop() {}

  get said() {
    const { hello, decoder, misfits } = this.board;
    if (!hello) return "waiting for the board's HELLO";
    const keys = this.wired ? "keys as glove.toml wires them" : "key k is switch k of the build, from 0";
    return `board of ${hello.keys} keys, ${keys}; ${decoder.frames} frames, ${decoder.bad + misfits} damaged`;
  }
}

class GloveReader {
  constructor(data, inputs, send, calibration) {
    this.joints = data.joints;
    this.inputs = inputs;
    this.glove = new CyberGlove(send, data.wiring.cyberglove);
    this.tables = data.joints.map((joint) => codesOfBytes(joint, calibration?.get(joint.name) ?? null));
    this.unplugged = false;
  }

  ask() {
    this.glove.ask();
  }

  received(bytes) {
    const record = this.glove.received(bytes).at(-1);
    if (!record) return false;
    this.unplugged = record.unplugged;
    this.joints.forEach((joint, at) => {
      const place = this.glove.names.indexOf(joint.name);
      this.inputs.code(at, place < 0 || record.unplugged ? null : this.tables[at][record.sensors[place]]);
    });
    return true;
  }

  stop() {
    this.glove.stop();
  }

  get said() {
    const { decoder, names } = this.glove;
    if (!decoder) return "querying the CyberGlove";
    return `CyberGlove of ${names.length} sensors${this.unplugged ? ", unplugged" : ""}; ${decoder.records} records, ${decoder.bad} damaged`;
  }
}

class LineReader {
  constructor(data, inputs, _send, calibration) {
    this.data = data;
    this.inputs = inputs;
    this.stream = data.wiring.stream;
    this.parser = new LineParser();
    this.rows = this.strange = 0;
    const used = [...data.switches.filter((each) => !each.taxel).map((each) => each.name)];
    this.order = this.stream?.columns ?? [...used, ...data.joints.map((joint) => joint.name)];
    this.calibration = calibration;
    this.tables = data.joints.map((joint) => {
      const range = this.stream?.joints[joint.name];
      if (!range) return null;
      const line = { raw_a: 1, value_a: range[0], raw_b: 255, value_b: range[1] };
      return codesOfBytes(joint, calibration ? calibration.get(joint.name) : joint.unit === "raw" ? null : line);
    });
  }

  ask() {}

  received(bytes) {
    const row = this.parser.feed(bytes).at(-1);
    if (!row) return false;
    const names = row.names ?? (this.order.length === row.values.length ? this.order : null);
    const values = new Map(names?.map((name, at) => [name, row.values[at]]));
    const found = readRow(this.data, (name) => values.get(name) ?? null, this);
    if (!found.some) {
      this.strange++;
      return false;
    }
    this.rows++;
    Object.assign(this.inputs, found.inputs);
    return true;
  }

  closed(name, value) {
    const { thresholds, threshold, low } = this.stream ?? { thresholds: {}, threshold: 0.5, low: false };
    return value > (thresholds[name] ?? threshold) !== low;
  }

  joint(at, value) {
    const range = this.stream?.joints[this.data.joints[at].name];
    return range ? this.tables[at][onGrid(range, 1, 255, value)] : codeOf(this.data.joints[at], value);
  }

  taxel(taxel, value) {
    const range = this.stream?.taxels[taxel.name];
    return range ? onGrid(range, 0, range[2], value) : codeOf(taxel, value);
  }

  stop() {}

  get said() {
    const { misfits, odd } = this.parser;
    if (!this.rows && this.strange) return "rows arrive, but without columns of the build: name the columns, or send them in the build's order";
    return `${this.rows} rows; lines without a row: ${misfits}${misfits ? `, such as "${odd}"` : ""}`;
  }
}

function onGrid([low, high], first, last, value) {
  const far = (value - low) * ((last - first) / (high - low));
  return Math.min(Math.max(first + rounded(Math.min(Math.max(far, -1e6), 1e6)), first), last);
}

/** In the units of the recordings' columns: a switch above 0.5 is closed; joints and taxels have their units. */
export const RECORDED = {
  closed: (_name, value) => value > 0.5,
  joint: null,
  taxel: null,
};

/** Return {some, inputs} of a row: `value(name)` is a number or null; `how` converts the numbers. */
export function readRow(data, value, how) {
  const inputs = new Inputs(data.switches, data.joints);
  let some = false;
  data.switches.forEach((each, bit) => {
    const found = value(each.taxel ? each.taxel.name : each.name);
    if (found === null) return;
    some = true;
    const closed = each.taxel ? (how.taxel?.(each.taxel, found) ?? codeOf(each.taxel, found)) > each.code : how.closed(each.name, found);
    inputs.bit(bit, closed);
  });
  data.joints.forEach((joint, at) => {
    const found = value(joint.name);
    if (found === null) return;
    some = true;
    inputs.code(at, how.joint?.(at, found) ?? codeOf(joint, found));
  });
  return { some, inputs: { ...inputs } };
}

const READERS = { scanner: BoardReader, cyberglove: GloveReader, lines: LineReader };

/**
 * Open a glove of a kind ("scanner", "cyberglove", "lines") on a port of Web Serial. shown(inputs, said) is called after
 * changes; ended(reason) once, at its end. Returns the function that closes it.
 */
export async function openGlove(kind, port, baudRate, data, calibration, shown, ended) {
  const inputs = new Inputs(data.switches, data.joints);
  let writer = null, alive = true, reader = null, reason = "";
  const send = (bytes) => writer?.write(bytes).catch(() => {});
  const source = new READERS[kind](data, inputs, send, calibration);
  await port.open({ baudRate });
  writer = port.writable.getWriter();
  const attempt = (work) => {
    try {
      return work();
    } catch (wrong) {
      reason = wrong.message;
      close();
      return false;
    }
  };
  const timer = setInterval(() => {
    attempt(() => source.ask());
    shown(null, source.said);
  }, AGAIN_MS);
  async function close() {
    if (!alive) return;
    alive = false;
    clearInterval(timer);
    source.stop();
    await reader?.cancel().catch(() => {});
  }
  attempt(() => source.ask());
  (async () => {
    try {
      reader = port.readable.getReader();
      while (alive) {
        const { value, done } = await reader.read();
        if (done) break;
        if (attempt(() => source.received(value))) shown(inputs, source.said);
      }
    } catch (wrong) {
      reason ||= wrong.message;
    }
    clearInterval(timer);
    alive = false;
    reader?.releaseLock();
    await writer.close().catch(() => {});
    await port.close().catch(() => {});
    ended(reason);
  })();
  return close;
}
