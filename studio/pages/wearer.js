// The page Wearer: a few trials of a person, a build that is adapted to them, and the way back.
import { onSubmit } from "./choice.js";
import { openPage } from "./shell.js";
import { tag, typeStyles } from "./types.js";
import { $, fillTable, list, say, tell } from "./wire.js";

let begun = false; // whether this page has just begun to record
let awaited = false; // whether it has just asked to adapt

const ask = openPage({
  wearing: (message) => {
    const { wearer, why } = message;
    if (document.activeElement !== $("subject")) $("subject").value = wearer;
    tell("empty", why);
    $("with-build").hidden = Boolean(why);
    if (!why) show(message);
  },
  adapt: (result) => {
    $("result").hidden = false;
    say($("result-heading"), `Adapted: ${result.folder}, from ${result.total} trials`);
    say($("before"), result.before);
    say($("after"), result.after);
    list($("warnings"), result.warnings);
    const styles = typeStyles(result.types.map(([name]) => name));
    const rows = result.types.map(([name, ...counts]) => [tag(styles, name), ...counts]);
    fillTable("types", ["Type", "Trials", "Before", "After"], rows);
    if (awaited) $("result-heading").focus();
    awaited = false;
  },
  collecting: ({ adapts }) => {
    // The page Record leads through the trials, and comes back here.
    if (begun && adapts) location.href = "record.html";
  },
  station: ({ why }) => {
    if (why) say($("refused"), why);
  },
});

function show({ wearer, base, build, types, sets, counts = {}, notes = [], adapt = "", glove, record, id }) {
  say($("use"), build === base ? `${build}: that of everybody` : `${build}: adapted from ${base}`);
  tell("undo", build !== base && `Undo: use ${base} again`);
  $("undo").onclick = () => ask("use-build", { id });
  say($("plan"), glove ? `Two trials of each of ${types.length} types; three if you add one.` : "The project has no glove.toml: connect a glove first.");
  for (const one of $("record").elements) one.disabled = !glove;
  say($("record-command"), record);
  tell("no-sets", !sets.length && `no set holds only trials of ${wearer}`);
  list($("sets"), sets);
  const lacking = types.filter((type) => !counts[type]);
  const trials = Object.entries(counts).map(([type, count]) => `${type} ${count}`).join(", ");
  say($("counts"), trials && `Trials: ${trials}${lacking.length ? `; none of ${lacking.join(", ")}, which change as the others do` : ""}`);
  list($("notes"), notes);
  $("adapt").disabled = !sets.length;
  say($("adapt-command"), adapt);
}

onSubmit("who", () => ask("wearer", { name: $("subject").value }));
onSubmit("record", () => {
  begun = ask("wear", { name: $("type").value });
});
$("adapt").addEventListener("click", () => {
  awaited = ask("adapt");
});
