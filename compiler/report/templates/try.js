// The page: one state of all inputs, from the hand or from a recorded row; and its prediction.

const data = JSON.parse(document.getElementById("page-data").textContent);
const at = (id) => document.getElementById(id);
const bytes = Uint8Array.from(atob(data.tables), (letter) => letter.charCodeAt(0));
const recogniser = new Recogniser(parseTables(bytes), data.classes, data.refusal);
const { switches, joints } = data;

const state = {
  bits: switches.map(() => false),
  codes: joints.map((joint) => joint.typical),
  lostSwitches: switches.map(() => false),
  lostJoints: joints.map(() => false),
};

function made(name, properties = {}, ...children) {
  const one = Object.assign(document.createElement(name), properties);
  one.append(...children);
  return one;
}

const inUnit = (joint, value) => `${Number(value.toPrecision(4))}${joint.unit === "deg" ? "°" : ` ${joint.unit}`}`;
const percent = (share) => `${(100 * share).toFixed(1)} %`;
const steps = (count) => `${count} step${count === 1 ? "" : "s"}`;

/* ---- Inputs ---- */

const hand = drawHand(at("hand"), data.hand, {
  onSwitch(bit, closed) {
    if (at("lose").checked) state.lostSwitches[bit] = !state.lostSwitches[bit];
    else state.bits[bit] = closed;
    byHand();
  },
});
at("flat").hidden = !switches.length;

const sliders = joints.map((joint, number) => {
  const [low, high] = joint.range;
  const slider = made("input", { type: "range", min: low, max: high, step: 1, id: `joint-${number}`, autocomplete: "off" });
  const lost = made("input", { type: "checkbox", autocomplete: "off" }), said = made("output", { htmlFor: slider.id });
  lost.setAttribute("aria-label", `${joint.name} is lost`);
  slider.addEventListener("input", () => {
    state.codes[number] = slider.valueAsNumber;
    state.lostJoints[number] = false;
    byHand();
  });
  lost.addEventListener("change", () => {
    state.lostJoints[number] = lost.checked;
    byHand();
  });
  const label = made("label", { htmlFor: slider.id, textContent: joint.name });
  at("joints").append(made("div", { className: "joint" }, label, slider, said, made("label", { className: "lost" }, lost, " lost")));
  return { slider, lost, said };
});
at("joints-section").hidden = !joints.length;

at("open-all").addEventListener("click", () => {
  state.bits.fill(false);
  state.lostSwitches.fill(false);
  state.lostJoints.fill(false);
  state.codes = joints.map((joint) => joint.typical);
  byHand();
});

/* ---- Prediction ---- */

const bars = data.classes.map((name) => {
  const bar = made("div", { className: "bar" }), behind = made("td", { className: "number" });
  const share = made("td", { className: "number" }), mark = made("span", { className: "mark" });
  const row = made("tr", {}, made("th", { scope: "row" }, mark, name), made("td", { className: "track" }, bar), behind, share);
  at("bars").append(row);
  return { row, bar, behind, share, mark };
});

function show() {
  const { bits, codes, lostSwitches, lostJoints } = state;
  const found = recogniser.recognise(bits, codes, lostSwitches, lostJoints);
  hand.setClosed(bits, lostSwitches);
  hand.setPose(joints.map((joint, number) => (lostJoints[number] ? null : valueOf(joint, codes[number]))));
  sliders.forEach(({ slider, lost, said }, number) => {
    slider.value = codes[number];
    lost.checked = Boolean(lostJoints[number]);
    const words = lostJoints[number] ? "lost" : inUnit(joints[number], valueOf(joints[number], codes[number]));
    said.textContent = words;
    slider.setAttribute("aria-valuetext", words);
  });
  const best = Math.max(...found.scores), seen = found.scores.filter((score) => best - score < 1e6);
  const span = Math.max(best - Math.min(...seen), 1);
  bars.forEach(({ row, bar, behind, share, mark }, number) => {
    const less = best - found.scores[number], first = number === found.number;
    row.classList.toggle("best", first);
    mark.textContent = first ? "▶ " : "";
    bar.style.width = `${less < 1e6 ? (100 * (span - less * 0.96)) / span : 0}%`;
    behind.textContent = first ? "0" : less < 1e6 ? `−${less}` : "not refused";
    share.textContent = percent(found.probabilities[number]);
  });
  const lost = [...lostSwitches, ...lostJoints].filter(Boolean).length;
  at("grasp").textContent = found.grasp;
  at("margin").textContent =
    `${percent(found.probabilities[found.number])}, ` +
    (found.margin < 1e6 ? `ahead by ${steps(found.margin)}` : "far ahead") +
    (lost ? `; degraded: ${lost} input${lost === 1 ? " is" : "s are"} lost, replaced by means` : "");
  return found;
}

function byHand() {
  at("truth").textContent = "";
  pause();
  show();
}

/* ---- Recorded rows ---- */

let rows = data.rows.map(([truth, mask, codes]) => ({
  truth: data.classes[truth] ?? null,
  bits: switches.map((_, bit) => ((parseInt(mask[bit >> 2], 16) >> (bit & 3)) & 1) === 1),
  codes,
  lostSwitches: switches.map(() => false),
  lostJoints: joints.map(() => false),
}));
let timer = null;
const slider = at("row");

function counted(title) {
  for (const row of rows) row.wrong = row.truth !== null && predictionOf(row) !== row.truth;
  const known = rows.filter((row) => row.truth !== null), right = known.filter((row) => !row.wrong).length;
  at("misread").disabled = right === known.length;
  at("rows-said").textContent = rows.length
    ? `${title}: ${rows.length} rows${known.length ? `, of ${known.length} with a known grasp ${right} are recognised` : ""}.`
    : `${title}: no rows.`;
  slider.max = Math.max(rows.length - 1, 0);
  slider.value = 0;
  for (const one of [slider, at("play"), at("before"), at("after")]) one.disabled = !rows.length;
}

const predictionOf = (row) => recogniser.recognise(row.bits, row.codes, row.lostSwitches, row.lostJoints).grasp;

function showRow() {
  const row = rows[slider.valueAsNumber];
  if (!row) return;
  for (const key of ["bits", "codes", "lostSwitches", "lostJoints"]) state[key] = row[key].slice();
  const { grasp } = show(), of = `Row ${slider.valueAsNumber + 1} of ${rows.length}`;
  at("truth").textContent = row.truth === null ? `${of}.` : `${of}: was ${row.truth}, ${grasp === row.truth ? "recognised" : "mistaken ✗"}.`;
}

function pause() {
  clearInterval(timer);
  timer = null;
  at("play").textContent = "Play";
}

slider.addEventListener("input", () => {
  pause();
  showRow();
});
for (const [id, step] of [["before", -1], ["after", 1]]) {
  at(id).addEventListener("click", () => {
    pause();
    slider.value = slider.valueAsNumber + step;
    showRow();
  });
}
function nextMisread() {
  pause();
  const first = at("truth").textContent ? slider.valueAsNumber + 1 : 0;
  const order = rows.map((_, step) => (first + step) % rows.length), found = order.find((number) => rows[number].wrong);
  if (found === undefined) return;
  slider.value = found;
  showRow();
}
at("misread").addEventListener("click", nextMisread);
addEventListener("keydown", (event) => {
  if (event.key === "n" && !event.ctrlKey && !event.altKey && !event.metaKey && !at("try").hidden) nextMisread();
});
at("play").addEventListener("click", () => {
  if (timer !== null) return pause();
  at("play").textContent = "Pause";
  timer = setInterval(() => {
    slider.value = (slider.valueAsNumber + 1) % rows.length;
    showRow();
  }, 400);
});

const LARGEST = 64 << 20, MOST = 200_000, LABELS = ["grasp", "grasp_type", "label", "type"];

function readTable(text, name) {
  const [head, ...body] = parseCsv(text);
  if (!head || !body.length) throw new Error(`${name} has no rows: give the columns in the first line and rows below`);
  if (body.length > MOST) throw new Error(`${name} has ${body.length} rows: the limit is ${MOST}`);
  const places = new Map(head.map((column, place) => [column.trim().replace(/^'(?=[=+\-@])/, ""), place]));
  const label = LABELS.find((each) => places.has(each)), missing = [];
  for (const input of [...switches.map((each) => each.taxel ?? each), ...joints]) {
    if (!places.has(input.name)) missing.push(input.name);
  }
  if (missing.length === switches.length + joints.length) throw new Error(`${name} has none of the build's columns, such as ${missing[0]}`);
  const found = body.map((cells) => {
    const value = (column) => {
      const cell = cells[places.get(column)]?.trim();
      return cell ? { true: 1, false: 0 }[cell.toLowerCase()] ?? (Number.isFinite(Number(cell)) ? Number(cell) : null) : null;
    };
    return { truth: label ? (cells[places.get(label)] ?? null) : null, ...readRow(data, value) };
  });
  const note = missing.length ? `; it lacks ${missing.length} column${missing.length === 1 ? "" : "s"}, such as ${missing[0]}, which are treated as lost` : "";
  return [found, note];
}

at("file").addEventListener("change", async ({ target: { files: [file] } }) => {
  if (!file) return;
  pause();
  try {
    if (file.size > LARGEST) throw new Error(`${file.name} has ${file.size} bytes: the limit is ${LARGEST}`);
    const [found, note] = readTable(await file.text(), file.name);
    rows = found;
    counted(`${file.name}${note}`);
    showRow();
  } catch (wrong) {
    at("rows-said").textContent = wrong.message;
  }
});

// For use from the browser's console.
globalThis.thenar = Object.freeze({
  recognise: (bits, codes, lostSwitches = [], lostJoints = []) => recogniser.recognise(bits, codes, lostSwitches, lostJoints),
});
counted("Recorded rows in this page");
show();
