"""Declarations: what may be declared, what an instance may be given, and the sentence for each mistake."""

import ctypes
import math

import fmpy
import fmpy.fmi2
import fmpy.fmi3
import numpy as np
import pytest

import hybrid_model as hm
from fmu.export import export_fmu
from hybrid_model.declare.variables import Kind, element_names
from hybrid_model.errors import DeclarationError, TraceError
from hybrid_model.models import BouncingBall
from hybrid_model.native.trace import trace


class Block(hm.HybridAutomaton):
    n = hm.Dimension("length")
    m = hm.Dimension()
    x = hm.State(1.0, shape="n", unit="m", description="a vector")
    a = hm.Parameter(0.0, shape=("m", "n"))
    mode = hm.DiscreteState(0, integer=True, output=True)
    u = hm.Input(0.0, shape="n", discrete=True)
    y = hm.Output(shape="m", unit="N")

    def flow_map(self, s):
        return {"x": s.u}

    def outputs(self, s):
        return {"y": s.a @ s.x}


def run(automaton, **options):
    return hm.simulate(automaton, 1.0, **options)


# What is right.


def test_variables_keep_order_kind_unit_and_shape():
    block = Block(n=3, m=2)
    assert [(v.name, v.kind, v.shape) for v in block.variables] == [
        ("x", Kind.STATE, (3,)),
        ("a", Kind.PARAMETER, (2, 3)),
        ("mode", Kind.DISCRETE, ()),
        ("u", Kind.INPUT, (3,)),
        ("y", Kind.OUTPUT, (2,)),
    ]
    assert (block.variables[0].unit, block.variables[0].description) == ("m", "a vector")
    np.testing.assert_array_equal(block.variables[0].start, [1.0, 1.0, 1.0])
    assert (block.variables[1].size, block.variables[2].integer, block.variables[3].discrete) == (6, True, True)


def test_lengths_come_from_the_vectors_given():
    block = Block(a=[[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    assert block.variables[0].shape == (2,)
    assert run(block).end.x == pytest.approx([1.0, 1.0])
    arc = run(block, inputs={"u": [1.0, -1.0]})
    assert arc.at("y", 1.0) == pytest.approx([2.0, 6.0, 10.0], abs=1e-12)


def test_a_scalar_stands_for_every_element():
    np.testing.assert_array_equal(Block(n=2, m=1, x=7.0).variables[0].start, [7.0, 7.0])


def test_length_zero_is_a_length():
    assert run(Block(n=0, m=0)).end.x.shape == (0,)


def test_element_names_count_from_one_row_by_row():
    block = Block(n=2, m=2)
    assert element_names(block.variables[1]) == ["a[1,1]", "a[1,2]", "a[2,1]", "a[2,2]"]
    assert element_names(block.variables[0]) == ["x[1]", "x[2]"]
    assert element_names(block.variables[2]) == ["mode"]


def test_subclasses_inherit_declarations_first_and_may_change_start_values():
    class Moon(BouncingBall):
        g = hm.Parameter(1.62)
        dust = hm.Parameter(0.1)

    names = [v.name for v in Moon().variables]
    assert names == [*(v.name for v in BouncingBall().variables), "dust"]
    assert next(v for v in Moon().variables if v.name == "g").start == 1.62


def test_instances_are_independent_and_named():
    one, two = BouncingBall("one", h=2.0), BouncingBall()
    assert (one.name, two.name) == ("one", "BouncingBall")
    assert (float(one.variables[0].start), float(two.variables[0].start)) == (2.0, 1.0)


def test_the_given_array_is_copied():
    given = np.array([1.0, 2.0])
    block = Block(m=1, x=given)
    given[0] = 99.0
    assert block.variables[0].start[0] == 1.0


# Instances.


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"mass": 1.0}, r"BouncingBall has nothing named 'mass' to set; it has h, v, g, e\."),
        (
            {"h": [1.0, 2.0]},
            r"BouncingBall\.h has shape \(\), but the value given has shape \(2,\): give one number\.$",
        ),
        ({"h": math.nan}, r"BouncingBall\.h = nan is not finite: start values and parameters must be finite"),
        ({"e": "bouncy"}, r"BouncingBall\.e = 'bouncy' is not a number"),
        ({"h": None}, r"BouncingBall\.h = None is not"),
        ({"g": [[1.0], [1.0, 2.0]]}, r"BouncingBall\.g = .* is not a number or an array of numbers"),
    ],
)
def test_values_of_an_instance(values, sentence):
    with pytest.raises(hm.DeclarationError, match=sentence):
        BouncingBall(**values)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({}, r"Block needs the length 'n': give n=\.\.\., a whole number"),
        ({"n": 2}, r"Block needs the length 'm'"),
        ({"m": 1, "x": [1.0, 2.0], "u": [1.0]}, r"Block has one length 'n', but x says 2, u says 1: make them equal"),
        ({"n": 3, "m": 1, "x": [1.0, 2.0]}, r"one length 'n', but n says 3, x says 2"),
        ({"n": 2, "m": 1, "a": [1.0, 2.0]}, r"Block\.a has shape \(1, 2\), but the value given has shape \(2,\)"),
        ({"n": 2, "m": 1, "mode": 0.5}, r"Block\.mode holds whole numbers, but its start value is 0\.5: round it"),
        ({"n": 2.5, "m": 1}, r"Block: the length n = 2\.5 .* whole number"),
        ({"n": -1, "m": 1}, r"Block: the length n = -1 .* whole number"),
        ({"n": math.nan, "m": 1}, r"Block: the length n = nan .* whole number"),
        ({"n": "two", "m": 1}, r"Block: the length n = 'two' .* whole number"),
    ],
)
def test_lengths_and_shapes_of_an_instance(values, sentence):
    with pytest.raises(hm.DeclarationError, match=sentence):
        Block(**values)


def test_a_whole_number_of_any_type_is_a_length():
    for two in (2, 2.0, np.int64(2), np.array(2)):
        assert Block(n=two, m=1).variables[0].shape == (2,)


# Classes.


@pytest.mark.parametrize(
    "name", ["t", "name", "variables", "jumps", "clocks", "priority", "flow_map", "outputs", "jump_set", "jump_map"]
)
@pytest.mark.parametrize("declaration", [hm.State(), hm.Parameter(1.0), hm.Dimension()])
def test_names_of_the_framework_are_refused(name, declaration):
    wrong = type("Wrong", (hm.HybridAutomaton,), {name: declaration})
    with pytest.raises(hm.DeclarationError, match=rf"Wrong declares '{name}', a name of the framework: choose another"):
        wrong()


def test_a_clock_may_not_take_a_name_of_the_framework_either():
    wrong = type("Wrong", (BouncingBall,), {"t": hm.Clock("jump")})
    with pytest.raises(hm.DeclarationError, match="'t', a name of the framework"):
        wrong()


def test_a_shape_must_name_a_dimension():
    class Wrong(hm.HybridAutomaton):
        count = hm.Dimension()
        x = hm.Input(0.0, shape="cuont")

    with pytest.raises(hm.DeclarationError, match=r"Wrong\.x has the shape .*'cuont'.*count"):
        Wrong(count=2)


@pytest.mark.parametrize("written", ["jump_set", "jump_map"])
def test_jump_set_and_jump_map_go_together(written):
    wrong = type("Wrong", (hm.HybridAutomaton,), {written: lambda self, s: 0.0})
    with pytest.raises(hm.DeclarationError, match="Wrong has one of jump_set and jump_map: write both, or neither"):
        wrong()


def test_two_transitions_of_one_name():
    class Wrong(BouncingBall):
        transitions = (hm.Jump("jump", lambda self, s: -1.0, lambda self, s: {}),)

    with pytest.raises(hm.DeclarationError, match=r"Wrong has two transitions of one name among \['jump', 'jump'\]"):
        Wrong()


def test_a_clock_of_an_unknown_jump():
    class Wrong(BouncingBall):
        bell = hm.Clock("impact")

    with pytest.raises(
        hm.DeclarationError, match=r"Wrong\.bell ticks with jump 'impact', but the jumps are \['jump'\]"
    ):
        Wrong()


# Maps.


def ball_with(**maps):
    return type("Wrong", (BouncingBall,), maps)()


@pytest.mark.parametrize(
    ("maps", "sentence"),
    [
        ({"flow_map": lambda self, s: {"h": s.v}}, r"flow_map of Wrong must also give \['v'\]"),
        (
            {"flow_map": lambda self, s: {"h": s.v, "v": -s.g, "w": 0.0}},
            r"flow_map of Wrong sets \['w'\], but may set only \['h', 'v'\]",
        ),
        ({"flow_map": lambda self, s: {"h": s.v, "v": -s.g, "g": 0.0}}, r"flow_map of Wrong sets \['g'\]"),
        ({"flow_map": lambda self, s: None}, r"flow_map of Wrong returned None: return a dictionary, name -> value"),
        ({"flow_map": lambda self, s: [s.v, -s.g]}, r"flow_map of Wrong returned \["),
        ({"flow_map": lambda self, s: {"h": s.vv, "v": -s.g}}, r"Wrong has no variable 'vv'; it has t, h, v, g, e\."),
        (
            {"flow_map": lambda self, s: {"h": [s.v, 1.0], "v": -s.g}},
            r"Wrong: the value computed for h has shape \(2,\), but h has shape \(\): return one number\.",
        ),
        ({"flow_map": lambda self, s: {"h": np.array([s.v]), "v": -s.g}}, r"has shape \(1,\), but h has shape \(\)"),
        ({"flow_map": lambda self, s: {"h": "fast", "v": -s.g}}, r"computed for h is 'fast': return one number\."),
        ({"jump_set": lambda self, s: s.h <= 0.0}, r"the jump set of 'jump' of Wrong is a boolean: return a margin"),
        ({"jump_set": lambda self, s: True}, r"the jump set of 'jump' of Wrong is a boolean"),
        ({"jump_set": lambda self, s: np.bool_(True)}, r"is a boolean"),
        ({"jump_set": lambda self, s: None}, r"the jump set of 'jump' of Wrong is None: return a margin"),
        ({"jump_set": lambda self, s: np.array([s.h, s.v])}, r"the jump set of 'jump' of Wrong .*shape \(2,\).*scalar"),
        ({"flow_set": lambda self, s: s.h >= 0.0}, r"flow_set of Wrong is a boolean: .* least for 'and'"),
        ({"flow_set": lambda self, s: None}, r"flow_set of Wrong is None"),
        ({"flow_set": lambda self, s: np.array([s.h])}, r"flow_set of Wrong .*shape \(1,\)"),
        (
            {"jump_set": lambda self, s: 0.0, "jump_map": lambda self, s: None},
            r"jump map of 'jump' of Wrong returned None",
        ),
        (
            {"jump_set": lambda self, s: 0.0, "jump_map": lambda self, s: {"g": 1.0}},
            r"the jump map of 'jump' of Wrong sets \['g'\], but may set only \['h', 'v'\]",
        ),
    ],
)
def test_maps_that_return_something_else(maps, sentence):
    with pytest.raises(hm.DeclarationError, match=sentence):
        run(ball_with(**maps))


class Matrix(hm.HybridAutomaton):
    """A matrix that follows what a function makes of it, and is set by another at t = 0.5."""

    m = hm.State([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    done = hm.DiscreteState(0)

    def __init__(self, rate, reset, **values):
        self._rate, self._reset = rate, reset
        super().__init__(**values)

    def flow_map(self, s):
        return {"m": self._rate(s.m)}

    def jump_set(self, s):
        return s.t - 0.5 - s.done

    def jump_map(self, s):
        return {"m": self._reset(s.m), "done": 1.0}


SHAPES = {
    "transposed": (lambda m: m.T, r"\(3, 2\)"),
    "flattened": (np.ravel, r"\(6,\)"),
    "one row": (lambda m: m[0], r"\(3,\)"),
    "a longer shape": (lambda m: m.reshape(1, 2, 3), r"\(1, 2, 3\)"),
    "one element": (lambda m: m[:1, :1], r"\(1, 1\)"),
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("where", ["flow map", "jump map"])
def test_a_matrix_of_another_shape_is_refused_in_floats_and_in_symbols(name, where):
    wrong, shape = SHAPES[name]
    block = Matrix(wrong, np.negative) if where == "flow map" else Matrix(np.negative, wrong)
    sentence = rf"Matrix: the value computed for m has shape {shape}, but m has shape \(2, 3\): return an array of"
    with pytest.raises(hm.DeclarationError, match=sentence):
        run(block)
    with pytest.raises(TraceError, match=sentence):
        trace(block)


def test_a_matrix_of_its_shape_and_one_number_for_all_elements_are_taken():
    start = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    # m' = -m up to 0.5, then 7, then e^(-1/2) of it; 1e-12: the tolerances of the run.
    for seven in (7.0, 7, np.float64(7.0), np.array(7.0), np.full((2, 3), 7.0), [[7.0] * 3] * 2):
        block = Matrix(np.negative, lambda m, seven=seven: seven)
        arc = run(block)
        np.testing.assert_allclose(arc.end.m, np.full((2, 3), 7.0 * np.exp(-0.5)), atol=1e-12)
        np.testing.assert_allclose(arc.at("m", 0.25), start * np.exp(-0.25), atol=1e-12)
        reset = trace(block).resets[0](0.5, np.arange(6.0), 0.0, [], [])[0]
        np.testing.assert_array_equal(np.ravel(reset), np.full(6, 7.0))


@pytest.mark.parametrize("name", SHAPES)
def test_the_verifier_refuses_another_shape_too(name):
    wrong, shape = SHAPES[name]
    arc = run(Matrix(np.negative, np.negative))
    with pytest.raises(hm.DeclarationError, match=rf"m has shape {shape}, but m has shape \(2, 3\)"):
        hm.verify(Matrix(wrong, np.negative), arc)


def test_outputs_must_all_be_given():
    class Silent(Block):
        def outputs(self, s):
            return {}

    with pytest.raises(hm.DeclarationError, match=r"outputs of Silent must also give \['y'\]"):
        run(Silent(n=1, m=1)).at("y", 0.0)


def test_computed_start_values_must_all_be_given_and_no_others():
    class Computed(BouncingBall):
        apex = hm.DiscreteState(computed=True)

        def start_map(self, s):
            return {}

    with pytest.raises(hm.DeclarationError, match=r"start_map of Computed must also give \['apex'\]"):
        run(Computed())
    wrong = type("Computed", (Computed,), {"start_map": lambda self, s: {"apex": s.h, "h": 3.0}})
    with pytest.raises(hm.DeclarationError, match=r"start_map of Computed sets \['h'\]"):
        run(wrong())


def test_computed_start_values_see_parameters_and_inputs():
    class Computed(hm.HybridAutomaton):
        u = hm.Input(2.0)
        k = hm.Parameter(3.0)
        x = hm.State(computed=True)

        def start_map(self, s):
            return {"x": s.u * s.k + s.t}

        def flow_map(self, s):
            return {"x": 0.0}

    assert hm.simulate(Computed(), 6.0, t_start=5.0, inputs={"u": 4.0}).end.x == 17.0


def test_a_value_asked_for_by_a_wrong_name_says_which_there_are():
    values = run(BouncingBall()).end
    with pytest.raises(hm.DeclarationError, match=r"BouncingBall has no variable 'height'; it has t, h, v, g, e\."):
        _ = values.height
    with pytest.raises(hm.DeclarationError, match="'height'"):
        values["height"]
    assert not hasattr(values, "height")
    assert values.h == values["h"]


def test_errors_are_of_one_family():
    for kind in (hm.DeclarationError, hm.WiringError, hm.AlgebraicLoopError, hm.SimulationError):
        assert issubclass(kind, hm.HybridModelError)


class Follower(hm.HybridAutomaton):
    """Starts where its input is; counts in steps of `step`."""

    u = hm.Input(1.0, discrete=True)
    held = hm.DiscreteState(computed=True)
    count = hm.DiscreteState(0, integer=True)
    step = hm.Parameter(1.0)

    def start_map(self, s):
        return {"held": s.u}

    def jump_set(self, s):
        return abs(s.u - s.held) - 0.5

    def jump_map(self, s):
        return {"held": s.u, "count": s.count + s.step}


def test_a_value_for_a_computed_state_is_refused():
    with pytest.raises(hm.DeclarationError, match=r"held is computed by start_map.*cannot be given"):
        Follower(held=2.0)


def test_a_jump_that_gives_an_integer_state_a_fraction_is_refused():
    steps = hm.Signal(lambda t: 1.0 + (t >= 1.0), [1.0])
    with pytest.raises(hm.SimulationError, match=r"count = 0\.5 after jump 'jump' at t = 1 s.*whole"):
        hm.simulate(Follower(step=0.5), 2.0, inputs={"u": steps})


def test_a_plain_function_on_a_discrete_input_is_refused():
    with pytest.raises(hm.DeclarationError, match=r"input u changes at jumps only.*Signal"):
        hm.simulate(Follower(), 2.0, inputs={"u": lambda t: t})


class Ranged(hm.HybridAutomaton):
    n = hm.Dimension()
    share = hm.Parameter(0.5, minimum=0.0, maximum=1.0)
    level = hm.State(2.0, shape="n", minimum=0.0, nominal=10.0)
    peak = hm.State(computed=True, minimum=1.0)
    total = hm.Output(minimum=5.0)

    def flow_map(self, s):
        return {"level": -s.share * s.level, "peak": 0.0}

    def start_map(self, s):
        return {"peak": np.max(s.level) + 1.0}

    def outputs(self, s):
        return {"total": np.sum(s.level)}


def test_a_range_holds_the_values_that_are_given():
    block = Ranged(n=2, share=1.0, level=[0.0, 3.0])
    share, level = block.variables[:2]
    assert (share.minimum, share.maximum, share.nominal) == (0.0, 1.0, None)
    assert (level.minimum, level.maximum, level.nominal) == (0.0, None, 10.0)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"share": 1.5}, r"Ranged.share = 1.5 lies outside its range from 0 to 1: give a value within it\."),
        ({"level": [1.0, -2.0]}, r"Ranged.level = -2 lies outside its range from 0 to inf: give a value within it\."),
    ],
)
def test_values_outside_a_range_are_refused(values, sentence):
    with pytest.raises(DeclarationError, match=f"^{sentence}$"):
        Ranged(n=2, **values)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"minimum": 2.0, "maximum": 1.0}, "from minimum 2 to maximum 1: exchange them"),
        ({"minimum": math.nan}, "from minimum nan to maximum inf: exchange them"),
        ({"nominal": 0.0}, "the nominal value 0: give a finite size above zero"),
        ({"nominal": math.inf}, "the nominal value inf: give a finite size above zero"),
    ],
)
def test_ranges_and_sizes_that_cannot_be_are_refused(options, sentence):
    wrong = type("Wrong", (hm.HybridAutomaton,), {"a": hm.Parameter(1.5, **options)})
    with pytest.raises(DeclarationError, match=sentence):
        wrong()


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_ranges_and_sizes_reach_the_importer(fmi, tmp_path):
    path = export_fmu(Ranged(n=2), tmp_path / "ranged.fmu", fmi=fmi)
    variables = {v.name: v for v in fmpy.read_model_description(str(path)).modelVariables}
    level = variables["level" if fmi == "3.0" else "level[2]"]
    assert (float(level.min), level.max, float(level.nominal)) == (0.0, None, 10.0)
    assert (float(variables["share"].min), float(variables["share"].max)) == (0.0, 1.0)
    assert variables["der(peak)"].min is None
    kind = fmpy.fmi2.FMU2Model if fmi == "2.0" else fmpy.fmi3.FMU3Model
    description = fmpy.read_model_description(str(path))
    folder = fmpy.extract(str(path), str(tmp_path / "ranged"))
    fmu = kind(
        guid=description.guid or description.instantiationToken,
        unzipDirectory=folder,
        modelIdentifier="Ranged",
        instanceName="ranged",
    )
    fmu.instantiate()
    nominals = (ctypes.c_double * 3)()
    getter = fmu.fmi2GetNominalsOfContinuousStates if fmi == "2.0" else fmu.fmi3GetNominalsOfContinuousStates
    getter(fmu.component, nominals, 3)
    assert list(nominals) == [10.0, 10.0, 1.0]
    fmu.freeInstance()


def test_an_automaton_shows_what_it_consists_of():
    assert repr(BouncingBall()) == "BouncingBall(BouncingBall: continuous states h, v; parameters g, e; jumps jump)"


def test_an_automaton_of_many_parts_shows_the_first():
    class Many(hm.HybridAutomaton):
        a, b, c, d, e, f = (hm.Parameter(0.0) for _ in range(6))

    assert repr(Many("m")) == "Many(m: parameters a, b, c, d and 2 more)"
