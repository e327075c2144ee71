"""How a piece of work reaches a worker of a cluster, large arrays apart, and what is done there."""

import pickle
import sys
from collections.abc import Sequence
from functools import lru_cache
from importlib.metadata import version
from io import BytesIO
from typing import TYPE_CHECKING, Any
from weakref import ref

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.errors import ThenarError

if TYPE_CHECKING:
    from distributed import Client, Future

# Arrays from this size on go to the workers once, not with every piece of work that holds them.
SHARED_BYTES = 1 << 16


class UnreadableError(ThenarError):
    """A worker cannot read what it is to do."""


class SharedArrays:
    """Large arrays, each sent to all workers when a task first holds it, and dropped there when it is gone here."""

    def __init__(self, client: "Client") -> None:
        self._client = client
        self._sent: dict[int, tuple[ref[NDArray[Any]], Future[Any]]] = {}

    def packed(self, piece: object) -> "list[bytes | Future[Any]]":
        """Return the arguments of `answered` for a piece of work."""
        file = BytesIO()
        packer = _Packer(file, pickle.HIGHEST_PROTOCOL)
        packer.dump(piece)
        return [file.getvalue(), *map(self._future, packer.arrays)]

    def _future(self, array: NDArray[Any]) -> "Future[Any]":
        number = id(array)
        if number not in self._sent:
            gone = ref(array, lambda _: self._sent.pop(number, None))
            self._sent[number] = gone, self._client.scatter(array, broadcast=True, hash=False)
        return self._sent[number][1]


class _Packer(pickle.Pickler):
    """Pickles all but large arrays, which it collects."""

    def __init__(self, file: BytesIO, protocol: int) -> None:
        super().__init__(file, protocol)
        self.arrays: list[NDArray[Any]] = []

    def persistent_id(self, part: Any) -> int | None:
        if type(part) is not np.ndarray or part.nbytes < SHARED_BYTES or part.dtype.hasobject:
            return None
        self.arrays.append(part)
        return len(self.arrays) - 1


class _Unpacker(pickle.Unpickler):
    """Undoes what _Packer did, given the arrays."""

    def __init__(self, data: bytes, arrays: Sequence[NDArray[Any]]) -> None:
        super().__init__(BytesIO(data))
        self._arrays = arrays

    def persistent_load(self, number: int) -> NDArray[Any]:
        array = self._arrays[number]
        array.flags.writeable = False  # other pieces of work have it too
        return array


def answered(data: bytes, *arrays: NDArray[Any]) -> Any:
    """Do a piece of work, in a worker."""
    try:
        work, task = _Unpacker(data, arrays).load()
    except Exception as reason:
        raise UnreadableError(
            f"a worker with thenar {installed()} and Python {sys.version.split()[0]} cannot read its work ({reason})"
        ) from reason
    _take_one_thread(len(sys.modules))
    return work(task)


@lru_cache(maxsize=1)
def _take_one_thread(_modules: int) -> None:
    """Give BLAS and OpenMP one thread; again when modules, and with them libraries, have been loaded since."""
    from threadpoolctl import threadpool_limits

    threadpool_limits(limits=1)


def installed() -> str:
    """Return the version of thenar in this process."""
    return version("thenar")
