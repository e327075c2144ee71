// The hand of a build, drawn from its hand.json: switches and taxels on the glove laid flat, joints as a posed hand.

const SVG = "http://www.w3.org/2000/svg";
const MARGIN = 5;
const NARROW = 560; // up to this width, in pixels, the parts are drawn one below the other
const LEAST_UNIT = 0.3; // minimum millimetres per pixel, so that few inputs are not drawn huge
const LETTER = 9.5; // minimum size of a letter, pixels
const FINGER = 6; // minimum half size of a button, pixels, if there is room

function element(name, attributes = {}, parent = null) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (parent) parent.append(made);
  return made;
}

function named(parent, words) {
  element("title", {}, parent).textContent = words;
}

const path = (points, closed) =>
  points.length ? `M${points.map(([x, y]) => `${x} ${-y}`).join(" ")}${closed ? "Z" : ""}` : "";

function bounds(points) {
  const xs = points.map(([x]) => x), ys = points.map(([, y]) => -y);
  const reduce = (values, pick, start) => values.reduce((a, b) => pick(a, b), start);
  const left = reduce(xs, Math.min, Infinity), top = reduce(ys, Math.min, Infinity);
  return { left, top, width: reduce(xs, Math.max, -Infinity) - left, height: reduce(ys, Math.max, -Infinity) - top };
}

function grown(box, sides, ends = sides) {
  return { left: box.left - sides, top: box.top - ends, width: box.width + 2 * sides, height: box.height + 2 * ends };
}

// Keep the beginning of a long name, and its end, which often has a number.
function shortened(name, most) {
  const letters = [...name], half = (most - 1) / 2;
  return letters.length > most ? `${letters.slice(0, Math.ceil(half)).join("")}…${letters.slice(-Math.floor(half)).join("")}` : name;
}

/* ---- The glove laid flat ---- */

class Glove {
  // states: for each kept bit, whether it is closed and lost. spots: for each kept bit, the group that shows it.
  constructor(parent, hand, onSwitch) {
    this.group = element("g", {}, parent);
    this.hand = hand;
    this.radius = hand.radius_mm;
    this.closed = [];
    this.lost = [];
    this.taxels = [];
    this.switches = [];
    this.areas = [];
    element("path", { class: "skin", d: path(hand.outline, true) }, this.group);
    for (const strip of hand.strips) element("path", { class: "side", d: path(strip, true) }, this.group);
    for (const crease of hand.creases) element("path", { class: "crease", d: path(crease, false) }, this.group);
    for (const { name, x_mm, y_mm } of hand.labels) this.#words(name, x_mm, -y_mm);
    const all = [...hand.switches, ...hand.taxels];
    for (const each of all.filter((one) => !this.#kept(one).length)) this.#spare(each);
    for (const each of hand.switches) if (each.bit !== undefined) this.#switch(each, onSwitch);
    for (const each of hand.taxels) this.#taxel(each, onSwitch);
    const points = [...hand.outline, ...hand.strips.flat(), ...[...all, ...hand.labels].map((one) => [one.x_mm, one.y_mm])];
    this.box = points.length ? grown(bounds(points), hand.placed ? 12 : 22, hand.placed ? MARGIN : 16) : null;
    this.spacing = spacing(all.filter((one) => this.#kept(one).length));
  }

  #kept(one) {
    return one.levels ? one.levels.map(([, bit]) => bit) : one.bit === undefined ? [] : [one.bit];
  }

  #words(text, x, y) {
    const made = element("text", { x, y, class: "middle" }, this.group);
    made.textContent = text;
    return made;
  }

  #place({ name, x_mm, y_mm }, kind) {
    const group = element("g", { class: kind, transform: `translate(${x_mm} ${-y_mm})` }, this.group);
    if (!this.hand.placed) this.#words(shortened(name, 13), x_mm, -y_mm + 3.8 * this.radius);
    return group;
  }

  #spare(each) {
    const group = this.#place(each, "spot");
    element("circle", { class: "spare", r: this.radius * 0.8 }, group);
    named(group, each.name);
  }

  #button(group, name, press) {
    this.areas.push(element("circle", { class: "area", r: this.radius * 2 }, group));
    group.setAttribute("role", "button");
    group.setAttribute("tabindex", "0");
    group.setAttribute("aria-label", name);
    group.setAttribute("aria-pressed", "false");
    group.addEventListener("click", press);
    group.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      if (!event.repeat) press();
    });
  }

  // Open: a ring. Closed: a full square, larger, on a corner. Lost: a cross in a dashed ring.
  #switch(each, onSwitch) {
    const group = this.#place(each, "spot"), r = this.radius;
    element("circle", { class: "open", r: 1.25 * r }, group);
    element("path", { class: "shut", d: `M0 ${-2 * r}L${2 * r} 0L0 ${2 * r}L${-2 * r} 0Z` }, group);
    element("path", { class: "cross", d: cross(r) }, group);
    named(group, each.name);
    if (onSwitch) this.#button(group, each.name, () => onSwitch(each.bit, !this.closed[each.bit]));
    this.switches.push({ bit: each.bit, group });
  }

  // A square; a disc in it shows how far it is pressed; with all levels closed the square is full.
  #taxel(each, onSwitch) {
    if (!each.levels?.length) {
      this.taxels.push({ ...each, levels: [], group: null });
      return;
    }
    const group = this.#place(each, "spot"), r = this.radius, side = 1.35 * r;
    const found = { levels: each.levels, name: each.name, group, count: 0, value: null };
    element("rect", { class: "open", x: -side, y: -side, width: 2 * side, height: 2 * side }, group);
    found.disc = element("circle", { class: "press", r: 0 }, group);
    element("path", { class: "shut", d: `M${-side} ${-side}H${side}V${side}H${-side}Z` }, group);
    element("path", { class: "cross", d: cross(r) }, group);
    named(group, each.name);
    if (onSwitch) {
      this.#button(group, each.name, () => {
        // From level to level, and from the last to none.
        const next = (found.count + 1) % (found.levels.length + 1);
        found.levels.forEach(([, bit], at) => {
          if (!this.closed[bit] === at < next) onSwitch(bit, at < next);
        });
      });
    }
    this.taxels.push(found);
  }

  setClosed(bits, lost) {
    const gone = lost ?? [];
    for (const { bit, group } of this.switches) {
      const closed = Boolean(bits[bit]), missing = Boolean(gone[bit]);
      if (closed === this.closed[bit] && missing === this.lost[bit]) continue;
      group.classList.toggle("closed", closed);
      group.classList.toggle("lost", missing);
      if (group.hasAttribute("role")) group.setAttribute("aria-pressed", String(closed));
    }
    this.closed = Array.from(bits, Boolean);
    this.lost = Array.from(gone, Boolean);
    for (const each of this.taxels) if (each.group) this.#levels(each);
  }

  #levels(taxel) {
    const bits = taxel.levels.map(([, bit]) => bit), count = bits.filter((bit) => this.closed[bit]).length;
    taxel.group.classList.toggle("lost", bits.some((bit) => this.lost[bit]));
    if (count === taxel.count) return;
    taxel.count = count;
    taxel.group.classList.toggle("closed", count === bits.length);
    if (taxel.group.hasAttribute("role")) {
      taxel.group.setAttribute("aria-pressed", count === bits.length ? "true" : count ? "mixed" : "false");
      const of = bits.length > 1 ? `, ${count} of ${bits.length} levels closed` : "";
      taxel.group.setAttribute("aria-label", taxel.name + of);
    }
    if (taxel.value === null) this.#press(taxel, count / bits.length);
  }

  #press(taxel, share) {
    taxel.disc.setAttribute("r", (1.2 * this.radius * Math.sqrt(Math.min(Math.max(share, 0), 1))).toFixed(2));
  }

  setTaxels(values) {
    this.taxels.forEach((taxel, at) => {
      if (!taxel.group || (values[at] ?? null) === taxel.value) return;
      taxel.value = values[at] ?? null;
      this.#press(taxel, taxel.value ?? taxel.count / taxel.levels.length);
    });
  }

  // One pixel of the screen is `unit` of the drawing.
  fit(unit) {
    const reach = Math.max(2 * this.radius, Math.min(2 * FINGER * unit, this.spacing / 2));
    for (const area of this.areas) area.setAttribute("r", reach.toFixed(2));
  }

  get said() {
    const closed = this.switches.filter(({ bit }) => this.closed[bit]).length;
    return this.switches.length ? `${closed} of ${this.switches.length} switches closed` : "";
  }
}

const cross = (r) => `M${-r} ${-r}L${r} ${r}M${r} ${-r}L${-r} ${r}`;

function spacing(places) {
  let least = Infinity;
  places.forEach((one, at) => {
    for (const other of places.slice(at + 1)) {
      least = Math.min(least, Math.hypot(one.x_mm - other.x_mm, one.y_mm - other.y_mm));
    }
  });
  return least;
}

/* ---- The posed hand: a right hand, seen from the side of its thumb; x to the thumb, y to the tips, z off the palm ---- */

const VIEW = (38 * Math.PI) / 180;
const DIGITS = {
  little: { base: [-31, 78, 0], lean: -13, lengths: [36, 21, 18], width: 13 },
  ring: { base: [-13, 87, 0], lean: -6, lengths: [44, 28, 20], width: 14.5 },
  middle: { base: [6, 91, 0], lean: 0, lengths: [48, 31, 21], width: 15 },
  index: { base: [25, 87, 0], lean: 6, lengths: [43, 26, 20], width: 15 },
  thumb: { base: [22, 20, 4], lean: 42, lengths: [44, 33, 26], width: 17 },
};
const NEIGHBOUR = { index: ["middle", 1], ring: ["middle", -1], little: ["ring", -1] };
const PALM = [[-21, -4, 0], [-34, 40, 0], "little", "ring", "middle", "index", [30, 45, 2], [21, -4, 0]];
const SPAN = { abduction: 30, arch: 30, yaw: 40 }; // degrees for joints not measured as angles; for others 90

const add = (a, b, by = 1) => a.map((value, at) => value + by * b[at]);
const dot = (a, b) => a.reduce((sum, value, at) => sum + value * b[at], 0);
const radians = (degrees) => (degrees * Math.PI) / 180;
const turned = (ahead, flex, degrees) =>
  add(ahead.map((value) => value * Math.cos(radians(degrees))), flex, Math.sin(radians(degrees)));
const project = ([x, y, z]) => [x * Math.cos(VIEW) - z * Math.sin(VIEW), y];

// A joint's value in degrees: an angle as it is, other units from straight at the lowest to bent at the highest.
function degrees(joint, value) {
  if (joint.unit === "deg") return value;
  if (joint.unit === "rad") return (value * 180) / Math.PI;
  const span = joint.high - joint.low;
  return span > 0 ? ((value - joint.low) / span) * (SPAN[joint.moves] ?? 90) : 0;
}

// From joint values, by digit and movement, to points of every digit, of the palm and of the forearm.
function posed(angles) {
  const at = (digit, moves, otherwise = 0) => angles[digit]?.[moves] ?? otherwise;
  const wrist = (point) => {
    const [pitch, yaw] = [radians(at("wrist", "pitch")), radians(-at("wrist", "yaw"))];
    const [x, y, z] = point;
    const [u, v] = [x * Math.cos(yaw) - y * Math.sin(yaw), x * Math.sin(yaw) + y * Math.cos(yaw)];
    return [u, v * Math.cos(pitch) - z * Math.sin(pitch), v * Math.sin(pitch) + z * Math.cos(pitch)];
  };
  const arch = Math.sin(radians(at("palm", "arch"))), leans = { middle: at("middle", "abduction") }, chains = {};
  const bases = { ring: [0, 0, 18 * arch], little: [4 * Math.abs(arch), 0, 34 * arch] };
  for (const digit of ["middle", "index", "ring", "little"]) {
    const { base, lean, lengths } = DIGITS[digit];
    if (NEIGHBOUR[digit]) {
      const [neighbour, side] = NEIGHBOUR[digit], spread = at(digit, "abduction", null);
      const usual = lean - DIGITS[neighbour].lean;
      leans[digit] = leans[neighbour] + (spread === null ? usual : side * spread);
    }
    const angle = radians(leans[digit]), ahead = [Math.sin(angle), Math.cos(angle), 0], curl = at(digit, "curl");
    const pip = at(digit, "pip", curl), bends = [at(digit, "mcp", curl * 0.8), pip, at(digit, "dip", pip * 0.66)];
    chains[digit] = chain(add(base, bases[digit] ?? [0, 0, 0]), ahead, [0, 0, 1], lengths, bends);
  }
  const { base, lean, lengths } = DIGITS.thumb, curl = at("thumb", "curl");
  const side = radians(at("thumb", "abduction", lean)), round = radians(at("thumb", "rotation", 20));
  const ahead = [Math.sin(side) * Math.cos(round), Math.cos(side), Math.sin(side) * Math.sin(round)];
  const over = [-1, 0.1, 0.35], flat = add(over, ahead, -dot(over, ahead)), size = Math.sqrt(dot(flat, flat)) || 1;
  const bends = [0, at("thumb", "mcp", curl * 0.6), at("thumb", "ip", curl)];
  chains.thumb = chain(base, ahead, flat.map((value) => value / size), lengths, bends);
  const turn = (points) => points.map((point) => project(wrist(point)));
  const palm = PALM.map((point) => (typeof point === "string" ? chains[point][0] : point));
  return {
    chains: Object.fromEntries(Object.entries(chains).map(([digit, points]) => [digit, turn(points)])),
    palm: turn(palm),
    forearm: [[-18, 4, 0], [-17, -34, 0], [17, -34, 0], [18, 4, 0]].map(project),
  };
}

function chain(base, ahead, flex, lengths, bends) {
  const points = [base];
  let bent = 0;
  lengths.forEach((length, at) => {
    bent += bends[at];
    points.push(add(points.at(-1), turned(ahead, flex, bent), length));
  });
  return points;
}

class Posed {
  constructor(parent, joints) {
    this.group = element("g", {}, parent);
    this.joints = joints;
    this.values = joints.map(() => null);
    this.box = { left: -72, top: -202, width: 152, height: 246 };
    this.forearm = element("path", { class: "flesh" }, this.group);
    this.palm = element("path", { class: "flesh" }, this.group);
    this.digits = {};
    for (const [digit, { width }] of Object.entries(DIGITS)) {
      const group = element("g", {}, this.group);
      named(group, digit);
      this.digits[digit] = [
        element("path", { class: "edge", "stroke-width": width }, group),
        element("path", { class: "bone", "stroke-width": width - 1.6 }, group),
        element("path", { class: "axis" }, group),
      ];
    }
    this.draw();
  }

  #angles(values) {
    const angles = {};
    this.joints.forEach((joint, at) => {
      if (values[at] !== null) (angles[joint.digit] ??= {})[joint.moves] = degrees(joint, values[at]);
    });
    return angles;
  }

  set(values) {
    const own = this.joints.map((joint) => values[joint.joint] ?? null);
    if (own.every((value, at) => value === this.values[at])) return;
    this.values = own;
    this.draw();
  }

  draw() {
    const pose = posed(this.#angles(this.values)), line = (points, closed) => rounded(path(points, closed));
    this.forearm.setAttribute("d", line(pose.forearm, false));
    this.palm.setAttribute("d", line(pose.palm, true));
    for (const [digit, parts] of Object.entries(this.digits)) {
      for (const part of parts) part.setAttribute("d", line(pose.chains[digit], false));
    }
    // A part of the hand is marked while one of its joints is lost.
    const lost = new Set(this.joints.filter((_, at) => this.values[at] === null).map(({ digit }) => digit));
    for (const [digit, [part]] of Object.entries(this.digits)) part.parentNode.classList.toggle("gone", lost.has(digit));
    this.palm.classList.toggle("gone", lost.has("palm") || lost.has("wrist"));
  }

  fit() {}
}

const rounded = (text) => text.replace(/-?\d+\.\d+(e-?\d+)?/g, (number) => Number(number).toFixed(1));

/* ---- Joints of which nobody knows where they are: needles, from level to upright ---- */

class Dials {
  constructor(parent, joints) {
    this.group = element("g", {}, parent);
    this.joints = joints;
    const columns = Math.max(1, Math.min(4, Math.ceil(Math.sqrt(joints.length)))), [wide, high] = [46, 46];
    this.box = { left: 0, top: 0, width: wide * columns, height: high * Math.ceil(joints.length / columns) };
    this.needles = joints.map((joint, at) => {
      const x = wide * (at % columns) + 9, y = high * Math.floor(at / columns) + 34;
      const group = element("g", { transform: `translate(${x} ${y})` }, this.group);
      element("path", { class: "dial", d: "M0 0H26A26 26 0 0 0 0 -26Z" }, group);
      const needle = element("path", { class: "needle", d: "M0 0H26" }, group);
      const handle = element("path", { class: "handle", d: "M-2.6 0a2.6 2.6 0 1 0 5.2 0a2.6 2.6 0 1 0 -5.2 0" }, group);
      element("text", { x: 13, y: 9, class: "middle" }, group).textContent = shortened(joint.name, 12);
      named(group, joint.name);
      return { group, needle, handle };
    });
    this.set([]);
  }

  set(values) {
    this.joints.forEach((joint, at) => {
      const value = values[joint.joint] ?? null, span = joint.high - joint.low;
      const share = value === null || !(span > 0) ? 0 : Math.min(Math.max((value - joint.low) / span, 0), 1);
      const angle = (share * Math.PI) / 2, x = 26 * Math.cos(angle), y = -26 * Math.sin(angle);
      const { group, needle, handle } = this.needles[at];
      needle.setAttribute("d", `M0 0L${x.toFixed(1)} ${y.toFixed(1)}`);
      handle.setAttribute("transform", `translate(${x.toFixed(1)} ${y.toFixed(1)})`);
      group.classList.toggle("gone", value === null);
    });
  }

  fit() {}
}

/* ---- All of it ---- */

/**
 * Draw the hand of a build into an empty <svg>.
 *
 * hand      the content of hand.json
 * onSwitch  called with (bit, closed) when a kept switch, or the next level of a taxel, is pressed; without it the
 *           drawing is a picture
 *
 * Returns functions that show a state; each may be called at every screen refresh, and unchanged parts cost nothing:
 *
 * setClosed(bits, lost)  arrays of truth, by the number of the kept switch; `lost` may be left out
 * setTaxels(values)      how far each of hand.taxels is pressed, 0 to 1; null: unknown
 * setPose(values)        the value of each of hand.joints, in its unit; null: lost
 */
export function drawHand(svg, hand, { onSwitch = null } = {}) {
  svg.replaceChildren();
  svg.classList.add("hand");
  const glove = new Glove(svg, hand, onSwitch), placed = hand.joints.filter((joint) => joint.digit);
  const others = hand.joints.filter((joint) => !joint.digit), parts = [];
  if (glove.box) parts.push(glove);
  const joints = [];
  if (placed.length) joints.push(new Posed(svg, placed));
  if (others.length) joints.push(new Dials(svg, others));
  parts.push(...joints);
  svg.setAttribute("role", onSwitch ? "group" : "img");
  const say = () => svg.setAttribute("aria-label", ["The hand", onSwitch ? "" : glove.said].filter(Boolean).join(": "));
  say();

  let wide = -1;
  const arrange = () => {
    const width = svg.clientWidth || NARROW;
    if (width === wide || !parts.length) return;
    wide = width;
    const narrow = width < NARROW;
    const across = narrow ? Math.max(...parts.map((part) => part.box.width)) : 0;
    let x = 0, y = 0, high = 0;
    for (const { box, group } of parts) {
      const shift = narrow ? (across - box.width) / 2 : 0;
      group.setAttribute("transform", `translate(${(x + shift - box.left).toFixed(1)} ${(y - box.top).toFixed(1)})`);
      if (narrow) y += box.height;
      else x += box.width;
      high = Math.max(high, box.height);
    }
    const [broad, tall] = narrow ? [across, y] : [x, high], whole = Math.max(broad, LEAST_UNIT * width);
    svg.setAttribute("viewBox", `${((broad - whole) / 2).toFixed(1)} 0 ${whole.toFixed(1)} ${tall.toFixed(1)}`);
    const unit = whole / width;
    svg.style.setProperty("--letter", `${(LETTER * unit).toFixed(2)}px`);
    for (const part of parts) part.fit(unit);
  };
  arrange();
  new ResizeObserver(arrange).observe(svg);

  return {
    setClosed(bits, lost = null) {
      glove.setClosed(bits, lost);
      if (!onSwitch) say();
    },
    setTaxels: (values) => glove.setTaxels(values),
    setPose(values) {
      for (const part of joints) part.set(values);
    },
  };
}
