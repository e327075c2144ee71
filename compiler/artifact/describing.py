"""What `build.json` says of a build: where it comes from, what it keeps, what is proved of it, how well it does."""

import hashlib
from collections.abc import Mapping
from importlib.metadata import version

import numpy as np

from thenar.runtime.build import ENSEMBLE_NAME, SCAN_NAME, TABLES_NAME
from thenar.runtime.manifest import SCHEMA, Calibration, Manifest, Options, Proof, Recognised, Source, Switch
from thenar.runtime.tables import IntegerTables

from ..recordings.graspset import GraspSet
from ..samples import Samples
from ..tables.compare import Comparison
from .recognition import Tested
from .training import Trained


def describe(
    grasp_set: GraspSet,
    options: Options,
    samples: Samples,
    trained: Trained,
    integers: IntegerTables,
    comparison: Comparison,
    tested: Tested | None,
    files: Mapping[str, bytes],
) -> Manifest:
    """Return the manifest, not sealed yet: `trained` on `samples`, made `integers`, held against the floats on every
    row by `comparison`, and `tested` in folds (None: was not); `files` are name -> content of what lies beside it.
    """
    digests = {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
    rates = [_training_rate(comparison, samples, options), *([tested.rate] if tested else [])]
    return Manifest(
        schema=SCHEMA,
        checksum="",
        thenar=version("thenar"),
        tables_sha256=digests[TABLES_NAME],
        ensemble_sha256=digests[ENSEMBLE_NAME],
        source=_source(grasp_set),
        options=options,
        grasps=samples.grasps,
        switches=_switches(grasp_set, trained),
        joints=_joints(grasp_set) if options.inputs != "switches" else (),
        proof=_proof(integers, comparison, options.width),
        rates=tuple(rates),
        stopped_after=trained.stumps.n_rounds if trained.stopped_early else 0,
        zero_gain_nodes=trained.zero_gain_nodes,
        scan_sha256=digests.get(SCAN_NAME),
    )


def _source(grasp_set: GraspSet) -> Source:
    return Source(
        fingerprint=grasp_set.fingerprint(),
        rows=len(grasp_set),
        taxonomy=grasp_set.taxonomy.name,
        switches=len(grasp_set.switch_names),
        simulated=grasp_set.simulated,
    )


def _switches(grasp_set: GraspSet, trained: Trained) -> tuple[Switch, ...]:
    pairs = zip(trained.columns, trained.gains, strict=True)
    return tuple(Switch(column, grasp_set.switch_names[column], gain) for column, gain in pairs)


def _joints(grasp_set: GraspSet) -> tuple[Calibration, ...]:
    return tuple(
        Calibration(column, joint.name, joint.unit, joint.code_a, joint.value_a, joint.code_b, joint.value_b)
        for column, joint in enumerate(grasp_set.joints)
    )


def _proof(integers: IntegerTables, comparison: Comparison, width: int) -> Proof:
    return Proof(
        width=width,
        scale=integers.scale,
        bound=integers.bound,
        error=comparison.integer_bound,
        safe_margin=comparison.safe_margin,
        covered=int(np.count_nonzero(comparison.covered)),
        changed=len(comparison.changed),
    )


def _training_rate(comparison: Comparison, samples: Samples, options: Options) -> Recognised:
    correct = int(np.count_nonzero(comparison.deployed == samples.labels))
    return Recognised("training", 0, options.seed, correct, len(samples.labels))
