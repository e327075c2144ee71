// Recorded rows: tables in CSV, and their rows as frames of the build.

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

/**
 * Return a row as {bits, codes, lostSwitches, lostJoints}. `value(name)` is a number or null, in the units of the
 * recordings: a switch above 0.5 is closed. What has no value is lost.
 */
export function readRow(data, value) {
  const closed = data.switches.map((each) => {
    const found = value(each.taxel ? each.taxel.name : each.name);
    if (found === null) return null;
    return each.taxel ? codeOf(each.taxel, found) > each.code : found > 0.5;
  });
  const codes = data.joints.map((joint) => {
    const found = value(joint.name);
    return found === null ? null : codeOf(joint, found);
  });
  return {
    bits: closed.map(Boolean),
    codes: codes.map((code, at) => code ?? data.joints[at].typical),
    lostSwitches: closed.map((bit) => bit === null),
    lostJoints: codes.map((code) => code === null),
  };
}
