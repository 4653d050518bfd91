"""Block diagrams by operators: ``second * first``, ``a + b``, ``-a``, and negative feedback, as in python-control.

Signals are joined in the order of their declarations. Where they meet or part, a junction stands between the parts;
the parts stay what they are, with their own names, jumps and event times.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hybrid_model.declare.automaton import Automaton, require_automaton
from hybrid_model.declare.composition import Composition, Source
from hybrid_model.declare.real_numbers import is_real
from hybrid_model.declare.transitions import Assignments, Priority
from hybrid_model.declare.variables import Kind, Value, Values, Variable
from hybrid_model.errors import WiringError


class Junction(Automaton):
    """Outputs that are weighted sums of inputs.

    Parameters
    ----------
    name : str
        Name of the part.
    signals : sequence of Variable
        What each output is like: its name, shape, unit, and whether it changes at jumps only. Input ``y_1`` is the
        first term of output ``y``.
    gains : sequence of float
        The weight of each term.
    """

    has_flow_set = False
    stiff = False

    def __init__(self, name: str, signals: Sequence[Variable], gains: Sequence[float]) -> None:
        self.name, self.jumps, self.clocks, self.priority = name, (), (), Priority.JUMP
        self._terms = {
            signal.name: [(f"{signal.name}_{k}", gain) for k, gain in enumerate(gains, 1)] for signal in signals
        }
        plain = [Variable(s.name, Kind.OUTPUT, np.zeros(s.shape), s.unit, discrete=s.discrete) for s in signals]
        self.variables = tuple(
            [replace(v, name=term, kind=Kind.INPUT) for v in plain for term, _ in self._terms[v.name]] + plain
        )

    def output_values(self, s: Values) -> Assignments:
        """See `Automaton.output_values`."""
        return {name: _sum([gain * s[term] for term, gain in terms]) for name, terms in self._terms.items()}

    def start_values(self, s: Values) -> Assignments:
        """See `Automaton.start_values`."""
        return {}

    def derivatives(self, s: Values) -> Assignments:
        """See `Automaton.derivatives`."""
        return {}

    def flow_margin(self, s: Values) -> Value:
        """See `Automaton.flow_margin`."""
        return 1.0

    def jump_margins(self, s: Values) -> list[Value]:
        """See `Automaton.jump_margins`."""
        return []

    def event_times(self, s: Values) -> list[Value]:
        """See `Automaton.event_times`."""
        return []

    def reset(self, jump: int, s: Values) -> Assignments:
        """See `Automaton.reset`."""
        raise IndexError(jump)


def _sum(terms: Sequence[Value]) -> Value:
    return sum(terms[1:], terms[0])


@dataclass(frozen=True)
class _Ends:
    """Parts and wires, and the signals on which a diagram is joined to others: ``part.variable`` and what it is."""

    parts: Mapping[str, Automaton]
    wires: Mapping[str, Source]
    inputs: Mapping[str, Variable]
    outputs: Mapping[str, Variable]


class Diagram(Composition):
    """A composition by operators: it knows which of its signals are joined next, and is taken apart when it is."""

    def __init__(self, name: str, ends: _Ends) -> None:
        self.ends = ends
        super().__init__(name, ends.parts, ends.wires)


def in_series(name: str, first: Automaton, second: Automaton) -> Diagram:
    """The outputs of `first` drive the inputs of `second`, in their order."""
    a, b = _apart(name, first, second)
    remedy = f"name the wires, hm.series({name!r}, first, second, {{'input of second': 'output of first'}})"
    wires = _joined(name, (second.name, "inputs", b.inputs), (first.name, "outputs", a.outputs), remedy)
    return Diagram(name, _Ends({**a.parts, **b.parts}, {**a.wires, **b.wires, **wires}, a.inputs, b.outputs))


def in_parallel(name: str, first: Automaton, second: Automaton, gains: Sequence[float] = (1.0, 1.0)) -> Diagram:
    """Both have the same inputs, and their outputs are added, with gains."""
    a, b = _apart(name, first, second)
    remedy = "write hm.Composition with its connections"
    _joined(name, (second.name, "inputs", b.inputs), (first.name, "inputs", a.inputs), remedy)
    _joined(name, (second.name, "outputs", b.outputs), (first.name, "outputs", a.outputs), remedy)
    parts = {**a.parts, **b.parts}
    pairs = zip(a.inputs.values(), b.inputs.values(), strict=True)
    common = _signals([replace(v, discrete=v.discrete or w.discrete) for v, w in pairs])
    pairs = zip(a.outputs.values(), b.outputs.values(), strict=True)
    added = _signals([replace(v, discrete=_discrete(v) and _discrete(w)) for v, w in pairs])
    split, total = Junction(_free("split", parts), common, [1.0]), Junction(_free("sum", parts), added, gains)
    wires = {
        **a.wires,
        **b.wires,
        **{target: f"{split.name}.{k}" for side in (a, b) for target, k in _numbered(side.inputs)},
        **{
            f"{total.name}.{k}_{n}": source for n, side in enumerate((a, b), 1) for source, k in _numbered(side.outputs)
        },
    }
    ends = _Ends({split.name: split, **parts, total.name: total}, wires, _inputs_of(split), _outputs_of(total))
    return Diagram(name, ends)


def scaled(name: str, part: Automaton, gain: float) -> Diagram:
    """The outputs times a number."""
    a = _ends(part)
    junction = Junction(_free("gain", a.parts), _signals(a.outputs.values()), [gain])
    wires = {**a.wires, **{f"{junction.name}.{k}_1": source for source, k in _numbered(a.outputs)}}
    return Diagram(name, _Ends({**a.parts, junction.name: junction}, wires, a.inputs, _outputs_of(junction)))


def in_feedback(name: str, plant: Automaton, controller: Automaton, sign: float) -> Diagram:
    """The plant is driven by a reference plus `sign` times what the controller makes of the plant's outputs."""
    a, b = _apart(name, plant, controller)
    remedy = f"name the wires, hm.feedback({name!r}, plant, controller, measured, actuated)"
    measured = _joined(name, (controller.name, "inputs", b.inputs), (plant.name, "outputs", a.outputs), remedy)
    _joined(name, (plant.name, "inputs", a.inputs), (controller.name, "outputs", b.outputs), remedy)
    parts = {**a.parts, **b.parts}
    error = Junction(_free("sum", parts), _signals(a.inputs.values()), [1.0, sign])
    wires = {
        **a.wires,
        **b.wires,
        **measured,
        **{f"{error.name}.{k}_2": source for source, k in _numbered(b.outputs)},
        **{target: f"{error.name}.{k}" for target, k in _numbered(a.inputs)},
    }
    reference = {key: v for key, v in _inputs_of(error).items() if key.endswith("_1")}
    return Diagram(name, _Ends({error.name: error, **parts}, wires, reference, a.outputs))


def _apart(name: str, first: Automaton, second: Automaton) -> tuple[_Ends, _Ends]:
    a, b = _ends(first), _ends(second)
    twice = [part for part in a.parts if part in b.parts]
    if twice:
        raise WiringError(
            f"{name}: two parts are called {twice[0]!r}: give each a name of its own when it is made, as in "
            f"{type(a.parts[twice[0]]).__name__}('left')."
        )
    return a, b


def _ends(part: Automaton) -> _Ends:
    require_automaton(part)
    if isinstance(part, Diagram):
        return part.ends
    return _Ends({part.name: part}, {}, _inputs_of(part), _outputs_of(part))


def _inputs_of(part: Automaton) -> dict[str, Variable]:
    return {f"{part.name}.{v.name}": v for v in part.of_kind(Kind.INPUT)}


def _outputs_of(part: Automaton) -> dict[str, Variable]:
    return {f"{part.name}.{v.name}": v for v in part.variables if v.kind is Kind.OUTPUT or v.output}


def _joined(
    name: str,
    into: tuple[str, str, Mapping[str, Variable]],
    source: tuple[str, str, Mapping[str, Variable]],
    remedy: str,
) -> dict[str, Source]:
    """Pair signals in their order, or say that there are not as many of them."""
    (target, whose, wanted), (origin, which, there) = into, source
    if len(wanted) != len(there) or not wanted:
        raise WiringError(
            f"{name}: {origin} has the {which} {', '.join(there) or 'none'} and {target} the {whose} "
            f"{', '.join(wanted) or 'none'}, which are joined in their order: {remedy}."
        )
    return dict(zip(wanted, there, strict=True))


def _signals(variables: Iterable[Variable]) -> list[Variable]:
    return [replace(v, name=f"y{k}") for k, v in enumerate(variables, 1)]


def _numbered(ends: Mapping[str, Variable]) -> list[tuple[str, str]]:
    return [(name, f"y{k}") for k, name in enumerate(ends, 1)]


def _discrete(variable: Variable) -> bool:
    return variable.discrete or variable.kind is Kind.DISCRETE


def _free(name: str, parts: Mapping[str, Automaton]) -> str:
    return next(free for k in range(1, len(parts) + 2) if (free := name if k == 1 else f"{name}{k}") not in parts)


def _by_operator(self: Automaton, operator: str, other: object) -> Automaton:
    """What the operators do with an automaton and the `other` operand: a composition."""
    if operator == "gain" and is_real(other):
        return scaled(f"{other:g}*{self.name}", self, float(other))  # type: ignore[arg-type]
    if not isinstance(other, Automaton):
        return NotImplemented  # type: ignore[no-any-return]
    if operator == "*":
        return in_series(f"{self.name}*{other.name}", other, self)
    return in_parallel(f"({self.name}{operator}{other.name})", self, other, (1.0, 1.0 if operator == "+" else -1.0))


Automaton.joined = _by_operator
