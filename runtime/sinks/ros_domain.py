"""A participant in the domain that ROS 2's nodes are in."""

import os

from cyclonedds.core import DDSException
from cyclonedds.domain import Domain, DomainParticipant

# Behind the user's own settings. A reader that hangs would otherwise hold up every writer's end for a second.
_SETTINGS = (
    "<CycloneDDS><Domain><Internal><WriterLingerDuration>100 ms</WriterLingerDuration></Internal></Domain></CycloneDDS>"
)


def join(number: int) -> tuple[Domain | None, DomainParticipant]:
    """Return the domain, where it is ours to end, and a participant in it. Raises DDSException."""
    users = os.environ.get("CYCLONEDDS_URI", "")
    try:
        ours = Domain(number, f"{users},{_SETTINGS}" if users else _SETTINGS)
    except DDSException as reason:
        if reason.code != DDSException.DDS_RETCODE_PRECONDITION_NOT_MET:
            raise
        ours = None  # somebody in this process is in it already, with settings of their own
    return ours, DomainParticipant(number)
