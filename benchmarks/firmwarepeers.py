"""Other models and code generators in C for the AVR, with the same rows and bytes as thenar's firmware.

A peer's `predict` reads `input`, the bytes of the switches' ports and of the joints in their wire format, and extracts
its features, which is part of its cost. emlearn casts thresholds to integers and tests with <, so 0/1 features become 0
and 2, and codes are doubled, as int16; or, as uint8, they are in steps of two degrees.
"""

import importlib.util
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from itertools import product
from typing import Any

import numpy as np
from firmwaredata import JOINTS, PORTS, SWITCHES, Fold, Predictor, Rows
from firmwarelogit import integer_logit
from numpy.typing import NDArray

FEATURES = SWITCHES + JOINTS
# Trees and leaves of the forests tried.
FORESTS = ((10, 40), (10, 80), (15, 60), (20, 30), (20, 60), (30, 40), (60, 14))
# How many switches of a logistic regression share a lookup.
GROUPS = (4, 8)
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


def _doubled(X: Rows) -> NDArray[np.int16]:
    return X.astype(np.int16) * 2


def _coarse(X: Rows) -> Rows:
    return np.hstack([X[:, :SWITCHES] * 2, X[:, SWITCHES:] & 0xFE])


@cache
def _forest(fold: Fold, trees: int, leaves: int, features: Callable[[Rows], Any]) -> Any:
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


def peers() -> Iterator[Peer]:
    """Yield the peers."""
    for group, share in product(GROUPS, SHARES):
        kept = "" if share == 1 else f", {share:.0%} of the joints' weights"
        name = f"int8 logistic regression by hand{kept}, groups of {group}"
        fit = partial(integer_logit, group=group, share=share)
        code, in_c = (lambda made: {"peer.S": made.source}), (lambda made: {"peer.c": made.in_c})
        yield Peer(name, fit, code, lambda made: made, in_c=in_c)
    for kind, features, what in (("uint8_t", _coarse, "uint8, 2-degree steps"), ("int16_t", _doubled, "int16")):
        for trees, leaves in FORESTS:
            name = f"emlearn, forest {trees} x {leaves}, {what}"
            train = partial(_forest, trees=trees, leaves=leaves, features=features)
            yield Peer(name, train, _emlearn_forest(kind), _of(features), ("emlearn",))
    for neurons in HIDDEN:
        name, network = f"int8 network by hand, {neurons} hidden", partial(Network.trained, neurons=neurons)
        yield Peer(name, network, Network.files, lambda made: made, in_c=Network.files)
