// How the grasp types of the published taxonomies look: a posture of the hand, and the shape of the object in it.
import { drawHand } from "./hand.js";

const SVG = "http://www.w3.org/2000/svg";
const FINGERS = ["index", "middle", "ring", "little"];

// Of every finger mcp, pip and dip in degrees, or of all alike; of the thumb abduction, rotation, mcp and ip.
const wrapped = [65, 75, 45], half = [45, 50, 30], straight = [30, 12, 6], curled = [60, 65, 40];
const POSTURES = {
  wrap: { fingers: [wrapped, wrapped, wrapped, wrapped], thumb: [30, 60, 30, 30] },
  along: { fingers: [[35, 20, 10], wrapped, wrapped, wrapped], thumb: [15, 30, 10, 10] },
  hook: { fingers: [[25, 95, 50], [25, 95, 50], [25, 95, 50], [25, 95, 50]], thumb: [20, 10, 10, 10] },
  wide: { fingers: [half, half, half, half], thumb: [45, 60, 20, 20] },
  flat: { fingers: [straight, straight, straight, straight], thumb: [40, 75, 20, 15] },
  tips: { fingers: [[50, 35, 15], [50, 35, 15], [50, 35, 15], [50, 35, 15]], thumb: [40, 70, 15, 15] },
  two: { fingers: [[50, 45, 20], [20, 25, 10], [15, 20, 10], [10, 15, 10]], thumb: [38, 65, 15, 25] },
  three: { fingers: [[50, 40, 20], [52, 48, 25], curled, curled], thumb: [38, 65, 15, 20] },
  key: { fingers: [[50, 60, 30], curled, curled, curled], thumb: [20, 40, 20, 15] },
  between: { fingers: [[10, 5, 5], [10, 5, 5], [30, 40, 20], [30, 40, 20]], thumb: [30, 20, 10, 10] },
  open: { fingers: [[5, 5, 5], [5, 5, 5], [5, 5, 5], [5, 5, 5]], thumb: [45, 10, 5, 5] },
};

// The object: its shape, its middle in mm beside the hand (x to the thumb, y to the tips, z off the palm), its size.
const OBJECTS = {
  cylinder: ["cylinder", [0, 62, 36], 110, 34],
  stick: ["cylinder", [0, 66, 30], 130, 14],
  bar: ["cylinder", [0, 84, 26], 110, 12],
  jar: ["cylinder", [0, 70, 52], 90, 62],
  rod: ["cylinder", [12, 78, 62], 100, 14],
  pen: ["pen", [34, 100, 55], 110, 7],
  ball: ["sphere", [4, 74, 56], 64, 64],
  bead: ["sphere", [28, 96, 62], 14, 14],
  disc: ["disc", [4, 80, 58], 74, 20],
  plate: ["flat", [8, 100, 46], 84, 10],
  card: ["flat", [40, 84, 34], 60, 4],
};

const TYPES = new Map();
function types(posture, object, names) {
  for (const name of names.split("; ")) TYPES.set(name.toLowerCase(), [posture, object]);
}
types("wrap", "cylinder", "PoS; Medium wrap");
types("wrap", "stick", "Small diameter; Light tool");
types("along", "stick", "PoI; Adducted thumb; Index Finger Extension");
types("hook", "bar", "PoH; Hook, platform, push; Fixed Hook");
types("wide", "jar", "Large diameter");
types("wide", "cylinder", "PoD; Distal Type; Ring");
types("wide", "ball", "Sphere (power); Power Sphere; Sphere 4 Finger; Sphere 3 Finger");
types("wide", "disc", "Disk (power); Power Disk");
types("flat", "plate", "PoE; PE; Extension Type; Parallel Extension");
types("tips", "rod", "PMF; Thumb-4 finger; Thumb-3 finger; Thumb-2 finger; Prismatic 4 Finger; Prismatic 3 Finger; Prismatic 2 Finger");
types("tips", "disc", "CMF; Disk (precision); Precision Disk");
types("tips", "ball", "Sphere (precision); Precision Sphere");
types("two", "bead", "Tip; Thumb-index finger; Palmar Pinch; Tip Pinch; Inferior Pincer");
types("three", "pen", "Tpd; TVI; TVII; Writing Tripod; Tripod Variation");
types("three", "bead", "Tripod; Quadpod");
types("key", "card", "Lat; Lateral; Lateral pinch; Lateral Tripod");
types("between", "pen", "Add; Adduction Grip");
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
    // Between the fingers and the thumb, which are drawn from the little finger on.
    const group = svg.querySelector("g");
    group.insertBefore(drawnObject(...OBJECTS[object]), group.lastElementChild);
  }
  svg.setAttribute("aria-label", object ? `a hand that holds a ${object}` : "an open hand");
  return true;
}

// As the hand is seen: from the side of its thumb.
const VIEW = (38 * Math.PI) / 180;

function drawnObject(shape, [x, y, z], long, thick) {
  const group = document.createElementNS(SVG, "g");
  const at = [x * Math.cos(VIEW) - z * Math.sin(VIEW), -y];
  const turn = { cylinder: 0, pen: 35, flat: -30, disc: 0, sphere: 0 }[shape];
  group.setAttribute("class", "object");
  group.setAttribute("transform", `translate(${at[0].toFixed(1)} ${at[1]}) rotate(${turn})`);
  const part = (name, attributes) => {
    const made = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    group.append(made);
    return made;
  };
  const [half, r] = [long / 2, thick / 2];
  if (shape === "sphere") part("circle", { r: half });
  else if (shape === "flat" || shape === "pen") part("rect", { x: -half, y: -r, width: long, height: thick, rx: 1.5 });
  else if (shape === "disc") {
    part("path", { d: `M${-half} 0V${thick}A${half} ${half / 3} 0 0 0 ${half} ${thick}V0Z` });
    part("ellipse", { rx: half, ry: half / 3, class: "top" });
  } else {
    // Across the palm, and seen from the thumb: its near end is a disc.
    const across = half * Math.cos(VIEW);
    part("path", { d: `M${-across} ${-r}H${across}A${r * 0.6} ${r} 0 0 1 ${across} ${r}H${-across}A${r * 0.6} ${r} 0 0 1 ${-across} ${-r}Z` });
    part("ellipse", { cx: across, rx: r * 0.6, ry: r, class: "top" });
  }
  return group;
}
