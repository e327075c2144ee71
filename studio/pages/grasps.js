// How the grasp types of the published taxonomies look: a posture of the hand, and the shape of the object in it.
import { draw, drawHand } from "./hand.js";

const FINGERS = ["index", "middle", "ring", "little"];

// Of every finger mcp, pip and dip in degrees, or of all alike; of the thumb abduction, rotation, mcp and ip.
const wrapped = [65, 75, 45], half = [45, 50, 30], straight = [30, 12, 6], curled = [60, 65, 40];
const POSTURES = {
  wrap: { fingers: [wrapped, wrapped, wrapped, wrapped], thumb: [30, 60, 30, 30] },
  along: { fingers: [[35, 20, 10], wrapped, wrapped, wrapped], thumb: [15, 30, 10, 10] },
  hook: { fingers: [[25, 95, 50], [25, 95, 50], [25, 95, 50], [25, 95, 50]], thumb: [20, 10, 10, 10] },
  wide: { fingers: [half, half, half, half], thumb: [45, 60, 20, 20] },
  flat: { fingers: [straight, straight, straight, straight], thumb: [40, 75, 20, 15] },
  tips: { fingers: [[58, 38, 18], [58, 38, 18], [58, 38, 18], [58, 38, 18]], thumb: [40, 70, 15, 15] },
  two: { fingers: [[50, 45, 20], [20, 25, 10], [15, 20, 10], [10, 15, 10]], thumb: [38, 65, 15, 25] },
  three: { fingers: [[50, 40, 20], [52, 48, 25], curled, curled], thumb: [38, 65, 15, 20] },
  key: { fingers: [[50, 60, 30], curled, curled, curled], thumb: [20, 40, 20, 15] },
  between: { fingers: [[10, 5, 5], [10, 5, 5], [30, 40, 20], [30, 40, 20]], thumb: [30, 20, 10, 10] },
  open: { fingers: [[5, 5, 5], [5, 5, 5], [5, 5, 5], [5, 5, 5]], thumb: [45, 10, 5, 5] },
};

// The object: its shape, the number of digits behind it (from the little finger on; the thumb is the fifth), the place of
// its middle in the picture, its length and thickness, all in mm, and by how many degrees it is turned.
const OBJECTS = {
  cylinder: ["cylinder", 0, -6, -88, 140, 34, 0],
  stick: ["cylinder", 0, -6, -88, 150, 14, 0],
  lever: ["cylinder", 0, 2, -112, 140, 12, 60],
  bar: ["cylinder", 0, -4, -104, 140, 12, 0],
  grip: ["cylinder", 4, -24, -88, 110, 20, 0],
  jar: ["cylinder", 0, -14, -94, 110, 64, 0],
  rod: ["cylinder", 4, -26, -92, 96, 14, 0],
  pen: ["flat", 4, 2, -114, 125, 6, -40],
  cigarette: ["flat", 3, 12, -132, 84, 7, -18],
  ball: ["sphere", 0, -18, -94, 72, 72, 0],
  apple: ["sphere", 4, -44, -86, 56, 56, 0],
  bead: ["sphere", 5, -23, -103, 16, 16, 0],
  disc: ["disc", 0, -18, -104, 84, 18, 0],
  lid: ["disc", 4, -44, -92, 70, 16, 0],
  plate: ["flat", 4, -10, -102, 112, 8, -30],
  card: ["flat", 4, -6, -140, 44, 28, -70],
};

const TYPES = new Map();
function types(posture, object, names) {
  for (const name of names.split("; ")) TYPES.set(name.toLowerCase(), [posture, object]);
}
types("wrap", "cylinder", "PoS; Medium wrap");
types("wrap", "stick", "Small diameter; Light tool");
types("along", "lever", "PoI; Adducted thumb; Index Finger Extension");
types("hook", "bar", "PoH; Hook, platform, push; Fixed Hook");
types("wide", "jar", "Large diameter");
types("wide", "grip", "PoD; Distal Type; Ring");
types("wide", "ball", "Sphere (power); Power Sphere; Sphere 4 Finger; Sphere 3 Finger");
types("wide", "disc", "Disk (power); Power Disk");
types("flat", "plate", "PoE; PE; Extension Type; Parallel Extension");
types("tips", "rod", "PMF; Thumb-4 finger; Thumb-3 finger; Thumb-2 finger; Prismatic 4 Finger; Prismatic 3 Finger; Prismatic 2 Finger");
types("tips", "lid", "CMF; Disk (precision); Precision Disk");
types("tips", "apple", "Sphere (precision); Precision Sphere");
types("two", "bead", "Tip; Thumb-index finger; Palmar Pinch; Tip Pinch; Inferior Pincer");
types("three", "pen", "Tpd; TVI; TVII; Writing Tripod; Tripod Variation");
types("three", "bead", "Tripod; Quadpod");
types("key", "card", "Lat; Lateral; Lateral pinch; Lateral Tripod");
types("between", "cigarette", "Add; Adduction Grip");
types("open", "", "none");

const MOVES = ["mcp", "pip", "dip"], THUMB = ["abduction", "rotation", "mcp", "ip"];
const JOINTS = [...FINGERS.flatMap((digit) => MOVES.map((moves) => [digit, moves])), ...THUMB.map((moves) => ["thumb", moves])];
const HAND = {
  placed: true, radius_mm: 1, outline: [], strips: [], creases: [], labels: [], switches: [], taxels: [],
  joints: JOINTS.map(([digit, moves], joint) => ({ name: `${digit} ${moves}`, joint, unit: "deg", low: 0, high: 90, digit, moves })),
};

/** Draw a grasp type into an <svg>, with an object of its shape; return whether it is a known one. */
export function drawGrasp(svg, name) {
  const found = TYPES.get(name.toLowerCase());
  if (!found) return false;
  const [posture, object] = found, { fingers, thumb } = POSTURES[posture];
  drawHand(svg, HAND).setPose([...fingers.flat(), ...thumb]);
  if (object) {
    const [shape, behind, ...where] = OBJECTS[object];
    const posed = svg.lastElementChild, digits = [...posed.querySelectorAll("g")];
    posed.insertBefore(drawnObject(shape, ...where), digits[behind] ?? null);
  }
  svg.setAttribute("aria-label", object ? `a hand that holds a ${object}` : "an open hand");
  return true;
}

function drawnObject(shape, x, y, long, thick, turn) {
  const [half, r] = [long / 2, thick / 2], parts = {
    sphere: () => [draw("circle", { r: half })],
    flat: () => [draw("rect", { x: -half, y: -r, width: long, height: thick, rx: 1.5 })],
    disc: () => [
      draw("path", { d: `M${-half} 0V${thick}A${half} ${half / 3} 0 0 0 ${half} ${thick}V0Z` }),
      draw("ellipse", { rx: half, ry: half / 3, class: "top" }),
    ],
    // Its end at the thumb is seen.
    cylinder: () => [
      draw("path", { d: `M${-half} ${-r}H${half}A${r / 2} ${r} 0 0 1 ${half} ${r}H${-half}A${r / 2} ${r} 0 0 1 ${-half} ${-r}Z` }),
      draw("ellipse", { cx: half, rx: r / 2, ry: r, class: "top" }),
    ],
  };
  return draw("g", { class: "object", transform: `translate(${x} ${y}) rotate(${turn})` }, ...parts[shape]());
}
