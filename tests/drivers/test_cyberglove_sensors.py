from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.cyberglove_protocol import MASK_18, MASK_22, SENSORS_18, SENSORS_22, masked_sensors

# As Shadow (22) and toon (18) list them, under our names.
OF_22 = """thumb_rotation thumb_mpj thumb_ij thumb_abduction index_mpj index_pij index_dij middle_mpj middle_pij
middle_dij middle_index_abduction ring_mpj ring_pij ring_dij ring_middle_abduction little_mpj little_pij little_dij
little_ring_abduction palm_arch wrist_pitch wrist_yaw"""
OF_18 = """thumb_rotation thumb_mpj thumb_ij thumb_abduction index_mpj index_pij middle_mpj middle_pij
middle_index_abduction ring_mpj ring_pij ring_middle_abduction little_mpj little_pij little_ring_abduction palm_arch
wrist_pitch wrist_yaw"""


def test_the_sensors_stand_in_the_order_in_which_they_are_sent() -> None:
    assert tuple(OF_18.split()) == SENSORS_18
    assert tuple(OF_22.split()) == SENSORS_22


def test_the_masks_are_those_that_public_drivers_print() -> None:
    assert int.from_bytes(MASK_18, "little") == 0x7BBB3F
    assert int.from_bytes(MASK_22, "little") == 0x7FFF7F


@given(st.binary(min_size=3, max_size=3))
def test_a_mask_takes_sensors_away_and_changes_no_order(mask: bytes) -> None:
    both = bytes(one & other for one, other in zip(mask, MASK_22, strict=True))
    assert list(masked_sensors(mask)) == [name for name in SENSORS_22 if name in masked_sensors(both)]
