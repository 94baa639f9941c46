"""SIMD lanes: sixteen numbers as one value, for kernels that the compiler does not vectorise by itself.

`load` reads 16 consecutive float32 as one value; +, -, *, /, <, == and the functions below apply lane by
lane. `load_wide` reads 16 float64. `columns` reads the columns of a 16 x 16 block. `prefetch` loads one
cache line for writing: 16 float32 if they are aligned. With the compiler off, lanes are NumPy arrays. Who
uses them, and what for: docs/adr/0017-lanes.md.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from inspect import signature
from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.extending import intrinsic, models, overload, register_model

from slz.kernels.jit import kernel_for_any_types

LANES = 16
FLOAT, DOUBLE, FLAG, INT32 = ir.FloatType(), ir.DoubleType(), ir.IntType(1), ir.IntType(32)
Floats = Any  # 16 float32, or 16 flags
Doubles = Any  # 16 float64


class Lanes(types.Type):
    """Numba type of 16 numbers or flags."""

    def __init__(self, element: Any) -> None:
        self.vector = ir.VectorType(element, LANES)
        super().__init__(f"lanes({element})")


@register_model(Lanes)
class _Held(models.PrimitiveModel):
    def __init__(self, manager: Any, lanes: Lanes) -> None:
        super().__init__(manager, lanes, lanes.vector)  # type: ignore[no-untyped-call]


FLOATS, DOUBLES, FLAGS = Lanes(FLOAT), Lanes(DOUBLE), Lanes(FLAG)


def _code(result: Any, build: Callable[..., Any]) -> Any:
    """Return a Numba intrinsic whose LLVM code `build` emits from the values of its arguments."""

    def typed(*given: Any) -> Any:  # pragma: no cover - the compiler's
        def code(context: Any, builder: Any, typing: Any, values: Any) -> Any:
            arrays = [
                context.make_array(kind)(context, builder, value).data
                if isinstance(kind, types.Array)
                else value
                for kind, value in zip(typing.args, values, strict=True)
            ]
            return build(builder, *arrays)

        return result(*given), code

    by_number = {
        1: lambda _, a: typed(a),
        2: lambda _, a, b: typed(a, b),
        3: lambda _, a, b, c: typed(a, b, c),
        4: lambda _, a, b, c, d: typed(a, b, c, d),
    }
    return intrinsic(by_number[len(signature(build).parameters) - 1])


def _place(builder: Any, data: Any, at: Any, kind: Lanes = FLOATS) -> Any:
    return builder.bitcast(builder.gep(data, [at]), kind.vector.as_pointer())


def _broadcast(builder: Any, value: Any, kind: Lanes) -> Any:
    one = builder.insert_element(ir.Constant(kind.vector, ir.Undefined), value, INT32(0))
    return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(INT32, LANES), None))


def _columns(builder: Any, data: Any, at: Any) -> Any:
    """Load a 16 x 16 block and transpose it, by exchanging ever smaller squares across the diagonal."""
    rows = [
        builder.load(_place(builder, data, builder.add(at, ir.IntType(64)(LANES * i))), align=4)
        for i in range(LANES)
    ]
    side = LANES // 2
    while side:
        lower = [i if not i & side else i - side + LANES for i in range(LANES)]
        upper = [i + side if not i & side else i + LANES for i in range(LANES)]
        masks = [ir.Constant(ir.VectorType(INT32, LANES), mask) for mask in (lower, upper)]
        for i in range(LANES):
            if not i & side:
                pair = rows[i], rows[i + side]
                rows[i], rows[i + side] = (builder.shuffle_vector(*pair, mask) for mask in masks)
        side //= 2
    out = ir.Constant(ir.ArrayType(FLOATS.vector, LANES), ir.Undefined)
    for i, row in enumerate(rows):
        out = builder.insert_value(out, row, i)
    return out


def _prefetch(builder: Any, data: Any, at: Any) -> None:
    place = builder.bitcast(builder.gep(data, [at]), ir.IntType(8).as_pointer())
    function = ir.FunctionType(ir.VoidType(), [place.type, INT32, INT32, INT32])
    to_write, soon, data_cache = INT32(1), INT32(3), INT32(1)
    asked = builder.module.declare_intrinsic("llvm.prefetch", (place.type,), function)
    builder.call(asked, [place, to_write, soon, data_cache])


def _store_bytes(builder: Any, data: Any, at: Any, ones: Any, alls: Any) -> None:
    """Store a byte for each lane: 255 where `alls` is set, else 1 where `ones` is set, else 0."""
    kind = ir.VectorType(ir.IntType(8), LANES)
    place = builder.bitcast(builder.gep(data, [at]), kind.as_pointer())
    builder.store(builder.or_(builder.zext(ones, kind), builder.sext(alls, kind)), place, align=1)


def _fused_multiply_add(builder: Any, a: Any, b: Any, c: Any) -> Any:
    """Return a * b + c, fused where the processor can."""
    function = ir.FunctionType(FLOATS.vector, [FLOATS.vector] * 3)
    name = f"llvm.fmuladd.v{LANES}f32"
    return builder.call(builder.module.declare_intrinsic(name, (), function), [a, b, c])


def _sqrt(builder: Any, value: Any) -> Any:
    function = ir.FunctionType(FLOATS.vector, [FLOATS.vector])
    name = f"llvm.sqrt.v{LANES}f32"
    return builder.call(builder.module.declare_intrinsic(name, (), function), [value])


if vars(config)["DISABLE_JIT"]:

    def load(values: Any, at: int) -> Floats:
        return values[at : at + LANES].copy()

    def store(values: Any, at: int, lanes: Floats) -> None:
        values[at : at + LANES] = lanes

    def columns(values: Any, at: int) -> tuple[Floats, ...]:
        return tuple(values[at : at + LANES * LANES].reshape(LANES, LANES).T.copy())

    def prefetch(values: Any, at: int) -> None:
        pass

    def widened(lanes: Floats) -> Doubles:
        return lanes.astype(np.float64)

    def narrowed(lanes: Doubles) -> Floats:
        return lanes.astype(np.float32)

    def broadcast(value: Any) -> Floats:
        return value

    def fused_multiply_add(a: Floats, b: Floats, c: Floats) -> Floats:
        return a * b + c

    def flags_of(flags: Floats) -> np.uint64:
        return np.uint64(sum(1 << i for i in np.flatnonzero(flags).tolist()))

    def store_bytes(values: Any, at: int, ones: Floats, alls: Floats) -> None:
        values[at : at + LANES] = np.where(alls, 255, ones)

    def flags(bits: np.uint64) -> Floats:
        return np.array([int(bits) >> i & 1 for i in range(LANES)], bool)

    where: Callable[..., Floats] = np.where
    sqrt, logical_and = np.sqrt, np.logical_and
    load_wide, store_wide, broadcast_wide = load, store, broadcast
else:
    load = _code(FLOATS, lambda b, data, at: b.load(_place(b, data, at), align=4))
    store = _code(
        types.void, lambda b, data, at, lanes: b.store(lanes, _place(b, data, at), align=4) and None
    )
    columns = _code(types.UniTuple(FLOATS, LANES), _columns)  # type: ignore[no-untyped-call]
    prefetch = _code(types.void, _prefetch)
    broadcast = _code(FLOATS, lambda b, value: _broadcast(b, value, FLOATS))
    load_wide = _code(DOUBLES, lambda b, data, at: b.load(_place(b, data, at, DOUBLES), align=8))
    store_wide = _code(
        types.void, lambda b, data, at, lanes: b.store(lanes, _place(b, data, at, DOUBLES), align=8) and None
    )
    broadcast_wide = _code(
        DOUBLES, lambda b, x: _broadcast(b, b.fpext(x, DOUBLE) if x.type == FLOAT else x, DOUBLES)
    )
    widened = _code(DOUBLES, lambda b, lanes: b.fpext(lanes, DOUBLES.vector))
    narrowed = _code(FLOATS, lambda b, lanes: b.fptrunc(lanes, FLOATS.vector))
    where = _code(FLOATS, lambda b, flags, then, other: b.select(flags, then, other))
    sqrt = _code(FLOATS, _sqrt)
    fused_multiply_add = _code(FLOATS, _fused_multiply_add)
    logical_and = _code(FLAGS, lambda b, flags, others: b.and_(flags, others))
    flags_of = _code(
        types.uint64, lambda b, flags: b.zext(b.bitcast(flags, ir.IntType(LANES)), ir.IntType(64))
    )
    store_bytes = _code(types.void, _store_bytes)
    flags = _code(FLAGS, lambda b, bits: b.bitcast(b.trunc(bits, ir.IntType(LANES)), FLAGS.vector))

    def _operator(function: Any, build: Callable[..., Any], result: Lanes | None = None) -> None:
        by_kind = {kind: _code(result or kind, build) for kind in (FLOATS, DOUBLES)}

        def given(a, b):  # type: ignore[no-untyped-def]
            code = by_kind.get(a)
            return (lambda a, b: code(a, b)) if code is not None else None

        overload(function)(given)

    _operator(operator.add, lambda b, x, y: b.fadd(x, y))
    _operator(operator.sub, lambda b, x, y: b.fsub(x, y))
    _operator(operator.mul, lambda b, x, y: b.fmul(x, y))
    _operator(operator.truediv, lambda b, x, y: b.fdiv(x, y))
    _operator(operator.lt, lambda b, x, y: b.fcmp_ordered("<", x, y), FLAGS)
    _operator(operator.eq, lambda b, x, y: b.fcmp_ordered("==", x, y), FLAGS)


@kernel_for_any_types
def minimum(a: Floats, b: Floats) -> Floats:
    """Return the lane-wise minimum; where either is NaN, the lane of `b`."""
    return where(a < b, a, b)


@kernel_for_any_types
def maximum(a: Floats, b: Floats) -> Floats:
    """Return the lane-wise maximum; where either is NaN, the lane of `b`."""
    return where(b < a, a, b)
