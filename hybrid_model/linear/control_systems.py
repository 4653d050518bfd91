"""python-control both ways: flows of automata as its systems, its linear systems as automata.

The one module that imports python-control, which is slow to import; ``import hybrid_model`` does not load it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import control
import numpy as np
import numpy.typing as npt

from hybrid_model.declare.arguments import require_automaton
from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.state_space import LinearAutomaton, state_space
from hybrid_model.declare.variables import FloatArray, Kind, Values, element_names, start_array, unknown_name
from hybrid_model.errors import DeclarationError
from hybrid_model.linear.jacobian import jacobian
from hybrid_model.linear.operating_point import OperatingPoint, find_places, outputs_of_flow, read_outputs

StateSpace: TypeAlias = control.StateSpace
"""python-control's class, for annotations."""


def flow_system(automaton: Automaton, z: Mapping[str, npt.ArrayLike] | None = None) -> control.NonlinearIOSystem:
    """Return the flow of an automaton as a system of python-control.

    The discrete states are frozen: the system is the automaton between two jumps, and its jumps and its flow set are
    not part of it.

    Parameters
    ----------
    automaton : Automaton
        Whose flow.
    z : mapping, optional
        Discrete state -> value; those not named keep their start values, computed ones included.

    Returns
    -------
    control.NonlinearIOSystem
        States, inputs and outputs are scalars under the automaton's names, ``x``, ``v[1]``, with ``_`` for each dot of
        a composition; the outputs are the computed outputs and the states declared as outputs (all states if there
        are none). The parameters are the system's ``params`` under their scalar names, dots included.

    Raises
    ------
    DeclarationError
        For an unknown discrete state, a wrong shape, or names that are the same once their dots are replaced.

    Notes
    -----
    ``control.input_output_response`` lets SciPy choose its steps, which grow where nothing happens: they can step over
    a late pulse in a table of inputs, in silence. ``solve_ivp_kwargs={"max_step": ...}`` with the shortest interval of
    the table, or the shortest pulse, prevents that.
    """
    require_automaton("flow_system", automaton)
    point = OperatingPoint(automaton)
    layout = point.layout
    for name, value in (z or {}).items():
        point.put(name, value, (Kind.DISCRETE,))
    names = layout.names(Kind.PARAMETER)
    shown = outputs_of_flow(layout)

    def values(t: float, x: FloatArray, u: FloatArray, params: Mapping[str, float]) -> Values:
        unknown = next((name for name in params if name not in defaults), None)
        if unknown is not None:
            raise DeclarationError(unknown_name(f"{automaton.name} (parameters)", unknown, defaults))
        p = np.array([params.get(name, defaults[name]) for name in names], dtype=np.float64)
        return layout.values(t, np.asarray(x), point.vectors[Kind.DISCRETE], np.asarray(u), p)

    def update(t: float, x: FloatArray, u: FloatArray, params: Mapping[str, float]) -> FloatArray:
        return layout.pack(Kind.STATE, automaton.derivatives(values(t, x, u, params)))

    def output(t: float, x: FloatArray, u: FloatArray, params: Mapping[str, float]) -> FloatArray:
        return read_outputs(automaton, shown, values(t, x, u, params))

    defaults = dict(zip(names, map(float, point.vectors[Kind.PARAMETER]), strict=True))
    return control.nlsys(
        update,
        output,
        inputs=_labels(automaton, layout.names(Kind.INPUT)),
        outputs=_labels(automaton, [name for place in shown for name in element_names(place.variable)]),
        states=_labels(automaton, layout.names(Kind.STATE)),
        params=defaults,
        name=automaton.name.replace(".", "_"),
    )


def linearise(
    automaton: Automaton,
    at: Mapping[str, npt.ArrayLike] | None = None,
    *,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> StateSpace:
    """Return the linearisation of an automaton's flow and outputs at a point, with its discrete states frozen.

    The point need not be an equilibrium: the system tells how deviations from the solution through it begin.

    Parameters
    ----------
    automaton : Automaton
        Whose flow.
    at : mapping, optional
        State, discrete state, input or parameter -> value at the point, or ``"t"`` -> time in s; scalars of vectors
        by their own names, ``"x[2]"``. What is not named has its start value.
    inputs : sequence of str, optional
        Inputs of the linear system: names of inputs, and of discrete states where a held value is to act as an input.
        Default: all inputs, those that change at jumps only included.
    outputs : sequence of str, optional
        Outputs of the linear system: names of computed outputs and of states. Default: as for `flow_system`.

    Returns
    -------
    control.StateSpace
        With the names of the scalars, ``_`` for each dot.

    Raises
    ------
    DeclarationError
        For unknown names, a wrong shape, or a point where the maps have a kink or a jump.
    SimulationError
        If the maps are not finite at the point.

    Notes
    -----
    Derivatives are extrapolated central differences, see `hybrid_model.linear.jacobian`: exact to rounding for affine
    flows.
    """
    require_automaton("linearise", automaton)
    point = OperatingPoint(automaton)
    layout = point.layout
    for name, value in (at or {}).items():
        if name == "t":
            point.t = float(start_array(f"{automaton.name}: t", value))
        else:
            point.put(name, value)
    driven = layout.places[Kind.INPUT] if inputs is None else find_places(layout, inputs, (Kind.INPUT, Kind.DISCRETE))
    shown = outputs_of_flow(layout) if outputs is None else find_places(layout, outputs, (Kind.OUTPUT, Kind.STATE))
    states = layout.names(Kind.STATE)
    driving = [name for place in driven for name in element_names(place.variable)]
    read = [name for place in shown for name in element_names(place.variable)]

    def maps(vector: FloatArray) -> FloatArray:
        s = point.values(vector[: len(states)], driven, vector[len(states) :])
        return np.concatenate([layout.pack(Kind.STATE, automaton.derivatives(s)), read_outputs(automaton, shown, s)])

    centre = np.concatenate([point.vectors[Kind.STATE], point.take(driven)])
    rows = [*(f"the derivative of {name}" for name in states), *read]
    found = jacobian(maps, centre, owner=automaton.name, rows=rows, columns=[*states, *driving])
    n = len(states)
    return named_system(
        found[:n, :n],
        found[:n, n:],
        found[n:, :n],
        found[n:, n:],
        inputs=_labels(automaton, driving),
        outputs=_labels(automaton, read),
        states=_labels(automaton, states),
        name=automaton.name,
    )


def named_system(
    A: npt.ArrayLike,
    B: npt.ArrayLike,
    C: npt.ArrayLike,
    D: npt.ArrayLike,
    *,
    inputs: Sequence[str],
    outputs: Sequence[str],
    states: Sequence[str],
    name: str,
    period: float = 0.0,
) -> StateSpace:
    """Return a linear system with named signals.

    Parameters
    ----------
    A, B, C, D : array_like
        Shapes (n, n), (n, m), (p, n), (p, m).
    inputs, outputs, states : sequence of str
        Names of the m inputs, p outputs and n states.
    name : str
        Name of the system; its dots become ``_``.
    period : float
        Sampling period in s of a system in discrete time; 0 for continuous time.
    """
    return control.ss(
        A,
        B,
        C,
        D,
        dt=period,
        inputs=list(inputs),
        outputs=list(outputs),
        states=list(states),
        name=name.replace(".", "_"),
        remove_useless_states=False,
    )


def h_infinity_norm(system: StateSpace, tolerance: float = 1e-6) -> float:
    """Return the largest gain over all frequencies of a stable continuous system, by python-control.

    Parameters
    ----------
    system : control.StateSpace
        Continuous and stable; any number of inputs and outputs.
    tolerance : float
        Relative accuracy.

    Raises
    ------
    DeclarationError
        If the system is discrete or has a pole that is not stable: then the norm is not defined.

    Notes
    -----
    Without slycot, python-control compares real parts with an absolute tolerance and needs as many inputs as outputs.
    So time is scaled to the fastest pole, the gain to one at frequency zero, and rows or columns of zeros are added;
    the norm is the same but for that factor.
    """
    poles = system.poles()
    if not system.isctime(strict=False) or np.any(poles.real >= 0):
        raise DeclarationError(
            f"{system.name} is discrete or has a pole that is not stable, so it has no H-infinity norm: "
            "give a continuous system whose poles have negative real parts."
        )
    if not system.nstates:
        return float(np.linalg.norm(system.D, 2))
    fastest = float(np.max(np.abs(poles)))
    size = max(system.ninputs, system.noutputs)
    rows, columns = size - system.noutputs, size - system.ninputs
    scale = float(np.linalg.norm(system.D - system.C @ np.linalg.solve(system.A, system.B), 2)) or 1.0
    square = control.ss(
        system.A / fastest,
        np.pad(system.B / fastest, ((0, 0), (0, columns))),
        np.pad(system.C / scale, ((0, rows), (0, 0))),
        np.pad(system.D / scale, ((0, rows), (0, columns))),
    )
    return scale * float(control.system_norm(square, "inf", tol=tolerance, print_warning=False))


def lti(
    system: control.StateSpace | control.TransferFunction,
    name: str | None = None,
    *,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    state: str = "x",
    start: npt.ArrayLike = 0.0,
) -> LinearAutomaton:
    """Return a linear system of python-control as an automaton, a part for a composition.

    A continuous system flows. A discrete one has discrete states and samples at ``k dt``, see
    `hybrid_model.declare.state_space.DiscreteStateSpace`. The matrices are parameters.

    Parameters
    ----------
    system : control.StateSpace or control.TransferFunction
        With its timebase; a transfer function is realised by ``control.ss``.
    name : str, optional
        Name of the automaton; default: the system's.
    inputs, outputs : sequence of str, optional
        Names of the scalar inputs and outputs; default: the system's labels.
    state : str
        Name of the state vector.
    start : float or array_like, shape (states,)
        State at the start.

    Returns
    -------
    LinearAutomaton
        Ready to run, to compose and to export.

    Raises
    ------
    DeclarationError
        For a system of another class, an improper transfer function, a sampling period that is not known, and names
        that are no Python identifiers.
    """
    called: str = name or str(getattr(system, "name", system))
    if not isinstance(system, (control.StateSpace, control.TransferFunction)):
        raise DeclarationError(
            f"{called} is a {type(system).__name__}: give a control.StateSpace or control.TransferFunction "
            "(control.linearize makes one of a nonlinear system)."
        )
    given = list(system.input_labels if inputs is None else inputs)
    taken = list(system.output_labels if outputs is None else outputs)
    if (len(given), len(taken)) != (system.ninputs, system.noutputs):
        raise DeclarationError(
            f"{called} has {system.ninputs} inputs and {system.noutputs} outputs, but {len(given)} and {len(taken)} "
            "names were given: give one for each."
        )
    realised = system if isinstance(system, control.StateSpace) else _realised(called, system)
    return state_space(
        realised.A,
        realised.B,
        realised.C,
        realised.D,
        inputs=given,
        outputs=taken,
        period=_period(called, realised),
        name=called,
        state=state,
        start=start,
    )


def _labels(automaton: Automaton, names: Sequence[str]) -> list[str]:
    # python-control keeps dots for itself: system.signal.
    labels = [name.replace(".", "_") for name in names]
    double = next((label for label in labels if labels.count(label) > 1), None)
    if double is not None:
        same = [name for name in names if name.replace(".", "_") == double]
        raise DeclarationError(
            f"{automaton.name}: {' and '.join(same)} are both called {double!r} in python-control, which allows no "
            "dots in names: rename one by names={...} of the composition."
        )
    return labels


def _realised(name: str, system: control.TransferFunction) -> StateSpace:
    for numerator, denominator in zip(np.ravel(system.num_array), np.ravel(system.den_array), strict=True):
        degrees = [len(np.trim_zeros(np.atleast_1d(polynomial), "f")) - 1 for polynomial in (numerator, denominator)]
        if degrees[0] > degrees[1]:
            raise DeclarationError(
                f"{name} is improper: its numerator has degree {degrees[0]}, its denominator {degrees[1]}: a "
                "derivative of the input has no state; add poles, or differentiate by hand."
            )
    try:
        return control.ss(system)
    except control.ControlMIMONotImplemented as error:
        raise DeclarationError(
            f"{name} is a transfer function with several inputs or outputs, which python-control realises only with "
            "slycot installed: give a control.StateSpace."
        ) from error


def _period(name: str, system: control.StateSpace) -> float | None:
    if system.dt is True:
        raise DeclarationError(
            f"{name} is a discrete-time system with dt=True, whose sampling period is not known: give it in s, dt=0.1."
        )
    if system.dt is None and system.nstates:
        raise DeclarationError(
            f"{name} has dt=None, so it may be continuous or discrete: give dt=0, or the sampling period in s."
        )
    return float(system.dt) if system.dt else None
