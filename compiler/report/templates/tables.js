// The integer tables of a build, from the bytes of tables.bin, and the prediction for a frame: thenar.runtime in
// JavaScript. The build has proved that no sum exceeds 16 bits, so JavaScript's numbers are exact.

const HEADER = 56;

/** Return the score tables in the bytes of tables.bin; runtime/model/integers.py describes them. */
export function parseTables(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const format = view.getUint16(8, true);
  if (format > 3) throw new Error(`tables.bin has format ${format}, but this page reads formats up to 3`);
  let at = HEADER;
  const words = (count, signed) =>
    Array.from({ length: count }, () => {
      at += 2;
      return signed ? view.getInt16(at - 2, true) : view.getUint16(at - 2, true);
    });
  const [K, s, j, n] = words(4, false);
  const rows = (count) => Array.from({ length: count }, () => words(K, true));
  const scale = view.getFloat64(at, true);
  at += 8;
  const counts = words(j, false), bias = words(K, true), switchRows = rows(s), switchMeans = rows(s), jointMeans = rows(j);
  const thresholds = counts.map((count) => words(count, false)), jointRows = counts.map((count) => rows(count + 1));
  const slopes = [], pairs = [];
  if (format === 2) {
    at += 2; // the grid, for firmware
    for (let each = 0; each < n; each++) {
      const [joint, low, high] = words(3, false), [gain] = words(1, true);
      slopes.push({ joint, low, high, gain });
    }
    for (const slope of slopes) {
      slope.row = Array.from({ length: K }, () => view.getInt8(at++));
      slope.zero = (gained(slope, slope.high - slope.low) + 1) >> 1;
    }
  }
  if (format === 3) {
    for (let each = 0; each < n; each++) {
      const [one, other, first, second] = words(4, false);
      pairs.push({ joints: [one, other], counts: [first, second] });
    }
    for (const pair of pairs) pair.thresholds = pair.counts.map((count) => words(count, false));
    for (const pair of pairs) pair.rows = Array.from({ length: pair.counts[0] + 1 }, () => rows(pair.counts[1] + 1));
  }
  if (at !== view.byteLength) throw new Error(`tables.bin has ${view.byteLength} bytes, but its counts require ${at}`);
  return { K, s, j, scale, bias, switchRows, switchMeans, jointMeans, thresholds, jointRows, slopes, pairs };
}

const gained = ({ gain }, above) => (gain > 0 ? above << gain : above >> -gain);

// The number of rising thresholds below a code.
function bin(thresholds, code) {
  let low = 0, high = thresholds.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (thresholds[middle] < code) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** Recognises frames: arrays of booleans for switches, and of codes for joints; `lost` ones are replaced by their means. */
export class Recogniser {
  // refusal: least scores, closed, ranges, outside, and leads: the lead of none over an accepted frame, and over a rejected
  // one; null: no frame is rejected.
  constructor(tables, classes, refusal) {
    this.tables = tables;
    this.classes = classes;
    this.refusal = refusal;
  }

  scores(bits, codes, lostSwitches = [], lostJoints = []) {
    const { K, bias, switchRows, switchMeans, jointMeans, thresholds, jointRows, slopes, pairs } = this.tables;
    const sums = bias.slice();
    const add = (row, times = 1) => {
      for (let k = 0; k < K; k++) sums[k] += times * row[k];
    };
    switchRows.forEach((row, at) => {
      if (lostSwitches[at]) add(switchMeans[at]);
      else if (bits[at]) add(row);
    });
    jointRows.forEach((rows, at) => add(lostJoints[at] ? jointMeans[at] : rows[bin(thresholds[at], codes[at])]));
    for (const slope of slopes) {
      if (lostJoints[slope.joint]) continue;
      const code = Math.min(Math.max(codes[slope.joint], slope.low), slope.high);
      add(slope.row, gained(slope, code - slope.low) - slope.zero);
    }
    for (const { joints, thresholds: steps, rows } of pairs) {
      const [one, other] = joints.map((joint, at) => bin(steps[at], lostJoints[joint] ? 0 : codes[joint]));
      add(rows[one][other]);
    }
    return sums;
  }

  #refuses(scores, bits, codes, lostSwitches, lostJoints) {
    const { least, closed, ranges, outside } = this.refusal, best = Math.max(...scores), candidate = scores.indexOf(best);
    const whole = !Array.from(lostSwitches).some(Boolean) && !Array.from(lostJoints).some(Boolean);
    if (best < least[candidate] && whole) return true;
    const { s } = this.tables, [fewest, most] = closed[candidate];
    let seen = 0, doubtful = 0;
    for (let at = 0; at < s; at++) {
      if (lostSwitches[at]) doubtful++;
      else if (bits[at]) seen++;
    }
    if (seen > most || seen + doubtful < fewest) return true;
    const out = ranges[candidate].filter(([low, high], at) => !lostJoints[at] && (codes[at] < low || codes[at] > high));
    return out.length > outside;
  }

  /**
   * Return the prediction: grasp; scores of all classes, in steps; margin, the lead over the second best;
   * probabilities of all classes; and whether an input was lost.
   */
  recognise(bits, codes, lostSwitches = [], lostJoints = []) {
    const scores = this.scores(bits, codes, lostSwitches, lostJoints);
    if (this.refusal) {
      const refused = this.#refuses(scores, bits, codes, lostSwitches, lostJoints);
      scores.push(Math.max(...scores) + this.refusal.leads[Number(refused)]);
    }
    const [best, second] = scores.toSorted((a, b) => b - a), winner = scores.indexOf(best);
    const odds = scores.map((score) => Math.exp((score - best) / this.tables.scale));
    const all = odds.reduce((a, b) => a + b, 0), lost = (flags) => Array.from(flags).some(Boolean);
    return {
      number: winner,
      grasp: this.classes[winner],
      scores,
      margin: best - second,
      probabilities: odds.map((each) => each / all),
      degraded: lost(lostSwitches) || lost(lostJoints),
    };
  }
}

/** Return a number rounded as in Python: half to even. */
function rounded(value) {
  const down = Math.floor(value), part = value - down;
  return part < 0.5 || (part === 0.5 && down % 2 === 0) ? down : down + 1;
}

/** Return the code of a value of a joint or a taxel, clamped to 0..65535, by the two points of its coding. */
export function codeOf(joint, value) {
  const step = (joint.value_b - joint.value_a) / (joint.code_b - joint.code_a);
  return rounded(Math.min(Math.max(joint.code_a + (value - joint.value_a) / step, 0), 65535));
}

/** Return the value of a code. */
export function valueOf(joint, code) {
  return joint.value_a + (code - joint.code_a) * ((joint.value_b - joint.value_a) / (joint.code_b - joint.code_a));
}
