"""libFuzzer on the C of a board, with the address and undefined behaviour sanitizers."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from thenar.compiler.firmware.protocol import BoardConfig, protocol_files
from thenar.drivers import scanner_protocol
from thenar.drivers.scanner_protocol import GetState, Ping, SetDebounce, SetRate, ToBoard, frame

FLAGS = ("-std=c99", "-g", "-O2", "-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all")


@pytest.fixture
def corpus(tmp_path: Path) -> Path:
    """What a host says when all is well, and what it never says."""
    messages: list[ToBoard] = [SetRate(1000, 0, 50_000), SetRate(500, 2000, 0), SetDebounce(5000, 10_000)]
    messages += [GetState(), Ping(1)]
    wire = [scanner_protocol.encode(frame(message, number)) for number, message in enumerate(messages)]
    others = [scanner_protocol.Frame(0x11, 0, bytes(250)), scanner_protocol.Frame(0x77, 9, b"\1" * 13)]
    said = [*wire, b"".join(wire * 3), *map(scanner_protocol.encode, others), b"\1" * 600 + b"\0" + wire[0]]
    folder = tmp_path / "corpus"
    folder.mkdir()
    for number, data in enumerate(said):
        (folder / f"{number:02}").write_bytes(data)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(("keys", "runs"), [(33, 80_000), (300, 3_000)])
def test_no_bytes_from_the_line_do_the_board_harm(
    tool: Callable[[str], str], corpus: Path, tmp_path: Path, keys: int, runs: int
) -> None:
    for name, text in protocol_files(BoardConfig(1, keys, press_us=5000, release_us=10_000)).items():
        (tmp_path / name).write_text(text)
    target = Path(__file__).with_name("fuzz_board.c")
    sources = [str(target), *(str(path) for path in sorted(tmp_path.glob("*.c")))]
    subprocess.run([tool("clang"), *FLAGS, f"-I{tmp_path}", *sources, "-o", "fuzz"], cwd=tmp_path, check=True)
    limits = [f"-runs={runs}", "-seed=1", "-max_len=256", "-rss_limit_mb=1024"]
    # Started by a shell: a process that we start ourselves counts our own peak of memory as its own.
    done = subprocess.run(
        ["sh", "-c", '"$@"; exit $?', "sh", "./fuzz", *limits, str(corpus)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=500,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert f"Done {runs} runs" in done.stderr
