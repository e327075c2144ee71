"""Manifests of integer tables that nobody trained."""

import hashlib

from thenar.runtime.manifest import SCHEMA, Calibration, Manifest, Origin, Proof, Recognised, Switch
from thenar.runtime.model.integers import IntegerTables, tables_to_bytes
from thenar.runtime.recipe import Recipe


def describe(tables: IntegerTables) -> Manifest:
    return Manifest(
        schema=SCHEMA,
        checksum="",
        thenar="0.1.0",
        tables_sha256=hashlib.sha256(tables_to_bytes(tables)).hexdigest(),
        ensemble_sha256="0" * 64,
        source=Origin("1" * 64, 10, "own", 20, joints=22),
        options=Recipe(0, 100, "both", 1.0, 4, 1),
        grasps=tuple(f"grasp {number}" for number in range(tables.n_classes)),
        switches=tuple(Switch(number, f"s{number}", 0.5) for number in range(tables.n_switches)),
        joints=tuple(Calibration(n, f"j{n}", "deg", 0, 0.0, 100, 50.0) for n in range(tables.n_joints)),
        proof=Proof(16, tables.scale, tables.bound, 6.5, 13.0, 10, 0),
        rates=(Recognised("training", 0, 1, 10, 10),),
    )
