// Parts of every page: elements, texts, tables and menus, and when something is painted.

export const $ = (id) => document.getElementById(id);

/** Return the time of day, now or of a moment in milliseconds since 1970: "10:24:07". */
export const clock = (ms = Date.now()) => new Date(ms).toTimeString().slice(0, 8);

/** Return a new element with these properties or attributes, and texts and elements in it. */
export function make(kind, settings = {}, ...children) {
  const element = document.createElement(kind);
  for (const [name, value] of Object.entries(settings)) {
    if (name in element) element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

/** Return a button. */
export function button(text, onclick, settings = {}) {
  return make("button", { type: "button", onclick, ...settings }, text);
}

/** Return a box to tick: its label, whose `control` is the box. */
export function box(text, onchange, settings = {}) {
  return make("label", {}, make("input", { type: "checkbox", onchange, ...settings }), text);
}

/** Set the text of an element if it differs: unchanged text is not read out again. */
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Say something in the element with this id, which is there only while there is something to say. */
export function tell(id, text) {
  $(id).hidden = !text;
  say($(id), text || "");
}

/** Fill a list, changing only the entries that differ. */
export function list(element, texts) {
  while (element.children.length > texts.length) element.lastChild.remove();
  texts.forEach((text, at) => say(element.children[at] ?? element.appendChild(make("li")), text));
}

/**
 * Make the table in the element with the id "<id>-table": its heads, and a body with this id, whose rows are texts and
 * elements, of which the first is the head of its row.
 */
export function fillTable(id, titles, rows) {
  const heads = titles.map((title) => (title === "" ? make("td") : make("th", { scope: "col" }, title)));
  const lines = rows.map(([title, ...rest]) => {
    return make("tr", {}, make("th", { scope: "row" }, title), ...rest.map((one) => make("td", {}, one)));
  });
  $(`${id}-table`).replaceChildren(make("table", {}, make("thead", {}, make("tr", {}, ...heads)), make("tbody", { id }, ...lines)));
}

/**
 * Fill a menu with members {id, name}: what was chosen stays if it is still there, or else it is `usual`. A menu in a
 * label is not shown without members.
 */
export function fillMenu(menu, members, usual = "") {
  const before = menu.options.length ? menu.value : usual, ids = members.map(({ id }) => id);
  const options = members.map(({ id, name }) => new Option(name, id));
  const words = (some) => some.map(({ value, text }) => `${value} ${text}`).join("\n");
  // A menu that is open stays open.
  if (words(options) !== words([...menu.options])) menu.replaceChildren(...options);
  menu.value = ids.includes(before) ? before : usual;
  if (menu.parentElement.matches("label")) menu.parentElement.hidden = !members.length;
}

export const WORDS_MS = 200; // numbers and words change five times a second at most, so that they can be read

/**
 * Return the function that lets `paint` run in the next frame of the screen, but not again within `ms` milliseconds: of
 * calls that come sooner, the last one counts. So all that comes at one time is painted in one frame.
 * @returns {function(boolean=): void} `atOnce` is in the next frame in any case
 */
export function paced(paint, ms = 0) {
  let asked = false, last = -Infinity, timer = null;
  return function ask(atOnce = false) {
    const now = performance.now();
    if (asked) return;
    clearTimeout(timer);
    if (!atOnce && now - last < ms) {
      timer = setTimeout(ask, ms);
      return;
    }
    [asked, last] = [true, now];
    requestAnimationFrame(() => {
      asked = false;
      paint();
    });
  };
}
