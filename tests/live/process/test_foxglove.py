"""A run that serves Foxglove, beside its lines of JSON: both say the same."""

import json
import socket
from collections.abc import Callable
from contextlib import suppress
from struct import unpack_from
from typing import Any

import pytest
from msgspec.json import decode, encode
from websockets import Subprotocol
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

pytestmark = pytest.mark.slow


def test_what_foxglove_reads_is_what_the_run_published_and_both_end_together(run: Callable[..., Any]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    running = run("both", "glove", "board")
    client = running.start("--sink", f"foxglove:127.0.0.1:{port}")
    scene, truth = running.scene, running.scene.truth
    scene.settled(0)
    address, protocol = f"ws://127.0.0.1:{port}", Subprotocol("foxglove.sdk.v1")
    with connect(address, subprotocols=[protocol], max_queue=None) as reader:
        reader.recv(20.0)
        topics = {each["id"]: each["topic"] for each in json.loads(reader.recv(20.0))["channels"]}
        asked = [{"id": channel, "channelId": channel} for channel in topics]
        reader.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
        for row in (5, 9, 13):
            scene.show(row)
            scene.settled(row)
        told = len(client.reports)
        running.eventually(lambda: len(client.reports) > told + 1)
        assert client.end() == 0
        came: dict[str, list[tuple[int, Any]]] = {topic: [] for topic in topics.values()}
        with suppress(ConnectionClosed):
            while data := reader.recv(20.0, decode=False):
                _, channel, time_ns = unpack_from("<BIQ", data)
                came[topics[channel]].append((time_ns, json.loads(data[13:])))
    lines = {grasp.number: grasp for grasp in scene.grasps.all}
    assert {content["grasp"] for _, content in came["/thenar/grasp"]} >= {truth.answer(row) for row in (5, 9, 13)}
    for time_ns, content in came["/thenar/grasp"]:
        line = decode(encode(lines[content["number"]]))
        # A line has four decimals.
        rounded = {name: round(value, 4) if isinstance(value, float) else value for name, value in content.items()}
        assert rounded == {name: line[name] for name in content}
        assert time_ns == 1000 * content["unix_us"]
    assert len(came["/thenar/joints"]) > 10
    assert came["/thenar/joints"][-1][1]["positions_rad"]
    reports = [{**decode(encode(report)), "kind": None} for report in client.reports]
    assert came["/thenar/health"]
    assert all({**content, "kind": None} in reports for _, content in came["/thenar/health"])
