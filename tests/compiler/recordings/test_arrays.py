import io
import zipfile

import numpy as np
import pytest

from thenar.compiler.arrays import pack, unpack
from thenar.runtime.errors import FormatError


def test_numpy_reads_what_is_packed() -> None:
    with np.load(io.BytesIO(pack(b"{}", {"a": np.arange(6).reshape(2, 3)}))) as arrays:
        assert arrays["a"].tolist() == [[0, 1, 2], [3, 4, 5]]
        assert arrays["header"].tobytes() == b"{}"


def test_equal_content_gives_equal_bytes_at_any_time() -> None:
    array = np.arange(6).reshape(2, 3)
    assert pack(b"{}", {"a": array}) == pack(b"{}", {"a": np.asfortranarray(array)})
    with zipfile.ZipFile(io.BytesIO(pack(b"{}", {"a": array}))) as members:
        assert {info.date_time for info in members.infolist()} == {(1980, 1, 1, 0, 0, 0)}


def with_members(compression: int = zipfile.ZIP_STORED, **members: bytes) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return file.getvalue()


def npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def test_a_compressed_member_is_refused_before_it_is_unpacked() -> None:
    with pytest.raises(FormatError, match="compressed"):
        unpack(with_members(zipfile.ZIP_DEFLATED, header=npy(np.zeros(10**6, np.uint8))))


def test_overstated_members_are_refused_before_allocation() -> None:
    lie = npy(np.zeros(8, np.uint8)).replace(b"(8,), }" + b" " * 12, b"(8000000000000,), }")
    assert b"8000000000000" in lie
    with pytest.raises(FormatError, match="not plain numbers of its shape"):
        unpack(with_members(header=lie))


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"", "no readable arrays"),
        (b"PK\x05\x06" + bytes(18), "holds no header"),
        (with_members(a=npy(np.zeros(1))), "holds no header"),
        (with_members(header=npy(np.zeros(1))), "holds no header"),
        (with_members(header=npy(np.array(["x"]))), "not plain numbers"),
        (with_members(header=npy(np.zeros((2, 2), order="F"))), "not plain numbers"),
        (with_members(header=b"\x93NUMPY\x02\x00"), "of another npy format"),
        (with_members(header=b"no npy"), "no readable arrays"),
    ],
)
def test_what_is_no_such_npz_is_refused_with_the_reason(payload: bytes, reason: str) -> None:
    with pytest.raises(FormatError, match=reason):
        unpack(payload, "set.grasps")


def test_a_member_that_occurs_twice_is_refused() -> None:
    header = npy(np.zeros(1, np.uint8))
    payload = with_members(header=header, HEADER=header).replace(b"HEADER", b"header")
    with pytest.raises(FormatError, match="holds an array twice"):
        unpack(payload)
