"""Memory asked for before it is needed, where the processor cannot foresee it."""

from __future__ import annotations

from typing import Any, cast

from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

LINE = 16  # numbers of four bytes that come together


def _prefetch() -> Any:
    """Return a kernel function that asks for the memory of an array's cell; it may lie outside."""
    if vars(config)["DISABLE_JIT"]:
        return lambda values, word, row, col: None

    def typed(_: Any, values: Any, word: Any, row: Any, col: Any) -> Any:  # pragma: no cover - the compiler's
        def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            array = cast(Any, make_array)(signature.args[0])(context, builder, args[0])
            _, rows, cols = cast(Any, cgutils).unpack_tuple(builder, array.shape)
            at = builder.add(builder.mul(builder.add(builder.mul(args[1], rows), args[2]), cols), args[3])
            pointer = builder.bitcast(builder.gep(array.data, [at]), ir.IntType(8).as_pointer())
            word = ir.IntType(32)
            kind = ir.FunctionType(ir.VoidType(), [pointer.type, word, word, word])
            function = builder.module.declare_intrinsic("llvm.prefetch", [pointer.type], kind)
            builder.call(function, [pointer, *(ir.Constant(word, k) for k in (1, 3, 1))])
            return context.get_dummy_value()

        return types.void(values, types.int64, types.int64, types.int64), code

    return intrinsic(typed)


prefetch = _prefetch()
