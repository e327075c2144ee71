// Controls of the page Live in the studio: the build in use, the run, and recordings.
import { $, button, fillMenu, make, say, tell } from "./wire.js";

export class Steer {
  #ids;
  #commands = { paths: {} };
  #station = { doing: "" };

  /** @param {string[]} ids the recording and builds in the address of the page; none: it shows the run */
  constructor(section, ids, ask) {
    this.#ids = ids;
    const menu = (name, title, changed) => make("label", {}, `${title} `, make("select", { id: `steer-${name}`, onchange: changed }));
    const show = () => this.#show(), open = () => location.assign(`live.html?${this.#chosen.map((id) => `id=${id}`).join("&")}`);
    const run = [
      menu("build", "Build in use", ({ target }) => ask("use-build", { id: target.value })),
      button("Start", () => ask(this.#station.doing === "live" ? "halt" : "run"), { id: "steer-run" }),
    ];
    const replay = [
      menu("recording", "Recording", show),
      menu("first", "Build", show),
      menu("second", "Compare with", show),
      button("Show", open, { id: "steer-open" }),
    ];
    const back = make("a", { id: "back", href: "live.html" }, "Back to the run");
    const sides = [
      make("div", {}, make("div", { class: "row" }, ...(ids.length ? [back] : run)), make("code", { id: "run-command" })),
      make("div", {}, make("div", { class: "row" }, ...replay), make("code", { id: "open-command" })),
    ];
    sides[0].append(make("p", { id: "doing", role: "status" }));
    sides[1].append(make("p", { id: "lacking" }));
    section.append(make("h2", { id: "steer-heading" }, ids.length ? "Recording" : "Run"), make("div", { class: "columns" }, ...sides));
    section.hidden = false;
  }

  /** Take the recordings and builds of the project. */
  project({ recordings, builds, state }) {
    const used = builds.find(({ name }) => name === state.build)?.id ?? "", [recording, first = used, second = ""] = this.#ids;
    if ($("steer-build")) {
      fillMenu($("steer-build"), builds.length && !used ? [{ id: "", name: "none" }, ...builds] : builds);
      $("steer-build").value = used;
    }
    fillMenu($("steer-recording"), recordings, recording ?? recordings[0]?.id);
    fillMenu($("steer-first"), builds, first || builds[0]?.id);
    fillMenu($("steer-second"), builds.length ? [{ id: "", name: "no other" }, ...builds] : [], second);
    const lacks = [
      builds.length ? "" : "The project has no build yet: train one on Choose or Record.",
      recordings.length ? "" : "The project has no recording yet: make one on Record.",
    ];
    tell("lacking", lacks.filter(Boolean).join(" "));
    this.#show();
  }

  /** Take the commands. */
  commands(commands) {
    this.#commands = commands;
    this.#show();
  }

  /** Take what uses the glove, and why the last run ended. */
  station(station) {
    this.#station = station;
    this.#show();
  }

  get #chosen() {
    return ["recording", "first", "second"].map((name) => $(`steer-${name}`).value).filter(Boolean);
  }

  #show() {
    const { paths, run, why, unread } = this.#commands, { doing, why: ended } = this.#station;
    const [recording, ...builds] = this.#chosen.map((id) => paths[id]);
    const enough = Boolean(recording && builds.length && $("steer-recording").value);
    $("steer-open").disabled = !enough;
    say($("open-command"), enough ? `thenar monitor ${recording}${builds.map((build) => ` --build ${build}`).join("")}` : "");
    if (!$("steer-run")) return;
    const other = doing && doing !== "live" ? `The glove is in use: ${doing}.${doing === "recording" ? "" : " Start ends that."}` : "";
    say($("steer-run"), doing === "live" ? "Stop" : "Start");
    $("steer-run").disabled = Boolean(why);
    say($("run-command"), run ?? "");
    say($("doing"), [ended, why, unread, other].filter(Boolean).join(" "));
  }
}
