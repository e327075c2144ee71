"""`README.txt` of a spec: what its files are, how to build from them, what to expect, and what is not certain."""

from collections.abc import Iterator
from textwrap import fill

from .expected import Expected
from .glove_spec import Summary
from .placing import CONTACT_MM

_WIDTH = 100


def readme_of(summary: Summary) -> str:
    """Return the text."""
    parts = [f"{summary.glove}: a glove of {len(summary.switches)} switches", *_building(summary)]
    parts += ["What to expect", *expectations(summary.expected)]
    doubts = [f"{m.part or m.what}: {m.note}" for m in summary.materials if not m.sure]
    parts += ["To heed", *_advice(), *summary.remarks, *doubts]
    headings = {parts[0], "To cut and sew", "To wire", "To solder", "To run", "What to expect", "To heed"}
    return "\n".join(_laid_out(part, part in headings) for part in parts)


def expectations(expected: Expected) -> Iterator[str]:
    """Yield sentences on times and recognition."""
    if expected.transactions:
        full = "" if expected.full_us == expected.scan_us else f"; for all that is wired, {expected.full_us:.1f} us"
        yield (
            f"A whole scan takes {expected.scan_us:.1f} us on the wire, in {expected.transactions} "
            f"transaction{'s' if expected.transactions > 1 else ''}{full}. What the computer adds to each of them, "
            "thenar doctor measures."
        )
    for us in expected.boards_us:
        yield f"A scanner board's bitmap takes {us:.0f} us on its line."
    if expected.glove_us is not None:
        yield f"The CyberGlove sends a record every {expected.glove_us:.0f} us at best."
    for rate in expected.rates:
        how = "on the rows trained on" if rate.protocol == "training" else f"in {rate.folds} folds, placement and all"
        yield f"Recognised {how}: {rate.correct} of {rate.total} ({rate.rate:.1%})."


def _building(summary: Summary) -> Iterator[str]:
    if summary.hand_length_mm is not None:
        yield "To cut and sew"
        yield (
            f"cutting.svg and cutting.dxf are the right hand of {summary.hand_length_mm:g} mm length laid flat, the "
            f"palm up, at 1:1 in millimetres, for {summary.print_on}. Print without scaling and measure the bar of "
            "50 mm. For a left hand, mirror it. Layers: outline, strips (the sides of the digits, unfolded), creases, "
            f"holes ({CONTACT_MM} mm, where the switch's disc meets the hand), names, scale."
        )
        yield (
            "The pattern is a map: lengths along the digits are true; the digits are spread and the palm is broader "
            "than the hand, so that the strips find room. Fit the cloth to the hand, and place the switches by the "
            "joints' creases."
        )
        yield "switches.csv: every switch with its place, counted from the middle of the wrist, and the pin it is on."
    yield "To wire"
    yield (
        "wiring.csv: a bundle of wires for each digit, and in it a wire for contact 1 of every switch and a common "
        "return for contact 2, from switch to switch. Colours count the wires of a bundle; marks tell a colour's "
        "second use from its first. Lengths are estimates: a straight way to the wrist and a quarter more."
    )
    yield "To solder"
    yield (
        "bom.csv: what to buy. glove.net: the circuit for the board at the wrist; in KiCad's board editor, File, "
        "Import, Netlist. The switches are in it with their connections and are left off the board. A part number "
        "stands only where it is known."
    )
    for reader in summary.readers:
        yield f"{reader.ref}: {reader.place}, {len(reader.switches)} switches."
    yield "To run"
    yield (
        "glove.toml: the wiring as thenar run, record, emulate and doctor read it. Device files and ports are the "
        "lines to look at. spec.json: all of this for machines."
    )


def _advice() -> Iterator[str]:
    yield "Supply all chips and pull-ups with the voltage of the host's bus: 3.3 V on a Raspberry Pi."
    yield "A contact bounces for up to 3 ms when it closes and 8 ms when it opens: thenar debounces."


def _laid_out(part: str, heading: bool) -> str:
    if heading:
        return f"{part}\n{'-' * len(part)}\n"
    return fill(part, _WIDTH) + "\n"
