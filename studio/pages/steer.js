// Controls of the page Live in the studio: the build in use, the run, and recordings.
import { say } from "./wire.js";

export class Steer {
  #ids;
  #ask;
  #parts = {};
  #paths = {};
  #members = null;
  #doing = "";
  #ended = "";
  #lacking = "";
  #unread = "";

  /** @param {string[]} ids the recording and builds in the address of the page; none: it shows the run */
  constructor(section, ids, ask) {
    [this.#ids, this.#ask] = [ids, ask];
    section.hidden = false;
    section.append(made("h2", "steer-heading", ids.length ? "Recording" : "Run"));
    const sides = section.appendChild(document.createElement("div"));
    sides.className = "sides";
    const [left, right] = [0, 1].map(() => sides.appendChild(document.createElement("div")));
    const run = this.#row(left), replay = this.#row(right);
    if (ids.length) {
      const back = made("a", "back", "Back to the run");
      back.href = "live.html";
      run.append(back);
    } else {
      this.#choice(run, "build", "Build in use", (id) => ask("use-build", { id }));
      this.#button(run, "run", "Start", () => ask(this.#doing === "live" ? "halt" : "run"));
      this.#parts.doing = made("p", "doing");
      this.#parts.doing.setAttribute("role", "status");
      left.append(this.#command("run"), this.#parts.doing);
    }
    this.#choice(replay, "recording", "Recording", () => this.#show());
    this.#choice(replay, "first", "Build", () => this.#show());
    this.#choice(replay, "second", "Compare with", () => this.#show());
    this.#button(replay, "open", "Show", () => location.assign(`live.html?${this.#chosen.map((id) => `id=${id}`).join("&")}`));
    right.append(this.#command("open"));
  }

  /** Take the recordings and builds of the project. */
  project({ recordings, builds, state }) {
    this.#members = { recordings, builds };
    const used = builds.find(({ name }) => name === state.build)?.id ?? "", [recording, first = used, second = ""] = this.#ids;
    if (this.#parts.build) fill(this.#parts.build, [...(used ? [] : [{ id: "", name: "none" }]), ...builds], used);
    fill(this.#parts.recording, recordings, this.#parts.recording.value || recording);
    fill(this.#parts.first, builds, this.#parts.first.value || first);
    fill(this.#parts.second, [{ id: "", name: "no other" }, ...builds], this.#parts.second.value || second);
    this.#show();
  }

  /** Take the commands. */
  commands({ paths, run, why, unread }) {
    [this.#paths, this.#lacking, this.#unread] = [paths, why, unread];
    if (this.#parts.run) say(this.#parts["run-command"], run);
    this.#show();
  }

  /** Take what uses the glove, and why the last run ended. */
  station({ doing, why }) {
    [this.#doing, this.#ended] = [doing, why];
    this.#show();
  }

  get #chosen() {
    return ["recording", "first", "second"].map((name) => this.#parts[name].value).filter(Boolean);
  }

  #show() {
    const [recording, ...builds] = this.#chosen.map((id) => this.#paths[id]), enough = Boolean(recording && builds.length && this.#members?.recordings.length);
    this.#parts.open.disabled = !enough;
    if (this.#parts.run) {
      const other = this.#doing && this.#doing !== "live" ? `The glove is in use: ${this.#doing}. Start ends that.` : "";
      say(this.#parts.run, this.#doing === "live" ? "Stop" : "Start");
      this.#parts.run.disabled = Boolean(this.#lacking);
      say(this.#parts.doing, [this.#ended, this.#lacking, this.#unread, other].filter(Boolean).join(" "));
    }
    say(this.#parts["open-command"], enough ? `thenar monitor ${recording}${builds.map((build) => ` --build ${build}`).join("")}` : "");
  }

  #row(section) {
    const row = section.appendChild(document.createElement("div"));
    row.className = "row";
    return row;
  }

  #choice(row, name, title, changed) {
    const label = document.createElement("label"), select = made("select", `steer-${name}`);
    label.append(title, " ", select);
    select.addEventListener("change", () => changed(select.value));
    row.append(label);
    this.#parts[name] = select;
  }

  #button(row, name, title, press) {
    const button = made("button", `steer-${name}`, title);
    button.type = "button";
    button.addEventListener("click", press);
    row.append(button);
    this.#parts[name] = button;
  }

  #command(name) {
    const command = made("code", `${name}-command`);
    this.#parts[`${name}-command`] = command;
    return command;
  }
}

function made(kind, id, text = "") {
  const element = document.createElement(kind);
  element.id = id;
  element.textContent = text;
  return element;
}

function fill(select, members, value) {
  const names = members.map(({ id, name }) => `${id} ${name}`).join("\n");
  if (select.dataset.names !== names) {
    select.dataset.names = names;
    select.replaceChildren(...members.map(({ id, name }) => new Option(name, id)));
  }
  if (members.some(({ id }) => id === value)) select.value = value;
}
