"""Other models and code generators in C for the AVR, with the same rows and bytes as thenar's firmware.

A peer's `predict` reads `input`, the bytes of the switches' ports and of the joints in their wire format, and extracts
its features, which is part of its cost. emlearn casts thresholds to integers and tests with <, so 0/1 features become 0
and 2, and codes are doubled, as int16; or, as uint8, they are in steps of two degrees.
"""

import importlib.util
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from firmwaredata import JOINTS, PORTS, SWITCHES, Fold, Predictor, Rows
from firmwarelogit import Groups, fitted, integer_logit
from numpy.typing import NDArray

FEATURES = SWITCHES + JOINTS
# Trees and leaves of the forests tried.
FORESTS = ((10, 40), (10, 80), (15, 60), (20, 30), (20, 60), (30, 40), (60, 14))
LOGITS = (Groups(1, 3), Groups(3, 3), Groups(4, 3), Groups(4, 4), Groups(5, 3), Groups(6, 3), Groups(8, 3))
# Shares of the joints' weights.
SHARES = (1.0, 0.4, 0.3)
# Neurons of the networks tried.
HIDDEN = (10, 16)


@dataclass(frozen=True, slots=True)
class Peer:
    """A peer: its training, and its code.

    train    returns a model from a fold's training rows
    predictor returns the prediction function of a model, in Python
    files    returns name -> text of a model, which define `predict` over `input`
    in_c     the same for cores of 32 bits; None where it is not measured there
    needs    packages
    """

    name: str
    train: Callable[[Fold], Any]
    files: Callable[[Any], dict[str, str]]
    predictor: Callable[[Any], Predictor]
    needs: tuple[str, ...] = ()
    in_c: Callable[[Any], dict[str, str]] | None = None

    def answers_of(self, fold: Fold) -> Predictor:
        """Return the predictor of rows after training on a fold."""
        return self.predictor(self.train(fold))

    @property
    def available(self) -> bool:
        """Whether its packages are installed."""
        return all(importlib.util.find_spec(package) for package in self.needs)


def _filling(kind: str, bit: str = "byte & 1", code: str = "input[{0}]") -> str:
    """Return the C code that extracts features from `input`: each `bit` of switches, and the `code` of each joint."""
    lines = []
    for port in range(PORTS):
        lines.append(f"byte = input[{port}];")
        bits = range(8 * port, min(8 * port + 8, SWITCHES))
        lines += [f"features[{number}] = {bit}; byte >>= 1;" for number in bits]
    lines += [f"features[{SWITCHES + joint}] = {code.format(PORTS + joint)};" for joint in range(JOINTS)]
    body = "\n    ".join(lines)
    return (
        f"uint8_t input[{PORTS + JOINTS}];\nstatic {kind} features[{FEATURES}];\n"
        f"static void fill(void) {{\n    uint8_t byte;\n    {body}\n}}\n"
    )


def _plain(X: Rows) -> Rows:
    return X


def _doubled(X: Rows) -> NDArray[np.int16]:
    return X.astype(np.int16) * 2


def _coarse(X: Rows) -> Rows:
    return np.hstack([X[:, :SWITCHES] * 2, X[:, SWITCHES:] & 0xFE])


@cache
def _forest(fold: Fold, trees: int, leaves: int, features: Callable[[Rows], Any] = _plain) -> Any:
    from sklearn.ensemble import RandomForestClassifier

    return RandomForestClassifier(trees, max_leaf_nodes=leaves, random_state=1, n_jobs=1).fit(features(fold.X), fold.y)


def _of(features: Callable[[Rows], Any]) -> Callable[[Any], Predictor]:
    return lambda model: lambda rows: np.asarray(model.predict(features(rows)), np.intp)


def _emlearn_forest(kind: str) -> Callable[[Any], dict[str, str]]:
    def files(model: Any) -> dict[str, str]:
        import emlearn  # pyright: ignore[reportMissingImports]

        code = emlearn.convert(model, method="inline", dtype=kind).save(name="forest", format="c", include_proba=False)
        call = f"int predict(void) {{ fill(); return (int)forest_predict(features, {FEATURES}); }}\n"
        doubled = "input[{0}] & 0xFE" if kind == "uint8_t" else "(int16_t)input[{0}] * 2"
        return {"peer.c": f"{code}\n{_filling(kind, '(byte & 1) << 1', doubled)}{call}"}

    return files


@dataclass(frozen=True, slots=True)
class Network:
    """A network of one hidden layer in integers: weights of 8 bits (F, H) and (H, K), and biases of 32."""

    hidden: NDArray[np.int8]
    hidden_bias: NDArray[np.int32]
    shift: int
    output: NDArray[np.int8]
    output_bias: NDArray[np.int32]

    @classmethod
    def trained(cls, fold: Fold, neurons: int) -> "Network":
        """Return the network of a fold's rows, trained in floating point and rounded."""
        from sklearn.neural_network import MLPClassifier
        from sklearn.preprocessing import StandardScaler

        X = _levels(fold.X)
        scaler: Any = StandardScaler().fit(X)
        network = MLPClassifier((neurons,), solver="lbfgs", alpha=1.0, max_iter=2000, random_state=1).fit(
            scaler.transform(X), fold.y
        )
        first, second = network.coefs_[0] / scaler.scale_[:, np.newaxis], network.coefs_[1]
        scale, last = (127 / np.abs(weights).max() for weights in (first, second))
        hidden = np.rint(first * scale).astype(np.int8)
        bias = np.rint((network.intercepts_[0] - scaler.mean_ @ first) * scale).astype(np.int32)
        # The largest sum of a row becomes at most a byte.
        shift = max(0, int((X.astype(np.int64) @ hidden + bias).max()).bit_length() - 8)
        output_bias = np.rint(network.intercepts_[1] * last * scale / 2**shift).astype(np.int32)
        return cls(hidden, bias, shift, np.rint(second * last).astype(np.int8), output_bias)

    def __call__(self, rows: Rows) -> NDArray[np.intp]:
        """Return the type (n,) of each row."""
        sums = _levels(rows).astype(np.int64) @ self.hidden + self.hidden_bias
        neurons = np.clip(sums >> self.shift, 0, 255)
        return np.asarray((neurons @ self.output + self.output_bias).argmax(axis=1))

    def files(self) -> dict[str, str]:
        """Return the C code: loops over tables in flash, with sums of 24 bits on an AVR."""
        neurons, classes = self.output.shape
        return {
            "peer.c": f"""#include <stdint.h>
#ifdef __AVR__
#include <avr/pgmspace.h>
typedef __int24 wide;
#else
typedef int32_t wide;
#define PROGMEM
#define pgm_read_byte(at) (*(at))
#define pgm_read_dword(at) (*(at))
#endif
{_filling("uint8_t", "(byte & 1) << 6")}
static const int8_t hidden[] PROGMEM = {{{_cells(self.hidden)}}}, output[] PROGMEM = {{{_cells(self.output)}}};
static const int32_t hidden_bias[] PROGMEM = {{{_cells(self.hidden_bias)}}};
static const int32_t output_bias[] PROGMEM = {{{_cells(self.output_bias)}}};
static wide sum(const int8_t *weights, wide sum, const uint8_t *values, uint8_t n)
{{
    while (n--) sum += (int16_t)((int8_t)pgm_read_byte(weights++) * (int16_t)*values++);
    return sum;
}}
int predict(void)
{{
    static uint8_t neurons[{neurons}];
    wide most = -0x7FFFFF;
    int best = 0;
    fill();
    for (uint8_t j = 0; j < {neurons}; j++) {{
        wide value = sum(hidden + j * {FEATURES}, (wide)pgm_read_dword(hidden_bias + j), features, {FEATURES});
        value = value < 0 ? 0 : value >> {self.shift};
        neurons[j] = value > 255 ? 255 : (uint8_t)value;
    }}
    for (uint8_t k = 0; k < {classes}; k++) {{
        wide score = sum(output + k * {neurons}, (wide)pgm_read_dword(output_bias + k), neurons, {neurons});
        if (score > most) {{ most = score; best = k; }}
    }}
    return best;
}}
"""
        }


def _cells(values: NDArray[np.integer]) -> str:
    return ", ".join(map(str, values.T.ravel().tolist()))


def _levels(X: Rows) -> Rows:
    """Return rows whose switches are 0 or 64, so that their weights are as large as those of joints."""
    return np.hstack([X[:, :SWITCHES] * 64, X[:, SWITCHES:]])


def _in_cpp(header: str, declared: str, call: str) -> dict[str, str]:
    what = "#include <stdint.h>\n#include <string.h>\n#include <math.h>\n"
    text = f"{what}{header}\n{_filling('float')}{declared}\n"
    return {"peer.cpp": f'{text}extern "C" int predict(void) {{ fill(); return {call}; }}\n'}


def _micromlgen(model: Any) -> dict[str, str]:
    import micromlgen  # pyright: ignore[reportMissingImports]

    code = micromlgen.port(model).replace("#include <cstdarg>", "#include <stdarg.h>").replace("#pragma once", "")
    return _in_cpp(code, "static Eloquent::ML::Port::RandomForest forest;", "forest.predict(features)")


def _everywhereml_forest(trees: int, leaves: int) -> Callable[[Fold], Any]:
    def train(fold: Fold) -> Any:
        from everywhereml.sklearn.ensemble import RandomForestClassifier  # pyright: ignore[reportMissingImports]

        model = RandomForestClassifier(n_estimators=trees, max_leaf_nodes=leaves, random_state=1)
        model.fit(fold.X, fold.y)
        return model

    return train


def _everywhereml(model: Any) -> dict[str, str]:
    clock = "static unsigned long micros(void) { return 0; }\n"  # it times itself by Arduino's clock
    header = clock + model.to_arduino(instance_name="forest")
    return _in_cpp(header, "", "forest.predict(features)")


def _scores(code: str, classes: int) -> dict[str, str]:
    """Return code with `score(features, scores)`, and a function that takes the best."""
    return {
        "peer.c": f"""#include <stdint.h>
{code}
{_filling("double")}
int predict(void) {{
    static double scores[{classes}];
    int best = 0;
    fill();
    score(features, scores);
    for (uint8_t k = 1; k < {classes}; k++) if (scores[k] > scores[best]) best = k;
    return best;
}}
"""
    }


def _m2cgen_logit(model: Any) -> dict[str, str]:
    import m2cgen  # pyright: ignore[reportMissingImports]

    logit, mean, deviation = model
    raw = type(logit)()
    raw.classes_, raw.n_features_in_ = logit.classes_, FEATURES
    raw.coef_ = logit.coef_ / np.hstack([np.ones(SWITCHES), deviation])
    raw.intercept_ = logit.intercept_ - raw.coef_[:, SWITCHES:] @ mean
    return _scores(m2cgen.export_to_c(raw), len(raw.classes_))


def _logit_answers(model: Any) -> Predictor:
    logit, mean, deviation = model
    return lambda X: logit.predict(np.hstack([X[:, :SWITCHES] > 0, (X[:, SWITCHES:] - mean) / deviation]))


def _stumps(fold: Fold) -> Any:
    from xgboost import XGBClassifier  # pyright: ignore[reportMissingImports]

    return XGBClassifier(
        n_estimators=100, max_depth=1, learning_rate=1.0, tree_method="hist", base_score=0.5, num_parallel_tree=1,
        n_jobs=1,
    ).fit(fold.X, fold.y)  # fmt: skip


def _m2cgen_stumps(model: Any) -> dict[str, str]:
    import m2cgen  # pyright: ignore[reportMissingImports]

    return _scores(m2cgen.export_to_c(model), model.n_classes_)


def _tl2cgen(model: Any) -> dict[str, str]:
    import tl2cgen  # pyright: ignore[reportMissingImports]
    import treelite  # pyright: ignore[reportMissingImports]

    with tempfile.TemporaryDirectory() as folder:
        tl2cgen.generate_c_code(treelite.sklearn.import_model(model), folder, params={})
        files = {path.name: path.read_text() for path in Path(folder).glob("*.[ch]")}
    header = files.pop("header.h").replace("void predict(", "void forest_predict(")
    code = files.pop("main.c").replace("void predict(", "void forest_predict(")
    classes = len(model.classes_)
    score = f"""#include "header.h"
static void score(const double *values, double *scores)
{{
    static union Entry entries[{FEATURES}];
    for (uint8_t i = 0; i < {FEATURES}; i++) entries[i].fvalue = values[i];
    for (uint8_t k = 0; k < {classes}; k++) scores[k] = 0;
    forest_predict(entries, 0, scores);
}}
"""
    return {"header.h": header, "forest.c": code, **files, **_scores(score, classes)}


def _with(trees: int, leaves: int, features: Callable[[Rows], Any] = _plain) -> Callable[[Fold], Any]:
    return lambda fold: _forest(fold, trees, leaves, features)


def by_hand(groups: Groups, share: float) -> str:
    """Return the name of a handwritten logistic regression with a share of the joints' weights."""
    switches = "single switches" if groups.size == 1 else f"groups of {groups.size}"
    kept = "" if share == 1 else f", {share:.0%} of the joints' weights"
    return f"int8 logistic regression by hand{kept}, {switches}"


def peers() -> Iterator[Peer]:
    """Yield the peers."""
    for groups, share in product(LOGITS, SHARES):
        name = f"{by_hand(groups, share)}, joints {2**groups.shift} times finer"
        fit = partial(integer_logit, groups=groups, share=share)
        code, in_c = (lambda made: {"peer.S": made.source}), (lambda made: {"peer.c": made.in_c})
        yield Peer(name, fit, code, lambda made: made, in_c=in_c)
    for kind, features, what in (("uint8_t", _coarse, "uint8, 2-degree steps"), ("int16_t", _doubled, "int16")):
        for trees, leaves in FORESTS:
            name = f"emlearn, forest {trees} x {leaves}, {what}"
            yield Peer(name, _with(trees, leaves, features), _emlearn_forest(kind), _of(features), ("emlearn",))
    for neurons in HIDDEN:
        name, network = f"int8 network by hand, {neurons} hidden", partial(Network.trained, neurons=neurons)
        yield Peer(name, network, Network.files, lambda made: made, in_c=Network.files)
    small = (10, 40)
    forest = f"forest {small[0]} x {small[1]}"
    yield Peer(f"micromlgen, {forest}", _with(*small), _micromlgen, _of(_plain), ("micromlgen",))
    train = _everywhereml_forest(*small)
    yield Peer(f"everywhereml, {forest}", train, _everywhereml, _of(_plain), ("everywhereml",))
    yield Peer(f"TL2cgen, {forest}", _with(*small), _tl2cgen, _of(_plain), ("tl2cgen", "treelite"))
    yield Peer("m2cgen, logistic regression", fitted, _m2cgen_logit, _logit_answers, ("m2cgen",))
    yield Peer("m2cgen, XGBoost 100 x 14 stumps", _stumps, _m2cgen_stumps, _of(_plain), ("m2cgen", "xgboost"))
