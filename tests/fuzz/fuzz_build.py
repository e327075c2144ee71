"""Throws bytes at everything that loads a build; anything but a ThenarError is a find.

    python tests/fuzz/fuzz_build.py -runs=20000 -seed=1

The bytes are tried as they are and as well-sealed content, so that the checksum does not keep them from what is behind
it.
"""

import contextlib
import sys

import atheris

with atheris.instrument_imports(include=["thenar"]):
    from thenar.compiler.build import ensemble
    from thenar.drivers.errors import ThenarError
    from thenar.runtime import manifest, tables
    from thenar.runtime.scorer import Scorer
    from thenar.runtime.sealed import seal


def one_input(data: bytes) -> None:
    """Load `data` as each file of a build, and score a frame on what loads."""
    for document in (data, seal(tables.KIND, tables.VERSION, data)):
        with contextlib.suppress(ThenarError):
            loaded = tables.tables_from_bytes(document)
            Scorer(loaded).lanes([1] * loaded.n_switches, [65535] * loaded.n_joints)
    for document in (data, seal(ensemble.KIND, ensemble.VERSION, data)):
        with contextlib.suppress(ThenarError):
            ensemble.ensemble_from_bytes(document)
    with contextlib.suppress(ThenarError):
        manifest.manifest_from_bytes(data)


if __name__ == "__main__":
    atheris.Setup(sys.argv, one_input)
    atheris.Fuzz()
