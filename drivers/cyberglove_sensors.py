"""The CyberGlove's sensors: our names, the order in which they come on the wire, and the masks that choose them.

The box has 24 slots, of which two are never sent: the abduction of the index, which no glove measures, and the last.
(The slot list of VESS and the 18-sensor mask that ViSTA prints decode to each other; Shadow, asr and toon agree.)
"""

_FINGER_SLOTS = ("mpj", "pij", "dij")
# In slot order; a mask's bit is the slot's place, the lowest bit of the first byte first. "" is never sent.
_SLOTS = (
    *("thumb_rotation", "thumb_mpj", "thumb_ij", "thumb_abduction"),
    *(f"index_{joint}" for joint in _FINGER_SLOTS),
    "",
    *(f"middle_{joint}" for joint in _FINGER_SLOTS),
    "middle_index_abduction",
    *(f"ring_{joint}" for joint in _FINGER_SLOTS),
    "ring_middle_abduction",
    *(f"little_{joint}" for joint in _FINGER_SLOTS),
    "little_ring_abduction",
    *("palm_arch", "wrist_pitch", "wrist_yaw", ""),
)

MASK_18 = bytes.fromhex("3F BB 7B")
MASK_22 = bytes.fromhex("7F FF 7F")


def masked_sensors(mask: bytes) -> tuple[str, ...]:
    """Return the sensors that a mask of 3 bytes lets through, in wire order."""
    bits = int.from_bytes(mask, "little")
    return tuple(name for slot, name in enumerate(_SLOTS) if name and bits >> slot & 1)


# The order on the wire. The 18-sensor glove has no sensors on the outermost finger joints; the wrist's are always last.
SENSORS_18 = masked_sensors(MASK_18)
SENSORS_22 = masked_sensors(MASK_22)
