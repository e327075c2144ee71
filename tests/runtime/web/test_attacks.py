"""What a stranger, another site in the same browser, and a page that misbehaves can try, each tried."""

import hmac
import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from threading import Event
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from thenar.drivers.errors import SettingError
from thenar.runtime.web import guard, server
from thenar.runtime.web.server import Server, message

from ..conftest import eventually

PATIENCE_S = 20.0
EVIL = "evil.example"


def refused(client: Any, **options: Any) -> int:
    """Return the status with which a WebSocket is refused."""
    with pytest.raises(InvalidStatus) as found, client.open(**options):
        pass
    return int(found.value.response.status_code)


# Other machines.


@pytest.mark.parametrize("address", ["0.0.0.0:0", "[::]:0", "0:0"])
def test_an_address_that_others_reach_takes_a_token(address: str) -> None:
    with pytest.raises(SettingError, match=r"other machines can reach: add --web-token"):
        Server("live", address, token=None)


@pytest.mark.parametrize("token", ["", "short", "a" * 15, "a" * 129, "white space, and more of it", "ä" * 20])
def test_a_token_that_can_be_guessed_or_is_none_is_refused(token: str) -> None:
    with pytest.raises(SettingError, match="random letters, digits"):
        Server("live", "127.0.0.1:0", token=token)


def test_our_own_tokens_are_long_and_never_the_same() -> None:
    tokens = {guard.new_token() for _ in range(100)}
    assert len(tokens) == 100
    assert min(map(len, tokens)) >= 32


@pytest.mark.parametrize("path", ["/", "/wire.js", "/nothing", "/?token=", "/?token=" + "x" * 32, "/?token=%ff%fe"])
def test_without_the_token_nothing_is_served(serve: Callable[..., Any], path: str) -> None:
    client = serve(token=guard.new_token())
    answer = client.ask(path)
    assert answer.status == 403
    assert b"Open the full address that thenar printed" in answer.content
    assert "Set-Cookie" not in answer.headers
    assert client.ask(path, Cookie=f"thenar-{client.port}=guessed").status == 403
    assert refused(client) == 403


def test_the_token_is_answered_with_a_cookie_that_only_this_server_reads(serve: Callable[..., Any]) -> None:
    token = guard.new_token()
    client = serve(token=token)
    assert client.server.url.endswith(f"/?token={token}")
    welcome = client.ask(f"/?token={token}")
    assert (welcome.status, welcome.headers["Location"]) == (303, "/")
    cookie, *attributes = welcome.headers["Set-Cookie"].split("; ")
    assert {"HttpOnly", "SameSite=Lax", "Path=/"} == set(attributes)
    # What the browser keeps is not the token.
    assert token not in cookie
    assert client.ask("/", Cookie=cookie).status == 200
    with client.open(additional_headers={"Cookie": cookie}):
        pass
    other = serve(token=guard.new_token())
    assert other.ask("/", Cookie=cookie.replace(str(client.port), str(other.port))).status == 403


def test_secrets_are_compared_in_a_time_that_tells_nothing(
    serve: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    compared, compare = list[bytes](), hmac.compare_digest

    def seen(one: bytes, other: bytes) -> bool:
        compared.append(one)
        return bool(compare(one, other))

    monkeypatch.setattr(hmac, "compare_digest", seen)
    client = serve(token=guard.new_token())
    client.ask("/?token=first-guess")
    client.ask("/", Cookie=f"thenar-{client.port}=second-guess")
    assert compared == [b"first-guess", b"second-guess"]


# Another site in the same browser.


@pytest.mark.parametrize(
    "host",
    [EVIL, f"{EVIL}:8080", f"127.0.0.1.{EVIL}", f"localhost.{EVIL}", "", "127.0.0.1@evil", "10.0.0.1", "[::1", "a:b:c"],
)
def test_a_name_that_others_can_point_here_is_refused(serve: Callable[..., Any], host: str) -> None:
    """DNS rebinding: the browser asks this server, and believes that it is the attacker's."""
    client = serve()
    assert client.ask("/", Host=host).status == 403
    assert client.ask("/wire.js", Host=host).status == 403
    websocket = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13"}
    key = {"Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ=="}
    assert client.ask("/live", Host=host, Origin=f"http://{host}", **websocket, **key).status == 403


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.1:1", "localhost:9000", "[::1]:80", "LOCALHOST", "localhost."])
def test_names_of_this_machine_are_known_also_behind_a_tunnel(serve: Callable[..., Any], host: str) -> None:
    assert serve().ask("/", Host=host).status == 200


def test_a_public_page_accepts_addresses_and_this_machines_name(serve: Callable[..., Any]) -> None:
    client = serve(address="0.0.0.0:0", token=guard.new_token())
    names = ("10.0.0.1:8080", "[fe80::1]", socket.gethostname(), EVIL, f"10.0.0.1.{EVIL}")
    told = [client.server._guard.knows_host(name) for name in names]
    assert told == [True, True, True, False, False]


@pytest.mark.parametrize(
    "origin", [None, "null", f"http://{EVIL}", "http://127.0.0.1:1", "http://localhost", "file://"]
)
def test_a_websocket_of_another_site_is_refused(serve: Callable[..., Any], origin: str | None) -> None:
    taken: list[object] = []
    client = serve(on_message=taken.append)
    assert refused(client, origin=origin) == 403
    assert client.server.pages == 0
    with client.open():
        pass


@pytest.mark.parametrize("path", ["/", "/wire.js", "/base.css", "/nothing", "/live"])
def test_every_answer_forbids_what_is_not_needed(serve: Callable[..., Any], path: str) -> None:
    headers = serve().ask(path).headers
    policy = dict(rule.partition(" ")[::2] for rule in headers["Content-Security-Policy"].split("; "))
    assert policy["default-src"] == policy["frame-ancestors"] == policy["base-uri"] == "'none'"
    assert {policy[kind] for kind in ("script-src", "style-src", "connect-src")} == {"'self'"}
    assert policy["require-trusted-types-for"] == "'script'"
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Referrer-Policy"] == "no-referrer"
    assert headers["X-Frame-Options"] == "DENY"
    assert "Access-Control-Allow-Origin" not in headers


def test_pages_hold_nothing_inline_and_make_no_markup_of_text() -> None:
    texts = {path.name: path.read_text() for path in server.PAGES.iterdir()}
    assert {"live.html", "live.js"} <= set(texts)
    for name, text in texts.items():
        if name.endswith(".html"):
            assert "<style" not in text
            assert " style=" not in text
            assert "javascript:" not in text
            assert not [word for word in text.split() if word.startswith("on") and "=" in word]
            assert text.count("<script") == text.count('<script type="module" src=')
        for maker in ("innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval(", "new Function"):
            assert maker not in text, name


# Files, methods, sizes.


@pytest.mark.parametrize(
    "path",
    [
        "/../server.py",
        "/pages/../../server.py",
        "/%2e%2e/server.py",
        "/..%2fserver.py",
        "//etc/passwd",
        "/etc/passwd",
        "/..\\server.py",
        "/server.py",
        "/live.js%00.css",
        "/.",
    ],
)
def test_only_the_files_of_the_page_can_be_read(serve: Callable[..., Any], path: str) -> None:
    answer = serve().ask(path)
    assert (answer.status, answer.content) == (404, b"There is no such page.\n")


# Files to download.

SCRIPT = b"<!doctype html><script>alert(1)</script>"


def test_what_is_offered_is_saved_and_never_shown_as_a_page(serve: Callable[..., Any]) -> None:
    client = serve()
    answer = client.ask(client.server.offer("mine.html", SCRIPT))
    assert (answer.status, answer.content) == (200, SCRIPT)
    assert answer.headers["Content-Type"].partition(";")[0] == "application/octet-stream"
    assert answer.headers["Content-Disposition"] == "attachment; filename*=UTF-8''mine.html"
    assert answer.headers["X-Content-Type-Options"] == "nosniff"
    assert answer.headers["Content-Security-Policy"] == guard.POLICY
    assert answer.headers["Cross-Origin-Resource-Policy"] == "same-origin"


@pytest.mark.parametrize("name", ["a\r\nSet-Cookie: b=c", '"; filename=../../x', "../../etc/passwd", "ä\udcff\0", ""])
def test_the_name_of_what_is_offered_adds_no_header(serve: Callable[..., Any], name: str) -> None:
    client = serve()
    answer = client.ask(client.server.offer(name, SCRIPT))
    assert answer.content == SCRIPT
    assert "Set-Cookie" not in answer.headers
    start, _, said = answer.headers["Content-Disposition"].partition("''")
    assert start == "attachment; filename*=UTF-8"
    assert set(said) <= set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-~%")


def test_what_is_offered_is_guarded_as_all_else(serve: Callable[..., Any]) -> None:
    client = serve(token=guard.new_token())
    address = client.server.offer("mine.html", SCRIPT)
    assert client.ask(address).status == 403
    cookie = {"Cookie": f"{client.server._guard.cookie}={client.server._guard.secret}"}
    assert client.ask(address, **cookie).content == SCRIPT
    assert client.ask(address, Host=EVIL, **cookie).status == 403
    assert client.ask(address, method="POST", **cookie).status == 405
    assert client.ask(address, method="HEAD", **cookie).content == b""


@pytest.mark.parametrize("path", ["/offered", "/offered/", "/offered/mine.html", "/offered/../server.py"])
def test_what_is_not_offered_cannot_be_had(serve: Callable[..., Any], path: str) -> None:
    client = serve()
    address = client.server.offer("mine.html", SCRIPT)
    for wrong in (path, f"{address}/", f"{address}/../wire.js", f"{address[:-1]}", address.upper()):
        assert client.ask(wrong).status == 404


def test_so_many_files_are_offered_and_the_oldest_goes(serve: Callable[..., Any]) -> None:
    client = serve()
    addresses = [client.server.offer("x", b"%d" % number) for number in range(9)]
    assert len(set(addresses)) == 9
    assert [client.ask(address).status for address in addresses] == [404, *8 * [200]]


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "PROPFIND"])
def test_nothing_can_be_sent_but_through_the_websocket(serve: Callable[..., Any], method: str) -> None:
    client = serve()
    assert client.ask("/", method=method, body=b"x" * 1000).status == 405
    assert client.ask("/", method="GET", body=b"x" * 1000).status == 405


def test_a_message_that_is_too_long_ends_the_page_that_sent_it(serve: Callable[..., Any]) -> None:
    taken: list[object] = []
    client = serve(on_message=taken.append)
    with client.open() as live:
        live.send('{"do": "' + "x" * server.MOST_BYTES + '"}')
        with pytest.raises(ConnectionClosed):
            live.recv(timeout=PATIENCE_S)
        assert live.close_code == 1009
    assert taken == []


def test_a_page_that_asks_too_often_is_ended(serve: Callable[..., Any]) -> None:
    taken: list[object] = []
    client = serve(on_message=taken.append)
    with client.open() as live:
        with suppress(ConnectionClosed):
            while True:
                live.send('{"do": "mark"}')
        eventually(lambda: client.server.pages == 0)
        assert live.close_code == 1008
    assert server.MOST_AT_ONCE <= len(taken) <= server.MOST_AT_ONCE + PATIENCE_S * server.MOST_PER_S


def test_pings_are_counted_as_well(serve: Callable[..., Any]) -> None:
    client = serve()
    with client.open() as live:
        with suppress(ConnectionClosed):
            while True:
                live.ping()
        eventually(lambda: client.server.pages == 0)


def test_bytes_are_no_message(serve: Callable[..., Any]) -> None:
    with serve().open() as live:
        live.send(b"\0\1")
        with pytest.raises(ConnectionClosed):
            live.recv(timeout=PATIENCE_S)
        assert live.close_code == 1003


# Places.


def test_so_many_pages_and_no_more(serve: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MOST_PAGES", 3)
    client = serve()
    with ExitStack() as stack:
        pages = [stack.enter_context(client.open()) for _ in range(3)]
        assert refused(client) == 503
        pages[0].close()
        eventually(lambda: client.server.pages == 2)
        stack.enter_context(client.open())


@contextmanager
def connection(client: Any, sent: bytes = b"") -> Iterator[socket.socket]:
    with socket.create_connection((client.host, client.port), timeout=PATIENCE_S) as made:
        made.sendall(sent)
        yield made


def test_so_many_connections_and_no_more(serve: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MOST_CONNECTIONS", 4)
    client = serve()
    with ExitStack() as stack:
        idle = [stack.enter_context(connection(client)) for _ in range(4)]
        with connection(client, b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n") as fifth:
            assert ended(fifth)
        idle[0].close()
        eventually(lambda: served(client))


def test_of_many_connections_at_once_the_first_ones_stay(
    serve: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "MOST_CONNECTIONS", 4)
    asked, all_there = Event(), Event()

    def reply(_: object) -> None:
        asked.set()
        all_there.wait(PATIENCE_S)

    client = serve(on_message=reply)
    with ExitStack() as stack:
        live = stack.enter_context(client.open())
        live.send('{"do":"wait"}')
        assert asked.wait(PATIENCE_S)
        # The server's thread waits, and finds all of them in one turn.
        some = [stack.enter_context(connection(client, b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")) for _ in range(8)]
        all_there.set()
        assert [ended(made) for made in some] == [False] * 3 + [True] * 5
        assert client.server.pages == 1


def ended(made: socket.socket) -> bool:
    """Return whether the server ended a connection without a word."""
    try:
        return made.recv(100) == b""
    except ConnectionResetError:
        return True


def served(client: Any) -> bool:
    try:
        return bool(client.ask("/").status == 200)
    except OSError:
        return False


ASKED = b"GET /view.js HTTP/1.1\r\nHost: 127.0.0.1\r\n"


@pytest.mark.parametrize("sent", [b"", ASKED + b"X-Slow: ", 1000 * (ASKED + b"\r\n")], ids=["silent", "slow", "deaf"])
def test_who_only_holds_a_place_loses_it(
    serve: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, sent: bytes
) -> None:
    monkeypatch.setattr(server, "_FETCH_S", 0.2)
    client = serve()
    with client.open() as live, connection(client) as held:
        held.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        held.sendall(sent)
        eventually(lambda: len(client.server._server.connections) == 2)
        eventually(lambda: len(client.server._server.connections) == 1)
        # The page is another matter.
        client.server.publish("frame", message("frame"))
        assert live.recv(timeout=PATIENCE_S) == '{"topic":"frame"}'


def upgrade(client: Any) -> bytes:
    """Return the request that opens a WebSocket as the page does."""
    key = b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
    ask = f"GET /live HTTP/1.1\r\nHost: 127.0.0.1:{client.port}\r\nOrigin: {client.origin}\r\n".encode()
    return ask + b"Connection: Upgrade\r\nUpgrade: websocket\r\n" + key + b"\r\n"


PING, PONG = b"\x89\x00", b"\x8a\x80\x00\x00\x00\x00"


def test_silent_pages_lose_their_places(serve: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "PING_S", 0.3)
    client = serve()
    with ExitStack() as stack:
        silent = [stack.enter_context(connection(client, upgrade(client))) for _ in range(server.MOST_PAGES)]
        assert all(one.recv(12) == b"HTTP/1.1 101" for one in silent)
        eventually(lambda: client.server.pages == 0 and not client.server._server.connections)
        with client.open() as live:
            client.server.publish("frame", message("frame"))
            assert live.recv(timeout=PATIENCE_S) == '{"topic":"frame"}'


def test_a_page_that_replies_to_pings_keeps_its_place(
    serve: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "PING_S", 1.0)
    client = serve()
    with connection(client, upgrade(client)) as page:
        found = b""
        for _ in range(2):
            while not found.endswith(PING):
                found += page.recv(4096)
            page.sendall(PONG)
            found = b""
        assert client.server.pages == 1


def test_a_browser_that_stops_reading_is_dropped_and_others_see_all(
    serve: Callable[..., Any], hear: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "PING_S", 0.2)
    client = serve()
    with connection(client, upgrade(client)) as hanging:
        assert hanging.recv(12) == b"HTTP/1.1 101"
        eventually(lambda: client.server.pages == 1)
        with client.open() as live:
            eventually(lambda: client.server.pages == 2)
            for number in range(1_000_000):
                if client.server.pages == 1:
                    break
                client.server.publish("frame", message("frame", number=number, filler="x" * 10_000))
                while hear(live)["number"] != number:
                    pass
            client.server.publish("last", message("last"))
            assert hear(live)["topic"] == "last"


def test_who_asks_for_much_and_reads_nothing_loses_its_place(serve: Callable[..., Any]) -> None:
    taken: list[object] = []

    def reply(asked: object) -> bytes:
        taken.append(asked)
        return b'"' + (server.MOST_UNREAD // 4) * b"x" + b'"'

    client = serve(on_message=reply)
    question = b'{"do":"moments"}'
    with connection(client, upgrade(client)) as deaf:
        assert deaf.recv(12) == b"HTTP/1.1 101"
        eventually(lambda: client.server.pages == 1)
        deaf.sendall(30 * (bytes((0x81, 0x80 | len(question), 0, 0, 0, 0)) + question))
        eventually(lambda: client.server.pages == 0)
    # A little more is on its way: what the system buffers.
    assert 5 <= len(taken) <= 10
