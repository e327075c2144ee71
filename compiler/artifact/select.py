"""The inputs of a build, picked by name from recordings that may have others, in another order."""

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import Calibration, Manifest
from thenar.runtime.names import list_names

from ..recordings.graspset import GraspSet, Joint
from .errors import CompileError


def select_inputs(grasp_set: GraspSet, manifest: Manifest) -> tuple[NDArray[np.bool_], NDArray[np.uint16]]:
    """Return the kept switches (n, s) and the joints' codes (n, j) of `grasp_set` in the build's order.

    Raises CompileError naming the inputs that the recordings lack, or joints whose codes mean something else there.
    """
    switches = _columns("switches", [switch.name for switch in manifest.switches], grasp_set.switch_names)
    joints = _columns("joints", [joint.name for joint in manifest.joints], grasp_set.joint_names)
    for calibration, column in zip(manifest.joints, joints, strict=True):
        _check_calibration(calibration, grasp_set.joints[column])
    return grasp_set.switches[:, switches], grasp_set.codes[:, joints]


def _columns(kind: str, wanted: list[str], there: tuple[str, ...]) -> list[int]:
    number = {name: column for column, name in enumerate(there)}
    missing = [name for name in wanted if name not in number]
    if missing:
        raise CompileError(f"the recordings lack {kind} that the build needs: {list_names(missing)}")
    return [number[name] for name in wanted]


def _check_calibration(built: Calibration, recorded: Joint) -> None:
    values = np.array([built.value_a, built.value_b])
    meant = recorded.value([built.code_a, built.code_b])
    same = np.isclose(meant, values, rtol=0, atol=abs(recorded.step) * 1e-6)
    if recorded.unit != built.unit or not same.all():
        point = int(same.argmin())
        code = (built.code_a, built.code_b)[point]
        raise CompileError(
            f"joint {built.name} is coded differently here: code {code} is {meant[point]:g} {recorded.unit}, in the "
            f"build {values[point]:g} {built.unit}; import these recordings with the build's grid and origin"
        )
