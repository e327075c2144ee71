"""The machine that measured times are of. Nothing that is deployed depends on its name."""

import platform
import re
from pathlib import Path

MODEL_FILE, PROCESSOR_FILE = Path("/proc/device-tree/model"), Path("/proc/cpuinfo")


def on_a_pi() -> bool:
    """Return whether this machine is a Raspberry Pi."""
    return "Raspberry Pi" in _text(MODEL_FILE)


def machine_name() -> str:
    """Return this machine's board or processor, and its Python: "AMD EPYC, Python 3.11"."""
    listed = re.search(r"^model name\s*:\s*(.+)$", _text(PROCESSOR_FILE), re.MULTILINE)
    board = _text(MODEL_FILE).replace("\0", "")
    name = board or (listed[1] if listed else "") or platform.processor() or platform.machine()
    plain = " ".join(re.sub(r"\((?:R|TM)\)|\bCPU\b|@.*", " ", name).split())
    return f"{plain}, Python {'.'.join(platform.python_version_tuple()[:2])}"


def _text(file: Path) -> str:
    try:
        return file.read_text(errors="replace")
    except OSError:
        return ""
