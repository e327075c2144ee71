// The WebSocket of a page: every message to the handler of its topic; it reconnects automatically. And texts on the page.

const FIRST_MS = 250;
const LONGEST_MS = 5000;

/**
 * Connect to the server of this page.
 * @param {Object<string, function(object): void>} handlers by topic; "open" and "closed" are events of the connection itself;
 * the server sends these topics
 * @returns {function(object): boolean} send({do: ..., ...}), which returns false while there is no connection
 */
export function connect(handlers) {
  let socket = null;
  let wait = FIRST_MS;

  function open() {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    socket = new WebSocket(`${scheme}//${location.host}/live?topics=${Object.keys(handlers)}`);
    socket.addEventListener("open", () => {
      wait = FIRST_MS;
      handlers.open?.({});
    });
    socket.addEventListener("message", (event) => {
      const message = JSON.parse(event.data);
      handlers[message.topic]?.(message);
    });
    socket.addEventListener("close", () => {
      handlers.closed?.({});
      setTimeout(open, wait);
      wait = Math.min(2 * wait, LONGEST_MS);
    });
  }

  open();
  return (asked) => {
    if (socket.readyState !== WebSocket.OPEN) return false;
    socket.send(JSON.stringify(asked));
    return true;
  };
}

/** Set the text of an element if it differs: unchanged text is not read out again. */
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Return a cell of a table: "td", or "th" for the head of its row. */
export function cell(kind, text) {
  const made = document.createElement(kind);
  if (kind === "th") made.scope = "row";
  made.textContent = text;
  return made;
}

/** Fill a list, changing only the entries that differ. */
export function list(element, texts) {
  while (element.children.length > texts.length) element.lastChild.remove();
  texts.forEach((text, at) => {
    const item = element.children[at] ?? element.appendChild(document.createElement("li"));
    say(item, text);
  });
}
