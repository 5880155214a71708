"""Write formulas as an ONNX graph: arithmetic on `Value` adds nodes.

    graph = Builder()
    x = graph.input("x", ("robots",))
    graph.output("y", 2 * graph.exp(x) + 1, ("robots",))

Numbers are in double precision. Two functions that runtimes lack in double precision are written out here: asinh
and atan2. `loop` repeats a part of the graph. Needs the package onnx.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

OPSET, IR_VERSION = 18, 8  # of 2022: old enough for most runtimes
_TINY = 1e-30


class Value:
    """A tensor in a graph."""

    def __init__(self, builder: Builder, name: str):
        self.builder, self.name = builder, name

    def __add__(self, other: Any) -> Value:
        return self.builder.op("Add", self, other)

    def __radd__(self, other: Any) -> Value:
        return self.builder.op("Add", other, self)

    def __sub__(self, other: Any) -> Value:
        return self.builder.op("Sub", self, other)

    def __rsub__(self, other: Any) -> Value:
        return self.builder.op("Sub", other, self)

    def __mul__(self, other: Any) -> Value:
        return self.builder.op("Mul", self, other)

    def __rmul__(self, other: Any) -> Value:
        return self.builder.op("Mul", other, self)

    def __truediv__(self, other: Any) -> Value:
        return self.builder.op("Div", self, other)

    def __rtruediv__(self, other: Any) -> Value:
        return self.builder.op("Div", other, self)

    def __matmul__(self, other: Any) -> Value:
        return self.builder.op("MatMul", self, other)

    def __neg__(self) -> Value:
        return self.builder.op("Neg", self)

    def __pow__(self, power: float) -> Value:
        return self.builder.op("Pow", self, power)

    def __lt__(self, other: Any) -> Value:
        return self.builder.op("Less", self, other)

    def __gt__(self, other: Any) -> Value:
        return self.builder.op("Greater", self, other)

    def __le__(self, other: Any) -> Value:
        return self.builder.op("LessOrEqual", self, other)

    def __ge__(self, other: Any) -> Value:
        return self.builder.op("GreaterOrEqual", self, other)

    def __and__(self, other: Value) -> Value:
        return self.builder.op("And", self, other)

    def __or__(self, other: Value) -> Value:
        return self.builder.op("Or", self, other)

    def __invert__(self) -> Value:
        return self.builder.op("Not", self)


class Builder:
    """A graph that grows with each operation."""

    def __init__(self) -> None:
        self._nodes: list[list[Any]] = [[]]  # of the graph, and of the loops that are being written
        self._count = 0
        self._constants: dict[Any, Value] = {}
        self._initial: list[Any] = []
        self._inputs: list[Any] = []
        self._outputs: list[Any] = []

    def _fresh(self) -> Value:
        self._count += 1
        return Value(self, f"v{self._count}")

    def constant(self, array: Any) -> Value:
        """Numbers; floats become double precision."""
        array = np.array(array)
        key = (array.dtype.str, array.shape, array.tobytes())
        if key not in self._constants:
            value = self._fresh()
            self._initial.append(numpy_helper.from_array(array, value.name))
            self._constants[key] = value
        return self._constants[key]

    def _value(self, part: Any) -> Value:
        if isinstance(part, int | float) and not isinstance(part, bool):
            part = float(part)
        return part if isinstance(part, Value) else self.constant(part)

    def op(self, kind: str, *parts: Any, **attributes: Any) -> Value:
        """The result of one operator of ONNX."""
        return self.ops(kind, 1, *parts, **attributes)[0]

    def ops(self, kind: str, count: int, *parts: Any, **attributes: Any) -> list[Value]:
        """The results of one operator that has several."""
        names = [self._value(part).name for part in parts]
        results = [self._fresh() for _ in range(count)]
        self._nodes[-1].append(helper.make_node(kind, names, [r.name for r in results], **attributes))
        return results

    def input(self, name: str, shape: Sequence[str | int], words: str = "") -> Value:
        """An input in double precision."""
        self._inputs.append(helper.make_tensor_value_info(name, TensorProto.DOUBLE, list(shape), words))
        return Value(self, name)

    def output(
        self, name: str, value: Value, shape: Sequence[str | int], words: str = "", *, flag: bool = False
    ) -> None:
        """Give a value to the outside, as numbers or as a flag."""
        kind = TensorProto.BOOL if flag else TensorProto.DOUBLE
        self._nodes[-1].append(helper.make_node("Identity", [value.name], [name]))
        self._outputs.append(helper.make_tensor_value_info(name, kind, list(shape), words))

    def loop(
        self, most: int, goes_on: Value, start: Sequence[Value], body: Callable[..., tuple[Value, ...]], kinds: str
    ) -> list[Value]:
        """Repeat `body` at most so many times, while a flag is true.

        Args:
            most: number of rounds.
            goes_on: flag before the first round.
            start: values before the first round.
            body: takes the values; gives the flag and the values after a round.
            kinds: of the values, a letter for each: "d" for numbers, "b" for flags.
        """
        types = [{"d": TensorProto.DOUBLE, "b": TensorProto.BOOL}[letter] for letter in kinds]
        self._nodes.append([])
        inside = [self._fresh() for _ in start]
        round_, before = self._fresh(), self._fresh()
        after = [self.op("Identity", value) for value in body(*inside)]
        graph = helper.make_graph(
            self._nodes.pop(),
            f"loop{self._count}",
            [
                helper.make_tensor_value_info(round_.name, TensorProto.INT64, []),
                helper.make_tensor_value_info(before.name, TensorProto.BOOL, []),
                *(helper.make_tensor_value_info(v.name, t, None) for v, t in zip(inside, types, strict=True)),
            ],
            [
                helper.make_tensor_value_info(v.name, t, None)
                for v, t in zip(after, [TensorProto.BOOL, *types], strict=True)
            ],
        )
        return self.ops("Loop", len(start), np.array(most, dtype=np.int64), goes_on, *start, body=graph)

    def model(self, name: str, words: str, metadata: Mapping[str, str]) -> Any:
        """The finished, checked model."""
        graph = helper.make_graph(self._nodes[0], name, self._inputs, self._outputs, self._initial)
        model = helper.make_model(
            graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION, doc_string=words,
            producer_name="softflagella",
        )  # fmt: skip
        helper.set_model_props(model, dict(metadata))
        onnx.checker.check_model(model)
        return model

    def log(self, x: Value) -> Value:
        return self.op("Log", x)

    def sqrt(self, x: Value) -> Value:
        return self.op("Sqrt", x)

    def abs(self, x: Value) -> Value:
        return self.op("Abs", x)

    def tanh(self, x: Value) -> Value:
        return self.op("Tanh", x)

    def maximum(self, x: Any, y: Any) -> Value:
        return self.op("Max", x, y)

    def minimum(self, x: Any, y: Any) -> Value:
        return self.op("Min", x, y)

    def where(self, flag: Value, x: Any, y: Any) -> Value:
        return self.op("Where", flag, x, y)

    def gather(self, x: Value, places: Any, axis: int = -1) -> Value:
        """Entries at places along an axis; one whole number takes the axis away."""
        return self.op(
            "Gather", x, np.array(places, dtype=np.int64) if not isinstance(places, Value) else places, axis=axis
        )

    def reshape(self, x: Value, shape: Sequence[int]) -> Value:
        return self.op("Reshape", x, np.array(shape, dtype=np.int64))

    def stack(self, parts: Sequence[Value]) -> Value:
        """Along a new last axis."""
        last = np.array([-1], dtype=np.int64)
        return self.op("Concat", *(self.op("Unsqueeze", part, last) for part in parts), axis=-1)

    def concat(self, parts: Sequence[Value], axis: int) -> Value:
        return self.op("Concat", *parts, axis=axis)

    def sum(self, x: Value, axis: int) -> Value:
        return self.op("ReduceSum", x, np.array([axis], dtype=np.int64), keepdims=0)

    def any(self, flags: Value) -> Value:
        """Whether one of the flags is true: a flag without axes."""
        return self.op("ReduceMax", self.op("Cast", flags, to=TensorProto.INT32), keepdims=0)

    def finite(self, x: Value) -> Value:
        return ~(self.op("IsNaN", x) | self.op("IsInf", x))

    def asinh(self, x: Value) -> Value:
        size = self.abs(x)
        return self.op("Sign", x) * self.log(size + self.sqrt(size * size + 1))

    def atan2(self, y: Value, x: Value) -> Value:
        """In single precision, and then one step of Newton's method in double precision."""
        ratio = self.op("Cast", y / self.where(self.abs(x) < _TINY, _TINY, x), to=TensorProto.FLOAT)
        rough = self.op("Cast", self.op("Atan", ratio), to=TensorProto.DOUBLE)
        behind = self.where(y < 0, -np.pi, np.pi)
        rough = rough + self.where(x < 0, behind, 0.0)
        radius = self.sqrt(x * x + y * y) + _TINY
        return rough + (y * self.op("Cos", rough) - x * self.op("Sin", rough)) / radius
