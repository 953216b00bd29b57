"""Text of LLVM's functions. Each value gets a name; counters of loops have stack slots, which LLVM makes registers."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from itertools import count

ROUNDED = {"fadd", "fsub", "fmul"}  # may be fused: products then go into sums unrounded
Pair = tuple[str, str]


def literal(number: float) -> str:
    """A number as LLVM's hexadecimal literal, with all its bits."""
    return f"0x{struct.unpack('>Q', struct.pack('>d', number))[0]:016X}"


class LlvmFunction:
    """A function, line by line, on registers of `width` numbers.

    numbers    the type of such a register
    integers   the type of a register of as many integers
    bits       the type of as many bits
    pairs      the type of two registers of numbers
    """

    def __init__(self, head: str, width: int, attributes: str = "#0"):
        self._head = f"define {head} {attributes} {{"
        self._slots: list[str] = []
        self._lines: list[str] = []
        self._names = count(1)
        self._have(width)

    def _have(self, width: int) -> None:
        self.width = width
        self.numbers = self._of("double")
        self.integers = self._of("i64")
        self.bits = self._of("i1")
        self.pairs = f"{{ {self.numbers}, {self.numbers} }}"

    def of_width(self, width: int) -> LlvmFunction:
        """The same function, where it has registers of another width."""
        other = copy(self)
        other._have(width)
        return other

    def _of(self, type_: str) -> str:
        return type_ if self.width == 1 else f"<{self.width} x {type_}>"

    def text(self) -> str:
        return "\n".join([self._head, "entry:", *self._slots, *self._lines, "}"])

    # --- values

    def number(self, value: float) -> str:
        return literal(value) if self.width == 1 else f"splat (double {literal(value)})"

    def integer(self, value: int) -> str:
        return str(value) if self.width == 1 else f"splat (i64 {value})"

    def line(self, text: str) -> None:
        self._lines.append(f"  {text}")

    def name(self) -> str:
        return f"%v{next(self._names)}"

    def let(self, text: str) -> str:
        name = self.name()
        self.line(f"{name} = {text}")
        return name

    def do(self, operation: str, x: str, y: str) -> str:
        """fadd, fsub, fmul, fdiv of registers."""
        flags = " contract" if operation in ROUNDED else ""
        return self.let(f"{operation}{flags} {self.numbers} {x}, {y}")

    def add(self, x: str, y: str) -> str:
        return self.do("fadd", x, y)

    def subtract(self, x: str, y: str) -> str:
        return self.do("fsub", x, y)

    def multiply(self, x: str, y: str) -> str:
        return self.do("fmul", x, y)

    def polynomial(self, x: str, low: float, high: float) -> str:
        """low + high x."""
        return self.add(self.multiply(x, self.number(high)), self.number(low))

    def integral(self, operation: str, x: str, y: str) -> str:
        return self.let(f"{operation} {self.integers} {x}, {y}")

    def as_integers(self, x: str) -> str:
        return self.let(f"bitcast {self.numbers} {x} to {self.integers}")

    def as_numbers(self, x: str) -> str:
        return self.let(f"bitcast {self.integers} {x} to {self.numbers}")

    def compare(self, how: str, x: str, y: str) -> str:
        return self.let(f"fcmp {how} {self.numbers} {x}, {y}")

    def choose(self, condition: str, x: str, y: str) -> str:
        return self.let(f"select {self.bits} {condition}, {self.numbers} {x}, {self.numbers} {y}")

    def intrinsic(self, name: str, x: str) -> str:
        suffix = "f64" if self.width == 1 else f"v{self.width}f64"
        return self.let(f"call {self.numbers} @llvm.{name}.{suffix}({self.numbers} {x})")

    def all(self, bits: str) -> str:
        """Whether all bits are set."""
        if self.width == 1:
            return bits
        return self.let(f"call i1 @llvm.vector.reduce.and.v{self.width}i1({self.bits} {bits})")

    def pair(self, x: str, y: str, type_: str = "") -> str:
        """A pair of two values, by default of registers of numbers."""
        of = type_ or self.numbers
        first = self.let(f"insertvalue {{ {of}, {of} }} poison, {of} {x}, 0")
        return self.let(f"insertvalue {{ {of}, {of} }} {first}, {of} {y}, 1")

    def of_pair(self, pair: str) -> Pair:
        first, second = (self.let(f"extractvalue {self.pairs} {pair}, {k}") for k in range(2))
        return first, second

    def lanes(self, x: str) -> list[str]:
        """The numbers of a register."""
        if self.width == 1:
            return [x]
        return [self.let(f"extractelement {self.numbers} {x}, i64 {k}") for k in range(self.width)]

    def together(self, lanes: Sequence[str]) -> str:
        if self.width == 1:
            return lanes[0]
        found = "poison"
        for k, lane in enumerate(lanes):
            found = self.let(f"insertelement {self.numbers} {found}, double {lane}, i64 {k}")
        return found

    def splat(self, lane: str) -> str:
        """A register of one number."""
        if self.width == 1:
            return lane
        first = self.let(f"insertelement {self.numbers} poison, double {lane}, i64 0")
        return self.let(
            f"shufflevector {self.numbers} {first}, {self.numbers} poison, <{self.width} x i32> zeroinitializer"
        )

    # --- memory

    def slot(self, type_: str, count: int = 1) -> str:
        """Memory on the stack of the function."""
        name = self.name()
        self._slots.append(f"  {name} = alloca {type_}, i64 {count}, align 64")
        return name

    def place(self, array: str, k: int | str) -> str:
        """The address of number k of an array."""
        return array if k == 0 else self.let(f"getelementptr inbounds double, ptr {array}, i64 {k}")

    def read(self, place: str) -> str:
        return self.let(f"load {self.numbers}, ptr {place}, align {8 * self.width}")

    def write(self, place: str, x: str) -> None:
        self.line(f"store {self.numbers} {x}, ptr {place}, align {8 * self.width}")

    def read_one(self, place: str) -> str:
        return self.let(f"load double, ptr {place}, align 8")

    def pointer(self, place: str, k: int) -> str:
        """Loads pointer k of a structure with only pointers before it."""
        there = place if k == 0 else self.let(f"getelementptr inbounds ptr, ptr {place}, i64 {k}")
        return self.let(f"load ptr, ptr {there}, align 8")

    # --- the order of things

    def label(self, name: str) -> None:
        self._lines.append(f"{name[1:]}:")

    @contextmanager
    def each(self, first: int | str, end: int | str, step: int = 1) -> Iterator[str]:
        """A loop, and its counter."""
        counter, (head, body, done) = self.slot("i64"), (self.name() for _ in range(3))
        self.line(f"store i64 {first}, ptr {counter}")
        self.line(f"br label {head}")
        self.label(head)
        k = self.let(f"load i64, ptr {counter}")
        more = self.let(f"icmp {'slt' if step > 0 else 'sgt'} i64 {k}, {end}")
        self.line(f"br i1 {more}, label {body}, label {done}")
        self.label(body)
        yield k
        following = self.let(f"add nsw i64 {k}, {step}")
        self.line(f"store i64 {following}, ptr {counter}")
        self.line(f"br label {head}")
        self.label(done)

    @contextmanager
    def each_register(self, states: int) -> Iterator[int | str]:
        """A loop over registers; yields the first state of each. No loop if one register holds all states."""
        if states == self.width:
            yield 0
        else:
            with self.each(0, states, self.width) as lane:
                yield lane

    @contextmanager
    def only_if(self, condition: str) -> Iterator[None]:
        holds, done = self.name(), self.name()
        self.line(f"br i1 {condition}, label {holds}, label {done}")
        self.label(holds)
        yield
        self.line(f"br label {done}")
        self.label(done)

    def whole(self, operation: str, x: int | str, y: int | str) -> str:
        """An operation on counters."""
        return self.let(f"{operation} nsw i64 {x}, {y}")
