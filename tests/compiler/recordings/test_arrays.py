import io
import zipfile
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from thenar.compiler.recordings.arrays import pack, unpack
from thenar.runtime.errors import SealError

ARRAYS = hnp.arrays(
    st.sampled_from(["?", "u1", "<u2", "<i8", ">i4", "<f8"]), hnp.array_shapes(min_dims=0, min_side=0, max_side=4)
)


@given(st.binary(max_size=20), st.dictionaries(st.sampled_from(["a", "file", "x.y"]), ARRAYS))
def test_unpack_is_the_inverse_of_pack(header: bytes, arrays: dict[str, np.ndarray]) -> None:
    got_header, got = unpack(pack(header, arrays))
    assert got_header == header
    assert got.keys() == arrays.keys()
    for name, array in arrays.items():
        assert got[name].dtype == array.dtype
        assert got[name].shape == np.ascontiguousarray(array).shape
        assert got[name].tobytes() == array.tobytes()


def test_numpy_reads_what_is_packed() -> None:
    with np.load(io.BytesIO(pack(b"{}", {"a": np.arange(6).reshape(2, 3)}))) as arrays:
        assert arrays["a"].tolist() == [[0, 1, 2], [3, 4, 5]]
        assert arrays["header"].tobytes() == b"{}"


def test_the_same_content_gives_the_same_bytes_at_any_time_and_order_of_memory() -> None:
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
    with pytest.raises(SealError, match="compressed"):
        unpack(with_members(zipfile.ZIP_DEFLATED, header=npy(np.zeros(10**6, np.uint8))))


def test_a_member_that_claims_more_than_it_holds_is_refused_before_it_is_allocated() -> None:
    lie = npy(np.zeros(8, np.uint8)).replace(b"(8,), }" + b" " * 12, b"(8000000000000,), }")
    assert b"8000000000000" in lie
    with pytest.raises(SealError, match="not plain numbers of its shape"):
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
    with pytest.raises(SealError, match=reason):
        unpack(payload, "set.grasps")


def test_a_member_that_occurs_twice_is_refused() -> None:
    header = npy(np.zeros(1, np.uint8))
    payload = with_members(header=header, HEADER=header).replace(b"HEADER", b"header")
    with pytest.raises(SealError, match="holds an array twice"):
        unpack(payload)


@given(st.binary(max_size=300))
@example(b"PK\x03\x04" + bytes(60))
def test_random_bytes_are_refused_and_never_crash(payload: bytes) -> None:
    with pytest.raises(SealError):
        unpack(payload)


@given(st.data())
def test_mutated_bytes_are_read_or_refused_and_never_crash(data: st.DataObject) -> None:
    payload = bytearray(pack(b"{}", {"a": np.arange(4)}))
    for _ in range(data.draw(st.integers(1, 4))):
        payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.integers(0, 255))
    try:
        header, arrays = unpack(bytes(payload))
    except SealError:
        return
    assert isinstance(header, bytes)
    assert all(array.nbytes <= len(payload) for array in arrays.values())


@given(st.lists(st.tuples(st.integers(0, 127), st.sampled_from(b"()[]{}'\",:9-<uO \0\n")), min_size=1, max_size=4))
@example([(63, ord("("))])
def test_a_mutated_header_in_a_sound_zip_is_read_or_refused_and_never_crashes(changes: list[tuple[int, int]]) -> None:
    member = bytearray(npy(np.zeros(8, np.uint8)))
    for place, byte in changes:
        member[place] = byte
    with suppress(SealError):
        assert len(unpack(with_members(header=bytes(member)))[0]) == 8
