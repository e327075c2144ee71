"""Backends of bleak whose adapter is one of bumble's, over HCI by TCP: they do what bleak's own do through BlueZ."""

import os
from typing import Any

import bleak
import pytest
from bleak.backends.characteristic import BleakGATTCharacteristic
from bleak.backends.client import BaseBleakClient, NotifyCallback
from bleak.backends.scanner import AdvertisementData, BaseBleakScanner
from bleak.backends.service import BleakGATTService, BleakGATTServiceCollection
from bumble.core import AdvertisingData
from bumble.device import Advertisement, Device, Peer
from bumble.hci import Address
from bumble.transport import open_transport

ADAPTER = "THENAR_TEST_ADAPTER"


def use(monkeypatch: pytest.MonkeyPatch, hci: int) -> None:
    """Let bleak use the adapter whose HCI is at this port of 127.0.0.1."""
    monkeypatch.setattr(bleak, "get_platform_scanner_backend_type", lambda: (Scanner, "bumble"))
    monkeypatch.setattr(bleak, "get_platform_client_backend_type", lambda: (Client, "bumble"))
    monkeypatch.setenv(ADAPTER, str(hci))


async def _opened() -> tuple[Any, Device]:
    hci = await open_transport(f"tcp-client:127.0.0.1:{os.environ[ADAPTER]}")
    device = Device.with_hci("host", Address("C0:C1:C2:C3:C4:C5"), hci.source, hci.sink)
    await device.power_on()
    return hci, device


class Scanner(BaseBleakScanner):
    def __init__(self, detection_callback: Any, service_uuids: Any, scanning_mode: str, **_: Any) -> None:
        super().__init__(detection_callback, service_uuids)

    async def start(self) -> None:
        self.seen_devices = {}
        self._hci, self._device = await _opened()
        self._device.on("advertisement", self._advertised)
        await self._device.start_scanning()

    def _advertised(self, came: Advertisement) -> None:
        name = came.data.get(AdvertisingData.COMPLETE_LOCAL_NAME)
        data = AdvertisementData(name, {}, {}, [], None, came.rssi, ())
        address = str(came.address).partition("/")[0]
        self.call_detection_callbacks(self.create_or_update_device(address, address, name, came.address, data), data)

    async def stop(self) -> None:
        await self._device.power_off()
        await self._hci.close()


class Client(BaseBleakClient):
    """A connection; what is never called is not there."""

    def __init__(self, device: Any, *, services: Any = None, **options: Any) -> None:
        super().__init__(device, **options)
        self._peer_address = device.details

    name = mtu_size = property(lambda _self: NotImplemented)
    is_connected = property(lambda self: self._connection is not None)

    async def connect(self, pair: bool, **_: Any) -> None:
        self._hci, self._device = await _opened()
        self._connection = await self._device.connect(self._peer_address)
        self._connection.on("disconnection", self._lost)
        self._peer = Peer(self._connection)
        await self._peer.request_mtu(64)
        await self._peer.discover_all()  # type: ignore[no-untyped-call]
        self.services = BleakGATTServiceCollection()
        for service in self._peer.services:
            known = BleakGATTService(service, service.handle, service.uuid.to_hex_str("-").lower())
            self.services.add_service(known)
            for one in service.characteristics:
                flags: Any = [
                    flag.name.lower() for flag in type(one.properties) if flag in one.properties and flag.name
                ]
                uuid = one.uuid.to_hex_str("-").lower()
                uuid = uuid if len(uuid) > 8 else f"{uuid:0>8}-0000-1000-8000-00805f9b34fb"
                self.services.add_characteristic(
                    BleakGATTCharacteristic(one, one.handle, uuid, flags, lambda: 61, known)
                )

    def _lost(self, _reason: int) -> None:
        if self._disconnected_callback is not None:
            self._disconnected_callback()

    async def disconnect(self) -> None:
        self._disconnected_callback = None
        if self._connection.handle in self._device.connections:
            await self._connection.disconnect()
        await self._device.power_off()
        await self._hci.close()

    async def start_notify(self, characteristic: BleakGATTCharacteristic, callback: NotifyCallback, **_: Any) -> None:
        await self._peer.subscribe(characteristic.obj, lambda value: callback(bytearray(value)))

    async def _never(self, *_: Any, **__: Any) -> Any:
        raise NotImplementedError

    pair = unpair = stop_notify = _never
    read_gatt_char = read_gatt_descriptor = write_gatt_char = write_gatt_descriptor = _never
