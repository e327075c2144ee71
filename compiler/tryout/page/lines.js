// Text lines with rows of numbers: drivers/lines.py in JavaScript; and tables of recorded rows in CSV.

const LONGEST = 16384;
const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?$/;
const NO_NUMBER = /^([+-]?nan|[+-]?inf(inity)?|null|none|na|-|)$/i;
const NAME = /^[\p{L}_][^,;:\t"{}]*$/u;

const finite = (value) => (Number.isFinite(value) ? value : null);
const number = (field) => (NUMBER.test(field) ? finite(Number(field)) : null);
const sound = (names) => new Set(names).size === names.length && !names.includes("");

function fieldsOf(text) {
  if (text.includes(";")) return text.split(";").map((field) => field.trim().replaceAll(",", "."));
  if (/[,\t]/.test(text)) return text.split(/[,\t]/).map((field) => field.trim().replace(/^"+|"+$/g, ""));
  return text.split(/\s+/).filter(Boolean);
}

function valueOf(found) {
  if (typeof found === "string") return number(found.trim());
  return typeof found === "boolean" ? Number(found) : finite(found);
}

// A text, such as a label, may stand in a row of as many fields as `columns`, most of them numbers.
function rowOf(names, fields, columns = 0) {
  const known = fields.filter((field) => NUMBER.test(field) || NO_NUMBER.test(field)).length;
  if (!fields.length || (known < fields.length && (fields.length !== columns || 2 * known <= columns))) return null;
  return names && !sound(names) ? null : { names, values: fields.map(number) };
}

/** Parse a line: {names, values}, {header}, or null for an invalid line. A value that is not a number is null. */
export function parsedLine(line, columns = 0) {
  const text = line.replace(/^[\ufeff \r\t\0]+|[\ufeff \r\t\0]+$/g, "");
  if (text.startsWith("{") || text.startsWith("[")) {
    let found;
    try {
      found = JSON.parse(text.replace(/(?<=[:[,]\s*)-?(NaN|Infinity)(?=\s*[,\]}])/g, "null"));
    } catch {
      return null;
    }
    const names = Array.isArray(found) ? null : Object.keys(found);
    const values = Object.values(found).map(valueOf);
    return values.length && (!names || sound(names)) ? { names, values } : null;
  }
  const fields = fieldsOf(text);
  if (fields.some((field) => field.includes(":"))) {
    const cut = fields.map((field) => field.lastIndexOf(":"));
    const names = fields.map((field, at) => field.slice(0, Math.max(cut[at], 0)).trim());
    return rowOf(names, fields.map((field, at) => field.slice(cut[at] + 1).trim()));
  }
  const worded = fields.length === 1 || text.split(/\s+/).length < fields.length || /[,;\t]/.test(text);
  const named = fields.every((field) => NAME.test(field));
  if (worded && named && !fields.every((field) => NO_NUMBER.test(field))) return sound(fields) ? { header: fields } : null;
  return rowOf(null, fields, columns);
}

/** Converts chunks of bytes to rows; `misfits` counts lines without a row, `odd` is the last of them. */
export class LineParser {
  constructor() {
    this.misfits = 0;
    this.odd = "";
    this.rest = "";
    this.names = null;
    this.text = new TextDecoder();
  }

  feed(chunk) {
    const pieces = (this.rest + this.text.decode(chunk, { stream: true })).split("\n"), rows = [];
    this.rest = pieces.pop();
    if (this.rest.length > LONGEST) {
      this.rest = "";
      this.misfits++;
    }
    for (const line of pieces.filter((piece) => piece.trim())) {
      const named = this.names?.length ?? 0;
      const found = line.length > LONGEST ? null : parsedLine(line, named > 1 ? named : 0);
      if (!found) {
        this.misfits++;
        this.odd = line.slice(0, 60);
      } else if (found.header) {
        if (found.header.length > 1 || named < 2) this.names = found.header; // a word alone is a message
      } else {
        const known = !found.names && this.names?.length === found.values.length;
        rows.push(known ? { ...found, names: this.names } : found);
      }
    }
    return rows;
  }
}

/** Return the rows of a table in CSV as arrays of texts, the head first: RFC 4180. */
export function parseCsv(text) {
  const rows = [];
  let row = [], field = "", quoted = false;
  const whole = text.replace(/^\ufeff/, "");
  for (let at = 0; at < whole.length; at++) {
    const letter = whole[at];
    if (quoted) {
      if (letter !== '"') field += letter;
      else if (whole[at + 1] === '"') field += whole[++at];
      else quoted = false;
    } else if (letter === '"') quoted = true;
    else if (letter === "," || letter === "\n") {
      row.push(field.replace(/\r$/, ""));
      field = "";
      if (letter === "\n") {
        rows.push(row);
        row = [];
      }
    } else field += letter;
  }
  if (field || row.length) rows.push([...row, field.replace(/\r$/, "")]);
  return rows.filter((each) => each.length > 1 || each[0] !== "");
}
