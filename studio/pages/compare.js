// The page Compare: two builds of the project on the same trials, and the report of b.
import { interval, listBoxes, points, scanTime } from "./choice.js";
import { draw, drawHand } from "./hand.js";
import { openPage } from "./shell.js";
import { tag, typeStyles } from "./types.js";
import { $, fillMenu, fillTable, list, make, say } from "./wire.js";

const SIGNS = { both: "ab", a: "a", b: "b" };

const ask = openPage({
  project: ({ builds, sets, state }) => {
    const ids = builds.map(({ id }) => id), current = builds.find(({ name }) => name === state.build)?.id ?? ids.at(-1);
    fillMenu($("a"), builds, ids.find((id) => id !== current) ?? current);
    fillMenu($("b"), builds, current);
    $("no-build").hidden = builds.length > 0;
    // They are compared on all sets in use unless others are ticked.
    listBoxes($("sets"), sets.map(({ id, name }) => ({ id, text: name, checked: !state.aside.includes(name) })), changed);
    $("compare").disabled = $("report").disabled = !builds.length;
    commands();
  },
  commands: ({ report, compare }) => {
    say($("report-command"), report);
    say($("compare-command"), compare);
    $("compare").disabled = !compare;
  },
  compare: (compared) => {
    if (String(compared.ids) === String(request())) show(compared);
  },
  report: ({ said, address, name }) => {
    say($("exported"), said);
    $("download").replaceChildren(make("a", { href: address, download: name }, `Save ${name}`));
    commands();
  },
});

const request = () => [$("a"), $("b"), ...$("sets").querySelectorAll(":checked")].map(({ value }) => value);

/** Ask for the commands that do what the buttons do. */
function commands() {
  if ($("b").value) ask("commands", { id: $("b").value, ids: request() });
}

function show({ builds, hand, kept, found, said, unused }) {
  $("result").hidden = false;
  say($("said"), said);
  list($("unused"), unused);
  const rows = [
    ["Recognised of these trials", ({ right, ends: [low, high] }) => interval({ mean: right / found.trials, low, high })],
    ["Sensors", (build) => build.sensors],
    ["Scan of switches and pads", (build) => scanTime(build.scan_us)],
    ["Tables", (build) => `${build.bytes.toLocaleString("en")} bytes`],
    ["Accuracy as compiled", (build) => build.stated],
    ...(builds[0].price === null ? [] : [["Price", ({ price }) => price.toFixed(2)]]),
  ];
  fillTable("both", ["", `a: ${builds[0].name}`, `b: ${builds[1].name}`], rows.map(([title, text]) => [title, ...builds.map(text)]));
  overlay(hand, kept, builds);
  const styles = typeStyles([...found.types.map(({ grasp }) => grasp), ...found.changed.flatMap(({ a, b }) => [a, b])]);
  const types = found.types.map(({ grasp, trials, a, b }) => [tag(styles, grasp), trials, a, b, points((b - a) / trials)]);
  fillTable("types", ["Type", "Trials", "a right", "b right", "Points"], types);
  say($("changed-heading"), `Trials that changed: ${found.changed.length || "none"}; ${found.better} better, ${found.worse} worse with b`);
  fillTable("changed", ["Trial", "True type", "a", "b"], found.changed.map((trial) => {
    const marked = [trial.a, trial.b].map((read) => {
      const right = read === trial.recorded;
      return make("span", { "data-is": right ? "good" : "bad" }, tag(styles, read), right ? " (right)" : "");
    });
    return [linked(trial), tag(styles, trial.recorded), ...marked];
  }));
}

/** Return the name of a trial, as a link to it on the page Errors. */
function linked({ trial, subject, object, recorded }) {
  const words = `trial ${trial} of ${subject}, ${object}`;
  return make("a", { href: `errors.html#${encodeURIComponent(`${words}: ${recorded}`)}` }, words);
}

/** Draw one hand on which letters say which build reads a sensor, and list all sensors by their builds. */
function overlay(hand, kept, [a, b]) {
  const kinds = new Map(Object.entries(kept).flatMap(([kind, names]) => names.map((name) => [name, kind])));
  $("hand").toggleAttribute("hidden", !hand.switches.length);
  const switches = hand.switches.map(({ bit, ...one }) => (kinds.has(one.name) ? { ...one, bit } : one));
  for (const [name, spot] of drawHand($("hand"), { ...hand, switches }).spots) {
    spot.append(draw("text", { class: `sign ${kinds.get(name)} middle` }, SIGNS[kinds.get(name)]));
  }
  $("hand").setAttribute("aria-label", "The hand with the sensors of both builds, which the list names");
  const titles = { both: "both", a: `only a (${a.name})`, b: `only b (${b.name})` };
  list($("legend"), Object.entries(kept).map(([kind, names]) => {
    return `${titles[kind]}: ${names.length ? `${names.length}, ${names.join(", ")}` : "none"}`;
  }));
}

/** What was compared before is another matter. */
function changed() {
  $("result").hidden = true;
  commands();
}

for (const id of ["a", "b"]) $(id).addEventListener("change", changed);
$("compare").addEventListener("click", () => {
  $("result").hidden = true;
  ask("compare", { ids: request() });
});
$("report").addEventListener("click", () => ask("report", { id: $("b").value }));
