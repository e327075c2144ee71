// The page Compare: two builds of the project on the same trials, and what one of them is exported as.
import { drawHand } from "./hand.js";
import { openPage } from "./shell.js";
import { cell, say } from "./wire.js";

const $ = (id) => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg";
// Up: only b, down: only a; shapes differ as well as colours.
const SIGNS = { both: "M0-4L4 0L0 4L-4 0Z", a: "M-4-3H4L0 4Z", b: "M-4 3H4L0-4Z" };
const percent = (share) => (100 * share).toFixed(1);

let sets = []; // the project's sets, all of which are compared on unless some are unticked
let errors = ""; // the page that shows a trial, if there is one

const ask = openPage({
  open: () => commands(),
  shell: ({ pages }) => {
    errors = pages.map(([file]) => file).find((file) => file.startsWith("errors")) ?? "";
  },
  project: ({ builds, sets: named, state }) => {
    const ids = builds.map(({ id }) => id), current = builds.find(({ name }) => name === state.build)?.id ?? ids.at(-1);
    fill($("a"), builds, ids.find((id) => id !== current));
    fill($("b"), builds, current);
    fill($("build"), builds, current);
    listSets(named, state.aside);
    $("compare").disabled = builds.length < 2;
    $("report").disabled = $("firmware").disabled = !builds.length;
    commands();
  },
  targets: ({ targets }) => {
    fill($("target"), targets.map(([id, help]) => ({ id, name: `${id}: ${help}` })), targets[0][0]);
    commands();
  },
  commands: ({ report, firmware }) => {
    say($("report-command"), report);
    say($("firmware-command"), firmware);
  },
  compare: (compared) => {
    if (String(compared.ids.slice(0, 2)) === String([$("a").value, $("b").value])) show(compared);
  },
  exported: ({ said, address, name }) => {
    say($("exported"), said);
    $("download").hidden = !address;
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
  const unticked = new Set(sets.filter(({ box }) => !box.checked).map(({ id }) => id));
  const before = sets.map(({ id }) => id);
  sets = members.map(({ id, name }) => {
    const label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox";
    box.checked = before.includes(id) ? !unticked.has(id) : !aside.includes(name);
    label.append(box, name);
    return { id, box, label };
  });
  $("sets").replaceChildren($("sets").firstElementChild, ...sets.map(({ label }) => label));
}

function commands() {
  if ($("build").value && $("target").value) ask("commands", { id: $("build").value, name: $("target").value });
}

function table(element, head, rows) {
  const top = document.createElement("thead"), body = document.createElement("tbody");
  const line = (cells) => {
    const made = document.createElement("tr");
    made.append(...cells);
    return made;
  };
  const titles = head.map((text) => cell(text ? "th" : "td", text));
  for (const title of titles) if (title.scope) title.scope = "col";
  top.append(line(titles));
  body.append(...rows.map(([first, ...others]) => line([cell("th", first), ...others.map((one) => (one instanceof Node ? one : cell("td", one)))])));
  element.replaceChildren(top, body);
}

const scan = (us) => (us === null ? "unknown" : us ? `${us.toFixed(0)} µs` : "none is read");
const interval = ({ mean, low, high }) => `${percent(mean)} % [${percent(low)}, ${percent(high)}]`;

function show({ builds, hand, both, only, found, said }) {
  $("result").hidden = false;
  say($("said"), said);
  const rows = [
    ["Sensors", (build) => build.sensors],
    ["Scan of switches and pads", (build) => scan(build.scan_us)],
    ["Tables", (build) => `${build.bytes.toLocaleString("en")} bytes`],
    ["Accuracy as compiled", (build) => build.stated],
  ].map(([title, text]) => [title, ...builds.map(text)]);
  if (builds[0].price !== null) rows.push(["Price", ...builds.map(({ price }) => price.toFixed(2))]);
  if (found) rows.unshift(["Recognised of these trials", ...found.rates.map(interval)]);
  table($("both"), ["", ...builds.map(({ name }, at) => `${"ab"[at]}: ${name}`)], rows);
  overlay(hand, { both, a: only[0], b: only[1] }, builds);
  $("differences").hidden = !found;
  if (!found) return;
  const points = (a, b, count) => `${b >= a ? "+" : "−"}${percent(Math.abs(b - a) / count)}`;
  const types = found.by_type.map(([type, count, a, b]) => [type, String(count), `${a}`, `${b}`, points(a, b, count)]);
  table($("types"), ["Type", "Trials", "a right", "b right", "Points"], types);
  say($("changed-heading"), `Trials that changed: ${found.changed.length || "none"}`);
  const changed = found.changed.map(([trial, truth, a, b]) => {
    const marked = [a, b].map((read) => {
      const made = cell("td", read === truth ? `${read} (right)` : read);
      made.dataset.is = read === truth ? "good" : "bad";
      return made;
    });
    return [linked(trial), truth, ...marked];
  });
  table($("changed"), ["Trial", "True type", "a", "b"], changed);
}

/** Return the name of a trial, which leads to it where a page shows it. */
function linked(trial) {
  if (!errors) return `trial ${trial}`;
  const link = document.createElement("a");
  link.href = `${errors}#trial=${trial}`;
  link.textContent = `trial ${trial}`;
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

$("compare").addEventListener("click", () => {
  $("result").hidden = true;
  const used = sets.filter(({ box }) => box.checked).map(({ id }) => id);
  if (sets.length && !used.length) say($("refused"), "choose recordings");
  else ask("compare", { ids: [$("a").value, $("b").value, ...used] });
});
for (const name of ["report", "firmware"]) {
  $(name).addEventListener("click", () => ask(name, { id: $("build").value, name: $("target").value }));
}
for (const id of ["build", "target"]) $(id).addEventListener("change", commands);
