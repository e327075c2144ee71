// The hand of a build, drawn from its hand.json: switches and taxels on the glove laid flat, joints as a posed hand.

const SVG = "http://www.w3.org/2000/svg";
const NARROW = 560; // up to this width, in pixels, the parts are drawn one below the other
const LEAST_UNIT = 0.3; // minimum millimetres per pixel, so that few inputs are not drawn huge
const LETTER = 9.5; // minimum size of a letter, pixels
const FINGER = 6; // minimum half size of a button, pixels, if there is room

/** Return a new element of a drawing with these attributes, and texts and elements in it. */
export function draw(kind, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, kind);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/** Make an element of a drawing a button, by pointer and keys, and return it. */
export function pressable(element, name, press) {
  const attributes = { role: "button", tabindex: 0, "aria-label": name, "aria-pressed": false };
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.addEventListener("click", press);
  element.addEventListener("keydown", (event) => {
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    if (!event.repeat) press();
  });
  return element;
}

const path = (points, closed) =>
  points.length ? `M${points.map(([x, y]) => `${x} ${-y}`).join(" ")}${closed ? "Z" : ""}` : "";

// The box around points, with margins.
function around(points, [sides, ends]) {
  const reduce = (axis, pick, start) => points.reduce((most, point) => pick(most, point[axis]), start);
  const [left, right] = [reduce(0, Math.min, Infinity), reduce(0, Math.max, -Infinity)];
  const [low, high] = [reduce(1, Math.min, Infinity), reduce(1, Math.max, -Infinity)];
  return { left: left - sides, top: -high - ends, width: right - left + 2 * sides, height: high - low + 2 * ends };
}

// Keep the beginning of a long name, and its end, which often has a number.
function shortened(name, most) {
  const letters = [...name], half = (most - 1) / 2;
  return letters.length > most ? `${letters.slice(0, Math.ceil(half)).join("")}…${letters.slice(-Math.floor(half)).join("")}` : name;
}

/* ---- The glove laid flat ---- */

class Glove {
  #hand;
  #closed = []; // whether each kept bit is

  constructor(hand, onSwitch) {
    this.#hand = hand;
    const bits = (one) => (one.levels ? one.levels.map(([, bit]) => bit) : one.bit === undefined ? [] : [one.bit]);
    const all = [...hand.switches, ...hand.taxels], kept = all.filter((one) => bits(one).length);
    this.group = draw(
      "g",
      {},
      draw("path", { class: "skin", d: path(hand.outline, true) }),
      ...hand.strips.map((strip) => draw("path", { class: "side", d: path(strip, true) })),
      ...hand.creases.map((crease) => draw("path", { class: "crease", d: path(crease, false) })),
      ...hand.labels.map(({ name, x_mm, y_mm }) => draw("text", { x: x_mm, y: -y_mm, class: "middle" }, name)),
    );
    for (const one of all) if (!bits(one).length) this.#place(one, draw("circle", { class: "spare", r: 0.8 * hand.radius_mm }));
    this.spots = kept.map((one) => this.#spot(one, bits(one), onSwitch));
    this.taxels = hand.taxels.map(({ name }) => this.spots.find((spot) => spot.disc && spot.name === name));
    const points = [...hand.outline, ...hand.strips.flat(), ...[...all, ...hand.labels].map((one) => [one.x_mm, one.y_mm])];
    this.box = points.length ? around(points, hand.placed ? [12, 5] : [22, 16]) : null;
    this.spacing = spacing(kept);
  }

  #place({ name, x_mm, y_mm }, ...parts) {
    const { placed, radius_mm: radius } = this.#hand;
    const group = draw("g", { class: "spot", transform: `translate(${x_mm} ${-y_mm})` }, ...parts, draw("title", {}, name));
    this.group.append(group);
    if (!placed) this.group.append(draw("text", { x: x_mm, y: -y_mm + 3.8 * radius, class: "middle" }, shortened(name, 13)));
    return group;
  }

  // A switch: a ring, and closed a full square, larger, on a corner. A taxel: a square, and in it a disc that shows how
  // far it is pressed; with all levels closed the square is full. Lost: a cross in a dashed line.
  #spot(one, bits, onSwitch) {
    const r = this.#hand.radius_mm, side = 1.35 * r, area = draw("circle", { class: "area", r: 2 * r });
    const disc = one.levels ? draw("circle", { class: "press", r: 0 }) : null, parts = disc
      ? [
        draw("rect", { class: "open", x: -side, y: -side, width: 2 * side, height: 2 * side }),
        disc,
        draw("path", { class: "shut", d: `M${-side} ${-side}H${side}V${side}H${-side}Z` }),
      ]
      : [
        draw("circle", { class: "open", r: 1.25 * r }),
        draw("path", { class: "shut", d: `M0 ${-2 * r}L${2 * r} 0L0 ${2 * r}L${-2 * r} 0Z` }),
      ];
    const cross = draw("path", { class: "cross", d: `M${-r} ${-r}L${r} ${r}M${r} ${-r}L${-r} ${r}` });
    const group = this.#place(one, ...parts, cross), spot = { name: one.name, bits, group, disc, area, count: 0, value: null };
    if (!onSwitch) return spot;
    // From level to level, and from the last to none.
    const press = () => {
      const next = (spot.count + 1) % (bits.length + 1);
      bits.forEach((bit, at) => {
        if (!this.#closed[bit] === at < next) onSwitch(bit, at < next);
      });
    };
    pressable(group, one.name, press).append(area);
    return spot;
  }

  setClosed(bits, lost) {
    this.#closed = Array.from(bits, Boolean);
    for (const spot of this.spots) {
      const { bits: levels, group, name } = spot, count = levels.filter((bit) => bits[bit]).length, all = count === levels.length;
      group.classList.toggle("lost", levels.some((bit) => lost?.[bit]));
      if (count === spot.count) continue;
      spot.count = count;
      group.classList.toggle("closed", all);
      if (group.hasAttribute("role")) {
        group.setAttribute("aria-pressed", all ? "true" : count ? "mixed" : "false");
        if (spot.disc) group.setAttribute("aria-label", name + (levels.length > 1 ? `, ${count} of ${levels.length} levels closed` : ""));
      }
      if (spot.disc && spot.value === null) this.#press(spot, count / levels.length);
    }
  }

  #press({ disc }, share) {
    disc.setAttribute("r", (1.2 * this.#hand.radius_mm * Math.sqrt(Math.min(Math.max(share, 0), 1))).toFixed(2));
  }

  setTaxels(values) {
    this.taxels.forEach((taxel, at) => {
      const value = values[at] ?? null;
      if (!taxel || value === taxel.value) return;
      taxel.value = value;
      this.#press(taxel, value ?? taxel.count / taxel.bits.length);
    });
  }

  // One pixel of the screen is `unit` of the drawing.
  fit(unit) {
    const reach = Math.max(2 * this.#hand.radius_mm, Math.min(2 * FINGER * unit, this.spacing / 2));
    for (const { area } of this.spots) area.setAttribute("r", reach.toFixed(2));
  }
}

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

const VIEW = new DOMMatrix().rotateAxisAngle(0, 1, 0, -38);
const DIGITS = {
  little: { base: [-31, 78, 0], lean: -13, next: ["ring", -1], lengths: [36, 21, 18], width: 13 },
  ring: { base: [-13, 87, 0], lean: -6, next: ["middle", -1], lengths: [44, 28, 20], width: 14.5 },
  middle: { base: [6, 91, 0], lean: 0, lengths: [48, 31, 21], width: 15 },
  index: { base: [25, 87, 0], lean: 6, next: ["middle", 1], lengths: [43, 26, 20], width: 15 },
  thumb: { base: [22, 20, 4], lean: 42, lengths: [44, 33, 26], width: 17 },
};
const PALM = [[-21, -4, 0], [-34, 40, 0], "little", "ring", "middle", "index", [30, 45, 2], [21, -4, 0]];
const SPAN = { abduction: 30, arch: 30, yaw: 40 }; // degrees for joints not measured as angles; for others 90

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
  const wrist = VIEW.rotateAxisAngle(1, 0, 0, at("wrist", "pitch")).rotateAxisAngle(0, 0, 1, -at("wrist", "yaw"));
  const arch = Math.sin((at("palm", "arch") * Math.PI) / 180), leans = { middle: at("middle", "abduction") }, chains = {};
  const arched = { ring: [0, 0, 18 * arch], little: [4 * Math.abs(arch), 0, 34 * arch] };
  for (const digit of ["middle", "index", "ring", "little"]) {
    const { base, lean, lengths, next } = DIGITS[digit];
    if (next) {
      const [neighbour, side] = next, spread = at(digit, "abduction", side * (lean - DIGITS[neighbour].lean));
      leans[digit] = leans[neighbour] + side * spread;
    }
    const curl = at(digit, "curl"), pip = at(digit, "pip", curl);
    const place = wrist.translate(...base).translate(...(arched[digit] ?? []));
    const bends = [at(digit, "mcp", curl * 0.8), pip, at(digit, "dip", pip * 0.66)];
    chains[digit] = chain(place.rotateAxisAngle(0, 0, 1, -leans[digit]), lengths, bends);
  }
  const { base, lean, lengths } = DIGITS.thumb, curl = at("thumb", "curl"), round = at("thumb", "rotation", 20);
  const ahead = wrist.translate(...base).rotateAxisAngle(0, 1, 0, -round).rotateAxisAngle(0, 0, 1, -at("thumb", "abduction", lean));
  // It bends across the palm: the less it is opposed, the more it is turned to it.
  const bends = [0, at("thumb", "mcp", curl * 0.6), at("thumb", "ip", curl)];
  chains.thumb = chain(ahead.rotateAxisAngle(0, 1, 0, (round - 72) * 0.9), lengths, bends);
  const palm = PALM.map((point) => (typeof point === "string" ? chains[point][0] : seenAt(wrist.translate(...point))));
  return { chains, palm, forearm: [[-18, 4], [-17, -34], [17, -34], [18, 4]].map((point) => seenAt(VIEW.translate(...point))) };
}

// Where the origin of a coordinate system is seen.
const seenAt = ({ e, f }) => [e, f];

function chain(bone, lengths, bends) {
  const points = [seenAt(bone)];
  lengths.forEach((length, at) => {
    bone = bone.rotateAxisAngle(1, 0, 0, bends[at]).translate(0, length);
    points.push(seenAt(bone));
  });
  return points;
}

function posedHand(joints) {
  // A path is a style and points are not, so it costs less to change points.
  const [forearm, palm] = [draw("polyline", { class: "flesh" }), draw("polygon", { class: "flesh" })];
  const digits = Object.entries(DIGITS).map(([digit, { width }]) => {
    const parts = [
      draw("polyline", { class: "edge", "stroke-width": width }),
      draw("polyline", { class: "bone", "stroke-width": width - 1.6 }),
      draw("polyline", { class: "axis" }),
    ];
    return { digit, parts, group: draw("g", {}, draw("title", {}, digit), ...parts) };
  });
  let before = null;
  const set = (values) => {
    const own = joints.map((joint) => values[joint.joint] ?? null), angles = {};
    if (before && own.every((value, at) => value === before[at])) return;
    before = own;
    joints.forEach((joint, at) => {
      if (own[at] !== null) (angles[joint.digit] ??= {})[joint.moves] = degrees(joint, own[at]);
    });
    const pose = posed(angles), line = (points) => points.map(([x, y]) => `${x.toFixed(1)} ${(-y).toFixed(1)}`).join(" ");
    forearm.setAttribute("points", line(pose.forearm));
    palm.setAttribute("points", line(pose.palm));
    // A part of the hand is marked while one of its joints is lost.
    const lost = new Set(joints.filter((_, at) => own[at] === null).map(({ digit }) => digit));
    for (const { digit, parts, group } of digits) {
      const points = line(pose.chains[digit]);
      for (const part of parts) part.setAttribute("points", points);
      group.classList.toggle("gone", lost.has(digit));
    }
    palm.classList.toggle("gone", lost.has("palm") || lost.has("wrist"));
  };
  set([]);
  const group = draw("g", {}, forearm, palm, ...digits.map((one) => one.group));
  return { group, set, box: { left: -72, top: -202, width: 152, height: 246 } };
}

/* ---- Joints of which nobody knows where they are: squares as of taxels, in a grid ---- */

function unplaced(joints) {
  const columns = Math.max(1, Math.min(4, Math.ceil(Math.sqrt(joints.length))));
  const taxels = joints.map(({ name }, at) => {
    return { name, x_mm: 50 * (at % columns), y_mm: -22 * Math.floor(at / columns), levels: [[0, at]] };
  });
  const grid = new Glove({ placed: false, radius_mm: 3, outline: [], strips: [], creases: [], labels: [], switches: [], taxels });
  grid.set = (values) => {
    const own = joints.map(({ joint }) => values[joint] ?? null);
    grid.setTaxels(own.map((value, at) => {
      const { low, high } = joints[at];
      return value === null ? 0 : (value - low) / (high - low || 1);
    }));
    grid.setClosed([], own.map((value) => value === null));
  };
  grid.set([]);
  return grid;
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
 *
 * and `spots`, the element of each kept switch and taxel by its name, for marks.
 */
export function drawHand(svg, hand, { onSwitch = null } = {}) {
  const glove = new Glove(hand, onSwitch);
  const kinds = [[posedHand, hand.joints.filter(({ digit }) => digit)], [unplaced, hand.joints.filter(({ digit }) => !digit)]];
  const joints = kinds.filter(([, some]) => some.length).map(([drawn, some]) => drawn(some));
  const parts = [...(glove.box ? [glove] : []), ...joints];
  svg.replaceChildren(glove.group, ...joints.map(({ group }) => group));
  svg.classList.add("hand");
  svg.setAttribute("role", onSwitch ? "group" : "img");
  svg.setAttribute("aria-label", "The hand");

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
    if (glove.box) glove.fit(unit);
  };
  arrange();
  new ResizeObserver(arrange).observe(svg);

  return {
    spots: new Map([glove, ...joints].flatMap(({ spots = [] }) => spots).map(({ name, group: spot }) => [name, spot])),
    setClosed: (bits, lost) => glove.setClosed(bits, lost),
    setTaxels: (values) => glove.setTaxels(values),
    setPose(values) {
      for (const part of joints) part.set(values);
    },
  };
}
