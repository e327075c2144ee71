// Keys that count now, as buttons.

/**
 * Show keys as buttons, unless they are there already; the first is the main one.
 * @param {HTMLElement} element the row of buttons
 * @param {Object<string, string>} keys what each key does
 * @param {function(string): void} press called with the key of a button that is pressed
 * @param {Object<string, string>} letters of the keyboard, shown on the buttons
 * @returns {HTMLButtonElement | null} the first button, if it is new
 */
export function showKeys(element, keys, press, letters = {}) {
  const words = JSON.stringify(keys);
  if (words === element.dataset.keys) return null;
  element.dataset.keys = words;
  const buttons = Object.entries(keys).map(([key, what], at) => {
    const button = document.createElement("button");
    button.type = "button";
    button.className = at ? "plain" : "";
    button.dataset.key = key;
    button.append(what);
    if (letters[key]) button.append(Object.assign(document.createElement("kbd"), { textContent: letters[key] }));
    button.addEventListener("click", () => press(key));
    return button;
  });
  element.replaceChildren(...buttons);
  return buttons[0] ?? null;
}
