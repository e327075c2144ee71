"""What a matrix of keys reads when it has no diodes."""

Mask = int


def read_without_diodes(closed: Mask, rows: int, columns: int) -> Mask:
    """Return which keys, bits row * columns + column, read closed when those in `closed` are.

    Current finds any way from a row to a column through closed keys: rows that share a closed column are one wire.
    """
    width = (1 << columns) - 1
    wires: list[tuple[set[int], Mask]] = []
    for row in range(rows):
        held = closed >> row * columns & width
        joined = [wire for wire in wires if wire[1] & held]
        wires = [wire for wire in wires if not wire[1] & held]
        members = {row}.union(*(wire[0] for wire in joined))
        for _, others in joined:
            held |= others
        wires.append((members, held))
    return sum(held << row * columns for members, held in wires for row in members)
