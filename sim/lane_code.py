"""Machine code of `sim.lanes`: a type of numba for vectors with W lanes of float64, and what can be done with it.

A vector is LLVM's <W x double>; arrays of vectors need not be aligned. Instructions carry no flags of fast
mathematics, so LLVM neither reorders nor fuses them. Do not `.copy()` an array of vectors: numba would then take
the copy for aligned, which it is not. An index of such an array must not be negative: numba's check for that is
left out, since robots would take a tenth longer.
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
from numba.extending import lower_builtin, lower_cast, models, overload, register_model, type_callable
from numba.np.arrayobj import getitem_array_tuple, getitem_arraynd_intp, make_array, populate_array, setitem_array

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


def constant(kind: Any, value: float) -> Any:
    """Return a number, in all lanes where the type is one of vectors."""
    if not isinstance(kind, Lanes):
        return ir.Constant(ir.DoubleType(), value)
    return ir.Constant(ir.VectorType(ir.DoubleType(), kind.width), [value] * kind.width)


def _mask(builder: Any, value: Any, kind: Any) -> Any:
    return builder.fcmp_unordered("!=", value, constant(kind, 0.0))


def _from_mask(builder: Any, mask: Any, kind: Any) -> Any:
    return builder.select(mask, constant(kind, 1.0), constant(kind, 0.0))


@lower_cast(types.Integer, Lanes)
@lower_cast(types.Float, Lanes)
def from_number(context: Any, builder: Any, fromty: Any, toty: Lanes, value: Any) -> Any:
    """Make a vector of a number."""
    return _in_all(builder, context.cast(builder, value, fromty, types.float64), toty.width)


def _in_all(builder: Any, number: Any, width: int) -> Any:
    """Return a vector with a number in all lanes."""
    vector: Any = ir.Constant(ir.VectorType(number.type, width), ir.Undefined)
    first = builder.insert_element(vector, number, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, vector, ir.Constant(ir.VectorType(ir.IntType(32), width), [0] * width))


_BINARY = {
    "fadd": (operator.add, operator.iadd),
    "fsub": (operator.sub, operator.isub),
    "fmul": (operator.mul, operator.imul),
    "fdiv": (operator.truediv, operator.itruediv),
}


def _operate(symbol: Any, instruction: str) -> None:
    """Teach numba an operator of two vectors, or of a vector and a number."""

    def typed(a: Any, b: Any) -> Any:
        kind = _kind(a, b)
        return kind and kind(kind, kind)

    type_callable(symbol)(lambda context: typed)

    @lower_builtin(symbol, Lanes, Lanes)
    def _(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return getattr(builder, instruction)(*args)


for _instruction, _symbols in _BINARY.items():
    for _symbol in _symbols:
        _operate(_symbol, _instruction)

type_callable(operator.neg)(lambda context: lambda a: a if isinstance(a, Lanes) else None)


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


for _function, _name in ((np.sqrt, "sqrt"), (abs, "fabs")):
    type_callable(_function)(lambda context: lambda a: a if isinstance(a, Lanes) else None)
    lower_builtin(_function, Lanes)(lambda context, builder, sig, args, name=_name: _call(builder, name, args))


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


def _teach(function: Any, typed: Any) -> Any:
    """Teach numba a function of `sim.lanes`: its signature for some types, or None, and its code (a decorator).

    The code stands in each caller; an overload would be a function of its own, compiled for each of its types.
    """
    type_callable(function)(lambda context: typed)
    return lower_builtin(function, types.VarArg(types.Any))


def _numbers(*arguments: Any) -> Any:
    """Return the type of vectors among some arguments, float64 if all are numbers, None if they are neither."""
    plain_numbers = all(isinstance(a, types.Integer | types.Float | types.Boolean) for a in arguments)
    return _kind(*arguments) or (types.float64 if plain_numbers else None)


def _two(a: Any, b: Any) -> Any:
    kind = _numbers(a, b)
    return kind and kind(kind, kind)


def _three(a: Any, b: Any, c: Any) -> Any:
    kind = _numbers(a, b, c)
    return kind and kind(kind, kind, kind)


@_teach(plain.fma, _three)
def _fma(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return _call(builder, "fma", args) if isinstance(sig.return_type, Lanes) else builder.fma(*args)


@_teach(plain.less, _two)
def _less(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return _from_mask(builder, builder.fcmp_ordered("<", *args), sig.return_type)


@_teach(plain.choose, _three)
def _choose(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.select(_mask(builder, args[0], sig.return_type), args[1], args[2])


@_teach(plain.larger, _two)
def _larger(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    first = builder.or_(builder.fcmp_ordered(">", *args), builder.fcmp_unordered("uno", args[0], args[0]))
    return builder.select(first, *args)


@_teach(plain.smaller, _two)
def _smaller(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.select(builder.fcmp_ordered("<", *args), *args)


@_teach(plain.somewhere, lambda condition: types.boolean(_numbers(condition)))
def _somewhere(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    mask = _mask(builder, args[0], sig.args[0])
    if not isinstance(sig.args[0], Lanes):
        return mask
    bits = builder.bitcast(mask, ir.IntType(sig.args[0].width))
    return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))


@_teach(plain.lane_count, lambda value: types.int64(_numbers(value)))
def _lane_count(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return context.get_constant(types.int64, getattr(sig.args[0], "width", 1))


@_teach(plain.lane, lambda value, i: types.float64(_numbers(value), types.int64))
def _lane(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    if not isinstance(sig.args[0], Lanes):
        return args[0]
    return builder.extract_element(args[0], builder.trunc(args[1], ir.IntType(32)))


@_teach(plain.with_lane, lambda value, i, number: _numbers(value)(_numbers(value), types.int64, types.float64))
def _with_lane(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    if not isinstance(sig.args[0], Lanes):
        return args[2]
    return builder.insert_element(args[0], args[2], builder.trunc(args[1], ir.IntType(32)))


@_teach(plain.width, lambda: types.int64())
def _width(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return context.get_constant(types.int64, plain.width())


def _vectors(array: Any) -> Any:
    return types.Array(Lanes(plain.width()), array.ndim - 1, "C", aligned=False)(array)


@_teach(plain.lanes, _vectors)
def _view(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """View numbers (…, W) as vectors (…)."""
    kind = sig.return_type
    numbers = make_array(sig.args[0])(context, builder, args[0])
    vectors = make_array(kind)(context, builder)
    populate_array(
        vectors,
        data=builder.bitcast(numbers.data, context.get_data_type(kind.dtype).as_pointer()),
        shape=unpack_tuple(builder, numbers.shape)[:-1],
        strides=unpack_tuple(builder, numbers.strides)[:-1],
        itemsize=context.get_constant(types.intp, 8 * kind.dtype.width),
        meminfo=numbers.meminfo,
        parent=numbers.parent,
    )
    return impl_ret_borrowed(context, builder, kind, vectors._getvalue())


def _allocated(allocate: Any) -> Any:
    """Make the code that allocates numbers, or vectors that do not straddle lines of the cache."""

    def typed(like: Any, shape: Any) -> Any:
        if not isinstance(like.dtype, Lanes):
            return lambda like, shape: allocate(shape)
        count = like.dtype.width

        def code(like: Any, shape: Any) -> Any:
            size = count
            for extent in shape:
                size *= extent
            numbers = allocate(size + LINE)
            first = (-numbers.ctypes.data // 8) % LINE
            return plain.lanes(numbers[first : first + size].reshape((*shape, count)))

        return code

    return typed


overload(plain.zeros, strict=False)(_allocated(np.zeros))
overload(plain.empty, strict=False)(_allocated(np.empty))


def _tuple(like: Any, values: Any) -> Any:
    if isinstance(like, types.BaseNamedTuple):
        return types.NamedUniTuple(values.dtype, len(like), like.instance_class)(like, values)
    return types.UniTuple(values.dtype, len(like))(like, values)


@_teach(plain.tuple_like, _tuple)
def _tuple_like(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    kind = sig.return_type
    first = make_array(sig.args[1])(context, builder, args[1]).data
    places = (builder.gep(first, [context.get_constant(types.intp, i)]) for i in range(len(kind)))
    return context.make_tuple(builder, kind, [builder.load(place, align=8) for place in places])


def _without_wraparound(code: Any) -> Any:
    """Make numba's code of an entry or row of vectors for indices that are not negative, so without a check."""

    def entry(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        array, index, *value = sig.args
        kinds = set(getattr(index, "types", (index,)))
        if isinstance(array.dtype, Lanes) and all(isinstance(kind, types.Integer) for kind in kinds):
            unsigned = types.uintp if index in kinds else types.UniTuple(types.uintp, len(index))
            sig = sig.return_type(array, unsigned, *value)
        return code(context, builder, sig, args)

    return entry


for _index, _getter in ((types.Integer, getitem_arraynd_intp), (types.UniTuple, getitem_array_tuple)):
    lower_builtin(operator.getitem, types.Array, _index)(_without_wraparound(_getter))
    lower_builtin(operator.setitem, types.Array, _index, types.Any)(_without_wraparound(setitem_array))
