"""A circuit as KiCad's netlist, the S-expressions that `Import Netlist` of its board editor reads."""

import uuid
from collections.abc import Iterator

from .circuit import Circuit, Component, Kind

_VERSION = "E"
# Any constant will do: identifiers must only be the same whenever the same component is written.
_NAMESPACE = uuid.UUID("5e1f3c0a-7f7a-5d0b-9a53-4d6f0b7c2e61")


def netlist_of(circuit: Circuit, title: str) -> bytes:
    """Return the netlist. What is off the board is in it, and KiCad is told to leave it out of the layout.

    It holds no date and no path: the same circuit gives the same bytes.
    """
    lines = [
        f"(export (version {_quoted(_VERSION)})",
        f'  (design (source {_quoted(title)}) (date "") (tool "thenar")',
        f'    (sheet (number "1") (name "/") (tstamps "/") (title_block (title {_quoted(title)}))))',
        "  (components",
        *(line for component in circuit.components for line in _component(component)),
        "  )",
        "  (libparts",
        *(line for kind in _symbols(circuit) for line in _libpart(kind)),
        "  )",
        "  (libraries)",
        "  (nets",
        *_nets(circuit),
        "  ))",
    ]
    return ("\n".join(lines) + "\n").encode()


def _component(component: Component) -> Iterator[str]:
    kind = component.kind
    yield f"    (comp (ref {_quoted(component.ref)})"
    yield f"      (value {_quoted(component.name if component.name and not kind.part else kind.value)})"
    if kind.footprint:
        yield f"      (footprint {_quoted(kind.footprint)})"
    fields = {"MPN": kind.part, "Manufacturer": kind.maker, "Place": component.name}
    given = [f"(field (name {_quoted(name)}) {_quoted(value)})" for name, value in fields.items() if value]
    if given:
        yield f"      (fields {' '.join(given)})"
    yield f'      (libsource (lib {_quoted(kind.library)}) (part {_quoted(kind.symbol)}) (description ""))'
    if not component.on_board:
        yield '      (property (name "exclude_from_board"))'
    yield '      (sheetpath (names "/") (tstamps "/"))'
    yield f"      (tstamps {_quoted(str(uuid.uuid5(_NAMESPACE, component.ref)))}))"


def _symbols(circuit: Circuit) -> list[Kind]:
    """Return one sort of component for each symbol."""
    return list({(c.kind.library, c.kind.symbol): c.kind for c in circuit.components}.values())


def _libpart(kind: Kind) -> Iterator[str]:
    yield f"    (libpart (lib {_quoted(kind.library)}) (part {_quoted(kind.symbol)})"
    yield "      (pins"
    for number, name, electrical in kind.pins:
        yield f"        (pin (num {_quoted(number)}) (name {_quoted(name)}) (type {_quoted(electrical)}))"
    yield "      ))"


def _nets(circuit: Circuit) -> Iterator[str]:
    pins = {c.ref: {number: (name, kind) for number, name, kind in c.kind.pins} for c in circuit.components}
    for code, (net, nodes) in enumerate(circuit.nets.items(), start=1):
        yield f'    (net (code "{code}") (name {_quoted(net)})'
        for node in nodes:
            name, electrical = pins[node.ref][node.pin]
            yield (
                f"      (node (ref {_quoted(node.ref)}) (pin {_quoted(node.pin)}) "
                f"(pinfunction {_quoted(name)}) (pintype {_quoted(electrical)}))"
            )
        yield "    )"


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
