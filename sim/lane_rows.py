"""Machine code of what `sim.lanes` reads from rows of matrices and writes to them at once."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core.cgutils import get_or_insert_function, unpack_tuple
from numba.core.typing.templates import signature
from numba.extending import intrinsic, overload
from numba.np.arrayobj import make_array

from sim import lanes as plain
from sim.lane_code import LINE, Lanes, constant, from_number


def _at_once(matrix: Any) -> Lanes:
    """Return the type of what is read at once of a row."""
    kind = matrix.dtype
    return kind if isinstance(kind, Lanes) and kind.width > 1 else Lanes(LINE)


def _place(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Return the address of entry (i, j)."""
    kind = sig.args[0]
    matrix = make_array(kind)(context, builder, args[0])
    columns = unpack_tuple(builder, matrix.shape)[1]
    place = builder.gep(matrix.data, [builder.add(builder.mul(args[1], columns), args[2])])
    return builder.bitcast(place, context.get_data_type(_at_once(kind)).as_pointer())


def _need_order(matrix: Any) -> None:
    if matrix.layout != "C":
        raise TypeError("rows that are not in C order")


def _some(builder: Any, kind: Lanes, left: Any) -> Any:
    """Return the mask of the first `left` numbers."""
    whole = ir.VectorType(ir.IntType(64), kind.width)
    none: Any = ir.Constant(whole, ir.Undefined)
    first = builder.insert_element(none, left, ir.Constant(ir.IntType(32), 0))
    order = ir.Constant(ir.VectorType(ir.IntType(32), kind.width), [0] * kind.width)
    count = builder.shuffle_vector(first, none, order)
    return builder.icmp_signed("<", ir.Constant(whole, list(range(kind.width))), count)


def _masked(builder: Any, name: str, kind: Any, types_of_arguments: list[Any], arguments: list[Any]) -> Any:
    """Call LLVM's masked load or store of vectors of a type; addresses are multiples of 8."""
    function = ir.FunctionType(kind, types_of_arguments)
    count = arguments[-1].type.count if kind == ir.VoidType() else kind.count
    full_name = f"llvm.masked.{name}.v{count}f64.p0v{count}f64"
    return builder.call(get_or_insert_function(builder.module, function, full_name), arguments)


@intrinsic
def _load(typingctx: Any, matrix: Any, i: Any, j: Any) -> Any:
    _need_order(matrix)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.load(_place(context, builder, sig, args), align=8)

    return signature(_at_once(matrix), matrix, types.intp, types.intp), code


@intrinsic
def _store(typingctx: Any, matrix: Any, i: Any, j: Any, value: Any) -> Any:
    _need_order(matrix)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.store(args[3], _place(context, builder, sig, args), align=8)
        return context.get_dummy_value()

    return signature(types.void, matrix, types.intp, types.intp, value), code


@intrinsic
def _load_some(typingctx: Any, matrix: Any, i: Any, j: Any, left: Any) -> Any:
    _need_order(matrix)
    kind = _at_once(matrix)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = _place(context, builder, sig, args)
        zero = constant(kind, 0.0)
        arguments = [place, ir.Constant(ir.IntType(32), 8), _some(builder, kind, args[3]), zero]
        return _masked(builder, "load", zero.type, [a.type for a in arguments], arguments)

    return signature(kind, matrix, types.intp, types.intp, types.intp), code


@intrinsic
def _store_some(typingctx: Any, matrix: Any, i: Any, j: Any, value: Any, left: Any) -> Any:
    _need_order(matrix)
    kind = _at_once(matrix)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = _place(context, builder, sig, args)
        arguments = [args[3], place, ir.Constant(ir.IntType(32), 8), _some(builder, kind, args[4])]
        _masked(builder, "store", ir.VoidType(), [a.type for a in arguments], arguments)
        return context.get_dummy_value()

    return signature(types.void, matrix, types.intp, types.intp, value, types.intp), code


@intrinsic
def _spread(typingctx: Any, value: Any) -> Any:
    kind = Lanes(LINE)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        number = args[0]
        if isinstance(sig.args[0], Lanes):
            number = builder.extract_element(number, ir.Constant(ir.IntType(32), 0))
        return from_number(context, builder, types.float64, kind, number)

    return signature(kind, value), code


@intrinsic
def _nothing(typingctx: Any, matrix: Any) -> Any:
    kind = _at_once(matrix)
    return signature(kind, matrix), lambda context, builder, sig, args: constant(kind, 0.0)


@overload(plain.columns_at_once, strict=False)
def _columns_at_once(matrix: Any) -> Any:
    count = 1 if isinstance(matrix.dtype, Lanes) and matrix.dtype.width > 1 else LINE
    return lambda matrix: count


@overload(plain.load, strict=False)
def _loaded(matrix: Any, i: Any, j: Any) -> Any:
    return lambda matrix, i, j: _load(matrix, i, j)


@overload(plain.store, strict=False)
def _stored(matrix: Any, i: Any, j: Any, value: Any) -> Any:
    return lambda matrix, i, j, value: _store(matrix, i, j, value)


@overload(plain.load_some, strict=False)
def _loaded_some(matrix: Any, i: Any, j: Any, left: Any) -> Any:
    return lambda matrix, i, j, left: _load_some(matrix, i, j, left)


@overload(plain.store_some, strict=False)
def _stored_some(matrix: Any, i: Any, j: Any, value: Any, left: Any) -> Any:
    return lambda matrix, i, j, value, left: _store_some(matrix, i, j, value, left)


@overload(plain.spread, strict=False)
def _spread_out(value: Any) -> Any:
    if isinstance(value, Lanes) and value.width > 1:
        return lambda value: value
    return lambda value: _spread(value)


@overload(plain.nothing, strict=False)
def _zero(matrix: Any) -> Any:
    return lambda matrix: _nothing(matrix)
