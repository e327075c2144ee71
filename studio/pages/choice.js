// What pages of the studio share: the sensors that are in use, boxes, keys, and what was trained.
import { $, box, button, list, make, say, tell } from "./wire.js";

// The sensors are those of all pages in this tab; a reload and a restart of the server keep them.
const KEY = "thenar.sensors";

/** Return the numbers of the chosen sensors; none if they were chosen among other sensors than these. */
export function storedChoice(sensors) {
  const { names, chosen } = JSON.parse(sessionStorage.getItem(KEY) ?? "{}");
  return String(names) === String(sensors.map(({ name }) => name)) ? chosen : [];
}

/** Keep the numbers of the chosen sensors. */
export function storeChoice(sensors, chosen) {
  sessionStorage.setItem(KEY, JSON.stringify({ names: sensors.map(({ name }) => name), chosen }));
}

/** Return an accuracy with its interval, in percent. */
export function interval({ mean, low, high }) {
  return `${percent(mean)} % [${percent(low)}, ${percent(high)}]`;
}

export function percent(share) {
  return (100 * share).toFixed(1);
}

/** Return a difference of shares in points, with its sign. */
export function points(share) {
  return `${share < 0 ? "−" : "+"}${percent(Math.abs(share))}`;
}

/** Return the time of a scan of sensors, in words. */
export function scanTime(us) {
  if (us === null) return "unknown: they are more than the chips of one bus read";
  return us ? `${us.toFixed(0)} µs on the wire` : "none is read";
}

/**
 * List members {id, text, checked} as boxes, whose values are the ids. Boxes that stay keep the focus and what a user
 * ticked.
 */
export function listBoxes(element, members, changed) {
  const before = new Map([...element.children].map((label) => [`${label.control.value} ${label.textContent}`, label]));
  const labels = members.map(({ id, text, checked }) => before.get(`${id} ${text}`) ?? box(text, changed, { value: id, checked }));
  if (labels.length !== before.size || labels.some((label, at) => label !== element.children[at])) element.replaceChildren(...labels);
}

/**
 * Show the keys that count now as buttons, the usual one first, with their letters if they have some.
 * @returns {?HTMLButtonElement} the first one, or null if the keys are those of before
 */
export function showKeys(keys, ask, letters = {}) {
  const words = Object.entries(keys), said = words.map(String).join();
  if (said === ($("keys").dataset.keys ?? "")) return null;
  $("keys").dataset.keys = said;
  const buttons = words.map(([key, what], at) => {
    const made = button(what, () => ask("key", { name: key }), { class: at ? "plain" : "", "data-key": key });
    if (letters[key]) made.append(" ", make("kbd", {}, letters[key]));
    return made;
  });
  $("keys").replaceChildren(...buttons);
  return buttons[0] ?? null;
}

/** Let a form do this when it is sent, instead of loading another page. */
export function onSubmit(id, act) {
  $(id).addEventListener("submit", (event) => {
    event.preventDefault();
    act();
  });
}

/** Show the last edit of trials, which can be undone. */
export function showLastEdit(words) {
  $("undo").disabled = !words;
  say($("edited"), words && `Last edit: ${words}.`);
}

/** Show what was trained. */
export function trained({ folder, facts }) {
  tell("build-heading", `Trained: ${folder}`);
  list($("facts"), facts);
}
