import errno
from collections.abc import Sequence

import pytest

from thenar.drivers.errors import DeviceError
from thenar.drivers.i2c.chips import CHIPS
from thenar.drivers.i2c.keeper import Keeper, PlacedChip
from thenar.drivers.i2c.node import Node, Query, Run


class DeadNode(Node):
    """An adapter that answers every transfer with one errno, until its node is gone too."""

    def __init__(self, code: int) -> None:
        super().__init__("/dev/i2c-7")
        self.code, self.gone = code, False

    def open(self) -> None:
        if self.gone:
            raise DeviceError(f"{self.device} cannot be opened")

    def claim(self, address: int) -> None:
        pass

    def write(self, address: int, data: bytes) -> None:
        raise OSError(self.code, "dead")

    def prepare(self, queries: Sequence[Query]) -> Run:
        raise OSError(self.code, "dead")


@pytest.mark.parametrize("code", [errno.EREMOTEIO, errno.ENXIO, errno.EIO, errno.ETIMEDOUT])
def test_an_adapter_that_is_gone_is_noticed_whatever_it_says_of_its_chips(code: int) -> None:
    node = DeadNode(code)
    chips = [PlacedChip(node.device, CHIPS["mcp23017"], address, frozenset(), None) for address in (0x20, 0x21)]
    keeper = Keeper(node, chips, check_every_s=1.0)
    keeper.begin()
    assert not any(chip.present for chip in chips)
    node.gone = True
    with pytest.raises(DeviceError, match="cannot be opened"):
        keeper.attend()
