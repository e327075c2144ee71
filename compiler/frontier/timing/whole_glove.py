"""What reading each switch costs on the glove that grasps are recorded with: methods that choose by cost ask for it."""

from collections.abc import Sequence

from thenar.runtime.errors import HarnessError
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.scanning.propose import propose_harness

from ...placement.costaware import PortCosts
from .wirings import port_costs


def ports_of_whole_glove(harness: Harness | None, names: Sequence[str]) -> PortCosts | None:
    """Return what the ports cost that all switches `names` hang on: in `harness`, or where there is none, on as few
    MCP23017 as will do, in the order of the names.

    None where a harness lacks switches, as that of a reduced glove does, or there is no room for so many.
    """
    if not names or (harness is not None and not set(names) <= set(harness.switches)):
        return None
    try:
        return port_costs(harness or propose_harness(names), names)
    except HarnessError:
        return None
