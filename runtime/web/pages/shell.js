// The frame of every page: the bar on top, the links to the other pages, the connection to the server, its work, and
// what it refuses.
import { $, button, clock, make, say, tell } from "./wire.js";

const FIRST_MS = 250, LONGEST_MS = 5000; // before it connects again

// What the server does, in words.
const WORK = {
  reading: "reading", measure: "measuring", curve: "measuring the curve", train: "training", adapt: "adapting",
  compare: "comparing", report: "exporting",
};

/**
 * Make the page's bar, and connect to its server, again and again.
 * @param {Object<string, function(object): void>} handlers by topic: a page gets those that it handles; "open" and
 * "closed" are events of the connection itself
 * @returns {function(string, object=): boolean} ask(what, more): send a request, unless there is no connection; what is
 * refused is said in #refused
 */
export function openPage(handlers) {
  let socket, wait = FIRST_MS, lasts; // until what is said of the glove is too old
  const badges = ["wearer", "glove-state", "build-state", "link"].map((id) => make("span", { id, class: "badge", hidden: true }));
  const title = make("h1", {}, make("span", { class: "brand" }, "thenar"), " ", make("span", { id: "name" }));
  const pages = make("nav", { id: "pages", "aria-label": "Pages" });
  document.head.append(make("link", { rel: "icon", href: "icon.svg" }));
  const cancel = button("Cancel", () => ask("cancel"), { id: "cancel", class: "plain", hidden: true });
  const busy = make("p", { class: "row" }, make("span", { id: "work" }), cancel);
  const refused = make("p", { id: "refused", role: "alert" });
  document.body.prepend(make("header", {}, title, make("p", { class: "row" }, ...badges), pages, busy), refused);
  badge("link", "bad", "page: connecting");
  const own = {
    work,
    shell: show,
    open: () => badge("link", "good", `page: connected since ${clock()}`),
    closed: () => {
      badge("link", "bad", `page: not connected since ${clock()}`);
      clearTimeout(lasts);
      if (!$("glove-state").hidden) badge("glove-state", "warn", "glove: not known");
    },
    glove: ({ is, words, lasts_s: until }) => {
      const since = clock();
      clearTimeout(lasts);
      if (until) lasts = setTimeout(() => badge("glove-state", "bad", `glove: silent since ${since}`), 1000 * until);
      badge("glove-state", is, words && `glove: ${words}`);
    },
    refused: ({ why }) => say(refused, why),
  };
  const take = (message) => [own, handlers].forEach((some) => some[message.topic]?.(message));
  const topics = new Set([own, handlers].flatMap(Object.keys));
  function open() {
    socket = new WebSocket(new URL(`/live?topics=${[...topics]}`, location.href.replace("http", "ws")));
    socket.addEventListener("open", () => {
      wait = FIRST_MS;
      take({ topic: "open" });
    });
    socket.addEventListener("message", (event) => take(JSON.parse(event.data)));
    socket.addEventListener("close", () => {
      take({ topic: "closed" });
      setTimeout(open, wait);
      wait = Math.min(2 * wait, LONGEST_MS);
    });
  }
  function ask(what, more = {}) {
    const up = socket.readyState === WebSocket.OPEN;
    say(refused, up ? "" : "not connected");
    if (up) socket.send(JSON.stringify({ do: what, ...more }));
    return up;
  }
  open();
  return ask;
}

function badge(id, level, words) {
  $(id).dataset.is = level;
  tell(id, words);
}

function show({ project, pages, wearer, build, rate }) {
  say($("name"), project);
  tell("wearer", wearer && `wearer: ${wearer}`);
  tell("build-state", build && `build: ${build}${rate && `, ${rate}`}`);
  // The address of the first page may have no name: its module has.
  const here = new URL(document.querySelector("script[type=module]").src).pathname.slice(1).replace(".js", ".html");
  const links = pages.map(([href, title]) => make("a", { href, ...(href === here ? { "aria-current": "page" } : {}) }, title));
  // Links that stay keep the focus.
  if (String([...$("pages").children]) !== String(links)) $("pages").replaceChildren(...links);
  $("pages").hidden = links.length < 2;
}

let working = null; // what is done now, and when it will be finished

function work({ done, total, what, why, left_s: left }) {
  working = done < total ? { what, share: done / total, end: left == null ? null : performance.now() + 1000 * left } : null;
  $("work").role = "status"; // a server without work has nothing there to be read out
  $("cancel").hidden = !working || what === "reading";
  if (working) countDown();
  else say($("work"), why ?? "");
}

/** Say how far the work is, and how much longer it takes. */
function countDown() {
  const { what, share, end } = working, left = end === null ? null : (end - performance.now()) / 1000;
  const time = left === null ? "" : left > 1 ? `, about ${duration(left)} left` : ", any moment now";
  say($("work"), `${WORK[what] ?? what}: ${Math.round(100 * share)} %${time}`);
}

setInterval(() => working && countDown(), 1000);

/** Return a duration in words. */
function duration(seconds) {
  if (seconds < 10) return `${Math.max(1, Math.round(seconds))} s`;
  return seconds < 100 ? `${5 * Math.round(seconds / 5)} s` : `${Math.round(seconds / 60)} min`;
}
