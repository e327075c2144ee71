"""Bluetooth Low Energy: what a peripheral notifies, through bleak (extra `ble`).

ble://NAME, ble://ADDRESS   the peripheral that advertises this name or has this address: the transmitting
                            characteristic of a Nordic UART service, or else the only one that notifies
ble://NAME/UUID             its characteristic with this UUID
"""

import re
from contextlib import suppress
from queue import Empty, SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING, Any

from .closing import Closing
from .errors import DeviceError, SettingError
from .extras import optional
from .names import shortened

if TYPE_CHECKING:
    from collections.abc import Coroutine

    from bleak import BleakClient

BLE = re.compile(
    r"ble://([^/\x00-\x1f]{1,60})(?:/([0-9A-Fa-f]{4}|[0-9A-Fa-f]{8}(?:-[0-9A-Fa-f]{4}){3}-[0-9A-Fa-f]{12}))?"
)
# What a peripheral with a Nordic UART service sends.
NORDIC_UART = "6e400003-b5a3-f393-e0a9-e50e24dcca9e"
# Services of the standard, such as that of the battery, notify no rows.
_STANDARD = "000018"
_SEARCH_S, _CONNECT_S, _LEAVE_S = 5.0, 10.0, 2.0
_SHOWN = 5


class BleLine(Closing):
    """The notifications of a peripheral. Each may be a part of a line, a line, or a frame."""

    def __init__(self, url: str) -> None:
        """Find the peripheral, connect and subscribe. Raises DeviceError if a retry may help, SettingError if it does
        not: bleak is not installed, or it is not known which characteristic is meant.
        """
        with optional(SettingError, url):
            import bleak  # noqa: F401
        import asyncio

        self._url = url
        self._client: BleakClient | None = None
        self._came = SimpleQueue[bytes | None]()
        self._loop = asyncio.new_event_loop()
        self._thread = Thread(target=self._loop.run_forever, name=url, daemon=True)
        self._thread.start()
        try:
            self._wait(self._subscribe(), _SEARCH_S + _CONNECT_S)
        except BaseException:
            self.close()
            raise

    def read(self, timeout_s: float) -> bytes:
        """Return the next notification; b"" if none comes until the timeout. Raises DeviceError if the connection is
        lost.
        """
        try:
            data = self._came.get(timeout=max(0.0, timeout_s))
        except Empty:
            return b""
        if data is None:
            self._came.put(None)
            raise DeviceError(f"{self._url}: the connection is lost: is it on, charged and near?")
        return data

    def close(self) -> None:
        """Disconnect."""
        if self._loop.is_closed():
            return
        client, self._client = self._client, None
        if client is not None:
            with suppress(DeviceError):  # it is gone already
                self._wait(client.disconnect(), _LEAVE_S)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()
        self._came.put(None)

    def _wait(self, work: "Coroutine[Any, Any, None]", timeout_s: float) -> None:
        """Do work in the thread of the connection. Raises its errors as DeviceError."""
        import asyncio

        async def limited() -> None:
            async with asyncio.timeout(timeout_s):
                await work

        try:
            asyncio.run_coroutine_threadsafe(limited(), self._loop).result()
        except (DeviceError, SettingError):
            raise
        except TimeoutError:
            raise DeviceError(f"{self._url}: it does not respond: is it near, and connected to nothing else?") from None
        except Exception as reason:  # of bleak, of each system's Bluetooth, and of D-Bus
            said = str(reason) or type(reason).__name__
            advice = "is this computer's Bluetooth on (`bluetoothctl power on`)?"
            raise DeviceError(f"{self._url}: {said}: {advice}") from reason

    async def _subscribe(self) -> None:
        from bleak import BleakClient, BleakScanner

        found = BLE.fullmatch(self._url)
        assert found is not None
        wanted, seen = found[1].casefold(), dict[str, None]()

        def fits(device: Any, advertisement: Any) -> bool:
            names = [name for name in (advertisement.local_name, device.name) if name]
            seen.update(dict.fromkeys(names))
            return wanted in map(str.casefold, (*names, device.address))

        device = await BleakScanner.find_device_by_filter(fits, _SEARCH_S)
        if device is None:
            others = f": others are {', '.join(map(shortened, list(seen)[:_SHOWN]))}" if seen else ""
            raise DeviceError(f"{self._url}: it does not advertise; is it on, and connected to nothing else?{others}")
        self._client = client = BleakClient(device, lambda _client: self._came.put(None), timeout=_CONNECT_S)
        await client.connect()
        characteristic = self._characteristic(client, found[2])
        await client.start_notify(characteristic, lambda _sender, data: self._came.put(bytes(data)))

    def _characteristic(self, client: "BleakClient", uuid: str | None) -> str:
        """Return the UUID of the characteristic that notifies rows."""
        notify = [
            one.uuid
            for service in client.services
            for one in service.characteristics
            if not service.uuid.startswith(_STANDARD) and not {"notify", "indicate"}.isdisjoint(one.properties)
        ]
        wanted = [NORDIC_UART] if uuid is None else [uuid.lower(), f"0000{uuid.lower()}-0000-1000-8000-00805f9b34fb"]
        matching = [one for one in notify if one in wanted] or (notify if uuid is None else [])
        if len(matching) == 1:
            return matching[0]
        if not notify:
            raise SettingError(f"{self._url}: none of its characteristics notifies: it sends no rows by Bluetooth")
        ways = " or ".join(f"ble://{shortened(self._url.split('/')[2])}/{one}" for one in notify[:_SHOWN])
        raise SettingError(f"{self._url}: say which characteristic sends the rows: {ways}")
