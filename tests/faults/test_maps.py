"""The maps in C give the numbers of the maps in Python bit for bit (fault 23), over the automata of the catalogue.

Both come from one trace: what is compared is the code that is generated and compiled, with the flags of an FMU, against
the evaluation of the same expressions in Python's process, and this against the numpy maps themselves.
"""

import ctypes
import subprocess

import numpy as np
import pytest
from catalogue import cases

from fmu.build.binaries import OWN_FOLDERS
from hybrid_model.declare.variables import Kind
from hybrid_model.native.build.compiler import find_compiler
from hybrid_model.native.build.objects import COMMON_FLAGS
from hybrid_model.native.model_code import model_code
from hybrid_model.native.trace import trace

pytestmark = pytest.mark.faults
POINTS = 100_000
# The tables of the model give the functions; a few lines of C hand them on to ctypes.
HANDS_ON = """
#include "model.h"
int evaluate(int which, const double **arg, double **res, long long *iw, double *w);
int evaluate(int which, const double **arg, double **res, long long *iw, double *w)
{
    ModelFunction functions[] = {model.start, model.flow, model.flow_set, model.margins, model.times, model.outputs};
    return which < 6 ? functions[which](arg, res, iw, w, 0) : model.reset((size_t)(which - 6), arg, res, iw, w);
}
const size_t *sizes(void);
const size_t *sizes(void)
{
    static size_t found[4];
    found[0] = model.n_arg, found[1] = model.n_res, found[2] = model.n_iw, found[3] = model.n_w;
    return found;
}
"""


class Maps:
    """A model's maps, compiled as for an FMU."""

    def __init__(self, traced, folder):
        (folder / "model.c").write_text(model_code(traced))
        (folder / "hands_on.c").write_text(HANDS_ON)
        library = folder / "maps.so"
        flags = [flag for flag in COMMON_FLAGS if flag != "-fvisibility=hidden"]
        subprocess.run(
            [*find_compiler(), *flags, *(f"-I{folder}" for folder in OWN_FOLDERS), "-shared", "-o", str(library)]
            + [str(folder / name) for name in ("model.c", "hands_on.c")]
            + ["-lm"],
            check=True,
            capture_output=True,
        )
        self.library = ctypes.CDLL(str(library))
        self.library.sizes.restype = ctypes.POINTER(ctypes.c_size_t)
        n_arg, n_res, n_iw, n_w = self.library.sizes()[:4]
        self.arguments = (ctypes.c_void_p * (n_arg + 16))()
        self.results = (ctypes.c_void_p * (n_res + 16))()
        self.work = (ctypes.c_longlong * (n_iw + 1))(), (ctypes.c_double * (n_w + 1))()

    def evaluate(self, which, arguments, results):
        for place, array in ((self.arguments, arguments), (self.results, results)):
            for k, values in enumerate(array):
                place[k] = values.ctypes.data
        assert self.library.evaluate(which, self.arguments, self.results, *self.work) == 0


def points(traced, rng, n):
    """Points around the start values: near, far, and exactly there."""
    layout, kinds = traced.layout, ("STATE", "DISCRETE", "INPUT", "PARAMETER")
    starts = [np.array(layout.start(Kind[name]), dtype=float) for name in kinds]
    integer = [np.zeros(len(start), dtype=bool) for start in starts]
    for k, name in enumerate(kinds):
        for j, variable in enumerate(layout.names(Kind[name])):
            base = variable.partition("[")[0]
            found = [v for v in traced.automaton.of_kind(Kind[name]) if v.name == base]
            integer[k][j] = bool(found and found[0].integer)
    for i in range(n):
        scale = 10.0 ** rng.uniform(-3.0, 0.5) * (i > 0)
        yield [np.array([abs(rng.normal()) * scale])] + [
            start
            + np.where(
                whole, np.floor(rng.uniform(0.0, 4.0, len(start))) * (i > 0), scale * rng.normal(size=len(start))
            )
            for start, whole in zip(starts, integer, strict=True)
        ]


def same_bits(a, b):
    """Equal numbers; two that are none are equal whatever their bits, which the standard of arithmetic leaves open."""
    a, b = np.ravel(np.asarray(a, dtype=float)), np.ravel(np.asarray(b, dtype=float))
    return a.shape == b.shape and bool(np.all((a.view(np.uint64) == b.view(np.uint64)) | (np.isnan(a) & np.isnan(b))))


@pytest.mark.parametrize("name", list(cases()))
def test_no_bit_differs(name, tmp_path):
    traced = trace(cases()[name].automaton)
    maps, rng = Maps(traced, tmp_path), np.random.default_rng(list(cases()).index(name))
    functions = [traced.start, traced.flow, traced.flow_set, traced.margins, traced.times, traced.outputs]
    functions += list(traced.resets)
    # Shared out among the automata of the catalogue: together more than a hundred thousand points.
    n = -(-POINTS // len(cases()))
    rooms = [[np.zeros(max(function.size1_out(k), 1)) for k in range(function.n_out())] for function in functions]
    for arguments in points(traced, rng, n):
        which = int(rng.integers(len(functions)))
        function, room = functions[which], rooms[which]
        maps.evaluate(which, arguments, room)
        found = function(*arguments)
        found = found if isinstance(found, tuple) else (found,)
        for k, values in enumerate(found):
            size = function.size1_out(k)
            assert same_bits(room[k][:size], np.asarray(values.full()).ravel()), (function.name(), k, arguments)
