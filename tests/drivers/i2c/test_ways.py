from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.i2c.bus import Port, Way, cut
from thenar.drivers.i2c.chips import CHIPS
from thenar.drivers.i2c.keeper import PlacedChip, Route
from thenar.drivers.i2c.node import MOST_MESSAGES, Query

MEMBERS = [
    PlacedChip("/dev/i2c-7", CHIPS["mcp23017"], 0x20 + n % 4, frozenset(), route, present=n != 3)
    for n, route in enumerate([None, None, None, None, Route(0x70, 1), Route(0x70, 1), Route(0x70, 2)])
]
ports = st.lists(
    st.builds(
        lambda member, command: Port(member, Query(member.address, command, 1), 0),
        st.sampled_from(MEMBERS),
        st.sampled_from([b"", b"\x12"]),
    ),
    max_size=60,
)


@pytest.mark.parametrize("way", Way)
@given(ports=ports)
def test_groups_hold_each_port_of_a_chip_that_is_there_once_and_in_order(way: Way, ports: list[Port]) -> None:
    numbers = [number for group in cut(ports, way) for number, _ in group.ports]
    assert numbers == [number for number, port in enumerate(ports) if port.member.present]
    assert all(ports[number] is port for group in cut(ports, way) for number, port in group.ports)


@pytest.mark.parametrize("way", Way)
@given(ports=ports)
def test_no_group_asks_more_than_its_way_allows(way: Way, ports: list[Port]) -> None:
    for group in cut(ports, way):
        members = {id(port.member) for _, port in group.ports}
        assert {port.member.route for _, port in group.ports} == {group.route}
        assert sum(port.query.messages for _, port in group.ports) <= MOST_MESSAGES
        assert len(members) == 1 or way is Way.CHANNEL
        assert len(group.ports) == 1 or way in (Way.CHANNEL, Way.CHIP)


@given(ports=ports)
def test_neighbours_are_parted_only_where_they_must_be(ports: list[Port]) -> None:
    groups = list(cut(ports, Way.CHANNEL))
    for one, other in pairwise(groups):
        messages = sum(port.query.messages for _, port in one.ports) + other.ports[0][1].query.messages
        assert one.route != other.route or messages > MOST_MESSAGES


def test_each_way_has_a_lower_one_but_the_last() -> None:
    assert [way.lower() for way in Way] == [Way.CHIP, Way.PORT, Way.SMBUS, Way.SMBUS]
