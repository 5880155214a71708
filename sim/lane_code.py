"""Machine code of `sim.lanes`: a type of numba for vectors with W lanes of float64, and what can be done with it.

A vector is LLVM's <W x double>; arrays of vectors need not be aligned. Instructions carry no flags of fast
mathematics, so LLVM neither reorders nor fuses them. Do not `.copy()` an array of vectors: numba would then take
the copy for aligned, which it is not.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.cgutils import get_or_insert_function, unpack_tuple
from numba.core.imputils import impl_ret_borrowed
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, overload, register_model
from numba.np.arrayobj import make_array, populate_array

from sim import lanes as plain

LINE = 8  # numbers in a line of the cache


class Lanes(types.Type):
    """A vector of float64, a lane for each robot."""

    def __init__(self, width: int):
        self.width = width
        super().__init__(f"Lanes({width})")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Let a number take the place of a vector: the same in all lanes."""
        return Conversion.safe if isinstance(other, types.Integer | types.Float) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """Make a variable that holds numbers and vectors one of vectors."""
        return self if isinstance(other, types.Integer | types.Float) else None


@register_model(Lanes)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Lanes):
        super().__init__(manager, kind, ir.VectorType(ir.DoubleType(), kind.width))


def _kind(*arguments: Any) -> Lanes | None:
    """Return the type of the vectors among some arguments that are vectors or numbers; None if there is none."""
    found = [a for a in arguments if isinstance(a, Lanes)]
    others = all(isinstance(a, Lanes | types.Integer | types.Float) for a in arguments)
    return found[0] if found and others and len(set(found)) == 1 else None


def constant(kind: Lanes, value: float) -> Any:
    """Return a vector with a number in all lanes."""
    return ir.Constant(ir.VectorType(ir.DoubleType(), kind.width), [value] * kind.width)


def _mask(builder: Any, value: Any, kind: Lanes) -> Any:
    return builder.fcmp_unordered("!=", value, constant(kind, 0.0))


def _from_mask(builder: Any, mask: Any, kind: Lanes) -> Any:
    return builder.select(mask, constant(kind, 1.0), constant(kind, 0.0))


@lower_cast(types.Integer, Lanes)
@lower_cast(types.Float, Lanes)
def from_number(context: Any, builder: Any, fromty: Any, toty: Lanes, value: Any) -> Any:
    """Make a vector of a number."""
    number = context.cast(builder, value, fromty, types.float64)
    vector: Any = ir.Constant(ir.VectorType(ir.DoubleType(), toty.width), ir.Undefined)
    first = builder.insert_element(vector, number, ir.Constant(ir.IntType(32), 0))
    order = ir.Constant(ir.VectorType(ir.IntType(32), toty.width), [0] * toty.width)
    return builder.shuffle_vector(first, vector, order)


_BINARY = {
    "fadd": (operator.add, operator.iadd),
    "fsub": (operator.sub, operator.isub),
    "fmul": (operator.mul, operator.imul),
    "fdiv": (operator.truediv, operator.itruediv),
}


def _teach_operator(symbol: Any, instruction: str) -> None:
    """Teach numba an operator of two vectors, or of a vector and a number."""

    class _Template(AbstractTemplate):
        key = symbol

        def generic(self, args: Any, kws: Any) -> Any:
            kind = _kind(*args) if len(args) == 2 else None
            return kind and signature(kind, kind, kind)

    infer_global(symbol)(_Template)

    @lower_builtin(symbol, Lanes, Lanes)
    def _(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return getattr(builder, instruction)(*args)


for _instruction, _symbols in _BINARY.items():
    for _symbol in _symbols:
        _teach_operator(_symbol, _instruction)


@infer_global(operator.neg)
class _Negative(AbstractTemplate):
    key = operator.neg

    def generic(self, args: Any, kws: Any) -> Any:
        return signature(args[0], args[0]) if isinstance(args[0], Lanes) else None


@lower_builtin(operator.neg, Lanes)
def _negate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.fneg(args[0])


def _call(builder: Any, name: str, arguments: Any) -> Any:
    """Call LLVM's function of vectors."""
    kind = arguments[0].type
    function = ir.FunctionType(kind, [kind] * len(arguments))
    return builder.call(
        get_or_insert_function(builder.module, function, f"llvm.{name}.v{kind.count}f64"), arguments
    )


def _elementwise(name: str) -> Any:
    """Make an intrinsic of LLVM's function of one vector."""

    @intrinsic
    def function(typingctx: Any, a: Any) -> Any:
        def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return _call(builder, name, args)

        return signature(a, a), code

    return function


_root, _magnitude = _elementwise("sqrt"), _elementwise("fabs")


@overload(np.sqrt, strict=False)
def _sqrt(a: Any) -> Any:
    return (lambda a: _root(a)) if isinstance(a, Lanes) else None


@overload(abs, strict=False)
def _abs(a: Any) -> Any:
    return (lambda a: _magnitude(a)) if isinstance(a, Lanes) else None


def _by_lane(function: Any) -> Any:
    """Make a function of vectors from one of numbers, a lane at a time."""

    def typed(a: Any) -> Any:
        if not isinstance(a, Lanes):
            return None
        width = a.width

        def code(a: Any) -> Any:
            out = a
            for i in range(width):
                out = plain.with_lane(out, i, function(plain.lane(a, i)))
            return out

        return code

    return typed


overload(np.cos, strict=False)(_by_lane(np.cos))
overload(np.sin, strict=False)(_by_lane(np.sin))


@intrinsic
def _fused(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    kind = _kind(a, b, c) or types.float64

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _call(builder, "fma", args) if isinstance(kind, Lanes) else builder.fma(*args)

    return signature(kind, kind, kind, kind), code


@intrinsic
def _less(typingctx: Any, a: Any, b: Any) -> Any:
    kind = _kind(a, b)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _from_mask(builder, builder.fcmp_ordered("<", *args), kind)

    return signature(kind, kind, kind), code


@intrinsic
def _choose(typingctx: Any, condition: Any, a: Any, b: Any) -> Any:
    kind = _kind(condition, a, b)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.select(_mask(builder, args[0], kind), args[1], args[2])

    return signature(kind, kind, kind, kind), code


@intrinsic
def _larger(typingctx: Any, a: Any, b: Any) -> Any:
    kind = _kind(a, b)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        first = builder.or_(builder.fcmp_ordered(">", *args), builder.fcmp_unordered("uno", args[0], args[0]))
        return builder.select(first, *args)

    return signature(kind, kind, kind), code


@intrinsic
def _somewhere(typingctx: Any, condition: Any) -> Any:
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        mask = _mask(builder, args[0], sig.args[0])
        bits = builder.bitcast(mask, ir.IntType(sig.args[0].width))
        return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))

    return signature(types.boolean, condition), code


@intrinsic
def _lane(typingctx: Any, value: Any, i: Any) -> Any:
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.extract_element(args[0], builder.trunc(args[1], ir.IntType(32)))

    return signature(types.float64, value, types.int64), code


@intrinsic
def _with_lane(typingctx: Any, value: Any, i: Any, number: Any) -> Any:
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.insert_element(args[0], args[2], builder.trunc(args[1], ir.IntType(32)))

    return signature(value, value, types.int64, types.float64), code


@intrinsic
def _view(typingctx: Any, array: Any, width: Any) -> Any:
    """View numbers (…, W) as vectors (…)."""
    kind = types.Array(Lanes(len(width)), array.ndim - 1, "C", aligned=False)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        numbers = make_array(sig.args[0])(context, builder, args[0])
        vectors = make_array(kind)(context, builder)
        pointer = context.get_data_type(kind.dtype).as_pointer()
        populate_array(
            vectors,
            data=builder.bitcast(numbers.data, pointer),
            shape=unpack_tuple(builder, numbers.shape)[:-1],
            strides=unpack_tuple(builder, numbers.strides)[:-1],
            itemsize=context.get_constant(types.intp, 8 * kind.dtype.width),
            meminfo=numbers.meminfo,
            parent=numbers.parent,
        )
        return impl_ret_borrowed(context, builder, kind, vectors._getvalue())

    return signature(kind, array, width), code


@overload(plain.lanes, strict=False)
def _lanes(array: Any, width: Any) -> Any:
    return lambda array, width: _view(array, width)


def _allocated(allocate: Any) -> Any:
    """Make the code that allocates numbers, or vectors that do not straddle lines of the cache."""

    def typed(like: Any, shape: Any) -> Any:
        if not isinstance(like.dtype, Lanes):
            return lambda like, shape: allocate(shape)
        width = (0,) * like.dtype.width
        count = len(width)

        def code(like: Any, shape: Any) -> Any:
            size = count
            for extent in shape:
                size *= extent
            numbers = allocate(size + LINE)
            first = (-numbers.ctypes.data // 8) % LINE
            return _view(numbers[first : first + size].reshape((*shape, count)), width)

        return code

    return typed


overload(plain.zeros, strict=False)(_allocated(np.zeros))
overload(plain.empty, strict=False)(_allocated(np.empty))


@overload(plain.lane, strict=False)
def _lane_of(value: Any, i: Any) -> Any:
    return (lambda value, i: _lane(value, i)) if isinstance(value, Lanes) else (lambda value, i: value)


@overload(plain.count_lanes, strict=False)
def _count_lanes(value: Any) -> Any:
    count = value.width if isinstance(value, Lanes) else 1
    return lambda value: count


@overload(plain.with_lane, strict=False)
def _lane_set(value: Any, i: Any, number: Any) -> Any:
    if isinstance(value, Lanes):
        return lambda value, i, number: _with_lane(value, i, number)
    return lambda value, i, number: number


@intrinsic
def _named_like(typingctx: Any, like: Any, values: Any) -> Any:
    kind = types.NamedUniTuple(values.dtype, len(like), like.instance_class)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        first = make_array(sig.args[1])(context, builder, args[1]).data
        places = (builder.gep(first, [context.get_constant(types.intp, i)]) for i in range(len(kind)))
        return context.make_tuple(builder, kind, [builder.load(place, align=8) for place in places])

    return signature(kind, like, values), code


@overload(plain.named_like, strict=False)
def _under_names(like: Any, values: Any) -> Any:
    return lambda like, values: _named_like(like, values)


@overload(plain.fma, strict=False)
def _fma(a: Any, b: Any, c: Any) -> Any:
    return lambda a, b, c: _fused(a, b, c)


@overload(plain.less, strict=False)
def _is_less(a: Any, b: Any) -> Any:
    return (lambda a, b: _less(a, b)) if _kind(a, b) else (lambda a, b: 1.0 if a < b else 0.0)


@overload(plain.choose, strict=False)
def _chosen(condition: Any, a: Any, b: Any) -> Any:
    if _kind(condition, a, b):
        return lambda condition, a, b: _choose(condition, a, b)
    return lambda condition, a, b: a if condition != 0 else b


@overload(plain.larger, strict=False)
def _larger_of(a: Any, b: Any) -> Any:
    return (lambda a, b: _larger(a, b)) if _kind(a, b) else (lambda a, b: a if a > b or a != a else b)


@overload(plain.smaller, strict=False)
def _smaller_of(a: Any, b: Any) -> Any:
    return (lambda a, b: _choose(_less(a, b), a, b)) if _kind(a, b) else (lambda a, b: a if a < b else b)


@overload(plain.somewhere, strict=False)
def _is_somewhere(condition: Any) -> Any:
    if isinstance(condition, Lanes):
        return lambda condition: _somewhere(condition)
    return lambda condition: condition != 0


def _place(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Return the address of entry (i, j); numba's own allows for negative i and j, which takes longer."""
    matrix = make_array(sig.args[0])(context, builder, args[0])
    columns = unpack_tuple(builder, matrix.shape)[1]
    return builder.gep(matrix.data, [builder.add(builder.mul(args[1], columns), args[2])])


@intrinsic
def _load(typingctx: Any, matrix: Any, i: Any, j: Any) -> Any:
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.load(_place(context, builder, sig, args), align=8)

    return signature(matrix.dtype, matrix, types.intp, types.intp), code


@intrinsic
def _store(typingctx: Any, matrix: Any, i: Any, j: Any, value: Any) -> Any:
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.store(args[3], _place(context, builder, sig, args), align=8)
        return context.get_dummy_value()

    return signature(types.void, matrix, types.intp, types.intp, value), code


@overload(plain.load, strict=False)
def _loaded(matrix: Any, i: Any, j: Any) -> Any:
    return (lambda matrix, i, j: _load(matrix, i, j)) if matrix.layout == "C" else None


@overload(plain.store, strict=False)
def _stored(matrix: Any, i: Any, j: Any, value: Any) -> Any:
    return (lambda matrix, i, j, value: _store(matrix, i, j, value)) if matrix.layout == "C" else None
