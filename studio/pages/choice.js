// The sensors that are in use, on all pages of the studio in this tab; a reload and a restart of the server keep them.
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

/** Return a button with this text. */
export function button(text, press) {
  const made = document.createElement("button");
  made.type = "button";
  made.textContent = text;
  made.addEventListener("click", press);
  return made;
}
