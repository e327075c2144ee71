"""Logistic regression in int8, handwritten for an AVR as a careful engineer would: joints are multiplied.

Scores are relative to the last class, so that 13 sums, a pointer and two operands fill the registers. A code is clamped
to its training range, and multiplied by an immediate weight of each class (`mulsu`); a weight of 0 costs nothing, so
the smallest may be pruned, and the others are fitted again. The sums of the joints are SHIFT bits finer than the rest.
They are followed by groups of switches, halves of the bytes as read or whole ones, whose rows
are bytes above the minimum of a class. No sum exceeds 16 bits, which is checked for all possible rows.
"""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from firmwaredata import JOINTS, PORTS, SWITCHES, Fold, Labels, Rows, split
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import logsumexp

_LIMIT, _BYTE = 32767, 255
SHIFT = 3  # by which the joints' sums are finer
# scikit-learn's C of the fit of a pruned model: fewer weights need less of a pull. The full model has 1.
REFIT_C = 3.0
_SUMS = (2, 4, 6, 8, 10, 12, 14, 18, 20, 22, 24, 26, 28)  # r17:r16 are the operands, r31:r30 the pointer
Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class IntegerLogit:
    """Integers of a fitted model: bias (K - 1,), switches (s, K - 1), joints (j, K - 1), and each joint's range.

    group  how many switches share a lookup: 4 or 8
    """

    group: int
    bias: Ints
    switches: Ints
    joints: Ints
    low: Ints
    high: Ints

    def __call__(self, rows: Rows) -> Labels:
        """Return the class of each row."""
        bits, codes = split(rows)
        held = np.clip(codes, self.low, self.high) - self.low
        sums = (held @ self.joints) >> SHIFT
        sums += self.bias + bits @ self.switches
        predictions: Labels = np.hstack([sums, np.zeros((len(rows), 1), np.int64)]).argmax(axis=1)
        return predictions

    @cached_property
    def tables(self) -> list[tuple[int, int, Ints]]:
        """For each group the port, the first bit, and the rows, as sums, (2^n, K - 1)."""
        found = []
        for first in range(0, SWITCHES, self.group):
            rows = self.switches[first : first + self.group]
            closed = np.arange(1 << len(rows))[:, np.newaxis] >> np.arange(len(rows)) & 1
            found.append((*divmod(first, 8), closed @ rows))
        return found

    @property
    def source(self) -> str:
        """The assembly: `predict` over `input`, which holds the bytes of the switches and then the codes."""
        leasts = [table.min(axis=0) for *_, table in self.tables]
        starts = (self.bias + sum(leasts)) << SHIFT
        lines = _saved("push")
        for register, start in zip(_SUMS, starts.tolist(), strict=True):
            lines += [f"ldi r16, lo8({start})", f"ldi r17, hi8({start})", f"movw r{register}, r16"]
        for joint in range(JOINTS):
            lines += self._joint(joint)
        for register in _SUMS:
            lines += [f"asr r{register + 1}", f"ror r{register}"] * SHIFT
        lines += [f"ldi r16, {len(_SUMS)}", "ldi r17, 0"]
        first = 0
        for port, bit, table in self.tables:
            lines += [f"lds r30, input + {port}", *["swap r30"] * (bit > 0)]
            lines += [f"andi r30, {len(table) - 1}"] * (len(table) <= _BYTE)
            lines += ["mul r30, r16", "movw r30, r0"]
            lines += [f"subi r30, lo8(-(rows + {first}))", f"sbci r31, hi8(-(rows + {first}))"]
            for register in _SUMS:
                lines += ["lpm r0, Z+", f"add r{register}, r0", f"adc r{register + 1}, r17"]
            first += table.size
        rows = np.concatenate([(table - least).ravel() for (*_, table), least in zip(self.tables, leasts, strict=True)])
        text = "".join(f"    {line}\n" for line in [*lines, *_best(), "clr r1", *_saved("pop"), "ret"])
        table_text = "".join(f"    .byte {', '.join(map(str, part))}\n" for part in np.array_split(rows, 40))
        return (
            f'    .comm input, {PORTS + JOINTS}\n    .section .progmem.rows, "a", @progbits\nrows:\n{table_text}'
            f"    .balign 2\n    .text\n    .global predict\n    .type predict, @function\npredict:\n{text}"
        )

    @property
    def in_c(self) -> str:
        """The same in C, for a core of 32 bits."""
        first, rows, names = 0, [], [f"s{k}" for k in range(len(self.bias))]
        starts = [f"{name} = {start}" for name, start in zip(names, (self.bias << SHIFT).tolist(), strict=True)]
        code = [f"int32_t {', '.join(starts)}, code;", "const int16_t *row;"]
        for joint, (low, high) in enumerate(zip(self.low.tolist(), self.high.tolist(), strict=True)):
            code.append(f"code = input[{PORTS + joint}];")
            code.append(f"code = (code < {low} ? {low} : code > {high} ? {high} : code) - {low};")
            code += [f"{name} += code * {w};" for name, w in zip(names, self.joints[joint].tolist(), strict=True) if w]
        code += [f"{name} >>= {SHIFT};" for name in names]
        for port, bit, table in self.tables:
            code.append(f"row = rows + {first} + (input[{port}] >> {bit} & {len(table) - 1}) * {len(names)};")
            code += [f"{name} += row[{k}];" for k, name in enumerate(names)]
            rows += table.ravel().tolist()
            first += table.size
        code += ["int best = 0;", "int32_t top = s0;"]
        code += [f"if ({name} > top) {{ top = {name}; best = {k}; }}" for k, name in enumerate(names[1:], 1)]
        body = "\n    ".join([*code, f"return top < 0 ? {len(names)} : best;"])
        table_text = f"static const int16_t rows[] = {{{', '.join(map(str, rows))}}};"
        return (
            f"#include <stdint.h>\nuint8_t input[{PORTS + JOINTS}];\n{table_text}\n"
            f"int predict(void)\n{{\n    {body}\n}}\n"
        )

    def _joint(self, joint: int) -> list[str]:
        low, span = int(self.low[joint]), int(self.high[joint] - self.low[joint])
        lines = [f"lds r17, input + {PORTS + joint}", f"subi r17, {low}", "brcc 1f", "ldi r17, 0"]
        lines += [f"1: cpi r17, {span}", "brlo 1f", f"ldi r17, {span}", "1:"]
        for register, weight in zip(_SUMS, self.joints[joint].tolist(), strict=True):
            if weight:
                lines += [f"ldi r16, {weight & _BYTE}", "mulsu r16, r17", f"add r{register}, r0"]
                lines += [f"adc r{register + 1}, r1"]
        return lines


def _saved(how: str) -> list[str]:
    kept = [*range(2, 18), 28, 29]
    return [f"{how} r{register}" for register in (kept if how == "push" else reversed(kept))]


def _best() -> list[str]:
    """Return code that finds the first maximum: the last class, with score 0, is compared last."""
    lines = [f"movw r30, r{_SUMS[0]}", "ldi r16, 0"]
    for number, register in enumerate(_SUMS[1:], 1):
        lines += [f"cp r30, r{register}", f"cpc r31, r{register + 1}", "brge 1f", f"movw r30, r{register}"]
        lines += [f"ldi r16, {number}", "1:"]
    return [*lines, "tst r31", "brpl 1f", f"ldi r16, {len(_SUMS)}", "1: mov r24, r16", "clr r25"]


def fitted(inputs: Floats, y: Labels, kept: Floats, C: float, start: Floats) -> Floats:
    """Return the weights (d, K - 1), relative to the last class, of a logistic regression that has only those `kept`.

    C is scikit-learn's. The first input is the constant, whose weights are not penalised.
    """
    hits = np.eye(kept.shape[1] + 1)[y]

    def loss(flat: Floats) -> tuple[float, Floats]:
        weights = flat.reshape(kept.shape) * kept
        scores = np.hstack([inputs @ weights, np.zeros((len(inputs), 1))])
        whole = logsumexp(scores, axis=1, keepdims=True)
        # scikit-learn's penalty, which does not depend on the class that the weights are relative to.
        pull = (weights - weights.sum(axis=1, keepdims=True) / scores.shape[1]) / C
        pull[0] = 0
        slope = inputs.T @ (np.exp(scores - whole) - hits)[:, :-1] + pull
        return float((whole - scores)[hits > 0].sum() + (pull * weights).sum() / 2), (slope * kept).ravel()

    found = minimize(loss, start.ravel(), jac=True, method="L-BFGS-B", options={"maxiter": 1000})
    return found.x.reshape(kept.shape) * kept


@cache
def pruned(fold: Fold, share: float) -> tuple[Floats, Floats, Floats]:
    """Return bias (K - 1,) and weights of switches and codes, relative to the last class, with `share` of the joints'
    weights: the largest of standardised joints, fitted again together with the switches' and the bias.
    """
    bits, codes = split(fold.X)
    mean, deviation = codes.mean(axis=0), codes.std(axis=0) + 1e-9
    inputs = np.hstack([np.ones((len(bits), 1)), bits, (codes - mean) / deviation])
    everything = np.ones((inputs.shape[1], len(fold.grasps) - 1))
    weights = fitted(inputs, fold.y, everything, 1.0, 0 * everything)
    if share < 1:
        size = np.abs(weights[1 + SWITCHES :])
        kept = np.vstack([everything[: 1 + SWITCHES], size >= np.quantile(size, 1 - share)])
        weights = fitted(inputs, fold.y, kept, REFIT_C, weights)
    joints = weights[1 + SWITCHES :] / deviation[:, np.newaxis]
    return weights[0] - mean @ joints, weights[1 : 1 + SWITCHES], joints


def integer_logit(fold: Fold, group: int, share: float = 1.0) -> IntegerLogit:
    """Return the integers at the finest scale at which weights, rows and sums fit, with a `share` of joint weights."""
    bias, switches, joints = pruned(fold, share)
    codes = split(fold.X)[1].astype(np.int64)
    low, high = codes.min(axis=0), codes.max(axis=0)
    bias = bias + low @ joints
    scale = 4096.0
    while True:
        whole = IntegerLogit(
            group,
            np.rint(bias * scale).astype(np.int64),
            np.rint(switches * scale).astype(np.int64),
            np.rint(joints * scale * 2**SHIFT).astype(np.int64),
            low,
            high,
        )
        if _fits(whole):
            return whole
        scale *= 0.99


def _fits(made: IntegerLogit) -> bool:
    spans = max(int(np.ptp(table, axis=0).max()) for *_, table in made.tables)
    reach = np.abs(made.joints) * (made.high - made.low)[:, np.newaxis]
    leasts = sum(table.min(axis=0) for *_, table in made.tables)
    begun = (np.abs(made.bias + leasts) << SHIFT) + reach.sum(axis=0)
    whole = (reach.sum(axis=0) >> SHIFT) + 1 + np.abs(made.bias) + np.abs(made.switches).sum(axis=0)
    return spans <= _BYTE and np.abs(made.joints).max() <= 127 and max(begun.max(), whole.max()) <= _LIMIT
