"""Networks as arrays: what they run is what the same composition runs, and what they leave is in proportion."""

import subprocess
import sys
import time

import networkx as nx
import numpy as np
import pytest
import scipy.sparse as sp

import hybrid_model as hm
from hybrid_model.schedule import event_store, native_network

END = 3.0


class Sender(hm.HybridAutomaton):
    """Drifts to what it hears, and sends its state when that has moved by a threshold."""

    degree = hm.Dimension()
    rates = hm.Parameter(1.0, shape="degree", unit="1/s")
    threshold = hm.Parameter(0.1)
    heard = hm.Input(0.0, shape="degree", discrete=True)
    x = hm.State(0.0, output=True)
    sent = hm.DiscreteState(0.0, output=True, computed=True)

    def start_map(self, s):
        return {"sent": s.x}

    def flow_map(self, s):
        return {"x": np.sum(s.rates * (s.heard - s.sent))}

    transitions = (hm.Jump("send", lambda self, s: abs(s.x - s.sent) - s.threshold, lambda self, s: {"sent": s.x}),)


def path_of_four():
    """A path with other rates on each link: parts of two degrees."""
    matrix = sp.csr_matrix(nx.to_scipy_sparse_array(nx.path_graph(4)))
    rates = matrix.copy()
    rates.data = np.linspace(0.5, 1.5, matrix.nnz)
    x = np.array([1.0, -0.5, 0.3, -1.0])
    values = {"x": x, "threshold": 0.05}
    return hm.Network(
        "path",
        lambda degree: Sender(degree=degree),
        matrix,
        {"heard": "sent"},
        values=values,
        link_values={"rates": rates},
    )


def by_hand():
    """The same, written part by part."""
    x, rates = [1.0, -0.5, 0.3, -1.0], [[0.5], [0.7, 0.9], [1.1, 1.3], [1.5]]
    parts = {f"part{k + 1}": Sender(degree=len(rates[k]), x=x[k], rates=rates[k], threshold=0.05) for k in range(4)}
    wires = {f"part{k + 1}.heard": [f"part{j + 1}.sent" for j in (k - 1, k + 1) if 0 <= j < 4] for k in range(4)}
    return hm.Composition("path", parts, wires)


def test_a_network_of_arrays_is_the_composition_written_by_hand():
    network, whole = path_of_four(), by_hand()
    run, other = hm.simulate_network(network, END, engine="native"), hm.simulate(whole, END)
    assert len(run.events) > 30
    for part in network.parts:
        assert run.event_times(part, "send") == pytest.approx(other.event_times(f"{part}.send"), abs=1e-9)
        assert run.at("x", [0.5, 2.9], [part])[0] == pytest.approx(other.at(f"{part}.x", [0.5, 2.9]), abs=1e-9)
    assert run.final("x") == pytest.approx([float(other.at(f"{part}.x", END)) for part in network.parts], abs=1e-9)


def test_both_schedulers_run_it_and_leave_the_same_events():
    network = path_of_four()
    native, plain = (hm.simulate_network(network, END, engine=engine) for engine in ("native", "python"))
    for name in ("t", "values"):
        np.testing.assert_allclose(getattr(native.events, name), getattr(plain.events, name), rtol=0.0, atol=1e-9)
    np.testing.assert_array_equal(native.events.part, plain.events.part)
    assert native.events.named("send").all()
    assert native.events.signals[0] == ("sent",)
    np.testing.assert_allclose(native.final("x"), plain.final("x"), rtol=0.0, atol=1e-9)
    np.testing.assert_array_equal(native.events.counts(4), [len(arc.jumps) for arc in native.arcs.values()])


def test_graphs_matrices_and_columns_say_who_hears_whom():
    graph = nx.DiGraph([("a", "b"), ("c", "b"), ("b", "c")])
    matrix = sp.csr_matrix((np.ones(3), ([1, 1, 2], [0, 2, 1])), shape=(3, 3))
    columns = (np.array([1, 2, 1]), np.array([0, 1, 2]))
    for links in (graph, matrix, columns):
        network = hm.Network("three", lambda degree: Sender(degree=degree), links, {"heard": "sent"})
        assert network.links.receivers.tolist() == [1, 1, 2]
        assert network.links.senders.tolist() == [0, 2, 1]
        assert list(network.parts) == ["part1", "part2", "part3"]


def test_a_row_for_each_link_goes_where_its_link_goes():
    # Given from the last receiver to the first one.
    columns = (np.array([2, 1, 1, 0]), np.array([1, 2, 0, 1]))
    network = hm.Network(
        "three",
        lambda degree: Sender(degree=degree),
        columns,
        {"heard": "sent"},
        link_values={"rates": [4.0, 3.0, 2.0, 1.0]},
    )
    assert [list(next(v.start for v in network.copy(k).variables if v.name == "rates")) for k in range(3)] == [
        [1.0],
        [3.0, 2.0],
        [4.0],
    ]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"values": {"x": np.zeros(3)}},
            r"x is given with shape \(3,\): give one value of shape \(\), or one for each",
        ),
        ({"values": {"speed": 1.0}}, "has no variable 'speed'"),
        ({"values": {"x": np.inf}}, "x has values that are not finite"),
        ({"values": {"x": "1"}}, "path: x = '1' is no array of real numbers: give numbers"),
        ({"values": {"x": ["a"] * 4}}, "path: x = .* is no array of real numbers"),
        ({"values": {"x": [1.0, [2.0]]}}, "path: x = .* is no array of real numbers"),
        ({"link_values": {"rates": "fast"}}, "path: rates = 'fast' is no array of real numbers"),
        ({"link_values": {"rates": 1.0}}, r"rates is given with shape \(\): give one value for each of 6 links"),
        (
            {"values": {"rates": 1.0}, "link_values": {"rates": np.ones(6)}},
            "path: rates is given among the values and among the link_values: leave one of them out",
        ),
        ({"link_values": {"rates": np.ones(5)}}, "one value for each of 6 links"),
        ({"link_values": {"threshold": np.ones(6)}}, "give it among the values"),
        ({"signals": {"heard": "x"}}, "only a scalar that changes at jumps can be sent"),
        ({"signals": {"ear": "sent"}}, "has no variable 'ear'"),
        ({"links": sp.csr_matrix((2, 3))}, r"shape \(2, 3\)"),
        ({"links": (np.array([5]), np.array([0])), "count": 2}, "names part 5, but parts are numbered from 0 to 1"),
        ({"links": 7}, "is given as int"),
        ({"part": Sender(degree=1)}, "heard has 1 elements, but a part hears 2 others"),
    ],
)
def test_what_does_not_fit_is_told(given, message):
    known = {
        "part": lambda degree: Sender(degree=degree),
        "links": nx.path_graph(4),
        "signals": {"heard": "sent"},
        **given,
    }
    with pytest.raises((hm.WiringError, hm.DeclarationError), match=message):
        hm.Network("path", **known)


def test_events_that_are_many_go_to_files_and_are_the_same(tmp_path, monkeypatch):
    network = path_of_four()
    plain = hm.simulate_network(network, END, engine="native").events
    told = hm.simulate_network(network, END, engine="native", events_to=tmp_path / "events")
    monkeypatch.setattr(event_store, "LIMIT", 10)
    passing = hm.simulate_network(network, END, engine="native")
    assert len(passing.arcs["part2"].jumps) == passing.events.counts(4)[1]
    for other in (told.events, passing.events, hm.load_network_events(tmp_path / "events")):
        for name in ("t", "part", "jump", "values"):
            np.testing.assert_array_equal(getattr(other, name), getattr(plain, name))
    with pytest.raises(hm.DataError, match="has the events of a run already"):
        hm.simulate_network(network, END, engine="native", events_to=tmp_path / "events")


CHILD = """
import sys
sys.path[:0] = {path!r}
from test_network_arrays import *
from hybrid_model.schedule import native_network
native_network.EVENTS_AT_ONCE = 10
hm.simulate_network(path_of_four(), 1e9, engine="native", events_to={folder!r}, zeno=hm.ZenoGuard(max_jumps=10**9))
"""


def test_a_run_that_is_killed_leaves_what_it_has(tmp_path):
    folder = tmp_path / "events"
    code = CHILD.format(path=sys.path, folder=str(folder)).replace("1e9,", "1e9, solver=hm.Solver(max_step=1e-3),")
    with subprocess.Popen([sys.executable, "-c", code]) as child:
        for _ in range(600):
            time.sleep(0.1)
            if (folder / "t").exists() and (folder / "t").stat().st_size > 20 * 8:
                break
        child.kill()
    events = hm.load_network_events(folder)
    # Of the last ones some columns may be missing.
    assert len(events) > 0
    plain = hm.simulate_network(path_of_four(), END, engine="native", solver=hm.Solver(max_step=1e-3)).events
    both = min(len(events), len(plain))
    np.testing.assert_array_equal(events.t[:both], plain.t[:both])


def test_an_interrupt_brings_what_had_happened(monkeypatch):
    plain = hm.simulate_network(path_of_four(), END, engine="native").events
    monkeypatch.setattr(native_network, "EVENTS_AT_ONCE", 20)
    noted = native_network.Progress.note

    def note(self, t, events):
        noted(self, t, events)
        if t > 0.5 * END / 3.0:
            raise KeyboardInterrupt

    monkeypatch.setattr(native_network.Progress, "note", note)
    with pytest.raises(KeyboardInterrupt, match="interrupted after") as stopped:
        hm.simulate_network(path_of_four(), END, engine="native")
    found = stopped.value.events
    assert 5 < len(found) < len(plain)
    np.testing.assert_array_equal(found.t, plain.t[: len(found)])


def test_a_folder_without_events_is_refused(tmp_path):
    with pytest.raises(hm.DataError, match="has no events of a network"):
        hm.load_network_events(tmp_path)


def test_progress_is_told_on_stderr(capsys):
    from hybrid_model.schedule.progress import Progress

    told = Progress((0.0, 10.0), wanted=True, every=0.0)
    told.note(2.5, 100)
    assert "t = 2.5 of 10 s: 100 events" in capsys.readouterr().err
    Progress((0.0, 10.0), wanted=False, every=0.0).note(2.5, 100)
    assert capsys.readouterr().err == ""


def test_memory_does_not_grow_with_the_events_that_are_kept_elsewhere():
    """A part is a block of some two kilobytes."""
    from hybrid_model.schedule.part_table import table_of_arrays

    ring = nx.cycle_graph(1000)
    network = hm.Network("ring", lambda degree: Sender(degree=degree), ring, {"heard": "sent"})
    assert table_of_arrays(network, {}, 0.0, 1.0, stiff=False).network().memory < 1000 * 2500
