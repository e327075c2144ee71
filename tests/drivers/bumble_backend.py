"""Backends of bleak whose adapter is one of bumble's, over HCI by TCP: they do what bleak's own do through BlueZ."""

from typing import Any

import bleak
import pytest
from bleak.backends.characteristic import BleakGATTCharacteristic
from bleak.backends.client import BaseBleakClient
from bleak.backends.scanner import AdvertisementData, BaseBleakScanner
from bleak.backends.service import BleakGATTService, BleakGATTServiceCollection
from bleak.uuids import normalize_uuid_str
from bumble.core import AdvertisingData
from bumble.device import Advertisement, Device, Peer
from bumble.hci import Address
from bumble.transport import open_transport


def use(monkeypatch: pytest.MonkeyPatch, hci: int) -> None:
    """Let bleak use the adapter whose HCI is at this port of 127.0.0.1."""
    monkeypatch.setattr(_Host, "hci", hci)
    monkeypatch.setattr(bleak, "get_platform_scanner_backend_type", lambda: (_Scanner, "bumble"))
    monkeypatch.setattr(bleak, "get_platform_client_backend_type", lambda: (_Client, "bumble"))


class _Host:
    hci = 0

    async def power_on(self) -> Device:
        self._transport = await open_transport(f"tcp-client:127.0.0.1:{self.hci}")
        source, sink = self._transport.source, self._transport.sink
        self._device = Device.with_hci("host", Address("C0:C1:C2:C3:C4:C5"), source, sink)
        await self._device.power_on()
        return self._device

    async def stop(self) -> None:
        await self._device.power_off()
        await self._transport.close()


class _Scanner(_Host, BaseBleakScanner):
    def __init__(self, detection_callback: Any, service_uuids: Any, scanning_mode: str, **_: Any) -> None:
        super().__init__(detection_callback, service_uuids)

    async def start(self) -> None:
        device = await self.power_on()
        device.on("advertisement", self._advertised)
        await device.start_scanning()

    def _advertised(self, came: Advertisement) -> None:
        name, address = came.data.get(AdvertisingData.COMPLETE_LOCAL_NAME), str(came.address).partition("/")[0]
        data = AdvertisementData(name, {}, {}, [], None, came.rssi, ())
        self.call_detection_callbacks(self.create_or_update_device(address, address, name, came.address, data), data)


class _Client(_Host, BaseBleakClient):
    def __init__(self, device: Any, *, services: Any = None, **options: Any) -> None:
        super().__init__(device, **options)
        self._peer_address = device.details

    async def connect(self, pair: bool, **_: Any) -> None:
        self._connection = await (await self.power_on()).connect(self._peer_address)
        self._connection.on("disconnection", lambda _reason: self._disconnected_callback())  # type: ignore[misc]
        self._peer, self.services = Peer(self._connection), BleakGATTServiceCollection()
        await self._peer.request_mtu(64)
        await self._peer.discover_all()  # type: ignore[no-untyped-call]
        for service in self._peer.services:
            known = BleakGATTService(service, service.handle, normalize_uuid_str(service.uuid.to_hex_str("-")))
            self.services.add_service(known)
            for one in service.characteristics:
                flags: Any = [flag.name.lower() for flag in one.properties if flag.name]
                found = BleakGATTCharacteristic(
                    one, one.handle, normalize_uuid_str(one.uuid.to_hex_str("-")), flags, lambda: 61, known
                )
                self.services.add_characteristic(found)

    async def disconnect(self) -> None:
        self._disconnected_callback = lambda: None
        if self.is_connected:
            await self._connection.disconnect()
        await self.stop()

    async def start_notify(self, characteristic: BleakGATTCharacteristic, callback: Any, **_: Any) -> None:
        await self._peer.subscribe(characteristic.obj, lambda value: callback(bytearray(value)))

    is_connected = property(lambda self: self._connection.handle in self._device.connections)
    mtu_size = property(lambda _self: 64)

    async def _never(self, *_: Any, **__: Any) -> Any:
        raise NotImplementedError

    pair = unpair = stop_notify = read_gatt_char = read_gatt_descriptor = _never
    write_gatt_char = write_gatt_descriptor = _never
