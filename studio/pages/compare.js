// The page Compare: two builds of the project on the same trials, and what one of them is exported as.
import { drawHand } from "./hand.js";
import { openPage } from "./shell.js";
import { tag, typeStyles } from "./types.js";
import { cell, list, say } from "./wire.js";

const $ = (id) => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg";
// Up: only b, down: only a; shapes differ as well as colours.
const SIGNS = { both: "M0-4L4 0L0 4L-4 0Z", a: "M-4-3H4L0 4Z", b: "M-4 3H4L0-4Z" };
const percent = (share) => (100 * share).toFixed(1);

let sets = []; // the project's sets, all of which are compared on unless some are unticked

const ask = openPage({
  open: () => {
    commands();
    comparison();
  },
  project: ({ builds, sets: named, state }) => {
    const ids = builds.map(({ id }) => id), current = builds.find(({ name }) => name === state.build)?.id ?? ids.at(-1);
    fill($("a"), builds, ids.find((id) => id !== current));
    fill($("b"), builds, current);
    fill($("build"), builds, current);
    listSets(named, state.aside);
    $("report").disabled = $("firmware").disabled = !builds.length;
    commands();
    comparison();
  },
  targets: ({ targets }) => {
    fill($("target"), targets.map(([id, help]) => ({ id, name: `${id}: ${help}` })), targets[0][0]);
    commands();
  },
  commands: ({ report, firmware }) => {
    say($("report-command"), report);
    say($("firmware-command"), firmware);
  },
  comparison: ({ command }) => say($("compare-command"), command),
  compare: (compared) => {
    if (String(compared.ids) === String(request())) show(compared);
  },
  exported: ({ said, address, name }) => {
    say($("exported"), said);
    $("download").hidden = false;
    const link = $("download").firstChild;
    link.href = address;
    link.download = name;
    say(link, `Save ${name}`);
    commands();
  },
  work: ({ done, total, what, why }) => {
    const busy = { compare: "comparing", report: "exporting", firmware: "writing firmware" }[what];
    say($("work"), why ?? (busy && done < total ? `${busy} …` : ""));
  },
});

/** Fill a menu with members; what was chosen stays if it is still there. */
function fill(menu, members, usual) {
  const before = menu.value, options = members.map(({ id, name }) => new Option(name, id));
  menu.replaceChildren(...options);
  menu.value = members.some(({ id }) => id === before) ? before : (usual ?? "");
}

function listSets(members, aside) {
  // Boxes that stay keep the focus.
  if (String(members.map(({ id }) => id)) === String(sets.map(({ id }) => id))) return;
  const unticked = new Set(sets.filter(({ box }) => !box.checked).map(({ id }) => id));
  const before = sets.map(({ id }) => id);
  sets = members.map(({ id, name }) => {
    const label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox";
    box.addEventListener("change", changed);
    box.checked = before.includes(id) ? !unticked.has(id) : !aside.includes(name);
    label.append(box, name);
    return { id, box, label };
  });
  $("sets").replaceChildren($("sets").firstElementChild, ...sets.map(({ label }) => label));
}

const request = () => [$("a").value, $("b").value, ...sets.filter(({ box }) => box.checked).map(({ id }) => id)];

/** Ask for the command that compares; what was compared before is another matter. */
function comparison() {
  $("compare").disabled = request().length < 3 || $("a").value === $("b").value;
  say($("compare-command"), "");
  if (!$("compare").disabled) ask("comparison", { ids: request() });
}

function commands() {
  if ($("build").value && $("target").value) ask("commands", { id: $("build").value, name: $("target").value });
}

/** Fill a table with rows of texts or elements, of which the first is the head of its row. */
function table(element, titles, rows) {
  const top = document.createElement("thead"), body = document.createElement("tbody");
  const line = (kind, parts) => {
    const made = document.createElement("tr");
    made.append(...parts.map((part, at) => {
      const place = cell(part === "" ? "td" : at ? kind : "th", "");
      place.append(part);
      return place;
    }));
    return made;
  };
  top.append(line("th", titles));
  for (const title of top.querySelectorAll("th")) title.scope = "col";
  body.append(...rows.map((parts) => line("td", parts)));
  element.replaceChildren(top, body);
}

const scan = (us) => (us === null ? "unknown" : us ? `${us.toFixed(0)} µs` : "none is read");
const points = (share) => `${share < 0 ? "−" : "+"}${percent(Math.abs(share))}`;

function show({ builds, hand, both, only, found, said, unused }) {
  $("result").hidden = false;
  say($("said"), said);
  list($("unused"), unused);
  const rows = [
    ["Recognised of these trials", ({ right, ends }) => `${percent(right / found.trials)} % [${ends.map(percent).join(", ")}]`],
    ["Sensors", (build) => build.sensors],
    ["Scan of switches and pads", (build) => scan(build.scan_us)],
    ["Tables", (build) => `${build.bytes.toLocaleString("en")} bytes`],
    ["Accuracy as compiled", (build) => build.stated],
    ...(builds[0].price === null ? [] : [["Price", ({ price }) => price.toFixed(2)]]),
  ];
  table($("both"), ["", ...builds.map(({ name }, at) => `${"ab"[at]}: ${name}`)], rows.map(([title, text]) => [title, ...builds.map(text)]));
  overlay(hand, { both, a: only[0], b: only[1] }, builds);
  const styles = typeStyles([...found.types.map(({ grasp }) => grasp), ...found.changed.flatMap(({ a, b }) => [a, b])]);
  const types = found.types.map(({ grasp, trials, a, b }) => [tag(styles, grasp), `${trials}`, `${a}`, `${b}`, points((b - a) / trials)]);
  table($("types"), ["Type", "Trials", "a right", "b right", "Points"], types);
  say($("changed-heading"), `Trials that changed: ${found.changed.length || "none"}; ${found.better} better, ${found.worse} worse with b`);
  const changed = found.changed.map((trial) => {
    const marked = [trial.a, trial.b].map((read) => {
      const made = tag(styles, read);
      if (read === trial.recorded) made.append(" (right)");
      made.dataset.is = read === trial.recorded ? "good" : "bad";
      return made;
    });
    return [linked(trial), tag(styles, trial.recorded), ...marked];
  });
  table($("changed"), ["Trial", "True type", "a", "b"], changed);
}

/** Return the name of a trial, as a link to it on the page Errors. */
function linked({ trial, subject, object, recorded }) {
  const link = document.createElement("a");
  link.textContent = `trial ${trial} of ${subject}, ${object}`;
  link.href = `errors.html#${encodeURIComponent(`${link.textContent}: ${recorded}`)}`;
  return link;
}

function sign(parent, kind, size) {
  const made = document.createElementNS(SVG, "path");
  made.setAttribute("d", SIGNS[kind]);
  made.setAttribute("transform", `scale(${size})`);
  made.classList.add("sign", kind);
  parent.append(made);
}

/** Draw one hand on which a sign says which build reads a sensor, and list all sensors by their signs. */
function overlay(hand, kept, builds) {
  const kinds = new Map(Object.entries(kept).flatMap(([kind, names]) => names.map((name) => [name, kind])));
  $("hand").toggleAttribute("hidden", !hand.switches.length);
  drawHand($("hand"), { ...hand, switches: hand.switches.map(({ bit, ...one }) => (kinds.has(one.name) ? { ...one, bit } : one)) });
  for (const spot of $("hand").querySelectorAll(".spot")) {
    const kind = kinds.get(spot.querySelector("title").textContent);
    if (kind) sign(spot, kind, hand.radius_mm / 2);
  }
  $("hand").setAttribute("aria-label", "The hand with the sensors of both builds, which the list names");
  const titles = { both: "both", a: `only a (${builds[0].name})`, b: `only b (${builds[1].name})` };
  const entries = Object.entries(kept).map(([kind, names]) => {
    const item = document.createElement("li"), picture = document.createElementNS(SVG, "svg");
    picture.setAttribute("viewBox", "-5 -5 10 10");
    picture.setAttribute("aria-hidden", "true");
    sign(picture, kind, 1);
    item.append(picture, `${titles[kind]}: ${names.length ? `${names.length}, ${names.join(", ")}` : "none"}`);
    return item;
  });
  $("legend").replaceChildren(...entries);
}

function changed() {
  $("result").hidden = true;
  comparison();
}

for (const id of ["a", "b"]) $(id).addEventListener("change", changed);
$("compare").addEventListener("click", () => {
  $("result").hidden = true;
  ask("compare", { ids: request() });
});
for (const name of ["report", "firmware"]) {
  $(name).addEventListener("click", () => ask(name, { id: $("build").value, name: $("target").value }));
}
for (const id of ["build", "target"]) $(id).addEventListener("change", commands);
