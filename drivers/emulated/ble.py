"""An emulated peripheral of Bluetooth Low Energy, by bumble's controllers: real packets of HCI, ATT and GATT."""

import asyncio
from threading import Thread
from typing import TYPE_CHECKING

from bumble.controller import Controller
from bumble.core import AdvertisingData
from bumble.device import Device
from bumble.gatt import Characteristic, Service
from bumble.hci import Address
from bumble.host import Host
from bumble.link import LocalLink
from bumble.transport.common import AsyncPipeSink, StreamPacketSink, StreamPacketSource

from ..ble import NORDIC_UART
from ..closing import Closing

if TYPE_CHECKING:
    from collections.abc import Coroutine, Sequence
    from concurrent.futures import Future

ADDRESS = "F0:F1:F2:F3:F4:F5"
_SERVICE = "6E400001-B5A3-F393-E0A9-E50E24DCCA9E"  # of the Nordic UART
_OVERHEAD = 3  # of a notification, of the bytes that a packet of ATT may have


class _Adapter(StreamPacketSource):
    """The controller of whoever connects by TCP."""

    def __init__(self, air: LocalLink) -> None:
        super().__init__()
        self._air = air

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.WriteTransport)
        self._controller = Controller("adapter", self, StreamPacketSink(transport), self._air)

    def connection_lost(self, _reason: Exception | None) -> None:
        self._air.remove_controller(self._controller)


class EmulatedPeripheral(Closing):
    """A peripheral that advertises its name and notifies what `send` is given, with an adapter near it for each client.

    uuids  its characteristics that notify; `send` is by the first
    hci    the port of 127.0.0.1 where adapters talk HCI with their hosts
    """

    def __init__(self, name: str, uuids: "Sequence[str]" = (NORDIC_UART,)) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = Thread(target=self._loop.run_forever, name=name, daemon=True)
        self._thread.start()
        self._do(self._start(name, uuids)).result()

    def send(self, data: bytes) -> None:
        """Notify this to whoever has subscribed, in as many notifications as it takes."""
        self._do(self._notify(data))

    def hang_up(self) -> None:
        """Close all connections; it advertises again."""
        self._do(self._disconnect()).result()

    def close(self) -> None:
        """Leave the air."""
        self._do(self._stop()).result()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    def _do(self, work: "Coroutine[None, None, None]") -> "Future[None]":
        return asyncio.run_coroutine_threadsafe(work, self._loop)

    async def _start(self, name: str, uuids: "Sequence[str]") -> None:
        air = LocalLink()  # type: ignore[no-untyped-call]
        self._adapters = await self._loop.create_server(lambda: _Adapter(air), "127.0.0.1")
        self.hci: int = self._adapters.sockets[0].getsockname()[1]
        own = Controller("peripheral", link=air)
        self._device = Device(name, Address(ADDRESS), host=Host(own, AsyncPipeSink(own)))
        notify, read = Characteristic.Properties.NOTIFY, Characteristic.READABLE
        self._sent: list[Characteristic[bytes]] = [Characteristic(uuid, notify, read) for uuid in uuids]
        self._device.add_service(Service(_SERVICE, self._sent))
        self._device.advertising_data = bytes(AdvertisingData([(AdvertisingData.COMPLETE_LOCAL_NAME, name.encode())]))
        await self._device.power_on()
        await self._device.start_advertising(auto_restart=True, advertising_interval_min=20.0)

    async def _notify(self, data: bytes) -> None:
        for connection in list(self._device.connections.values()):
            most = connection.att_mtu - _OVERHEAD
            for start in range(0, len(data), most):
                await self._device.notify_subscriber(connection, self._sent[0], data[start : start + most])

    async def _disconnect(self) -> None:
        for connection in list(self._device.connections.values()):
            await connection.disconnect()

    async def _stop(self) -> None:
        self._adapters.close()
        await self._device.power_off()
