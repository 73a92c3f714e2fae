"""Constraints as Python functions, recorded as steps that C++ evaluates.

The function is called once, with symbols in place of numbers. Each operation on them is recorded,
equal ones once and those of constants carried out, so that no Python runs afterwards.
"""

from __future__ import annotations

import inspect
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NoReturn, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ._core import Error

# Operation, and the steps that it takes its arguments from; a constant's value, an input's place.
Step: TypeAlias = tuple[str, float, int]
Objects: TypeAlias = NDArray[np.object_]

OPERATIONS: dict[str, Callable[..., float]] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": operator.truediv,
    "negate": operator.neg,
    "sqrt": math.sqrt,
    "exp": math.exp,
    "log": math.log,
    "sin": math.sin,
    "cos": math.cos,
    "arctan2": math.atan2,
}


class Tape:
    """Steps that were done to symbols, each once."""

    def __init__(self) -> None:
        self.steps: list[Step] = []
        self.known: dict[Step, Symbol] = {}

    def step(self, operation: str, a: float, b: int = -1) -> Symbol:
        """Return the result of a step."""
        key = operation, a, b
        if key not in self.known:
            self.steps.append(key)
            self.known[key] = Symbol(self, len(self.steps) - 1)
        return self.known[key]

    def constant(self, value: float) -> Symbol:
        """Return a number that stays as it is."""
        return self.step("constant", float(value) + 0.0)  # -0.0 as 0.0

    def inputs(self, first: int, shape: tuple[int, ...]) -> Objects:
        """Return symbols of inputs, counted from the first."""
        out = np.empty(shape, dtype=object)
        for k in range(out.size):
            out.flat[k] = self.step("input", first + k)
        return out

    def pose(self, first: int) -> Objects:
        """Return a pose of twelve inputs, (4, 4)."""
        return np.vstack([self.inputs(first, (3, 4)), self.constants(np.eye(4)[3:])])

    def constants(self, values: Any) -> Objects:
        """Return numbers as symbols; symbols among them stay."""
        given = np.asarray(values, dtype=object)
        out = np.empty(given.shape, dtype=object)
        for k, x in enumerate(given.flat):
            out.flat[k] = x if isinstance(x, Symbol) else self.constant(x)
        return out

    def value(self, x: Symbol) -> float | None:
        """Return a constant's number, None for what is no constant."""
        operation, value, _ = self.steps[x.index]
        return value if operation == "constant" else None

    def apply(self, operation: str, *arguments: Symbol) -> Symbol:
        """Return a function of one symbol or two."""
        values = [self.value(x) for x in arguments]
        known = [v for v in values if v is not None]
        if len(known) == len(values):
            return self.constant(OPERATIONS[operation](*known))
        a, b = arguments[0], arguments[-1]
        x, y = values[0], values[-1]
        if (operation == "multiply" and 0.0 in known) or (operation, x) == ("divide", 0.0):
            return self.constant(0.0)
        # x + 0, x - 0, 1 x and x / 1 are x.
        if operation in ("add", "subtract") and y == 0.0:
            return a
        if operation in ("multiply", "divide") and y == 1.0:
            return a
        if (operation, x) in (("add", 0.0), ("multiply", 1.0)):
            return b
        if len(arguments) == 1:
            return self.step(operation, a.index)
        first, second = a.index, b.index
        if operation in ("add", "multiply"):
            first, second = sorted((first, second))
        return self.step(operation, first, second)

    def compact(self, outputs: Sequence[Symbol]) -> tuple[list[Step], list[int]]:
        """Return the steps that outputs are made of, and the outputs' places among them."""
        used = {x.index for x in outputs}
        for k in reversed(range(len(self.steps))):
            if k in used:
                used.update(self.sources(k))
        place = {-1: -1} | {k: i for i, k in enumerate(sorted(used))}
        steps = [
            (operation, place[int(a)], place[b]) if operation in OPERATIONS else (operation, a, b)
            for operation, a, b in (self.steps[k] for k in sorted(used))
        ]
        return steps, [place[x.index] for x in outputs]

    def sources(self, k: int) -> list[int]:
        """Return the steps that a step takes its arguments from."""
        operation, a, b = self.steps[k]
        return [x for x in (int(a), b) if x >= 0] if operation in OPERATIONS else []


def refused(what: str, instead: str) -> Callable[..., NoReturn]:
    """Return a method for what cannot be traced."""

    def method(self: Symbol, *_: object) -> NoReturn:
        raise Error(
            f"{what} of a pose, a twist or a parameter cannot be traced: the function is called "
            f"once, with symbols, and not at each state; {instead}"
        )

    return method


BRANCH = refused(
    "a comparison",
    'write one smooth function, an inequality g <= 0 as g with relation="at_most", and each case '
    "as a constraint of its own",
)
NUMBER = refused(
    "the number", "use numpy's functions (np.sin, not math.sin), and plain integers as indices"
)
ABSOLUTE = refused(
    "the absolute value", "it has no derivative at 0: write x**2, or np.sqrt(x**2 + small**2)"
)


def binary(operation: str, swapped: bool = False) -> Callable[[Symbol, Any], Any]:
    """Return the method of an operator."""

    def method(self: Symbol, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented
        x = self.tape.constants(other).item()
        return self.tape.apply(operation, *((x, self) if swapped else (self, x)))

    return method


def unary(operation: str) -> Callable[[Symbol], Symbol]:
    """Return the method that numpy's function of this name calls."""
    return lambda self: self.tape.apply(operation, self)


class Symbol:
    """A number of a pose, a twist or a parameter, or what was made of some."""

    __slots__ = ("index", "tape")

    def __init__(self, tape: Tape, index: int) -> None:
        self.tape = tape
        self.index = index

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        # Numbers beside a symbol have no method sin or arctan2, symbols of them do.
        arrays = [self.tape.constants(x) for x in inputs]
        return getattr(ufunc, method)(*arrays, **options)

    __add__, __radd__ = binary("add"), binary("add", swapped=True)
    __sub__, __rsub__ = binary("subtract"), binary("subtract", swapped=True)
    __mul__, __rmul__ = binary("multiply"), binary("multiply", swapped=True)
    __truediv__, __rtruediv__ = binary("divide"), binary("divide", swapped=True)

    def __repr__(self) -> str:
        return "symbol"

    def __pos__(self) -> Symbol:
        return self

    def __neg__(self) -> Symbol:
        return self.tape.apply("negate", self)

    def __pow__(self, exponent: Any) -> Any:
        power = self.tape.constants(exponent).item()
        n = self.tape.value(power)
        if n == 0.5:
            return self.sqrt()
        if n is None or not n.is_integer():
            return (power * self.log()).exp()
        if n < 0:
            return 1.0 / self ** int(-n)
        half = self ** int(n // 2) if n > 1 else self.tape.constant(1.0)
        return half * half * self if n % 2 else half * half

    def __rpow__(self, base: Any) -> Any:
        return (self * self.tape.constants(base).item().log()).exp()

    sqrt, exp, log = unary("sqrt"), unary("exp"), unary("log")
    sin, cos = unary("sin"), unary("cos")
    arctan2 = binary("arctan2")

    def tan(self) -> Any:
        return self.sin() / self.cos()

    def arcsin(self) -> Any:
        return self.arctan2(((1.0 - self) * (1.0 + self)).sqrt())

    def arccos(self) -> Any:
        return ((1.0 - self) * (1.0 + self)).sqrt().arctan2(self)

    def arctan(self) -> Any:
        return self.arctan2(1.0)

    def hypot(self, other: Any) -> Any:
        return (self * self + other * other).sqrt()

    def conjugate(self) -> Symbol:
        return self

    __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = __bool__ = BRANCH
    __float__ = __int__ = __index__ = NUMBER
    __abs__ = ABSOLUTE
    __hash__ = None  # type: ignore[assignment]


def arguments_of(
    what: str, function: Callable[..., Any], given: Mapping[str, Any]
) -> tuple[bool, dict[str, NDArray[np.float64]]]:
    """Return whether a function takes twists, and its parameters in their order."""
    try:
        signature = inspect.signature(function)
        of_velocity = list(signature.parameters)[1:2] == ["V"]
        bound = signature.bind(*("X", "V")[: 1 + of_velocity], **given)
        bound.apply_defaults()
        names = list(bound.arguments)[1 + of_velocity :]
        return of_velocity, {
            name: np.array(bound.arguments[name], dtype=np.float64) for name in names
        }
    except (TypeError, ValueError) as error:
        raise Error(
            f"{what}: {error}; expected a function of X, of X and V if it is of velocities, and of "
            f"its parameters by name, which are numbers; got {', '.join(given) or 'none'}"
        ) from None


def trace(
    what: str, function: Callable[..., Any], bodies: Sequence[int | None], given: Mapping[str, Any]
) -> tuple[list[Step], list[int], bool, dict[str, NDArray[np.float64]]]:
    """Return a function's steps, its results among them, whether it takes V, and its parameters.

    Inputs are numbers of the bodies' poses, (3, 4) each in C order, of their twists if it takes
    those, and of the parameters, a pose's as (3, 4); the world is the identity and stands still.
    """
    of_velocity, parameters = arguments_of(what, function, given)
    tape = Tape()
    poses = tape.constants(np.tile(np.eye(4), (len(bodies), 1, 1)))
    twists = tape.constants(np.zeros((len(bodies), 6)))
    moving = [k for k, body in enumerate(bodies) if body is not None]
    after_poses = 12 * len(moving)
    end = after_poses + (6 * len(moving) if of_velocity else 0)
    for k, body in enumerate(moving):
        poses[body] = tape.pose(12 * k)
        if of_velocity:
            twists[body] = tape.inputs(after_poses + 6 * k, (6,))
    symbols = {}
    first = end
    for name, value in parameters.items():
        if value.shape == (4, 4):
            symbols[name] = tape.pose(first)
            first += 12
        else:
            symbols[name] = tape.inputs(first, value.shape)[()]
            first += value.size
    result = function(poses, twists, **symbols) if of_velocity else function(poses, **symbols)
    try:
        outputs = np.atleast_1d(tape.constants(result))
    except (TypeError, ValueError):
        outputs = np.empty((0, 0), dtype=object)
    if outputs.ndim != 1 or not outputs.size:
        raise Error(
            f"{what}: got {result!r} from the function, expected a number or a list of them"
        )
    moved = range(after_poses if of_velocity else 0, end)
    for row, output in enumerate(outputs):
        steps, _ = tape.compact([output])
        if not any(operation == "input" and place in moved for operation, place, _ in steps):
            raise Error(f"{what}: row {row} of g does not depend on {'V' if of_velocity else 'X'}")
    return *tape.compact(list(outputs)), of_velocity, parameters
