"""Rolled maps compute what straight lines compute, to the last bit, in code whose length does not grow with a hub."""

import ctypes
import itertools
import subprocess

import casadi as ca
import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.native import c_text
from hybrid_model.native.build.compiler import find_compiler
from hybrid_model.native.model_code import run_code
from hybrid_model.native.rolled_loops import REPEATS, rolled
from hybrid_model.native.trace import trace

SIZE = REPEATS + 4
SHUFFLED = np.random.default_rng(3).permutation(SIZE).tolist()
DRAWN = np.random.default_rng(4).uniform(-2.0, 2.0, SIZE)


def chain(operation, items):
    total = items[0]
    for item in items[1:]:
        total = operation(total, item)
    return total


def horner(x, y):
    """Each value needs the two before it."""
    found = [x[0], y[0]]
    for k in range(2, SIZE):
        found.append(0.5 * found[-1] - 0.25 * found[-2] + x[k])
    return ca.vertcat(*found)


MAPS = {
    "a sum": lambda x, y: 2.0 * chain(lambda a, b: a + b, ca.vertsplit(ca.sin(x) * y)) + y[3],
    "the least": lambda x, y: chain(ca.fmin, ca.vertsplit(ca.floor(3.0 * x) / y)),
    "constants": lambda x, y: ca.vertcat(*(float(c) * x[k] + y[0] for k, c in enumerate(DRAWN))),
    "no order": lambda x, y: ca.vertcat(*(x[k] * y[j] - 1.0 for k, j in enumerate(SHUFFLED))),
    "neighbours": lambda x, y: ca.vertcat(0.0, x[2:] - 2.0 * x[1:-1] + x[:-2], 1.0),
    "choices": lambda x, y: ca.if_else(x > y, x, ca.fabs(y)) + ca.atan2(x, y),
    "from step to step": horner,
    "used again": lambda x, y: ca.vertcat(x * y, ca.sum1(x * y), (x * y)[SHUFFLED] / ca.sum1(x * y), x[-1] * y[-1]),
    "read again": lambda x, y: ca.vertcat(ca.cumsum(ca.exp(x)), ca.exp(x)[::-1], x[::2], ca.SX.zeros(SIZE)),
}
_EXPORTED = """
__attribute__((visibility("default"))) int %(name)s_%(which)s(const double **arg, double **res, double *w);
int %(name)s_%(which)s(const double **arg, double **res, double *w)
{
    return %(which)s_hybrid_%(name)s(arg, res, 0, w, 0);
}
"""


def program(name, inner):
    x, y = ca.SX.sym("x", SIZE), ca.SX.sym("y", SIZE)
    return ca.Function(f"hybrid_{name}", [x, y], [ca.densify(inner(x, y)), x[1] * y])


def libraries_of(given, folder):
    """All maps in one library: rolled, and as straight lines; and the work array that the first needs."""
    definitions = c_text.functions("model", given)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(c_text, "rolled", lambda body: None)
        straight = c_text.functions("model", given)
    assert definitions.text.count("for (casadi_int") >= len(given)
    names = [f"map{k}" for k in range(len(given))]
    files = {"rolled": definitions.text, "straight": straight.text}
    libraries = {}
    for which, text in files.items():
        text = text.replace("hybrid_map", f"{which}_hybrid_map")
        wrappers = "".join(_EXPORTED % {"name": name, "which": which} for name in names)
        file = folder / f"{which}.c"
        file.write_text(text + wrappers)
        # Thousands of straight lines take seconds to optimise, which changes no value.
        flags = ["-std=c99", "-fPIC", "-shared", "-ffp-contract=off", "-O1" if which == "rolled" else "-O0"]
        library = file.with_suffix(".so")
        subprocess.run([*find_compiler(), *flags, str(file), "-o", str(library), "-lm"], check=True)
        libraries[which] = ctypes.CDLL(str(library))
    return libraries, definitions.work[-1], given


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    given = [program(f"map{k}", inner) for k, inner in enumerate(MAPS.values())]
    return libraries_of(given, tmp_path_factory.mktemp("maps"))


def called(function, arguments, results, work):
    pointers = (ctypes.c_void_p * len(arguments))(*(None if a is None else a.ctypes.data for a in arguments))
    into = (ctypes.c_void_p * len(results))(*(None if r is None else r.ctypes.data for r in results))
    scratch = np.full(work + 1, np.nan)
    scratch[work] = -7.0
    assert function(pointers, into, ctypes.c_void_p(scratch.ctypes.data)) == 0
    assert scratch[work] == -7.0


def assert_the_same_bits(libraries, work, given, number, seed):
    generator = np.random.default_rng(seed)
    for _ in range(3):
        arguments = [generator.uniform(-2.0, 2.0, SIZE) for _ in range(2)]
        found = {}
        for which, library in libraries.items():
            results = [np.full(given[number].numel_out(k), np.nan) for k in range(2)]
            called(getattr(library, f"map{number}_{which}"), arguments, results, work)
            found[which] = np.concatenate(results)
        assert found["rolled"].tobytes() == found["straight"].tobytes()
    return found["rolled"]


@pytest.mark.parametrize("name", MAPS)
def test_loops_compute_what_straight_lines_compute_to_the_last_bit(both, name):
    number = list(MAPS).index(name)
    assert np.isfinite(assert_the_same_bits(*both, number, number)).all()


ONE = (ca.sin, ca.fabs, ca.floor, lambda a: -a, lambda a: a * a, lambda a: 1.0 / (a + 3.0))
TWO = (
    *(lambda a, b: a + b, lambda a, b: a - b, lambda a, b: a * b, ca.fmin, ca.atan2),
    lambda a, b: ca.if_else(a > b, a, 0.5 * b),
)


WAYS = (
    lambda random, a, b, total: list(map(ONE[random.integers(len(ONE))], a)),
    lambda random, a, b, total: list(map(TWO[random.integers(len(TWO))], a, b)),
    lambda random, a, b, total: list(map(TWO[random.integers(len(TWO))], a, [total] * SIZE)),
    lambda random, a, b, total: [a[k] for k in random.permutation(SIZE).tolist()],
    lambda random, a, b, total: [float(c) * v for c, v in zip(random.normal(size=SIZE).round(2), a, strict=True)],
    lambda random, a, b, total: [*(w - v for v, w in itertools.pairwise(a)), total],
    lambda random, a, b, total: [a[0], *(0.3 * v - 0.2 * w for v, w in zip(a[:-1], b[1:], strict=True))],
)
"""Columns made of columns."""


def random_map(random):
    def inner(x, y):
        columns, sums = [ca.vertsplit(x), ca.vertsplit(y)], [y[0]]
        for _ in range(random.integers(4, 9)):
            a, b = (columns[random.integers(len(columns))] for _ in range(2))
            columns.append(WAYS[random.integers(len(WAYS))](random, a, b, sums[random.integers(len(sums))]))
            sums.append(chain(TWO[random.integers(len(TWO))], columns[-1]))
        return ca.vertcat(*columns[-1], *columns[random.integers(len(columns))], *sums)

    return inner


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_random_maps_compute_the_same_bits(seed, tmp_path):
    random = np.random.default_rng(seed)
    found = libraries_of([program(f"map{k}", random_map(random)) for k in range(8)], tmp_path)
    for number in range(8):
        assert_the_same_bits(*found, number, number)


def test_arguments_and_results_that_are_not_there_are_zeros_and_not_wanted(both):
    libraries, work, given = both
    x, result = np.linspace(1.0, 2.0, SIZE), np.empty(given[2].numel_out(0))
    called(libraries["rolled"].map2_rolled, [x, None], [result, None], work)
    np.testing.assert_array_equal(result, DRAWN * x)


class Hub(hm.HybridAutomaton):
    """Follows what it hears, each signal with a gain and a rhythm of its own."""

    degree = hm.Dimension()
    gains = hm.Parameter(1.0, shape="degree")
    heard = hm.Input(0.0, shape="degree", discrete=True)
    x = hm.State(0.0, output=True)
    open = hm.DiscreteState(0.0, shape="degree")

    def flow_map(self, s):
        return {"x": np.sum(s.open * np.sin(s.gains * s.t) ** 2 * (s.heard - s.x))}

    transitions = (
        hm.Jump("turn", lambda self, s: np.max(s.heard - s.x) - 1.0, lambda self, s: {"open": 1.0 - s.open * s.gains}),
    )


def test_the_code_of_a_hub_is_as_long_for_many_neighbours_as_for_some():
    lines = [run_code(trace(Hub(degree=degree))).count("\n") for degree in (REPEATS + 12, 3 * REPEATS)]
    # Its tables of numbers and names have a line for each entry.
    assert lines[1] - lines[0] < 6 * (2 * REPEATS - 12)
    short = "".join(run_code(trace(Hub(degree=REPEATS - 2))))
    assert "for (casadi_int" not in short


def test_statements_of_another_form_stay_as_they_are():
    straight = "  casadi_real a0, a1;\n" + "".join(f"  a0=arg[0]? arg[0][{k}] : 0;\n  a1=sin(a0);\n" for k in range(99))
    assert rolled(straight) is not None
    assert rolled(straight + "  casadi_copy(w0, 3, w1);\n") is None
