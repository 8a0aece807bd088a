"""A physics step as machine code for a CPU: vectors of robots, compiled by LLVM within the process.

Each lane of a vector register holds one robot. The program has no branches except its two loops, over groups
of robots and over physics steps. A robot's results depend only on its own inputs.
"""

import ctypes
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from footfall.envs.physics.generated.arguments import arguments
from footfall.envs.physics.generated.expression import Expression, Loop, Scalar, schedule
from footfall.envs.physics.generated.substep import Substep

SINGLE_LANES = (("avx512f", 16), ("avx", 8))  # float32 lanes of a register, by CPU feature
MIN_LANES = 4  # of SSE and Neon
OPTIMISATION = 1  # LLVM's level: level 2 takes six times as long to compile code that is no faster
BINARY = {"add": "fadd", "subtract": "fsub", "multiply": "fmul", "divide": "fdiv"}
UNARY = {"sqrt": "sqrt", "abs": "fabs", "round": "rint", "sin": "sin", "cos": "cos"}
COMPARED = {"minimum": "olt", "maximum": "ogt"}


class Program:
    """A compiled control step. Several threads may run it at the same time, on different robots."""

    def __init__(
        self, substep: Substep, steps: int, dtype: Any = np.float32, lanes: int | None = None
    ) -> None:
        """Compile it for this processor.

        Args:
            substep: one physics step.
            steps: physics steps in a control step.
            dtype: dtype of all arrays.
            lanes: robots in a vector register; None: as many as the processor has room for.
        """
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        features = llvm.get_host_cpu_features()
        lanes = lanes or lanes_of(features, dtype)
        if lanes * np.dtype(dtype).itemsize == 64:
            features["prefer-256-bit"] = False
        self.inputs, self.outputs = arguments(substep)
        machine = llvm.Target.from_default_triple().create_target_machine(
            cpu=llvm.get_host_cpu_name(), features=features.flatten(), opt=OPTIMISATION, jit=True
        )
        self.text = module_text(substep, steps, dtype, lanes)
        module = llvm.parse_assembly(self.text)
        self._engine = llvm.create_mcjit_compiler(module, machine)
        self._engine.finalize_object()
        pointers = [ctypes.c_void_p] * (len(self.inputs) + len(self.outputs))
        prototype = ctypes.CFUNCTYPE(None, *pointers, ctypes.c_int64, ctypes.c_int64)
        self._function = prototype(self._engine.get_function_address("control_step"))

    def __call__(self, arrays: Sequence[np.ndarray], first: int, last: int) -> None:
        """Move the robots from number `first` up to `last`, not included.

        Args:
            arrays: inputs, then outputs, as `inputs` and `outputs` list them: contiguous, (robots, width) or
                (robots, steps, width).
            first: index of the first robot.
            last: index after the last robot.
        """
        self.move([array.ctypes.data for array in arrays], first, last)

    def move(self, pointers: Sequence[int], first: int, last: int) -> None:
        """Move the robots, given the addresses of the arrays."""
        if last > first:
            self._function(*pointers, first, last)


def lanes_of(features: Mapping[str, bool], dtype: Any) -> int:
    """Robots in a vector register of a processor with these features."""
    widest = next((n for name, n in SINGLE_LANES if features.get(name)), MIN_LANES)
    return widest * 4 // np.dtype(dtype).itemsize


def module_text(substep: Substep, steps: int, dtype: Any, lanes: int) -> str:
    """A control step in LLVM's intermediate representation: the same text for every processor."""
    return _Writer(substep, steps, np.dtype(dtype), lanes).text()


class _Writer:
    """Writes LLVM's intermediate representation, line by line."""

    def __init__(self, substep: Substep, steps: int, dtype: np.dtype, lanes: int) -> None:
        self._substep, self._steps, self._lanes = substep, steps, lanes
        self._inputs, outputs = arguments(substep)
        self._arrays = [*self._inputs, *outputs]
        self._plan = schedule(substep.results, substep.fixed_inputs)
        self._block = "step"  # in which the next line lies
        self._item = {4: "float", 8: "double"}[dtype.itemsize]
        self._bytes = dtype.itemsize
        self._vector, self._flags = f"<{lanes} x {self._item}>", f"<{lanes} x i1>"
        self._suffix = f"v{lanes}f{8 * dtype.itemsize}"
        self._dtype = dtype
        self._lines: list[str] = []
        self._declared: set[str] = set()
        self._results: dict[tuple[str, int], str] = {}  # of loops
        self._temporary = 0

    def text(self) -> str:
        """The whole module."""
        self._begin()
        self._physics_step()
        self._leave()
        return "\n".join([*sorted(self._declared), *self._lines])

    def _begin(self) -> None:
        """Emit everything before the loop over physics steps, which is computed once."""
        pointers = ", ".join(f'ptr noalias %"{array.name}"' for array in self._arrays)
        self._emit(f"define void @control_step({pointers}, i64 %first, i64 %last) {{\nentry:")
        self._emit("  %final = sub i64 %last, 1")
        for name, width in self._substep.state.items():
            self._emit(f'  %"room.{name}" = alloca [{width} x {self._vector}], align 64')
        self._emit("  br label %group\ngroup:\n  %robot = phi i64 [%first, %entry], [%next, %leave]")
        self._robots()
        for array in self._arrays:
            self._rows(array.name, array.width * (self._steps if array.is_stepwise else 1))
        for name, width in self._substep.state.items():
            for index in range(width):
                self._store(name, index, self._gather(f'%"rows.{name}"', index))
        for node in self._plan.before_steps:
            self._node(node)

    def _physics_step(self) -> None:
        """The loop over physics steps."""
        self._emit("  br label %step\nstep:\n  %k = phi i64 [0, %group], [%following, %after]")
        for name, width in ((array.name, array.width) for array in self._arrays if array.is_stepwise):
            self._emit(f'  %"shift.{name}" = mul i64 %k, {width}')
            rows = f'<{self._lanes} x ptr> %"rows.{name}"'
            self._emit(f'  %"now.{name}" = getelementptr {self._item}, {rows}, i64 %"shift.{name}"')
        for node in self._plan.step:
            self._node(node)
        for name, written in self._substep.trace.items():
            for index, value in written.items():
                self._scatter(f'%"now.trace.{name}"', index, self._value(value))
        for name, written in self._substep.following.items():
            for index, value in written.items():
                self._store(name, index, self._value(value))
        self._emit("  br label %after\nafter:")
        self._emit(f"  %following = add i64 %k, 1\n  %more = icmp ult i64 %following, {self._steps}")
        self._emit("  br i1 %more, label %step, label %leave")

    def _leave(self) -> None:
        """Emit the end of a group: write the state to the robots' rows, go to the next group."""
        self._emit("leave:")
        for name, width in self._substep.state.items():
            for index in range(width):
                self._scatter(f'%"rows.end.{name}"', index, self._load(name, index))
        self._emit(f"  %next = add i64 %robot, {self._lanes}\n  %others = icmp slt i64 %next, %last")
        self._emit("  br i1 %others, label %group, label %done\ndone:\n  ret void\n}")

    def _emit(self, line: str) -> None:
        self._lines.append(line)

    def _robots(self) -> None:
        """The robots in the lanes, by index; surplus lanes repeat the last robot, with the same result."""
        indices = f"<{self._lanes} x i64>"
        lanes = ", ".join(f"i64 {lane}" for lane in range(self._lanes))
        for name, value in (("robot", "%robot"), ("final", "%final")):
            self._emit(f"  %one.{name} = insertelement {indices} poison, i64 {value}, i32 0")
            self._emit(
                f"  %all.{name} = shufflevector {indices} %one.{name}, {indices} poison,"
                f" <{self._lanes} x i32> zeroinitializer"
            )
        self._emit(f"  %wanted = add {indices} %all.robot, <{lanes}>")
        self._emit(f"  %beyond = icmp sgt {indices} %wanted, %all.final")
        self._emit(f"  %robots = select {self._flags} %beyond, {indices} %all.final, {indices} %wanted")

    def _rows(self, name: str, stride: int) -> None:
        """Addresses of the rows of the robots in the lanes."""
        indices = f"<{self._lanes} x i64>"
        strides = ", ".join([f"i64 {stride}"] * self._lanes)
        self._emit(f'  %"start.{name}" = mul {indices} %robots, <{strides}>')
        self._emit(f'  %"rows.{name}" = getelementptr {self._item}, ptr %"{name}", {indices} %"start.{name}"')

    def _new(self) -> str:
        self._temporary += 1
        return f"%u{self._temporary}"

    def _address(self, rows: str, index: int) -> str:
        address = self._new()
        self._emit(f"  {address} = getelementptr {self._item}, <{self._lanes} x ptr> {rows}, i64 {index}")
        return address

    def _gather(self, rows: str, index: int) -> str:
        pointers, all_true = f"<{self._lanes} x ptr>", f"<{', '.join(['i1 true'] * self._lanes)}>"
        name = f"@llvm.masked.gather.{self._suffix}.v{self._lanes}p0"
        self._declared.add(f"declare {self._vector} {name}({pointers}, i32, {self._flags}, {self._vector})")
        address, value = self._address(rows, index), self._new()
        self._emit(
            f"  {value} = call {self._vector} {name}({pointers} {address}, i32 {self._bytes},"
            f" {self._flags} {all_true}, {self._vector} poison)"
        )
        return value

    def _scatter(self, rows: str, index: int, value: str) -> None:
        pointers, all_true = f"<{self._lanes} x ptr>", f"<{', '.join(['i1 true'] * self._lanes)}>"
        name = f"@llvm.masked.scatter.{self._suffix}.v{self._lanes}p0"
        self._declared.add(f"declare void {name}({self._vector}, {pointers}, i32, {self._flags})")
        address = self._address(rows, index)
        self._emit(
            f"  call void {name}({self._vector} {value}, {pointers} {address}, i32 {self._bytes},"
            f" {self._flags} {all_true})"
        )

    def _room(self, name: str, index: int) -> str:
        address = self._new()
        self._emit(f'  {address} = getelementptr {self._vector}, ptr %"room.{name}", i64 {index}')
        return address

    def _store(self, name: str, index: int, value: str) -> None:
        self._emit(f"  store {self._vector} {value}, ptr {self._room(name, index)}, align 64")

    def _load(self, name: str, index: int) -> str:
        address, value = self._room(name, index), self._new()
        self._emit(f"  {value} = load {self._vector}, ptr {address}, align 64")
        return value

    def _input(self, name: str, array: str, index: int) -> None:
        if array in self._substep.state:
            value = self._load(array, index)
        else:
            rows = "now" if array in self._substep.step_inputs else "rows"
            value = self._gather(f'%"{rows}.{array}"', index)
        self._lines[-1] = self._lines[-1].replace(f"{value} =", f"{name} =")

    def _loop(self, name: str, loop: Loop) -> None:
        """A block that repeats while the flag of any robot in the group is true."""
        numbers = range(len(loop.start))
        self._emit(f"  br label %{name}.turn\n{name}.turn:")
        self._emit(f"  %{name}.turns = phi i64 [1, %{self._block}], [%{name}.more, %{name}.turn]")
        variables = [
            f"%n{v.number}" if v is not None else f"%{name}.unread{k}" for k, v in enumerate(loop.variables)
        ]
        for k, variable in enumerate(variables):
            start, following = self._value(loop.start[k]), self._value(loop.following[k])
            self._emit(
                f"  {variable} = phi {self._vector} [{start}, %{self._block}], [{following}, %{name}.turn]"
            )
        for node in loop.body:
            self._node(node)
        any_lane = f"@llvm.vector.reduce.or.v{self._lanes}i1"
        self._declared.add(f"declare i1 {any_lane}({self._flags})")
        self._emit(f"  %{name}.any = call i1 {any_lane}({self._flags} {self._value(loop.continues)})")
        self._emit(f"  %{name}.more = add i64 %{name}.turns, 1")
        self._emit(f"  %{name}.left = icmp ule i64 %{name}.more, {loop.max_repetitions}")
        self._emit(f"  %{name}.again = and i1 %{name}.any, %{name}.left")
        self._emit(f"  br i1 %{name}.again, label %{name}.turn, label %{name}.end\n{name}.end:")
        self._block = f"{name}.end"
        for k in numbers:
            self._results[name, k] = self._value(loop.following[k])

    def _value(self, value: Scalar) -> str:
        if isinstance(value, Expression) and value.operation == "result":
            loop, index = value.operands
            return self._results[f"n{loop.number}", index]
        if isinstance(value, Expression):
            return f"%n{value.number}"
        bits = struct.unpack("<Q", struct.pack("<d", float(self._dtype.type(value))))[0]
        return f"<{', '.join([f'{self._item} 0x{bits:016X}'] * self._lanes)}>"

    def _node(self, node: Expression) -> None:
        """The lines of one operation."""
        name, vector = f"%n{node.number}", self._vector
        if node.operation == "input":
            self._input(name, *node.operands)
            return
        if node.operation == "loop":
            self._loop(f"n{node.number}", self._plan.loops[node])
            return
        if node.operation == "result":
            return
        a, *rest = (self._value(operand) for operand in node.operands)
        if node.operation in BINARY:
            self._emit(f"  {name} = {BINARY[node.operation]} contract {vector} {a}, {rest[0]}")
        elif node.operation in COMPARED:
            test = self._new()
            self._emit(f"  {test} = fcmp {COMPARED[node.operation]} {vector} {a}, {rest[0]}")
            self._emit(f"  {name} = select {self._flags} {test}, {vector} {a}, {vector} {rest[0]}")
        elif node.operation == "less":
            self._emit(f"  {name} = fcmp olt {vector} {a}, {rest[0]}")
        elif node.operation == "either":
            self._emit(f"  {name} = or {self._flags} {a}, {rest[0]}")
        elif node.operation == "where":
            self._emit(f"  {name} = select {self._flags} {a}, {vector} {rest[0]}, {vector} {rest[1]}")
        elif node.operation == "negative":
            self._emit(f"  {name} = fneg {vector} {a}")
        else:
            function = f"@llvm.{UNARY[node.operation]}.{self._suffix}"
            self._declared.add(f"declare {vector} {function}({vector})")
            self._emit(f"  {name} = call {vector} {function}({vector} {a})")
