"""Interpolation: pairs of numbers (u and v, i and j) or rows of four on a regular grid, linear along every axis.

The pairs at two neighbours along the last axis lie side by side: four float64, one vector register. So all
axes but the last are interpolated four numbers at a time. Numba's loop vectoriser cannot do that (the loads
might overlap the stores), and its vectoriser of straight code is off, for miscompilations in LLVM (Numba pull
request 8852): hence a few lines of LLVM's own. They doubled the flow evaluations
per second.
"""

import itertools
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload

from .cache import BARE

_FOUR, _TWO = (ir.VectorType(ir.DoubleType(), n) for n in (4, 2))
_INT = ir.IntType(32)


def _between(values, cell, weight):
    read_at = len(cell) - len(weight)
    index = [int(c) for c in cell]
    block = values[(*index[:read_at], *(slice(c, c + 2) for c in index[read_at:]))]
    for w in weight:
        block = block[0] + w * (block[1] - block[0])
    return block


def pair_between(values: Any, cell: Any, weight: Any) -> tuple[float, float]:
    """The pair at a fractional index: values (n_1, ..., n_d, 2), cell (d,) unsigned, weight (d,) of cell + 1.

    With fewer weights the first axes are read at their cell. Nothing is checked: each cell must be below n - 1,
    and below n along an axis without a weight.
    """
    u, v = _between(values, cell, weight)
    return u, v


def row_between(values: Any, cell: Any, weight: Any) -> tuple[float, float, float, float]:
    """The row of four at a fractional index: values (n_1, ..., n_d, 4), cell and weight as in `pair_between`."""
    u, v, w, nothing = _between(values, cell, weight)
    return u, v, w, nothing


def _shuffled(builder, vector, lanes):
    mask = ir.Constant(ir.VectorType(_INT, len(lanes)), lanes)
    return builder.shuffle_vector(vector, ir.Constant(vector.type, ir.Undefined), mask)


def _lerp(builder, low, high, weight):
    """Return low + weight (high - low); the last multiplication and addition are one fused step."""
    kind = low.type
    name, signature = f"llvm.fma.v{kind.count}f64", ir.FunctionType(kind, [kind] * 3)
    fma = cgutils.get_or_insert_function(builder.module, signature, name)
    one = builder.insert_element(ir.Constant(kind, ir.Undefined), weight, ir.Constant(_INT, 0))
    return builder.call(fma, [_shuffled(builder, one, [0] * kind.count), builder.fsub(high, low), low])


def _four_at(context, builder, array, shape, strides, layout, index):
    """Return the four numbers from an index on."""
    place = cgutils.get_item_pointer2(context, builder, array.data, shape, strides, layout, index)
    row = builder.load(builder.bitcast(place, _FOUR.as_pointer()), typ=_FOUR)
    row.align = 8
    return row


def _in_registers(count):
    """Return Numba's typing of an interpolation of rows of `count` numbers, two or four."""

    def typed(typing_context, values, cell, weight):
        def generate(context, builder, signature, arguments):
            layout, axes = signature.args[0].layout, signature.args[0].ndim - 1
            array = context.make_array(signature.args[0])(context, builder, arguments[0])
            shape, strides = (cgutils.unpack_tuple(builder, part) for part in (array.shape, array.strides))
            below, weights = (cgutils.unpack_tuple(builder, part) for part in arguments[1:])
            nothing = ir.Constant(below[0].type, 0)
            above = [builder.add(index, ir.Constant(index.type, 1)) for index in below]
            fixed = axes - len(weights)
            # two pairs, neighbours along the last axis, fill a register
            apart = len(weights) - 1 if count == 2 else len(weights)
            rows = []
            for corner in itertools.product((below, above), repeat=apart):
                ends = [corner[n][fixed + n] for n in range(apart)]
                index = [*below[:fixed], *ends, *below[fixed + apart :], nothing]
                rows.append(_four_at(context, builder, array, shape, strides, layout, index))
            for n in range(apart):
                half = len(rows) // 2
                rows = [_lerp(builder, rows[m], rows[m + half], weights[n]) for m in range(half)]
            row = rows[0]
            if count == 2:
                low, high = (_shuffled(builder, row, lanes) for lanes in ([0, 1], [2, 3]))
                row = _lerp(builder, low, high, weights[-1])
            parts = [builder.extract_element(row, ir.Constant(_INT, n)) for n in range(count)]
            return context.make_tuple(builder, signature.return_type, parts)

        return types.UniTuple(types.float64, count)(values, cell, weight), generate

    return typed


def _fits(values, cell, weight):
    plain = values.dtype == types.float64 and values.layout == "C"
    return plain and values.ndim - 1 == len(cell) >= len(weight)


_pair_between: Any = intrinsic(_in_registers(2))
_row_between: Any = intrinsic(_in_registers(4))


@overload(pair_between, inline="always", jit_options=BARE)
def _pair_between_in_kernels(values, cell, weight):
    if not _fits(values, cell, weight):
        return None
    return lambda values, cell, weight: _pair_between(values, cell, weight)


@overload(row_between, inline="always", jit_options=BARE)
def _row_between_in_kernels(values, cell, weight):
    if not _fits(values, cell, weight):
        return None
    return lambda values, cell, weight: _row_between(values, cell, weight)
