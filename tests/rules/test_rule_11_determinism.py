"""Rule 11: same inputs, same bits."""

import numpy as np
import pytest
from child_python import run_child
from small_automata import Ramp

import hybrid_model as hm
from hybrid_model.models import BouncingBall, Thermostat

CASES = {
    "ball": lambda: hm.simulate(BouncingBall(), 2.4),
    "thermostat": lambda: hm.simulate(Thermostat(), 120.0),
    "pair": lambda: hm.simulate(hm.Composition("pair", {"a": Ramp(rate=0.3), "b": Ramp(rate=0.7)}), 5.0),
    "radau": lambda: hm.simulate(BouncingBall(), 1.0, solver=hm.Solver(method=hm.Method.RADAU, rtol=1e-9, atol=1e-9)),
}


def bits(arc):
    rows = [arc.t, arc.j.astype(float), *(np.concatenate([j.x_before, j.x_after, j.z_after]) for j in arc.jumps)]
    return b"".join(row.tobytes() for row in rows) + arc.message.encode()


@pytest.mark.parametrize("case", list(CASES))
def test_a_run_repeated_gives_the_same_bits(case):
    assert bits(CASES[case]()) == bits(CASES[case]())


def test_other_runs_in_between_change_nothing():
    first = bits(CASES["ball"]())
    CASES["thermostat"]()
    CASES["radau"]()
    assert bits(CASES["ball"]()) == first


def test_runs_of_one_automaton_share_nothing():
    ball = BouncingBall()
    first = bits(hm.simulate(ball, 2.4))
    hm.simulate(ball, 5.0)
    assert bits(hm.simulate(ball, 2.4)) == first


def test_another_process_with_another_hash_seed_gives_the_same_bits():
    code = (
        "import hashlib, hybrid_model as hm\n"
        "from hybrid_model.models import BouncingBall\n"
        "pair = hm.Composition('pair', {'a': BouncingBall(), 'b': BouncingBall(e=0.8)})\n"
        "arc = hm.simulate(pair, 2.0)\n"
        "print(hashlib.sha256(b''.join([arc.t.tobytes(), arc['a.h'].tobytes(), arc['b.v'].tobytes()])).hexdigest())\n"
    )
    assert len({run_child(code, PYTHONHASHSEED=seed) for seed in ("0", "1")}) == 1


def test_a_copy_of_an_execution_goes_on_by_itself_and_alike():
    run = hm.Execution(BouncingBall())
    run.flow(0.3)
    copy = run.copy()
    copy.flow(1.0)
    assert (run.t, copy.t > 0.4) == (0.3, True)
    run.flow(1.0)
    assert (run.t, run.x.tobytes()) == (copy.t, copy.x.tobytes())
