"""A build around integer tables that nobody trained, for the runtime to recognise with."""

from thenar.runtime.build import Build
from thenar.runtime.manifest import SCHEMA, Calibration, Manifest, Options, Proof, Source, Switch
from thenar.runtime.tables import IntegerTables

_NO_DIGEST = "0" * 64


def bare_build(tables: IntegerTables) -> Build:
    """Return a build of `tables` whose grasp types, switches and joints are named by their numbers."""
    n_inputs = tables.n_switches + tables.n_joints
    return Build(
        Manifest(
            schema=SCHEMA,
            checksum="",
            thenar="",
            tables_sha256=_NO_DIGEST,
            ensemble_sha256=_NO_DIGEST,
            source=Source(_NO_DIGEST, 0, "none", tables.n_switches),
            options=Options(0, 1, "both", 1.0, 0, 1),
            grasps=tuple(str(number) for number in range(tables.n_classes)),
            switches=tuple(Switch(number, str(number), 0.0) for number in range(tables.n_switches)),
            joints=tuple(Calibration(number, str(number), "deg", 0, 0.0, 1, 1.0) for number in range(tables.n_joints)),
            proof=Proof(16, tables.scale, tables.bound, (n_inputs + 1) / 2, n_inputs + 1, 0, 0),
            rates=(),
        ),
        tables,
    )
