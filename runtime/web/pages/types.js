// A colour and a short code for each type, the same on all pages.
import { make } from "./wire.js";

// Okabe and Ito's colours, which colour-blind people can distinguish, and darker and paler ones for further types. The
// ink on the first ones is black, on the others white.
const COLOURS = [
  "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#8a8a8a", "#b5dcf5", "#a3c585",
  "#0072b2", "#003f66", "#8f6300", "#00543d", "#7a3d60", "#7a2d00", "#4b4f9e",
];
const PALE = 9;
const NO_TYPES = { none: "–", unknown: "?" };

/**
 * Return the style of each type, by its name: a `code` of one to three letters that no other has, whatever their case;
 * a `colour`, which another has only if there are more than 16; and the `ink` to write on it. None and unknown are no
 * types: their code is a sign, and they have no colour. The order of the names has no effect.
 */
export function typeStyles(names) {
  const styles = new Map(), codes = new Set(), colours = new Set();
  for (const name of [...new Set(names)].sort()) {
    if (Object.hasOwn(NO_TYPES, name)) {
      styles.set(name, { code: NO_TYPES[name], colour: null, ink: null });
      continue;
    }
    const code = candidates(name).find((one) => !codes.has(one.toLowerCase()));
    codes.add(code.toLowerCase());
    if (colours.size === COLOURS.length) colours.clear();
    // Another type changes few of them.
    let at = [...name].reduce((sum, letter) => (31 * sum + letter.codePointAt(0)) % 65_521, 7) % COLOURS.length;
    while (colours.has(at)) at = (at + 1) % COLOURS.length;
    colours.add(at);
    styles.set(name, { code, colour: COLOURS[at], ink: at < PALE ? "#000000" : "#ffffff" });
  }
  return styles;
}

/** Return an element that shows a type's code on its colour, for a place next to its name. */
export function chip({ code, colour, ink }) {
  const element = make("span", { class: "chip", "aria-hidden": "true" }, code);
  if (colour) [element.style.background, element.style.color] = [colour, ink];
  return element;
}

/** Return an element with the code of a type, and its name where that differs. */
export function tag(styles, name) {
  const style = styles.get(name), same = style.code === name;
  return make("span", {}, chip(style), same ? "" : " ", make("span", { class: same ? "unseen" : "" }, name));
}

// The best first: a short name itself, the initials of several words, two letters, three, a letter with a number.
function candidates(name) {
  const letters = name.match(/[\p{L}\p{N}]/gu) ?? ["T"], [first, ...rest] = letters;
  const words = name.match(/[\p{L}\p{N}]+/gu) ?? [];
  const initials = words.map(([letter]) => letter).slice(0, 3).join("");
  const numbers = Array.from({ length: 36 ** 2 }, (_, number) => first + number.toString(36));
  return [
    ...(words.length === 1 && letters.length <= 3 ? [letters.join("")] : []),
    ...(words.length > 1 ? [initials.toUpperCase()] : []),
    ...rest.map((letter) => first.toUpperCase() + letter),
    ...rest.slice(1).map((letter) => first.toUpperCase() + rest[0] + letter),
    ...numbers,
  ];
}
