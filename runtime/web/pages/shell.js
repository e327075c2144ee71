// The frame of every page: the bar on top, the links to the other pages, and the connection to the server.
import { clock } from "./state.js";
import { connect, say } from "./wire.js";

const $ = (id) => document.getElementById(id);

/**
 * Fill the page's bar, and connect to its server.
 * @param {Object<string, function(object): void>} handlers as for `connect`; a page gets the topics that it handles
 * @returns {function(string, object=): boolean} ask(what, more): send a request; what is refused is said in #refused
 */
export function openPage(handlers) {
  let lasts; // until what is said of the glove is too old
  const bar = document.querySelector("header");
  const title = document.createElement("h1"), brand = document.createElement("span"), badges = document.createElement("p");
  brand.className = "brand";
  brand.textContent = "thenar";
  title.append(brand, " ", made("span", "name"));
  for (const id of ["wearer", "glove-state", "build-state", "link"]) badges.append(made("span", id, "badge"), " ");
  bar.append(title, badges, made("nav", "pages"));
  $("pages").setAttribute("aria-label", "Pages");
  for (const id of ["wearer", "glove-state", "build-state"]) $(id).hidden = true;
  link(false, "connecting");
  const send = connect({
    ...handlers,
    open: () => {
      link(true, `connected since ${clock(performance.now())}`);
      handlers.open?.();
    },
    closed: () => {
      link(false, `not connected since ${clock(performance.now())}`);
      clearTimeout(lasts);
      glove("warn", $("glove-state").hidden ? "" : "not known");
      handlers.closed?.();
    },
    shell: (message) => {
      show(message);
      handlers.shell?.(message);
    },
    glove: (message) => {
      const since = clock(performance.now());
      clearTimeout(lasts);
      if (message.lasts_s) lasts = setTimeout(() => glove("bad", `silent since ${since}`), 1000 * message.lasts_s);
      glove(message.is, message.words);
      handlers.glove?.(message);
    },
    refused: (message) => {
      if ($("refused")) say($("refused"), message.why);
      handlers.refused?.(message);
    },
  });
  return (what, more = {}) => {
    const sent = send({ do: what, ...more });
    if ($("refused")) say($("refused"), sent ? "" : "not connected");
    return sent;
  };
}

function made(kind, id, name = "") {
  const element = document.createElement(kind);
  element.id = id;
  element.className = name;
  return element;
}

function link(up, words) {
  $("link").dataset.is = up ? "good" : "bad";
  say($("link"), `page: ${words}`);
}

function glove(level, words) {
  $("glove-state").hidden = !words;
  $("glove-state").dataset.is = level;
  say($("glove-state"), `glove: ${words}`);
}

function show({ project, pages, wearer, build, rate }) {
  say($("name"), project);
  for (const [id, words] of [["wearer", wearer && `wearer: ${wearer}`], ["build-state", build && `build: ${build}${rate && `, ${rate}`}`]]) {
    $(id).hidden = !words;
    say($(id), words);
  }
  // The address of the first page may have no name: its module has.
  const here = new URL(document.querySelector("script[type=module]").src).pathname.slice(1).replace(".js", ".html");
  const links = pages.map(([file, title]) => {
    const found = document.createElement("a");
    found.href = file;
    found.textContent = title;
    if (file === here) found.setAttribute("aria-current", "page");
    return found;
  });
  // Links that stay keep the focus.
  if (String([...$("pages").children]) !== String(links)) $("pages").replaceChildren(...links);
  $("pages").hidden = links.length < 2;
}
