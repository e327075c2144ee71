"""Manifests without builds, the shipped hand, and a reader of netlists that shares nothing with the writer."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from thenar.runtime.manifest import Calibration, Manifest, Origin, Proof, Recognised, Switch
from thenar.runtime.recipe import Recipe

Tree = str | list["Tree"]


@dataclass(frozen=True)
class Netlist:
    """What a netlist says: fields of each component, names of each library pin, and (designator, pin) pairs by net."""

    components: dict[str, dict[str, str]]
    off_board: frozenset[str]
    pin_names: dict[tuple[str, str], str]
    nets: dict[str, list[tuple[str, str]]]

    def net_of(self, ref: str, pin: str) -> str:
        (net,) = [name for name, nodes in self.nets.items() if (ref, pin) in nodes]
        return net

    def pin_of(self, ref: str, name: str) -> str:
        part = self.components[ref]["part"]
        (pin,) = [number for (owner, number), called in self.pin_names.items() if (owner, called) == (part, name)]
        return pin


def parse(text: str) -> Tree:
    stack: list[list[Tree]] = [[]]
    for opening, closing, quoted, bare in re.findall(r'(\()|(\))|"((?:\\.|[^"\\])*)"|([^\s()"]+)', text):
        if opening:
            stack.append([])
        elif closing:
            done = stack.pop()
            stack[-1].append(done)
        else:
            stack[-1].append(bare or re.sub(r"\\(.)", r"\1", quoted))
    (tree,) = stack[0]
    return tree


def children(tree: Tree, head: str) -> list[list[Tree]]:
    return [child for child in tree[1:] if isinstance(child, list) and child[:1] == [head]]


def text_of(tree: Tree, head: str) -> str:
    (child,) = children(tree, head)
    assert isinstance(child[1], str)
    return child[1]


def read_netlist(data: bytes) -> Netlist:
    tree = parse(data.decode())
    assert tree[0] == "export"
    assert text_of(tree, "version") == "E"
    components, off_board = {}, set()
    for comp in children(children(tree, "components")[0], "comp"):
        ref = text_of(comp, "ref")
        assert ref not in components
        footprints = [str(child[1]) for child in children(comp, "footprint")]
        components[ref] = {
            "value": text_of(comp, "value"),
            "footprint": "".join(footprints),
            "part": text_of(children(comp, "libsource")[0], "part"),
        }
        if any(text_of(child, "name") == "exclude_from_board" for child in children(comp, "property")):
            off_board.add(ref)
    names = {}
    for part in children(children(tree, "libparts")[0], "libpart"):
        for pin in children(children(part, "pins")[0], "pin"):
            names[text_of(part, "part"), text_of(pin, "num")] = text_of(pin, "name")
    nets: dict[str, list[tuple[str, str]]] = {}
    for net in children(children(tree, "nets")[0], "net"):
        nodes = [(text_of(node, "ref"), text_of(node, "pin")) for node in children(net, "node")]
        assert nets.setdefault(text_of(net, "name"), nodes) is nodes
    return Netlist(components, frozenset(off_board), names, nets)


def manifest_of(names: Sequence[str], joints: bool = True) -> Manifest:
    """Return a build's manifest that keeps the switches of these names, and one joint unless told otherwise."""
    return Manifest(
        schema=1,
        checksum="",
        thenar="0",
        tables_sha256="0" * 64,
        ensemble_sha256="0" * 64,
        source=Origin("0" * 64, 10, "own", 160, joints=22),
        options=Recipe(0, 1, "both", 1.0, 0, 1),
        grasps=("cup", "pen"),
        switches=tuple(Switch(number, name, 0.1) for number, name in enumerate(names)),
        joints=(Calibration(0, "thumb_mpj", "deg", 0, 0.0, 255, 90.0),) if joints else (),
        proof=Proof(16, 1.0, 1, 0.5, 1.0, 10, 0),
        rates=(
            Recognised("training", 0, 1, 10, 10),
            Recognised("nested", 4, 1, 9, 10, "new subject", "trials", 0.6, 0.98),
        ),
    )
