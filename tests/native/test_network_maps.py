"""The maps of networks in C: the same numbers as in Python, and the derivatives of the composition traced whole."""

import ctypes
import subprocess

import casadi as ca
import numpy as np
import pytest
from catalogue import cases

import hybrid_model as hm
from fmu.build.binaries import OWN_FOLDERS, own_files
from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.scenario.files import read_scenario
from hybrid_model.declare.transitions import Trigger
from hybrid_model.declare.variables import Kind
from hybrid_model.declare.vector_form import vector_form
from hybrid_model.models import BouncingBall
from hybrid_model.native.build.compiler import find_compiler
from hybrid_model.native.build.objects import GENERATED_FLAGS, STRICT_FLAGS
from hybrid_model.native.networks.network import network_trace
from hybrid_model.native.trace import trace

KINDS = (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER)
FUNCTIONS = ("start", "flow", "flow_set", "margins", "times", "outputs")
DERIVATIVES = ("forward", "reverse", "start_forward", "start_reverse")
POINTER = ctypes.POINTER(ctypes.c_double)
GUARD = 12345.678
# Both sides evaluate the same operations; CasADi may order the terms of the whole in another way.
CLOSE = {"rtol": 1e-11, "atol": 1e-11}


class Compiled:
    """A network's functions in a library; arrays have exactly the sizes announced, and a guard behind them."""

    def __init__(self, traced, folder):
        source = folder / "model.c"
        calls = [
            f"int call_{name}(const double **arg, double **res, long long *iw, double *w)"
            f"{{ return hybrid_{name}(arg, res, iw, w, 0); }}\n"
            for name in (*FUNCTIONS, *DERIVATIVES)
        ]
        calls.append(
            "int call_reset(const double **arg, double **res, long long *iw, double *w, size_t jump)"
            "{ return hybrid_reset(jump, arg, res, iw, w); }\n"
        )
        source.write_text(traced.definitions().text + "".join(calls), encoding="ascii")
        common = [
            *find_compiler(),
            "-std=c99",
            "-O1",
            "-fPIC",
            "-ffp-contract=off",
            *(f"-I{folder}" for folder in OWN_FOLDERS),
        ]
        generated, library = folder / "model.o", folder / "model.so"
        subprocess.run([*common, *GENERATED_FLAGS, "-Werror", "-c", source, "-o", generated], check=True)
        runtime = {folder / f"{source.stem}.o": source for source in own_files("network*.c")}
        for target, own in runtime.items():
            subprocess.run([*common, *STRICT_FLAGS, "-Werror", "-c", own, "-o", target], check=True)
        subprocess.run([*common, "-shared", generated, *runtime, "-lm", "-o", library], check=True)
        self.library = ctypes.CDLL(str(library))
        self.sizes = traced.definitions().work
        self.size = library.stat().st_size

    def __call__(self, name, arguments, sizes, jump=None, unwanted=()):
        n_arg, n_res, n_iw, n_w = self.sizes
        given = [None if a is None else np.ascontiguousarray(a, dtype=float) for a in arguments]
        results = [np.full(size + 1, GUARD) for size in sizes]
        work = np.full(n_w + 1, np.nan)
        work[-1] = GUARD
        arg, res, iw = (POINTER * n_arg)(), (POINTER * n_res)(), (ctypes.c_longlong * (n_iw + 1))()
        for k, array in enumerate(given):
            arg[k] = None if array is None else array.ctypes.data_as(POINTER)
        for k, array in enumerate(results):
            res[k] = None if k in unwanted else array.ctypes.data_as(POINTER)
        extra = [] if jump is None else [ctypes.c_size_t(jump)]
        assert getattr(self.library, f"call_{name}")(arg, res, iw, work.ctypes.data_as(POINTER), *extra) == 0
        assert [array[-1] for array in (*results, work)] == [GUARD] * (len(results) + 1)
        return [array[:-1] for array in results]


class Follower(hm.HybridAutomaton):
    """Follows its input; the output feeds the input through, and the start value is computed from it."""

    x = hm.State(0.0, computed=True, output=True)
    count = hm.DiscreteState(0, integer=True)
    u = hm.Input(0.2)
    offset = hm.Parameter(0.5)
    y = hm.Output()
    twice = hm.Output()

    def __init__(self, name, rate=1.0, **values):
        super().__init__(name, **values)
        self.rate = rate

    def start_map(self, s):
        return {"x": np.cos(s.u) + s.offset * s.x}

    def flow_map(self, s):
        return {"x": self.rate * np.sin(s.u - s.x) * np.exp(-0.1 * s.t)}

    def flow_set(self, s):
        return 3.0 - self.rate * s.x * s.u

    def outputs(self, s):
        return {"y": s.x * s.u + self.rate, "twice": 2.0 * s.x}

    def too_far(self, s):
        return np.abs(s.x - s.offset) - self.rate

    def back(self, s):
        return {"x": -0.5 * s.x + s.u, "count": s.count + 1}

    def next_tick(self, s):
        return s.offset * (s.count + 1)

    def tick(self, s):
        return {"count": s.count + 1}

    transitions = (hm.TimeEvent("tick", next_tick, tick), hm.Jump("back", too_far, back))


class Mean(hm.HybridAutomaton):
    """The mean of its inputs, as an output without states, and its square."""

    size = hm.Dimension()
    all = hm.Input(0.0, shape="size")
    more = hm.Input(0.3)
    mean = hm.Output()
    square = hm.Output()

    def outputs(self, s):
        mean = np.sum(s.all) / s.all.shape[0]
        return {"mean": mean + 0.1 * s.more, "square": mean * mean}


class Rows(hm.HybridAutomaton):
    """A matrix input and a matrix state."""

    rows = hm.Dimension()
    columns = hm.Dimension()
    m = hm.State(0.0, shape=("rows", "columns"))
    u = hm.Input(0.0, shape=("rows", "columns"))
    row = hm.Output(shape="columns")

    def flow_map(self, s):
        return {"m": s.u * s.u - s.m}

    def outputs(self, s):
        return {"row": np.sin(s.m[0]) + s.u[-1]}


def followers(count):
    return {f"f{k}": Follower(f"f{k}", rate=rate(k), offset=0.3 + 0.05 * k) for k in range(1, count + 1)}


def rate(k):
    return 1.03 + 0.1 * (k % 5)


def chain(backwards=False):
    """Each is driven by the output of its neighbour, which feeds it through; the first by an input of the network."""
    parts = followers(6)
    names = list(parts)
    pairs = zip(names[1:], names, strict=False)
    wires = {(f"{a}.u" if not backwards else f"{b}.u"): (f"{b}.y" if not backwards else f"{a}.y") for a, b in pairs}
    return hm.Composition("chain", parts, wires)


def mean_field():
    """Each is driven by the mean of all: each start value changes what the next one starts from."""
    parts = {**followers(5), "mean": Mean(size=5)}
    return hm.Composition(
        "mean_field",
        parts,
        {"mean.all": [f"f{k}.x" for k in range(1, 6)]} | {f"f{k}.u": "mean.mean" for k in range(1, 6)},
    )


def pair():
    """Two means that do not see each other: each output needs one of the inputs only."""
    parts = {"one": Mean(size=1, all=[0.4]), "two": Mean(size=1, all=[-0.3])}
    return hm.Composition("pair", parts)


def layers():
    """Means of outputs that feed other means through; what one part computes is needed by steps, and some by nobody."""
    parts = {"top": Mean(size=3), **followers(3), "pair": pair(), "low": Mean(size=3)}
    wires = {
        "low.all": [f"f{k}.x" for k in (3, 1, 2)],
        **{f"f{k}.u": "low.square" for k in (1, 3)},
        "pair.one.more": "f1.y",
        "f2.u": "pair.one.mean",
        "top.all": ["f1.y", "f2.twice", "f3.y"],
        "pair.two.more": "top.mean",
    }
    return hm.Composition("layers", parts, wires)


def matrices():
    parts = {"a": Rows(rows=2, columns=3), "b": Rows(m=[[0.5, 1.0, 2.0], [-1.0, 0.2, 0.7]], rows=2, columns=3)}
    return hm.Composition("matrices", parts, {"a.u": "b.m", "b.u": ["a.row", "a.row"]})


def nested():
    """A network inside a network, with names of its own, driven from outside and driving."""
    parts = {**followers(14), "mean": Mean(size=2)}
    wires = {f"f{k}.u": f"f{k - 1}.x" for k in range(3, 15)} | {"mean.all": ["f7.x", "f9.y"]}
    names = {"f1.x": "first", "f14.y": "last", "f2.offset": "shift", "mean.more": "drive"}
    inner = hm.Composition("inner", parts, wires, names)
    outer = {"ball": BouncingBall(h=0.7), "inner": inner, "end": Mean(size=3)}
    wires = {"end.all": ["inner.last", "ball.h", "inner.mean.mean"], "end.more": "inner.first", "inner.drive": "ball.h"}
    return hm.Composition("outer", outer, wires)


def one_broadcast():
    """Consensus with feedthrough of weights inside the agents, and switching."""
    edges = [[1, 2], [2, 3], [3, 4], [4, 5], [5, 1], [1, 3]]
    return closed_loop(
        read_scenario(
            {
                "name": "unequal degrees",
                "stop_time": 5.0,
                "network": {"agents": 5, "edges": edges, "initial": [1.0, -0.5, 0.3, 2.0, 0.0]},
                "weights": {"kind": "gated-sine", "gate_rate": 4.0, "sine_rate": 5.0, "duty_percent": 30.0},
                "switching": {"dwell": 0.7, "active": [[1, 2, 3], [4, 5, 6]]},
                "trigger": {"kind": "dynamic", "threshold": 0.3, "decay": 0.1},
            }
        )
    )


NETWORKS = {
    "chain": chain,
    "chain_backwards": lambda: chain(backwards=True),
    "mean_field": mean_field,
    "layers": layers,
    "matrices": matrices,
    "nested": nested,
    "unequal_degrees": one_broadcast,
    "continuous": lambda: cases()["ring_continuous"].automaton,
    "estimation": lambda: cases()["network_estimation"].automaton,
    "agent": lambda: cases()["agent2_girard"].automaton,
}


@pytest.fixture(scope="module", params=NETWORKS)
def network(request, tmp_path_factory):
    composition = NETWORKS[request.param]()
    traced = network_trace(composition)
    return composition, traced, Compiled(traced, tmp_path_factory.mktemp(request.param))


def points(layout, count=3):
    """The start point, and points around it."""
    rng = np.random.default_rng(5)
    x, z, u, p = (layout.start(kind) for kind in KINDS)
    yield [np.zeros(1), x, z, u, p]
    for _ in range(count - 1):
        shaken = [x + 0.3 * rng.normal(size=x.size), z, u + 0.3 * rng.normal(size=u.size)]
        yield [rng.uniform(0.0, 3.0, 1), *shaken, p * rng.uniform(0.9, 1.1, p.size)]


def test_the_maps_are_those_of_python(network):
    composition, traced, compiled = network
    form, layout = vector_form(composition), traced.layout
    nx, nz, _, _ = (layout.sizes[kind] for kind in KINDS)
    on_state = sum(info.trigger is Trigger.STATE for info in composition.jumps)
    for t, *vectors in points(layout):
        now, point = float(t[0]), [t, *vectors]
        np.testing.assert_allclose(
            np.concatenate(compiled("start", point, [nx, nz])), np.concatenate(form.start(now, *vectors)), **CLOSE
        )
        np.testing.assert_allclose(compiled("flow", point, [nx])[0], form.rates(now, *vectors), **CLOSE)
        margins = compiled("margins", point, [on_state])
        if composition.has_flow_set:
            margins += compiled("flow_set", point, [1])
        np.testing.assert_allclose(np.concatenate(margins), form.margins(now, *vectors), **CLOSE)
        times = compiled("times", point, [len(composition.jumps) - on_state])[0]
        np.testing.assert_allclose(times, form.event_times(now, *vectors), **CLOSE)
        outputs = layout.pack(Kind.OUTPUT, composition.output_values(layout.values(now, *vectors)))
        np.testing.assert_allclose(compiled("outputs", point, [outputs.size])[0], outputs, **CLOSE)
        for jump in range(len(composition.jumps)):
            new = compiled("reset", point, [nx, nz], jump)
            np.testing.assert_allclose(np.concatenate(new), np.concatenate(form.reset(jump, now, *vectors)), **CLOSE)


@pytest.mark.parametrize("start", [False, True])
def test_derivatives_are_those_of_the_whole(network, start):
    composition, traced, compiled = network
    whole, sizes = trace(composition), traced.layout.sizes
    symbols = [ca.SX.sym(f"a{k}", size) for k, size in enumerate([1, *(sizes[kind] for kind in KINDS)])]
    results = whole.start.call(symbols) if start else [*whole.flow.call(symbols), *whole.outputs.call(symbols)]
    lengths = [result.numel() for result in results]
    at = ca.vertcat(*symbols)
    jacobian = ca.Function("jacobian", [at], [ca.densify(ca.jacobian(ca.vertcat(*results), at))])
    rng = np.random.default_rng(6)
    prefix = "start_" if start else ""
    for point in points(traced.layout):
        matrix = np.reshape(jacobian(np.concatenate(point)).full(), (sum(lengths), -1))
        tangents = [rng.normal(size=vector.size) for vector in point]
        forward = compiled(f"{prefix}forward", [*point, *tangents], lengths)
        np.testing.assert_allclose(np.concatenate(forward), matrix @ np.concatenate(tangents), **CLOSE)
        adjoints = [rng.normal(size=length) for length in lengths]
        reverse = compiled(f"{prefix}reverse", [*point, *adjoints], [vector.size for vector in point])
        np.testing.assert_allclose(np.concatenate(reverse), matrix.T @ np.concatenate(adjoints), **CLOSE)


def test_what_is_not_wanted_and_what_is_zero(network):
    _, traced, compiled = network
    point = next(points(traced.layout))
    sizes = [vector.size for vector in point]
    n_rates, n_outputs = sizes[1], traced.layout.sizes[Kind.OUTPUT]
    rng = np.random.default_rng(7)
    tangents = [rng.normal(size=size) for size in sizes]
    zero = [tangents[0], tangents[1], np.zeros(sizes[2]), tangents[3], np.zeros(sizes[4])]
    none = [tangents[0], tangents[1], None, tangents[3], None]
    both = compiled("forward", [*point, *zero], [n_rates, n_outputs])
    np.testing.assert_array_equal(compiled("forward", [*point, *none], [n_rates, n_outputs])[0], both[0])
    one = compiled("forward", [*point, *zero], [n_rates, n_outputs], unwanted=(0,))
    np.testing.assert_array_equal(one[1], both[1])
    assert np.all(one[0] == GUARD)
    adjoints = [rng.normal(size=n_rates), rng.normal(size=n_outputs)]
    full = compiled("reverse", [*point, *adjoints], sizes)
    some = compiled("reverse", [*point, *adjoints], sizes, unwanted=(0, 2, 4))
    np.testing.assert_array_equal(np.concatenate([some[1], some[3]]), np.concatenate([full[1], full[3]]))


def test_patterns_are_those_of_the_whole(network):
    composition, traced, _ = network
    whole = trace(composition)
    results = {
        "flow": (whole.flow, 0),
        **({"flow_set": (whole.flow_set, 0)} if composition.has_flow_set else {}),
        "outputs": (whole.outputs, 0),
        "margins": (whole.margins, 0),
        "times": (whole.times, 0),
        "start_x": (whole.start, 0),
        "start_z": (whole.start, 1),
    }
    for name, (function, number) in results.items():
        for argument, letter in enumerate("txzup"):
            rows, columns = function.size1_out(number), function.size1_in(argument)
            expected = np.zeros((rows, columns), dtype=bool)
            if rows and columns:
                expected = ca.DM(function.jac_sparsity(number, argument), 1).full().astype(bool)
            np.testing.assert_array_equal(traced.pattern(name, letter).toarray(), expected)


def test_jumps_change_what_they_change_in_the_whole(network):
    composition, traced, _ = network
    whole = trace(composition)
    for number, kind in enumerate((Kind.STATE, Kind.DISCRETE)):
        expected = []
        for reset in whole.resets:
            arguments = reset.sx_in()
            new, old = reset.call(arguments)[number], arguments[1 + number]
            expected.append({k for k in range(old.numel()) if not ca.is_equal(new[k], old[k], 2)})
        assert traced.changes(kind) == expected


def test_a_thousand_parts_in_little_code(tmp_path):
    """A chain of 1000 with feedthrough of half of them: one function a kind, the binary far below 2 MB."""
    count = 1000
    parts = followers(count)
    wires = {f"f{k + 1}.u": f"f{k}.{'y' if k % 2 else 'twice'}" for k in range(1, count)}
    traced = network_trace(hm.Composition("many", parts, wires))
    assert len(traced.groups) == 1
    compiled = Compiled(traced, tmp_path)
    assert compiled.size < 1_000_000
    point = next(points(traced.layout))
    rates = compiled("flow", point, [count])[0]
    x = point[1]
    u = np.full(count, 0.2)
    for k in range(1, count):
        u[k] = x[k - 1] * u[k - 1] + rate(k) if k % 2 else 2.0 * x[k - 1]
    np.testing.assert_allclose(rates, [rate(k) * np.sin(u[k - 1] - x[k - 1]) for k in range(1, count + 1)], **CLOSE)
