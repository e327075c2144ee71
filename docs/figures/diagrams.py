"""Writes the diagrams of the documentation: python docs/figures/diagrams.py [--check]

Each diagram is a function that returns shapes and text, 688 units wide, in the colours of both schemes. With --check
nothing is written, and the exit code is 1 if a file differs from its diagram.
"""

import random
import sys
from collections.abc import Callable
from pathlib import Path
from xml.sax.saxutils import escape

from adapt import adapted

WIDTH = 688
STYLE = """text { font: 13px "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; fill: var(--ink) }
.name { font-weight: bold }
.note { font-size: 12px; fill: var(--soft) }
.small { font-size: 12px }
.code { font: 12px ui-monospace, Consolas, Menlo, monospace }
.on { fill: var(--paper) }
.box { fill: var(--pale); stroke: var(--soft) }
.cell { fill: var(--paper); stroke: var(--line) }
.mark { fill: var(--decision); stroke: var(--switches) }
.wire { fill: none; stroke: var(--soft); stroke-width: 1.5 }
.thin { fill: none; stroke: var(--soft) }
.lead { fill: none; stroke: var(--line); stroke-width: 1.5 }
.dot, .head { fill: var(--soft) }
.train { fill: var(--line) }
.inner { fill: var(--switches) }
.test { fill: var(--both) }
.none { fill: var(--pale); stroke: var(--line) }
"""

# Who imports whom, topmost first, with what each folder holds; tests compare this with tests/test_imports.py.
FOLDERS = {
    "cli": "the command: parse, call, print",
    "studio": "pages that train and show errors",
    "stability": "hard cases and their reference",
    "simulator": "scenes: grasps, hands, faults",
    "compiler": "from recordings to a build",
    "firmware_templates": "C99 templates",
    "runtime": "reads a build, recognises live",
    "drivers": "device protocols, real and emulated",
}
IMPORTS = {
    "runtime": ("drivers",),
    "compiler": ("drivers", "runtime", "firmware_templates"),
    "simulator": ("drivers", "runtime", "compiler"),
    "stability": ("drivers", "runtime", "compiler", "simulator"),
    "studio": ("drivers", "runtime", "compiler"),
    "cli": ("drivers", "runtime", "firmware_templates", "compiler", "simulator", "stability", "studio"),
}


def text(x: float, y: float, words: str, kind: str = "", anchor: str = "start") -> str:
    """Return a line of text whose base line begins, ends or has its middle at (x, y)."""
    return f'<text x="{x:g}" y="{y:g}" class="{kind}" text-anchor="{anchor}">{escape(words)}</text>'


def rect(x: float, y: float, width: float, height: float, kind: str = "box", rounded: float = 0) -> str:
    """Return a rectangle."""
    return f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="{rounded:g}" class="{kind}"/>'


def box(x: float, y: float, width: float, height: float, name: str, *notes: str) -> str:
    """Return a box with a name and notes below it, in its middle."""
    middle, top = x + width / 2, y + height / 2 + 5 - 8.5 * len(notes)
    lines = [text(middle, top + 17 * (n + 1), words, "note", "middle") for n, words in enumerate(notes)]
    return "\n".join([rect(x, y, width, height, rounded=6), text(middle, top, name, "name", "middle"), *lines])


def path(steps: str, kind: str = "wire") -> str:
    """Return a path."""
    return f'<path d="{steps}" class="{kind}"/>'


def dot(x: float, y: float) -> str:
    """Return a dot: wires that are connected."""
    return f'<circle cx="{x:g}" cy="{y:g}" r="3.5" class="dot"/>'


def arrow(x: float, y: float, to_x: float) -> str:
    """Return a level arrow."""
    back = 8 if to_x > x else -8
    head = path(f"M{to_x:g} {y:g}l{-back:g} -4.5v9z", "head")
    return path(f"M{x:g} {y:g}H{to_x - back:g}") + head


def span(x: float, to_x: float, y: float) -> str:
    """Return a level line between two ticks."""
    return path(f"M{x:g} {y - 4:g}v8M{x:g} {y:g}H{to_x:g}M{to_x:g} {y - 4:g}v8", "thin")


def way_of_data() -> tuple[int, str, list[str]]:
    """Return the five steps from recordings to a robot."""
    steps = (
        ("recordings", "CSV, ROS, npz,", "MCAP"),
        ("compiler", "chooses inputs,", "trains"),
        ("build", "integer tables,", "C firmware"),
        ("runtime", "or firmware:", "predicts live"),
        ("robot", "preshape,", "ROS 2, JSON"),
    )
    width, step = 114, 139
    shapes = [box(9 + step * n, 8, width, 76, *words) for n, words in enumerate(steps)]
    shapes += [arrow(9 + step * n + width + 3, 46, 9 + step * (n + 1) - 3) for n in range(len(steps) - 1)]
    return 92, "Recordings go to the compiler, which writes a build; runtime or firmware uses it for a robot", shapes


def architecture() -> tuple[int, str, list[str]]:
    """Return the folders, and a column of dots for each that imports others."""
    row, edge, top = 50, 416, 8
    y = {name: top + row * n for n, name in enumerate(FOLDERS)}
    column = {name: edge + 46 + 40 * n for n, name in enumerate(IMPORTS)}
    shapes = []
    for name, holds in FOLDERS.items():
        importers = [column[other] for other, imported in IMPORTS.items() if name in imported]
        shapes += [rect(8, y[name], edge - 8, 38, rounded=6), text(20, y[name] + 24, name, "name")]
        shapes.append(text(182, y[name] + 24, holds, "note"))
        if importers:
            shapes.append(arrow(max(importers), y[name] + 28, edge + 2))
            shapes += [dot(x, y[name] + 28) for x in importers]
    for name, imported in IMPORTS.items():
        last = max(y[other] for other in imported) + 28
        shapes.append(path(f"M{edge} {y[name] + 12}H{column[name]}V{last}"))
    end = top + row * len(FOLDERS) + 14
    words = "A line leaves each folder that imports others; a dot marks each folder that it imports."
    shapes.append(text(8, end, words, "note"))
    return end + 12, "Each folder imports only folders below it", shapes


def decision() -> tuple[int, str, list[str]]:
    """Return an example of what is announced, over time."""
    left, scale = 142, 0.49

    def at(ms: float) -> float:
        return left + scale * ms

    # Label, note, and what is shown until when: times in ms.
    candidates = ((170, "none"), (190, "pen"), (300, "none"), (900, "rod"), (1100, "none"))
    rows = (
        (46, "candidate", "of each frame", candidates),
        (92, "grasp", "after the dwell", ((350, "none"), (950, "rod"), (1100, "none"))),
        (176, "newest", "of the decoder", ((310, "none"), (910, "rod"), (1100, "none"))),
        (222, "150 ms ago", "final", ((450, "none"), (1050, "rod"), (1100, "none"))),
        (
            268,
            "state",
            "reported",
            ((310, "none"), (450, "forming"), (910, "held"), (1050, "releasing"), (1100, "none")),
        ),
    )
    kinds = {"none": "none", "rod": "inner", "pen": "test"}
    shapes = [text(8, 20, "Announced grasp", "name"), text(8, 150, "Segments", "name")]
    for y, name, note, blocks in rows:
        shapes += [text(8, y + 12, name), text(8, y + 28, note, "note")]
        start = 0
        for stop, kind in blocks:
            width = scale * (stop - start)
            shapes.append(rect(at(start), y, width, 26, kinds.get(kind, "mark")))
            if width > 40:
                words = "small on" if kind == "rod" else "small"
                shapes.append(text(at(start) + width / 2, y + 17, kind, words, "middle"))
            start = stop
    for ms in range(0, 1001, 200):
        shapes.append(text(at(ms), 324, str(ms) if ms else "0 ms", "note", "middle"))
    shapes.append(
        path(f"M{at(0):g} 304H{at(1100):g}" + "".join(f"M{at(ms):g} 304v6" for ms in range(0, 1101, 100)), "thin")
    )
    shapes += [span(at(300), at(350), 36), text(at(325), 26, "dwell 50 ms", "note", "middle")]
    shapes += [span(at(300), at(450), 166), text(at(375), 156, "lag 150 ms", "note", "middle")]
    shapes += [text(at(180), 26, "too short", "note", "middle"), path(f"M{at(180):g} 31v11", "thin")]
    return 334, "Candidates, the announced grasp and the state of segments over 1.1 s", shapes


def signed(score: int) -> str:
    """Return a score as in a sum."""
    return f"{score:+d}".replace("-", "−") if score else "0"


def tables() -> tuple[int, str, list[str]]:
    """Return rows of scores that a frame selects, and their sum."""
    types, left, width, height = ("rod", "pen", "disc"), 372, 84, 26
    rows = (
        ("", "bias", "", (12, -3, -9), True),
        ("thumb_distal_5", "closed", "its row", (-20, 31, 4), True),
        ("palm_heel_6", "open", "its row", (25, -14, 6), False),
        ("index_mpj", "code 143", "1 to 60", (-8, 14, 2), False),
        ("", "", "61 to 120", (3, 6, -1), False),
        ("", "", "121 to 180", (5, 22, -13), True),
        ("", "", "181 to 255", (18, -9, 0), False),
    )
    shapes = [text(left + width * (n + 0.5), 20, name, "name", "middle") for n, name in enumerate(types)]
    shapes += [text(12, 20, "input", "name"), text(158, 20, "in this frame", "name")]
    shapes.append(text(left - 14, 20, "table row", "name", "end"))
    y = 30
    for number, (name, value, bin_, scores, used) in enumerate(rows):
        y += 8 if number < 4 else 0
        shapes += [text(12, y + 18, name, "code"), text(158, y + 18, value)]
        shapes.append(text(left - 14, y + 18, bin_, "note", "end"))
        for n, score in enumerate(scores):
            shapes.append(rect(left + width * n, y, width, height, "mark" if used else "cell"))
            shapes.append(text(left + width * (n + 0.7), y + 18, signed(score), "" if used else "note", "end"))
        shapes += [text(left + width * 3 + 10, y + 18, "+", "name")] if used else []
        y += height
    sums = [sum(row[3][n] for row in rows if row[4]) for n in range(3)]
    y += 14
    shapes += [path(f"M{left} {y - 7}h{3 * width}", "wire"), text(left - 14, y + 18, "scores", "name", "end")]
    for n, score in enumerate(sums):
        best = score == max(sums)
        shapes.append(rect(left + width * n, y, width, height, "inner" if best else "cell"))
        shapes.append(text(left + width * (n + 0.7), y + 18, signed(score), "name on" if best else "", "end"))
    shapes.append(text(left - 90, y + 18, "The largest score is predicted:", "note", "end"))
    return y + height + 10, "The rows that a frame selects add up to one score for each grasp type", shapes


def folds() -> tuple[int, str, list[str]]:
    """Return the frames of trials by their use, with whole trials and without."""
    draw, trials, frames, side = random.Random(4), 8, 14, 14
    mixed = ["test"] * 28 + ["train"] * (trials * frames - 28)
    draw.shuffle(mixed)
    shapes = [text(76, 20, "Whole trials, nested", "name"), text(424, 20, "Random frames: they leak", "name")]
    for trial in range(trials):
        y = 34 + 20 * trial
        shapes += [text(x, y + 12, f"trial {trial + 1}", "note", "end") for x in (68, 416)]
        kind = {2: "test", 3: "test", 6: "inner", 7: "inner"}.get(trial, "train")
        for n in range(frames):
            shapes.append(rect(76 + (side + 2) * n, y, side, side, kind))
            shapes.append(rect(424 + (side + 2) * n, y, side, side, mixed[trial * frames + n]))
    y = 34 + 20 * trials + 18
    uses = {
        "train": "training",
        "inner": "inner test: chooses trainer and settings, in turn",
        "test": "outer test: measures the accuracy, in turn",
    }
    for n, (kind, words) in enumerate(uses.items()):
        shapes += [rect(76, y + 20 * n - 12, side, side, kind), text(98, y + 20 * n, words, "small")]
    shapes += [
        text(424, y, "Most test frames have a near", "small"),
        text(424, y + 20, "twin in the training set.", "small"),
    ]
    return y + 54, "Folds that keep trials whole, and folds of single frames", shapes


def wiring() -> tuple[int, str, list[str]]:
    """Return the ways from a sensor to the host, with their tables in glove.toml."""
    rows = (
        (("switches",), ("port expanders", "and multiplexers"), "I2C", "[[bus]]"),
        (("taxels",), ("converters", ""), "I2C or SPI", "[[bus]], [[spi]]"),
        (("any sensors",), ("your board", "prints lines"), "serial, TCP, UDP", "[[stream]]"),
        (("CyberGlove",), ("interface box", ""), "serial", "[cyberglove]"),
    )
    shapes = []
    for n, (sensor, device, line, table) in enumerate(rows):
        y = 8 + 60 * n
        shapes += [box(8, y, 138, 46, *sensor), box(184, y, 144, 46, *filter(None, device))]
        shapes += [arrow(148, y + 23, 182), arrow(330, y + 23, 532)]
        shapes += [text(428, y + 16, line, "small", "middle"), text(428, y + 40, table, "code", "middle")]
    shapes.append(box(534, 8, 146, 60 * len(rows) - 14, "host", "Linux computer:", "thenar run,", "thenar record"))
    return 60 * len(rows) + 2, "Sensors, the devices that read them, and the lines to the host", shapes


def key(x: float, y: float, name: str, row: float) -> list[str]:
    """Return a switch at a column's wire and a diode with its cathode towards the row's wire."""
    return [
        dot(x, y),
        path(f"M{x:g} {y:g}h14m0 0l22 -11m2 11h14V{row - 34:g}"),
        *(f'<circle cx="{x + c:g}" cy="{y:g}" r="2.5" class="dot"/>' for c in (14, 38)),
        path(f"M{x + 42:g} {row - 34:g}h20l-10 14z", "head"),
        path(f"M{x + 42:g} {row - 20:g}h20M{x + 52:g} {row - 20:g}V{row:g}"),
        dot(x + 52, row),
        text(x + 62, y + 4, name, "small"),
    ]


def matrix() -> tuple[int, str, list[str]]:
    """Return the circuit of the matrix in docs/how-to/wire-a-board.md."""
    columns, rows = {"8": 84, "9": 284, "10": 484}, {"2": 130, "3": 222}
    names = (("thumb_distal_5", "palm_heel_6", ""), ("index_distal_5", "", "middle_distal_8"))
    shapes = [text(8, 34, "columns,", "note"), text(8, 50, "pulled up", "note")]
    for name, x in columns.items():
        shapes += [text(x, 20, name, "name", "middle"), path(f"M{x} 28V244")]
    for name, y in rows.items():
        shapes += [text(8, y + 5, name, "name"), path(f"M42 {y}H664")]
    for words, y in zip(names, rows.values(), strict=True):
        for name, x in zip(words, columns.values(), strict=True):
            shapes += key(x, y - 62, name, y) if name else []
    words = "Rows are driven low, one at a time. Wires that cross without a dot are not connected."
    shapes.append(text(8, 268, words, "note"))
    return 280, "Each switch has a diode between its column and its row, with the cathode towards the row", shapes


DIAGRAMS: dict[str, Callable[[], tuple[int, str, list[str]]]] = {
    "way-of-data": way_of_data,
    "architecture": architecture,
    "decision": decision,
    "tables": tables,
    "folds": folds,
    "wiring": wiring,
    "matrix": matrix,
}


def drawn(name: str) -> str:
    """Return a diagram as SVG."""
    height, title, shapes = DIAGRAMS[name]()
    size = f'width="{WIDTH}" height="{height}" viewBox="0 0 {WIDTH} {height}"'
    paper = f'<rect width="{WIDTH}" height="{height}" style="fill: var(--paper)"/>'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">\n<title>{escape(title)}</title>'
    return adapted("\n".join([head, f"<style>\n{STYLE}</style>", paper, *filter(None, shapes), "</svg>\n"]))


def main() -> None:
    """Write the diagrams, or check them."""
    differing = []
    for name in DIAGRAMS:
        path, drawing = Path(__file__).with_name(f"{name}.svg"), drawn(name)
        if sys.argv[1:] != ["--check"]:
            path.write_text(drawing, encoding="utf-8")
        elif not path.is_file() or path.read_text(encoding="utf-8") != drawing:
            differing.append(path.name)
    if differing:
        sys.exit(f"not what docs/figures/diagrams.py draws: {', '.join(differing)}; run it without --check")


if __name__ == "__main__":
    main()
