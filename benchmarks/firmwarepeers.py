"""Other people's models and code generators as C for the AVR, on the same inputs as thenar's firmware.

A peer's C defines `int predict(void)` over `input`, its features as it wants them. emlearn casts thresholds to integers
and tests with <, so 0/1 features come as 0 and 2, and bytes doubled: thresholds between two of them are odd then, and
none is lost ("scaled by hand").
"""

import importlib.util
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.tables import IntegerTables

Rows = NDArray[np.uint8]
Labels = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Peer:
    """What one peer makes of the training rows.

    source    its C, with `input` and `predict`
    features  (n, F) of the test rows, as bytes of `input`
    expected  (n,) the classes that its Python side gives these rows
    """

    name: str
    source: str
    features: NDArray[np.uint8]
    expected: Labels


def available(*packages: str) -> bool:
    """Return whether all of these are installed."""
    return all(importlib.util.find_spec(package) for package in packages)


def scaled(X: Rows) -> NDArray[np.int16]:
    """Return the features doubled, so that no integer threshold falls on one."""
    return X.astype(np.int16) * 2


def forest(X: Rows, y: Labels, trees: int, leaves: int) -> Any:
    """Return a fitted forest on doubled features."""
    from sklearn.ensemble import RandomForestClassifier

    return RandomForestClassifier(trees, max_leaf_nodes=leaves, random_state=1, n_jobs=1).fit(scaled(X), y)


def emlearn_forest(model: Any, rows: Rows, name: str) -> Peer:
    """Return emlearn's C, in line, hard votes, of a forest on doubled features; rows are those to answer."""
    import emlearn  # pyright: ignore[reportMissingImports]

    converted = emlearn.convert(model, method="inline", dtype="int16_t")
    code = converted.save(name="forest", format="c", include_proba=False)
    source = f"""{code}
int16_t input[{rows.shape[1]}];
int predict(void);
int predict(void) {{ return (int)forest_predict(input, {rows.shape[1]}); }}
"""
    features = np.ascontiguousarray(scaled(rows)).astype("<i2").view(np.uint8).reshape(len(rows), -1)
    return Peer(name, source, features, model.predict(scaled(rows)).astype(np.intp))


def m2cgen_stumps(X: Rows, y: Labels, rows: Rows, rounds: int) -> Peer:
    """Return m2cgen's C of XGBoost's boosted stumps, as floating-point code of the AVR's four-byte doubles."""
    import m2cgen  # pyright: ignore[reportMissingImports]
    from xgboost import XGBClassifier  # pyright: ignore[reportMissingImports]

    classes = int(y.max()) + 1
    model = XGBClassifier(
        n_estimators=rounds, max_depth=1, learning_rate=1.0, tree_method="exact", base_score=0.5,
        num_parallel_tree=1, n_jobs=1,
    ).fit(X, y)  # fmt: skip
    code = m2cgen.export_to_c(model)
    # Features as bytes on the wire, widened as its C asks for them.
    source = f"""#include <stdint.h>
{code}
uint8_t input[{rows.shape[1]}];
int predict(void);
int predict(void) {{
    double features[{rows.shape[1]}], scores[{classes}];
    int best = 0;
    for (uint8_t i = 0; i < {rows.shape[1]}; i++) features[i] = input[i];
    score(features, scores);
    for (uint8_t k = 1; k < {classes}; k++) if (scores[k] > scores[best]) best = k;
    return best;
}}
"""
    return Peer(f"m2cgen, XGBoost {rounds} x {classes} stumps", source, np.ascontiguousarray(rows), model.predict(rows))


def plain_table(tables: IntegerTables, rows: Rows, expected: Labels) -> Peer:
    """Return the merged tables as one would write them down first: a row per switch and bin, loops, thresholds."""
    K, s, j = tables.n_classes, tables.n_switches, tables.n_joints

    def table(name: str, values: NDArray[Any], kind: str) -> str:
        return f"static const {kind} {name}[] PROGMEM = {{{', '.join(map(str, values.ravel().tolist()))}}};\n"

    bins = np.concatenate([np.asarray(rows_) for rows_ in tables.joint_rows])
    firsts = np.cumsum([0, *(len(t) for t in tables.thresholds)])
    source = (
        "#include <stdint.h>\n#include <avr/pgmspace.h>\n"
        + table("bias", tables.bias, "int16_t")
        + table("switch_rows", tables.switch_rows, "int16_t")
        + table("thresholds", np.concatenate(tables.thresholds), "uint8_t")
        + table("firsts", firsts, "uint16_t")
        + table("joint_rows", bins, "int16_t")
        + f"""uint8_t input[{s + j}];
int predict(void);
static void add(int16_t *sums, const int16_t *row) {{
    for (uint8_t k = 0; k < {K}; k++) sums[k] += (int16_t)pgm_read_word(&row[k]);
}}
int predict(void) {{
    int16_t sums[{K}];
    int best = 0;
    for (uint8_t k = 0; k < {K}; k++) sums[k] = (int16_t)pgm_read_word(&bias[k]);
    for (uint8_t i = 0; i < {s}; i++) if (input[i]) add(sums, &switch_rows[i * {K}]);
    for (uint8_t a = 0; a < {j}; a++) {{
        const uint16_t first = pgm_read_word(&firsts[a]), last = pgm_read_word(&firsts[a + 1]);
        uint16_t bin = first;
        while (bin < last && pgm_read_byte(&thresholds[bin]) < input[{s} + a]) bin++;
        add(sums, &joint_rows[(bin + a) * {K}]);
    }}
    for (uint8_t k = 1; k < {K}; k++) if (sums[k] > sums[best]) best = k;
    return best;
}}
"""
    )
    return Peer("a straightforward merged table", source, np.ascontiguousarray(rows), expected)
