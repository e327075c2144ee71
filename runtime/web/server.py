"""`Server`: serves pages, their files, and live messages to every browser that has one open.

It runs on a separate thread. A publisher leaves a reference and goes on; a message is made when it is sent, and none is
made while no page is open. Every page gets the newest message of each of its topics, at most 30 times a second. Only
the system buffers for a browser: a slow one sees fewer moments, and one that reads nothing, or does not reply to a
ping, for five seconds is dropped.
"""

import asyncio
import logging
import secrets
import socket
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from threading import Event, Thread
from urllib.parse import quote

import msgspec
from aiohttp import WSCloseCode, WSMsgType, web

from thenar.drivers.closing import Closing
from thenar.drivers.errors import ThenarError

from ..sinks.sockets import listen
from .guard import HEADERS, Guard

Message = bytes | Callable[[], bytes]

_log = logging.getLogger("thenar")
# It would write a stranger's input into our log.
_quiet = logging.getLogger("thenar.web")
_quiet.setLevel(logging.CRITICAL)

PAGES = Path(__file__).parent / "pages"
_KINDS = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
_TYPES = {suffix: f"{kind}; charset=utf-8" for suffix, kind in _KINDS.items()}

PERIOD_S = 1 / 30
# Pages open at the same time, and connections, some of which fetch files.
MOST_PAGES, MOST_CONNECTIONS = 32, 96
# Time limit of a connection that is not a page.
_FETCH_S = 20.0
# A silent page is pinged after this time; every browser replies by itself, and has half as long for that: a page that
# takes nothing for five seconds is dropped.
PING_S = 5.0 / 1.5
_SEND_BUFFER = 65_536
# A page sends a few words when a user presses a button or holds a key.
MOST_BYTES, MOST_PER_S, MOST_AT_ONCE = 16_384, 20.0, 40.0
# Files that can be downloaded at the same time: a new one takes the place of the oldest.
_MOST_OFFERED = 8
# Replies that a page has not read, before it loses its place.
MOST_UNREAD = 4 << 20
_CLOSING_S = 0.5
_ANY = {"0.0.0.0", "::"}


def message(topic: str, content: object = None, **more: object) -> bytes:
    """Return the text of a message: the topic, the fields of `content` (a struct, dataclass or mapping), and more."""
    fields = {} if content is None else msgspec.to_builtins(content)
    return msgspec.json.encode({"topic": topic, **fields, **more})


class Server(Closing):
    """Serves pages until it is closed; a context manager.

    Parameters
    ----------
    page : str
        Name of the first page: "live" is `pages/live.html`.
    address : str
        "127.0.0.1:8080", "localhost:8080", "[::1]:8080" or "8080". Port 0 is any free one.
    token : str or None
        The secret that the first address must hold; None is for loopback addresses only.
    on_message : callable, optional
        Takes a page's message: an object with "do", a string. It is called on the server's thread. A ThenarError that
        it raises is sent to that page only, as the message "refused", and so is a message that it returns.
    folder : Path
        A folder of pages, whose files are served in addition to those of the live page.

    Attributes
    ----------
    url : str
        The address to open, including the token.
    thread : Thread
        The server's thread.

    Raises
    ------
    SettingError
        For an invalid address or token.
    SinkError
        If the address is taken.
    """

    def __init__(
        self,
        page: str,
        address: str = "127.0.0.1:8080",
        *,
        token: str | None,
        on_message: Callable[[Mapping[str, object]], bytes | None] | None = None,
        folder: Path = PAGES,
    ) -> None:
        self._files = _files(page, folder)
        self._listener = listen(address, f"--web {address}", "127.0.0.1:8080")
        try:
            there, port = self._listener.getsockname()[:2]
            name = address.rpartition(":")[0].strip("[]") or there
            self._guard = Guard(name, there, port, token)
        except ThenarError:
            self._listener.close()
            raise
        shown = socket.gethostname() if name in _ANY else name
        self.url = f"http://{f'[{shown}]' if ':' in shown else shown}:{port}/" + (f"?token={token}" if token else "")
        self._on_message = on_message
        self._latest: dict[str, Message] = {}
        self._pages: list[_Page] = []
        self._started = Event()
        self.thread = Thread(target=self._run, name="thenar web", daemon=True)
        self.thread.start()
        self._started.wait()

    def publish(self, topic: str, message: Message) -> None:
        """Make this the newest message of its topic: its text, or a function that makes it on the server's thread.

        It is sent to the pages that are open, and to each one that is opened later. Never blocks. A message not sent
        before the next of its topic is dropped.
        """
        self._latest[topic] = message

    def offer(self, name: str, content: bytes) -> str:
        """Let pages download `content` as a file called `name`, and return the address to ask for.

        The address is random, and browsers save what is there: they do not show it as a page of this server.
        """
        address = f"/offered/{secrets.token_urlsafe(12)}"
        saved = f"attachment; filename*=UTF-8''{quote(name, safe='', errors='replace')}"
        self._files[address] = content, {"Content-Type": "application/octet-stream", "Content-Disposition": saved}
        for old in [path for path in list(self._files) if path.startswith("/offered/")][:-_MOST_OFFERED]:
            del self._files[old]
        return address

    @property
    def pages(self) -> int:
        """The number of open pages."""
        return len(self._pages)

    def close(self) -> None:
        """End the server; may be called again."""
        if self.thread.is_alive():
            self._loop.call_soon_threadsafe(self._ticking.cancel)
            self.thread.join()

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except Exception:  # a bug of ours, which must not end the run
            _log.exception("the page's server: a bug in the program")
        finally:
            self._started.set()

    async def _serve(self) -> None:
        self._loop, self._somebody = asyncio.get_running_loop(), asyncio.Event()
        self._server = web.Server(
            self._respond, access_log=None, logger=_quiet, keepalive_timeout=_FETCH_S, lingering_time=0
        )
        # Every connection has the buffer of the listener.
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        listening = await self._loop.create_server(self._connection, sock=self._listener)
        self._ticking = asyncio.create_task(self._tick())
        self._started.set()
        try:
            with suppress(asyncio.CancelledError):
                await self._ticking
        finally:
            listening.close()
            # The last message that a page shows is how it ended.
            for page in tuple(self._pages):
                await page.show(self._latest.copy(), _text)
            await asyncio.gather(*(page.close(WSCloseCode.GOING_AWAY) for page in self._pages))
            await self._server.shutdown(_CLOSING_S)

    def _connection(self) -> asyncio.Protocol:
        """Return the protocol of a new connection."""
        handler = self._server()

        def end_unless(may_stay: Callable[[], bool]) -> None:
            if handler.transport is not None and not may_stay():
                handler.transport.abort()

        # As soon as it has a transport, if it came after as many as there may be; and once it had time to fetch a file.
        self._loop.call_later(0, end_unless, lambda: handler in self._server.connections[:MOST_CONNECTIONS])
        self._loop.call_later(
            _FETCH_S, end_unless, lambda: any(page.transport is handler.transport for page in self._pages)
        )
        return handler

    async def _tick(self) -> None:
        """Send new messages to every page, while any is open."""
        due_s = self._loop.time()
        while True:
            if not self._pages:
                self._somebody.clear()
                await self._somebody.wait()
            now_s = self._loop.time()
            due_s = max(due_s + PERIOD_S, now_s)
            await asyncio.sleep(due_s - now_s)
            # Made once for all of them. One that hangs does not reply to a ping.
            latest, text = self._latest.copy(), cache(_text)
            for page in tuple(self._pages):
                if page.transport.get_write_buffer_size() == 0:
                    await page.show(latest, text)

    async def _respond(self, request: web.BaseRequest) -> web.StreamResponse:
        guard = self._guard
        if not guard.knows_host(request.headers.get("Host", "")):
            return _said(403, "Open this page by its numeric address, by localhost, or by this machine's name.")
        if request.method not in ("GET", "HEAD") or request.body_exists:
            return _said(405, "This server accepts no data.")
        if guard.takes_token(request.query.get("token")):
            return _welcome(guard)
        if not guard.lets_in(request.cookies.get(guard.cookie)):
            return _said(403, "Open the full address that thenar printed, including its token.")
        if request.path == "/live":
            return await self._live(request)
        if (file := self._files.get(request.path)) is None:
            return _said(404, "There is no such page.")
        return web.Response(body=file[0], headers=HEADERS | file[1])

    async def _live(self, request: web.BaseRequest) -> web.StreamResponse:
        if not self._guard.same_origin(request.headers.get("Origin"), request.headers.get("Host", "")):
            return _said(403, "This server only serves thenar's own page.")
        transport = request.transport
        if transport is None or len(self._pages) >= MOST_PAGES:
            return _said(503, f"{MOST_PAGES} pages are already open: close one.")
        live = web.WebSocketResponse(
            autoping=False,
            compress=False,
            max_msg_size=MOST_BYTES,
            timeout=_CLOSING_S,
            decode_text=False,
            heartbeat=PING_S,
        )
        live.headers.update(HEADERS)
        await live.prepare(request)
        topics = request.query.get("topics")
        page = _Page(live, transport, self._loop.time(), frozenset(topics.split(",")) if topics else None)
        await page.show(self._latest.copy(), _text)
        self._pages.append(page)
        self._somebody.set()
        try:
            await self._listen(page)
        finally:
            self._pages.remove(page)
            if live.exception() is not None:
                transport.abort()  # a page that hangs would keep what was not sent yet
        return live

    async def _listen(self, page: "_Page") -> None:
        async for came in page.socket:
            if not page.may_speak(self._loop.time()) or page.transport.get_write_buffer_size() > MOST_UNREAD:
                await page.close(WSCloseCode.POLICY_VIOLATION)
                return
            if came.type is WSMsgType.PING and page.transport.get_write_buffer_size() == 0:
                await page.socket.pong(came.data)
            elif came.type is WSMsgType.TEXT:
                await self._take(page, came.data)
            elif came.type is WSMsgType.BINARY:
                await page.close(WSCloseCode.UNSUPPORTED_DATA)
                return

    async def _take(self, page: "_Page", text: bytes) -> None:
        """Pass on a page's request; report an invalid one to it."""
        asked: dict[str, object] = {}
        try:
            asked = msgspec.json.decode(text, type=dict[str, object])
            if not isinstance(asked.get("do"), str):
                raise msgspec.ValidationError("it has no `do`")
            if self._on_message is None:
                raise ThenarError("this page takes no requests")
            await page.say(self._on_message(asked) or b"")
        except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as wrong:
            await page.say(message("refused", why=f"the page sent an invalid message: {wrong}"))
        except ThenarError as reason:
            await page.say(message("refused", do=asked.get("do"), why=str(reason)))
        except Exception as fault:  # a bug of ours
            _log.exception("the page's server: a bug in the program")
            await page.say(message("refused", do=asked.get("do"), why=f"a bug in thenar: {type(fault).__name__}"))


class _Page:
    """A page that is open in a browser: its WebSocket, the topics that it shows, or all, and what it was sent last."""

    def __init__(
        self, live: web.WebSocketResponse, transport: asyncio.Transport, now_s: float, topics: frozenset[str] | None
    ) -> None:
        self.socket, self.transport, self._topics = live, transport, topics
        # Nothing is sent until the system has taken everything before it: writing never has to wait.
        transport.set_write_buffer_limits(high=2**30)
        self._sent: dict[str, Message] = {}
        self._may, self._spoke_s = MOST_AT_ONCE, now_s

    async def show(self, latest: Mapping[str, Message], text: Callable[[Message], bytes]) -> None:
        """Send the newest message of each topic, if the page has not got it yet; `text` makes it."""
        for topic, made in latest.items():
            if (self._topics is None or topic in self._topics) and made is not self._sent.get(topic):
                self._sent[topic] = made
                await self.say(text(made))

    async def say(self, text: bytes) -> None:
        """Send one message; to a page that is gone, send nothing."""
        with suppress(OSError, RuntimeError):
            if text:
                await self.socket.send_frame(text, WSMsgType.TEXT)

    def may_speak(self, now_s: float) -> bool:
        """Return whether the page is within its message limit."""
        self._may = min(MOST_AT_ONCE, self._may + (now_s - self._spoke_s) * MOST_PER_S) - 1
        self._spoke_s = now_s
        return self._may >= 0

    async def close(self, code: int) -> None:
        """Close the connection."""
        with suppress(OSError, RuntimeError):
            await self.socket.close(code=code)


def _files(page: str, folder: Path) -> dict[str, tuple[bytes, dict[str, str]]]:
    """Return content and headers of each file, by its request path: nothing else can be read."""
    paths = [path for place in (PAGES, folder) for path in place.iterdir() if path.is_file()]
    found = {f"/{path.name}": (path.read_bytes(), {"Content-Type": _TYPES[path.suffix]}) for path in paths}
    return {"/": found[f"/{page}.html"], **found}


def _text(made: Message) -> bytes:
    """Return the text of a message, or b"" and a log entry if it cannot be made."""
    if isinstance(made, bytes):
        return made
    try:
        return made()
    except Exception:  # a bug of ours, or of a program that publishes here
        _log.exception("the page's server: a message could not be made")
        return b""


def _said(status: int, sentence: str) -> web.Response:
    response = web.Response(status=status, text=sentence + "\n", headers=HEADERS)
    response.force_close()
    return response


def _welcome(guard: Guard) -> web.Response:
    response = web.Response(status=303, headers=HEADERS | {"Location": "/"})
    response.set_cookie(guard.cookie, guard.secret, httponly=True, samesite="Lax", path="/")
    return response
