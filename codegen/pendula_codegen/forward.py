"""Derivatives along a direction: the slope of every value of a tape, put on the same tape."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pendula_codegen.tape import Row, Step, Tape, Value, triangle


def slopes(
    tape: Tape, direction: Callable[[Row], Value | None], steps: Sequence[Step] | None = None
) -> dict[Value, Value]:
    """The derivative of each value that depends on rows with a direction; direction(row) is the derivative of a row.

    steps   only of these; else of all steps of the tape
    """
    found = _Slopes(tape, direction)
    for step in [*tape.steps] if steps is None else steps:
        found.follow(step)
    return found.of


class _Slopes:
    def __init__(self, tape: Tape, direction: Callable[[Row], Value | None]):
        self.tape = tape
        self.direction = direction
        self.of: dict[Value, Value] = {}
        self._matrices: dict[Value, tuple[Value, ...]] = {}  # lower triangles, by the first of their factors

    def follow(self, step: Step) -> None:
        if step.operation == "read":
            along = self.direction(step.row)
            if along is not None:
                self.of[step.first] = along
        elif step.operation == "factor":
            self._matrices[step.first] = step.operands
        elif step.operation == "solve":
            self._solve(step)
        elif any(value in self.of for value in step.operands):
            getattr(self, f"_{step.operation}", self._call)(step)

    def _set(self, value: Value, slope: Value | None) -> None:
        if slope is not None:
            self.of[value] = slope

    # --- sums of slopes, where None stands for 0

    def _plus(self, x: Value | None, y: Value | None) -> Value | None:
        return y if x is None else x if y is None else self.tape.add(x, y)

    def _minus(self, x: Value | None, y: Value | None) -> Value | None:
        if x is None:
            return None if y is None else self.tape.negative(y)
        return x if y is None else self.tape.subtract(x, y)

    def _times(self, factor: Value, slope: Value | None) -> Value | None:
        if slope is None or self.tape.number_of(slope) == 1:
            return None if slope is None else factor
        return self.tape.multiply(factor, slope)

    # --- operations

    def _add(self, step: Step) -> None:
        x, y = step.operands
        self._set(step.first, self._plus(self.of.get(x), self.of.get(y)))

    def _subtract(self, step: Step) -> None:
        x, y = step.operands
        self._set(step.first, self._minus(self.of.get(x), self.of.get(y)))

    def _multiply(self, step: Step) -> None:
        x, y = step.operands
        self._set(step.first, self._plus(self._times(y, self.of.get(x)), self._times(x, self.of.get(y))))

    def _negative(self, step: Step) -> None:
        self._set(step.first, self.tape.negative(self.of[step.operands[0]]))

    def _inverse(self, step: Step) -> None:
        square = self.tape.multiply(step.first, step.first)
        self._set(step.first, self.tape.negative(self._times(square, self.of[step.operands[0]])))

    def _sincos(self, step: Step) -> None:
        slope = self.of[step.operands[0]]
        sine, cosine = step.results
        self._set(sine, self._times(cosine, slope))
        self._set(cosine, self.tape.negative(self._times(sine, slope)))

    def _solve(self, step: Step) -> None:
        """For M x = b, the slope x' solves M x' = b' − M' x, with the same factors."""
        entries = triangle(step.count)
        factors, b = step.operands[:entries], step.operands[entries:]
        matrix = self._matrices[factors[0]]
        right = []
        for i, value in enumerate(b):
            slope = self.of.get(value)
            for j, x in enumerate(step.results):
                entry = matrix[triangle(max(i, j)) + min(i, j)]
                slope = self._minus(slope, self._times(x, self.of.get(entry)))
            right.append(slope)
        if any(slope is not None for slope in right):
            zero = self.tape.number(0.0)
            found = self.tape.solve(factors, [zero if slope is None else slope for slope in right])
            self.of |= dict(zip(step.results, found, strict=True))

    def _call(self, step: Step) -> None:
        (x,) = step.operands
        self._set(step.first, self._times(self._slope(step, x, step.first), self.of[x]))

    def _slope(self, step: Step, x: Value, f: Value) -> Value:
        """f'(x) of a function of one argument."""
        tape = self.tape
        one = tape.number(1.0)

        def square_and_one(sign: int, y: Value) -> Value:
            square = tape.multiply(y, y)
            return tape.add(square, one) if sign > 0 else tape.subtract(one, square)

        match step.operation:
            case "tan":
                return square_and_one(1, f)
            case "asin":
                return tape.inverse(tape.call("sqrt", square_and_one(-1, x)))
            case "acos":
                return tape.negative(tape.inverse(tape.call("sqrt", square_and_one(-1, x))))
            case "atan":
                return tape.inverse(square_and_one(1, x))
            case "sinh":
                return tape.call("cosh", x)
            case "cosh":
                return tape.call("sinh", x)
            case "tanh":
                return square_and_one(-1, f)
            case "exp":
                return f
            case "log":
                return tape.inverse(x)
            case "sqrt":
                return tape.multiply(tape.number(0.5), tape.inverse(f))
            case "cbrt":
                return tape.inverse(tape.multiply(tape.number(3.0), tape.multiply(f, f)))
            case "pow":
                return tape.multiply(tape.number(step.number), tape.power(x, step.number - 1.0))
        raise AssertionError(f"no slope of {step.operation}")
