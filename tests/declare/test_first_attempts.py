"""Natural first attempts at writing an automaton: each works, or is answered by one sentence with the remedy."""

import copy
import math
import pickle
from fractions import Fraction

import numpy as np
import pytest

import hybrid_model as hm
from fmu.errors import ExportError
from fmu.export import export_fmu
from hybrid_model.declare.state_space import state_space
from hybrid_model.models import BouncingBall, RestingBall
from hybrid_model.native.trace import trace


def ball_with(**body):
    return type("Wrong", (BouncingBall,), body)


def run(automaton, t_end=1.0, **options):
    return hm.simulate(automaton, t_end, **options)


# Names of the framework, and names that nothing reads.


@pytest.mark.parametrize(
    "name", ["reset", "derivatives", "start_values", "jump_margins", "event_times", "variables", "name", "_named_once"]
)
def test_a_method_of_a_name_of_the_framework(name):
    wrong = ball_with(**{name: lambda self, s: {}})
    with pytest.raises(hm.DeclarationError, match=rf"^Wrong defines '{name}', a name of the framework: choose another"):
        wrong()


def test_methods_of_a_users_own_base_class_are_looked_at_too():
    base = ball_with(reset=lambda self, s: {})
    with pytest.raises(hm.DeclarationError, match=r"^Derived defines 'reset', a name of the framework"):
        type("Derived", (base,), {})()


def test_a_flow_map_beside_modes():
    wrong = type("Wrong", (RestingBall,), {"flow_map": lambda self, s: {"h": 0.0, "v": 0.0}})
    with pytest.raises(hm.DeclarationError, match=r"Wrong defines 'flow_map', a name of the framework.*modes, outputs"):
        wrong()


def test_helpers_of_any_other_name_are_free():
    class Own(BouncingBall):
        def energy(self, s):
            return s.g * s.h + 0.5 * s.v**2

        def jump_map(self, s):
            return {"h": 0.0, "v": math.sqrt(2.0 * self.energy(s))}

    # Without loss the ball is back at its height of 1 m after twice the time of fall, sqrt(2 h / g).
    assert run(Own(), 2.0 * math.sqrt(2.0 / 9.81)).end.h == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ("written", "meant"), [("flowsets", "flow_set"), ("output", "outputs"), ("StartMap", "start_map")]
)
def test_a_method_with_nearly_the_name_of_a_map(written, meant):
    with pytest.raises(hm.DeclarationError, match=f"a method '{written}', which nothing calls, and no '{meant}'"):
        type("Wrong", (hm.HybridAutomaton,), {written: lambda self, s: {}})()


@pytest.mark.parametrize("g", [1.62, None, lambda self: 1.62])
def test_a_number_in_the_place_of_an_inherited_declaration(g):
    with pytest.raises(
        hm.DeclarationError, match=r"^Wrong\.g = .* would hide what BouncingBall .* write g = hm\.Parameter\(\.\.\.\)"
    ):
        ball_with(g=g)()


def test_a_jump_that_is_not_listed():
    up = hm.Jump("up", lambda self, s: -1.0, lambda self, s: {})
    for body in ({"up": up}, {"up": [up]}, {"up": (up,), "transitions": ()}):
        with pytest.raises(hm.DeclarationError, match=r"^Wrong\.up is a Jump that is not in transitions.*= \(up,\)"):
            ball_with(**body)()
    assert [info.name for info in ball_with(up=up, transitions=(up,))().jumps] == ["jump", "up"]


@pytest.mark.parametrize("wrap", [lambda jump: jump, lambda jump: [jump], lambda jump: (jump,)])
def test_one_jump_without_a_tuple_is_a_list_of_one(wrap):
    up = hm.Jump("up", lambda self, s: s.t - 0.25 - s.h, lambda self, s: {"h": 5.0})
    assert [info.name for info in ball_with(transitions=wrap(up))().jumps] == ["jump", "up"]


@pytest.mark.parametrize("listed", ["up", ["up"], [lambda self, s: 1.0], {"up": 1.0}, None])
def test_what_is_no_jump_in_the_list_of_jumps(listed):
    with pytest.raises(hm.DeclarationError, match=r"^Wrong\.transitions holds .*: write transitions = \(hm\.Jump"):
        ball_with(transitions=listed)()


@pytest.mark.parametrize("modes", ["on", ("on", "off"), {"on": None}])
def test_what_is_no_mode_in_the_list_of_modes(modes):
    with pytest.raises(
        hm.DeclarationError, match=r"^Wrong\.modes holds .*, but lists hm\.Mode: write modes = \(hm\.Mode"
    ):
        type("Wrong", (hm.ModalAutomaton,), {"modes": modes})()


def test_declared_outputs_and_computed_starts_need_their_map():
    with pytest.raises(
        hm.DeclarationError, match=r"^Wrong declares the outputs y, but no map .* write def outputs\(self"
    ):
        ball_with(y=hm.Output())()
    with pytest.raises(hm.DeclarationError, match=r"^Wrong declares n as computed, but no map .* def start_map\(self"):
        ball_with(n=hm.DiscreteState(computed=True))()


# Declarations.


@pytest.mark.parametrize(
    ("declare", "sentence"),
    [
        (lambda: hm.State(1.0, units="m"), r"^hm\.State has no option 'units': write 'unit'\.$"),
        (lambda: hm.State(1.0, min=0.0), r"^hm\.State has no option 'min'[:;] .*"),
        (lambda: hm.State(1.0, integer=True), r"^hm\.State has no option 'integer'; it has start, output, computed"),
        (lambda: hm.Output(0.0), r"^hm\.Output takes 0 values by position, but \(0\.0,\) was given: name the others"),
        (lambda: hm.State(1.0, "m"), r"^hm\.State takes 1 value by position, but \(1\.0, 'm'\) was given"),
        (lambda: hm.Parameter(), r"^hm\.Parameter needs start: write hm\.Parameter\(start\)"),
        (lambda: hm.State([1.0, 2.0], shape=3), r"^shape = \(3,\) does not fit the start value \[1\.0, 2\.0\]"),
        (lambda: hm.State(0.0, shape=2.5), r"^shape = \(2\.5,\) does not fit"),
        (lambda: hm.State(0.0, shape=("n", 2)), r"^shape = \('n', 2\) mixes names and lengths"),
    ],
)
def test_options_of_a_declaration(declare, sentence):
    with pytest.raises(hm.DeclarationError, match=sentence):
        declare()


@pytest.mark.parametrize(
    ("declaration", "sentence"),
    [
        (hm.State(0.0, minimum="0"), r"^Wrong\.w has the minimum '0': give a number, or leave it out"),
        (hm.State("1"), r"^Wrong\.w = '1' is not a number"),
        (hm.State(None), r"^Wrong\.w = None is not a number"),
        (hm.State(1j), r"^Wrong\.w = 1j, a complex number is not a number"),
        (hm.Parameter(10**400), r"^Wrong\.w = 10{79}\.\.\. is too large: numbers end at 1\.8e308"),
        (hm.Parameter(10**5000), r"^Wrong\.w = a whole number beyond 80 digits is too large"),
    ],
)
def test_values_of_a_declaration(declaration, sentence):
    with pytest.raises(hm.DeclarationError, match=sentence):
        ball_with(w=declaration)()


@pytest.mark.parametrize(("shape", "wanted"), [(2, (2,)), ((2,), (2,)), ((3, 2), (3, 2))])
def test_a_shape_in_numbers(shape, wanted):
    class Decay(hm.HybridAutomaton):
        x = hm.State([1.0, 2.0], shape=shape)

        def flow_map(self, s):
            return {"x": -s.x}

    end = run(Decay()).end.x
    # x' = -x for 1 s; 1e-12 covers the tolerances of the run.
    np.testing.assert_allclose(end, np.broadcast_to([math.exp(-1.0), 2.0 * math.exp(-1.0)], wanted), atol=1e-12)


def test_declarations_can_be_copied_and_pickled():
    for one in (hm.Parameter(2.0, unit="m"), hm.Mode("rest"), hm.Signal(abs, [1.0]), hm.Clock("tick")):
        for other in (copy.copy(one), copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
            assert type(other) is type(one)
            assert vars(other) == vars(one)


# Instances.


def test_values_are_given_when_an_instance_is_made():
    ball = BouncingBall()
    with pytest.raises(
        hm.DeclarationError, match=r"^BouncingBall\.e is one of the parameters.*BouncingBall\(e=0\.5\)\.$"
    ):
        ball.e = 0.5
    with pytest.raises(
        hm.DeclarationError, match=r"BouncingBall\(h=2\.0\), and return {'h': \.\.\.} from a jump map\.$"
    ):
        ball.h = 2.0
    with pytest.raises(hm.DeclarationError, match=r"write s\.e in a map, and arc\['e'\] for a run"):
        _ = ball.e
    with pytest.raises(
        hm.DeclarationError, match="jump_set is read from the class, so it cannot be set on an instance"
    ):
        ball.jump_set = lambda self, s: s.h
    ball.colour = "red"
    assert ball.colour == "red"


@pytest.mark.parametrize("use", ["flow_map", "jump_map"])
def test_a_declaration_used_in_a_map_as_an_attribute_of_the_instance(use):
    wrong = ball_with(**{use: lambda self, s: {"h": 0.0, "v": -self.g}})
    with pytest.raises(hm.DeclarationError, match=r"Wrong\.g is one of the parameters.*write s\.g in a map"):
        run(wrong())
    with pytest.raises(hm.DeclarationError, match=r"write s\.g in a map"):
        trace(wrong())


@pytest.mark.parametrize("given", [2.0, {"h": 2.0}, BouncingBall])
def test_a_value_in_the_place_of_the_name(given):
    with pytest.raises(hm.DeclarationError, match=r"^BouncingBall was given .* as the name .*: give values by name"):
        BouncingBall(given)


# Maps.


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ({"flow_map": lambda self: {}}, r"^flow_map of Wrong takes \(self\), but is called with \(self, s\)"),
        (
            {"flow_map": lambda self, t, s: {}},
            r"^flow_map of Wrong takes \(self, t, s\), but is called with \(self, s\)",
        ),
        ({"jump_set": staticmethod(lambda s: -s.h)}, r"^jump_set of Wrong takes \(s\), but is called with \(self, s\)"),
        ({"flow_map": {"h": 0.0}}, r"^flow_map of Wrong is {'h': 0\.0}, but must be a function: write lambda self, s"),
        ({"jump_set": lambda self, s: [-s.h]}, r"the jump set of 'jump' of Wrong has shape \(1,\): return a margin"),
        ({"jump_set": lambda self, s: "x"}, r"the jump set of 'jump' of Wrong is 'x': return a margin"),
        ({"jump_set": lambda self, s: -s.h + 0j}, r"the jump set .* a complex number: return a margin"),
        ({"jump_set": lambda self, s: lambda: 1.0}, r"the jump set of 'jump' of Wrong is <function"),
        ({"flow_map": lambda self, s: {"h": "1", "v": -s.g}}, r"the value computed for h is '1': return one number"),
        ({"flow_map": lambda self, s: {"h": None, "v": -s.g}}, r"the value computed for h is None: return one number"),
        (
            {"flow_map": lambda self, s: {"h": s.v + 0j, "v": -s.g}},
            r"computed for h is .*, a complex number: return one",
        ),
        ({"flow_map": lambda self, s: {"h": np.array(1j), "v": -s.g}}, r"computed for h is .*, a complex number"),
        ({"flow_map": lambda self, s: {"h": 10**400, "v": -s.g}}, r"computed for h is 10+\.\.\.: return one number"),
    ],
)
def test_what_a_map_takes_and_returns(body, sentence):
    with pytest.raises(hm.DeclarationError, match=sentence):
        run(ball_with(**body)())


def test_real_numbers_of_every_type_are_rates():
    for one in (
        1,
        True,
        np.True_,
        np.float32(1.0),
        np.int8(1),
        Fraction(1, 1),
        np.array(1.0),
        np.array([1], dtype=object)[0],
    ):

        class Clock(hm.HybridAutomaton):
            x = hm.State(0.0)

            def flow_map(self, s, one=one):
                return {"x": one}

        assert run(Clock()).end.x == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("time", ["now", None, [1.0], 1j])
def test_the_time_of_a_time_event_is_a_number(time):
    class Tick(hm.HybridAutomaton):
        n = hm.DiscreteState(0.0)
        transitions = (hm.TimeEvent("tick", lambda self, s: time, lambda self, s: {"n": s.n + 1.0}),)

    with pytest.raises(
        hm.DeclarationError, match=r"^the time of 'tick' of Tick (is|has) .*return a time in s, or np\.inf"
    ):
        run(Tick())


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda f: hm.Jump("up", f, {"h": 1.0}), r"^jump_map of Jump 'up' is {'h': 1\.0}, but must be a function"),
        (lambda f: hm.Jump(f, f, f), r"^Jump has the name <function .*: give a text first, hm\.Jump\('name', "),
        (
            lambda f: hm.Jump("up", lambda s: 1.0, f),
            r"^jump_set of Jump 'up' takes \(s\), but is called with \(self, s\)",
        ),
        (lambda f: hm.TimeEvent("tick", 0.5, f), r"^time of TimeEvent 'tick' is 0\.5, but must be a function"),
        (lambda f: hm.Mode("on", {"x": 1.0}), r"^flow_map of Mode 'on' is {'x': 1\.0}, but must be a function"),
        (lambda f: hm.Switch("go", "on", "off", True), r"^guard of Switch 'go' is True, but must be a function"),
        (lambda f: hm.TimedSwitch("go", "on", "off", f, 1.0), r"^reset of TimedSwitch 'go' is 1\.0, but must be"),
    ],
)
def test_transitions_and_modes_take_functions(make, sentence):
    with pytest.raises(hm.DeclarationError, match=sentence):
        make(lambda self, s: 1.0)


def set_attribute(self, s):
    s.h = 1.0
    return {}


def set_item(self, s):
    s["h"] = 1.0
    return {}


@pytest.mark.parametrize("jump_map", [set_attribute, set_item])
def test_values_cannot_be_set_in_a_map(jump_map):
    with pytest.raises(hm.DeclarationError, match=r"^Wrong: h cannot be set on the values: return .* as {'h': \.\.\.}"):
        run(ball_with(jump_map=jump_map)())


@pytest.mark.parametrize("where", ["flow_map", "jump_map"])
def test_an_array_cannot_be_changed_in_place(where):
    def write(self, s):
        s.x[0] = 5.0
        return {"x": s.x}

    class Pair(hm.HybridAutomaton):
        x = hm.State([1.0, 2.0])

        def flow_map(self, s):
            return {"x": -s.x}

        def jump_set(self, s):
            return s.t - 0.5 - 10.0 * (s.x[0] > 3.0)

        def jump_map(self, s):
            return {"x": s.x}

    wrong = type("Wrong", (Pair,), {where: write})
    with pytest.raises(hm.DeclarationError, match=r"of Wrong writes into a value that it was given: work on a copy"):
        run(wrong())
    with pytest.raises(hm.DeclarationError, match=r"of Wrong writes into a value that it was given: work on a copy"):
        trace(wrong())
    t = [0.0, 0.5, 0.5]
    x = np.array([[1.0, 2.0], [4.0, 2.0], [4.0, 2.0]])
    before = x.copy()
    with pytest.raises(hm.DeclarationError, match=r"of Wrong writes into a value that it was given: work on a copy"):
        hm.verify(wrong(), hm.Samples(t, [0, 0, 1], {"x": x}))
    np.testing.assert_array_equal(x, before)


# What a run gives back.


def test_values_show_themselves():
    assert repr(run(BouncingBall(), 0.0).end) == "BouncingBall: t = 0.0, h = 1.0, v = 0.0, g = 9.81, e = 0.7"
    loop = hm.product("pair", BouncingBall("a"), BouncingBall("b"))
    assert repr(run(loop, 0.0).end).startswith("pair: t = 0.0, a.h = 1.0, a.v = 0.0, b.h = 1.0")


class Heating(hm.ModalAutomaton):
    """Modes and switches whose functions have no name that pickle could find."""

    temperature = hm.State(20.0)
    modes = (
        hm.Mode("on", lambda self, s: {"temperature": 1.0}),
        hm.Mode("off", lambda self, s: {"temperature": -1.0}),
    )
    switches = (
        hm.Switch("too hot", "on", "off", lambda self, s: s.temperature - 20.5),
        hm.Switch("too cold", "off", "on", lambda self, s: 19.0 - s.temperature),
    )


class Counter(hm.HybridAutomaton):
    """A jump whose functions have no name."""

    n = hm.DiscreteState(0.0)
    transitions = (hm.TimeEvent("tick", lambda self, s: 0.5 * s.n, lambda self, s: {"n": s.n + 1.0}),)


@pytest.mark.parametrize(
    "make",
    [
        Heating,
        Counter,
        BouncingBall,
        lambda: hm.Composition("both", {"a": Heating(), "b": Counter()}),
        lambda: hm.MinimumDwell(Heating(), 0.1),
        lambda: state_space([[-1.0]], [[1.0]], [[2.0]], [[3.0]], inputs=["u"], outputs=["y"], start=1.0),
        lambda: state_space(
            [[0.5]], [[1.0]], [[2.0]], inputs=["u"], outputs=["y"], period=0.25, name="clocked", start=1.0
        ),
    ],
)
@pytest.mark.parametrize("again", [lambda x: pickle.loads(pickle.dumps(x)), copy.copy, copy.deepcopy])
def test_automata_and_their_arcs_can_be_pickled_and_copied(make, again):
    arc = run(make(), 1.2)
    other = again(arc)
    np.testing.assert_array_equal(other.t, arc.t)
    assert repr(other.end) == repr(arc.end)
    repeated = run(again(make()), 1.2)
    assert repr(repeated.end) == repr(arc.end)
    assert [jump.t for jump in repeated.jumps] == [jump.t for jump in arc.jumps]


# Other slips of a first day.


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ({"w": hm.State}, r"^Wrong\.w is the class State: write w = hm\.State\(\.\.\.\)\.$"),
        (
            {"priority": "flow"},
            r"^Wrong\.priority is 'flow': write hm\.Priority\.JUMP \(the default\) or hm\.Priority\.FLOW",
        ),
    ],
)
def test_what_would_be_ignored_in_a_class(body, sentence):
    with pytest.raises(hm.DeclarationError, match=sentence):
        ball_with(**body)()


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: hm.State(0.0, unit=5), r"^unit = 5 is no text: write unit='5'\.$"),
        (lambda: hm.State(0.0, description=None), r"^description = None is no text"),
        (lambda: hm.State(0.0, output="yes"), r"^output = 'yes' is not yes or no: write output=True or output=False"),
        (lambda: hm.Clock(), r"^hm\.Clock needs jump: write hm\.Clock\(jump, description\)\.$"),
        (lambda: hm.Jump("up", len), r"^hm\.Jump needs jump_map: write hm\.Jump\(name, jump_set, jump_map\)\.$"),
        (
            lambda: hm.Jump("up", guard=1, reset=2),
            r"^hm\.Jump has no option 'guard'; it has name, jump_set, jump_map\.$",
        ),
        (lambda: hm.Mode("on", flow=len), r"^hm\.Mode has no option 'flow': write 'flow_map'\.$"),
        (
            lambda: hm.Switch("go", "on", "off"),
            r"^hm\.Switch needs guard: write hm\.Switch\(name, source, target, guard, ",
        ),
        (lambda: hm.Signal(len, breakpoint=[1.0]), r"^hm\.Signal has no option 'breakpoint': write 'breakpoints'\.$"),
        (lambda: hm.Solver(rtol="1e-6"), r"^solver option rtol = '1e-6': give a number\.$"),
        (lambda: hm.Solver(max_step=None), r"^solver option max_step = None: give a number\.$"),
        (lambda: hm.Solver(tol=1e-6), r"^hm\.Solver has no option 'tol': write 'rtol'\.$"),
        (lambda: hm.Tolerances(rtol="1"), r"^tolerance rtol = '1': give a positive number\.$"),
        (lambda: hm.Tolerances(tol=1e-6), r"^hm\.Tolerances has no option 'tol'"),
        (lambda: hm.least(), r"^no margin is given to least or greatest: write least\(first, second\)"),
        (lambda: hm.Samples([0.0], [0], [1.0]), r"^the values are \[1\.0\]: give a mapping, {'variable': its values}"),
        (lambda: hm.Samples([0.0], [0], {"h": [None]}), r"^h does not hold numbers only"),
        (
            lambda: hm.verify(BouncingBall(), "run.csv"),
            r"^run\.csv is the name of a file: write hm\.Samples\.from_csv\('run",
        ),
    ],
)
def test_constructors_and_functions_given_something_else(make, sentence):
    with pytest.raises(hm.HybridModelError, match=sentence):
        make()


@pytest.mark.parametrize(
    ("use", "sentence"),
    [
        (lambda arc: arc.h, r"^a run has no attribute 'h': write arc\['h'\] for the samples of h\.$"),
        (lambda arc: arc["h[1]"], r"^BouncingBall has no h\[1\]: h is a scalar\.$"),
        (lambda arc: arc.at("h", "soon"), r"^the times are 'soon': give numbers in s\.$"),
        (lambda arc: arc.resample(None), r"^the times are None: give numbers in s\.$"),
        (lambda arc: arc.restrict(t=1.0), r"^the interval t = 1\.0 has no two ends: write t=\(first, last\)\.$"),
        (lambda arc: arc.restrict(j=(1, 2, 3)), r"^the interval j = \(1, 2, 3\) has no two ends"),
    ],
)
def test_a_run_asked_for_something_else(use, sentence):
    with pytest.raises(hm.DeclarationError, match=sentence):
        use(run(BouncingBall()))


def test_other_attributes_of_a_run_are_missing_as_python_says():
    arc = run(BouncingBall())
    assert not hasattr(arc, "colour")
    with pytest.raises(AttributeError, match=r"^'HybridArc' object has no attribute 'colour'$"):
        _ = arc.colour


@pytest.mark.parametrize(
    ("given", "named", "sentence"),
    [
        ((BouncingBall, "ball.fmu"), {}, r"^export_fmu was given the class BouncingBall, but takes an instance"),
        (("ball.fmu", BouncingBall()), {}, r"^export_fmu was given 'ball\.fmu', but takes an automaton"),
        ((BouncingBall(), None), {}, r"^The path None is no name of a file: give one, such as 'BouncingBall\.fmu'\.$"),
        (
            (BouncingBall(), "ball.fmu"),
            {"version": "3.0"},
            r"^export_fmu has no option 'version'; it has fmi, kinds, plat",
        ),
        (
            (BouncingBall(), "ball.fmu"),
            {"stop_time": "2"},
            r"^The stop time '2' s cannot be proposed: give a finite number",
        ),
        ((BouncingBall(), "ball.fmu"), {"fmi": 3.0}, r"^FMI version 3\.0 is not one that can be exported"),
        ((BouncingBall(),), {}, r"^export_fmu needs path: write export_fmu\(automaton, path\)\.$"),
    ],
)
def test_an_export_of_something_else(given, named, sentence):
    with pytest.raises((hm.DeclarationError, ExportError), match=sentence):
        export_fmu(*given, **named)
