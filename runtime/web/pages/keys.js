// The buttons of the actions available now, also by keys: the same letters as on the terminal.
import { say } from "./wire.js";

/**
 * Make the buttons in `bar` and the keys of the page perform the offered actions.
 * @param {HTMLElement} bar
 * @param {Object<string, string>} letters by action: "Enter", or a letter
 * @param {function(string): void} press
 * @returns {function(Object<string, string>): void} offer(the available actions: words by action)
 */
export function keys(bar, letters, press) {
  let offered = {};
  const buttons = new Map();
  for (const [key, letter] of Object.entries(letters)) {
    const button = document.createElement("button");
    button.type = "button";
    button.id = `key-${key}`;
    button.hidden = true;
    button.className = letter === "Enter" ? "" : "plain";
    const words = document.createElement("span"), hint = document.createElement("kbd");
    hint.textContent = letter;
    button.setAttribute("aria-keyshortcuts", letter);
    button.append(words, " ", hint);
    button.addEventListener("click", () => press(key));
    bar.append(button);
    buttons.set(key, { button, words });
  }

  document.addEventListener("keydown", (event) => {
    if (event.repeat || event.ctrlKey || event.altKey || event.metaKey || document.querySelector("dialog[open]")) return;
    const key = Object.keys(letters).find((one) => letters[one].toLowerCase() === event.key.toLowerCase());
    // Enter on a button presses that button.
    if (key === undefined || offered[key] === undefined || (event.key === "Enter" && event.target.closest("button"))) return;
    event.preventDefault();
    press(key);
  });

  return (now) => {
    offered = now;
    for (const [key, { button, words }] of buttons) {
      const gone = offered[key] === undefined;
      // Keyboard focus stays among the buttons.
      if (gone && button === document.activeElement) bar.focus();
      button.hidden = gone;
      if (!gone) say(words, offered[key]);
    }
  };
}

/** Ask for confirmation in a dialog before leaving. */
export function leaving(dialog, leave, stay, then) {
  leave.addEventListener("click", () => {
    dialog.close();
    then();
  });
  stay.addEventListener("click", () => dialog.close());
}
