"""Every key of every kind of scenario file with values that make no sense: one sentence that names the key."""

import copy
import datetime
import math

import numpy as np
import pytest

from cosim.cli.main import main
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.files import load_scenario, read_scenario

BASE = {
    "name": "three",
    "stop_time": 10,
    "network": {"agents": 3, "edges": [[1, 2], [2, 3]], "initial": [1, 0.5, -2.0], "gain": 2.0, "underlying": "listed"},
    "weights": {"kind": "constant", "value": [1.0, 2.0]},
    "trigger": {"kind": "static", "threshold": 0.5},
}
DRAWN = {"shortest": 0.5, "longest": 2, "seed": 1, "duration": 12.0, "repeat": True}
KINDS = {
    "weights": [
        {
            "kind": "gated-sine",
            "map": "square",
            "gate_rate": 4.0,
            "sine_rate": [5.0, 6.0],
            "duty_percent": 20,
            "phase": 0.1,
        },
        {"kind": "constant", "value": [1.0, 2.0]},
        {"kind": "sine", "mean": [1, 2], "depth": 0.5, "rate": 3.0, "phase": 0.0},
        {"kind": "square", "high": 2, "low": 0.5, "gate_rate": 4.0, "duty_percent": [20, 30], "phase": 1},
        {"kind": "piecewise", "starts": [0, 1], "values": [[2, 0], [1, 1]], "cycle": 3},
        {"kind": "sampled", "times": [0, 4, 10], "values": [[1, 0, 2], [0, 1, 0]], "repeat": False},
    ],
    "switching": [
        {"kind": "periodic", "dwell": 2.0, "active": [[1], [1, 2]]},
        {"kind": "sequence", "dwell": [7, 4], "active": [[1], [2]], "repeat": False},
        {"kind": "random-dwell", "active": [[1], [2]], "order": "random", **DRAWN},
        {"kind": "markov", "active": [[1], [2]], "transition": [[0, 1], [0.5, 0.5]], "first": 1, **DRAWN},
        {
            "kind": "jointly-connected",
            "window": 1.5,
            "graphs": 2,
            "spare": 0.1,
            "seed": 1,
            "duration": 12.0,
            "repeat": True,
        },
    ],
    "trigger": [
        {"kind": "static", "threshold": 0.5},
        {"kind": "dynamic", "threshold": 0.5, "decay": 0.1},
        {"kind": "mixed", "offset": 0.1, "threshold": 0.5, "decay": 0.1},
        {"kind": "relative", "sigma": 0.5, "floor": 0.1, "decay": 0.1},
        {"kind": "girard", "sigma": 0.5, "theta": 1.0, "leak": 0.1, "reserve": 0.2},
        {"kind": "self-triggered", "threshold": 0.5, "decay": 0.1},
        {"kind": "sampled", "threshold": 0.5, "decay": 0.1, "period": 0.1},
        {"kind": "periodic", "period": 0.1},
    ],
    "channel": [{"delay": 0.05, "loss": 0.1, "seed": 3, "slots": 4}],
    "network": [BASE["network"]],
}
HUGE = 10**400
# Integers of more digits than Python prints: a TOML file can write them in hexadecimal.
GIANT = 16**5000
NEVER_VALID = [
    "x",
    "z" * 500,
    math.nan,
    math.inf,
    -math.inf,
    HUGE,
    -HUGE,
    GIANT,
    {},
    {"a": 1},
    [],
    [None],
    ["x", "y"],
    ["z" * 500],
    [math.nan, 1.0],
    [HUGE, 1],
    [[GIANT]],
    [[HUGE, 1], [1, 2]],
    [[math.nan, 1], [1, 1]],
    [[1], [1, 2, 3, 4, 5]],
    [[[1]]],
    [0.5] * 500,
    datetime.date(2020, 1, 1),
]
SOMETIMES_VALID = [
    *("", True, False, -1, -1.5, 0, 0.5, 3, 2.5, 5e-324, 1e-200, 1e200, 1e300, -1e300, 10**15, 2**63 - 1, 2**63),
    *([1], [1, 2, 3], [[1]], [[], []], [[1, 1], [1, 1]], [-1, -1], [0, 0], [1, 0], [True, False]),
    *([[1, 2], [2, 3], [1, 3]], [[-1, 1], [1, 2]], list(range(500)), [[1, 0], [0.5]]),
]


def entries_of_every_key():
    for key in ("name", "stop_time", "network", "weights", "switching", "trigger", "channel"):
        yield key, copy.deepcopy(BASE), key
    for table, kinds in KINDS.items():
        for kind in kinds:
            for key in kind:
                yield f"{table}-{kind.get('kind', 'only')}-{key}", BASE | {table: kind}, (table, key)


def with_value(entries, place, value):
    changed = copy.deepcopy(entries)
    if isinstance(place, str):
        changed[place] = value
    else:
        changed[place[0]][place[1]] = value
    return changed


KEYS = [pytest.param(entries, place, id=name) for name, entries, place in entries_of_every_key()]


@pytest.mark.parametrize(("entries", "place"), KEYS)
def test_values_that_no_key_takes_are_refused_by_name(entries, place):
    key = place if isinstance(place, str) else place[1]
    for value in NEVER_VALID:
        if (
            (key == "name" and isinstance(value, str))
            or (key == "active" and value == [])
            or (key, value) == ("channel", {})
        ):
            continue
        with pytest.raises(ScenarioError) as refusal:
            read_scenario(with_value(entries, place, value))
        check_sentence(str(refusal.value), key)


@pytest.mark.parametrize(("entries", "place"), KEYS)
def test_values_that_some_keys_take_are_taken_or_refused_by_name(entries, place):
    for value in SOMETIMES_VALID:
        try:
            read_scenario(with_value(entries, place, value))
        except ScenarioError as refusal:
            check_sentence(str(refusal), place if isinstance(place, str) else place[1])


def check_sentence(text, key):
    assert key in text
    assert text.endswith(".")
    assert "\n" not in text
    assert len(text) < 300, text


@pytest.mark.parametrize(
    ("table", "entries", "message"),
    [
        ("weights", {"kind": "constant", "value": [1, -1]}, r"\[weights\] value\[2\] is -1.0; it must not be negative"),
        (
            "weights",
            {"kind": "piecewise", "starts": [0, 9], "values": [1, 1], "cycle": 3},
            "cycle is 3.0; it must be longer than 9.0, from the first of starts to the last",
        ),
        (
            "weights",
            {"kind": "sampled", "times": [0, 5], "values": [1, 1]},
            r"\[weights\] of edge 1 is given from 0 s to 5 s, but the run goes from 0 s to 10 s; let its times cover",
        ),
        ("switching", {"kind": "sequence", "dwell": [7, 4], "active": []}, "active is empty"),
        (
            "switching",
            {"kind": "sequence", "dwell": [7, 4], "active": [[1]]},
            "dwell lists 2 numbers for 1 graphs in active; give one number for each of them",
        ),
        (
            "switching",
            {"kind": "markov", "active": [[1]], "transition": [[1, 0], [0, 1]], **DRAWN},
            "transition lists 2 lists for 1 graphs in active",
        ),
        (
            "switching",
            {"kind": "markov", "active": [[1], [2]], "transition": [[1], [0, 1]], **DRAWN},
            r"transition\[1\] lists 1 numbers for 2 graphs in active",
        ),
        (
            "switching",
            {"kind": "random-dwell", "active": [[1]], **DRAWN, "duration": 3, "repeat": False},
            r"\[switching\] duration is 3.0; it must be at least stop_time, 10 s, .* repeat = true",
        ),
        (
            "switching",
            {"kind": "jointly-connected", "window": 1, "graphs": 2, "seed": 1, "duration": 3},
            r"\[switching\] duration is 3.0; it must be at least stop_time, 10 s",
        ),
        (
            "switching",
            {"kind": "random-dwell", "active": [[1]], **DRAWN, "duration": 1e9},
            r"duration is 1e\+09 s, for which more than 100000 intervals are drawn",
        ),
        (
            "switching",
            {"kind": "jointly-connected", "window": 5e-324, "graphs": 2, "seed": 1},
            "window is 5e-324 .* more than 100000 graphs",
        ),
        ("channel", {"seed": HUGE}, r"seed is 1000\.\.\. \(401 digits\); it must be a whole number .* 64 bits"),
        ("channel", {"seed": -GIANT}, r"seed is -\d{4}\.\.\. \(6021 digits\)"),
        (
            "weights",
            {"kind": "gated-sine", "gate_rate": 1e25, "sine_rate": 1, "duty_percent": 20},
            r"\[weights\] of edge 1: gate_rate makes about 2e\+25 changes up to stop_time, 10 s",
        ),
        (
            "weights",
            {"kind": "sine", "mean": 1, "depth": 0.5, "rate": [1, 1e300]},
            "of edge 2: rate makes about 2e\\+300 changes",
        ),
        (
            "weights",
            {"kind": "piecewise", "starts": [0, 1e-9], "values": [1, 0], "cycle": 2e-9},
            "cycle makes about 1e\\+10 changes",
        ),
        ("weights", {"kind": "sampled", "times": [0, 1e-9], "values": [1, 0], "repeat": True}, "times makes about 2e"),
        ("switching", {"dwell": 1e-200, "active": [[1], [2]]}, "dwell makes about 1e\\+201 changes"),
        ("trigger", {"kind": "periodic", "period": 1e-9}, r"\[trigger\] period makes about 1e\+10 changes"),
        (
            "weights",
            {"kind": "sine", "mean": 1, "depth": 0.5, "rate": 1, "phase": 1e300},
            "phase is 1e\\+300; it must lie between -1e6 and 1e6",
        ),
        ("channel", {"slots": 10**6}, r"slots is 1000000; it must be at least 1 and at most 1000"),
        ("switching", {"dwell": 1, "active": [[HUGE]]}, r"active\[1\]\[1\] is 1000\.\.\. \(401 digits\)"),
        ("switching", {"dwell": 1, "active": [[7]]}, r"active phase 1 names edge 7"),
    ],
)
def test_the_key_that_is_wrong_is_the_one_that_is_named(table, entries, message):
    with pytest.raises(ScenarioError, match=message):
        read_scenario(BASE | {table: entries})


class TestSampledFiles:
    """What only a file of samples can do wrong."""

    @staticmethod
    def read(folder, name):
        return read_scenario(BASE | {"weights": {"kind": "sampled", "file": name}}, folder)

    @pytest.mark.parametrize(
        ("content", "message"),
        [
            (b"0,1\n20,-1\n", r"\[weights\] file 'w.csv', samples of edge 1: values\[2\] is -1.0; it must not be neg"),
            (b"0,1\n20,nan\n", r"file 'w.csv', samples of edge 1: values\[2\] is nan; it must be a finite number"),
            (b"0,1\n20," + b"9" * 400 + b"\n", r"values\[2\] is inf; it must be a finite number"),
            (b"0,1\n0,1\n", r"file 'w.csv', samples of edge 1: times\[2\] is 0.0; it must be later"),
            (b"0,1\n5,1\n", "of edge 1 is given from 0 s to 5 s, .* let its times cover the run"),
            (b"1,2\n", "times lists 1 samples; there must be at least 2"),
            (b"", "holds no rows of numbers"),
            (b"t,w\n0,1\nx,2\n", r"has no numbers in row 3: \['x', '2'\]"),
            (b"0,1\n1,2,3\n", "has 3 cells in row 2"),
            (b"0\n1\n", "has 1 cells in row 1"),
            (b"0,1,1,1\n1,1,1,1\n", "has weights for 3 edges, but the network has 2"),
            (b"t,w\n0,1\n\xff\xfe,1\n", r"w.csv is not a text in UTF-8: byte 8"),
            (b"0,1\n" + b"x" * 500 + b",1\n", r"has no numbers in row 2: "),
            (b"0,1\n" + b"x" * 200_000 + b",1\n", r"w.csv is not a table of comma-separated values"),
        ],
    )
    def test_csv(self, tmp_path, content, message):
        (tmp_path / "w.csv").write_bytes(content)
        with pytest.raises(ScenarioError, match=message) as refusal:
            self.read(tmp_path, "w.csv")
        assert len(str(refusal.value)) < 300 + len(str(tmp_path))

    @pytest.mark.parametrize(
        ("arrays", "message"),
        [
            ({"t": np.array([0.0, 20.0]), "w": np.array([1.0, 1j])}, "'w' holds complex128; it must hold real numbers"),
            ({"t": np.array(["a", "b"]), "w": np.ones(2)}, "'t' holds .*; it must hold real numbers"),
            ({"t": np.array([0, 20], dtype="M8[s]"), "w": np.ones(2)}, "'t' holds datetime64"),
            ({"t": np.empty(0), "w": np.empty(0)}, "has no samples"),
            ({"t": np.empty(0), "w": np.empty((0, 2))}, "has no samples"),
            ({"t": np.array(3.0), "w": np.array(1.0)}, r"has 't' of shape \(\) and 'w' of shape \(\)"),
            ({"t": np.ones(2), "w": np.ones((2, 2, 2))}, r"'w' of shape \(2, 2, 2\)"),
            ({"t": np.array([0.0, 20.0]), "w": np.ones((2, 0))}, "has weights for 0 edges"),
            ({"t": np.array([0.0, 20.0])}, "has no array 'w'; it must hold 't' and 'w'"),
            ({"t": np.array([0.0, 20.0]), "w": np.ones(3)}, r"has 't' of shape \(2,\) and 'w' of shape \(3,\)"),
        ],
    )
    def test_npz(self, tmp_path, arrays, message):
        np.savez(tmp_path / "w.npz", **arrays)
        with pytest.raises(ScenarioError, match=message):
            self.read(tmp_path, "w.npz")

    def test_npz_that_is_none(self, tmp_path):
        np.save(tmp_path / "one.npy", np.ones(3))
        (tmp_path / "one.npy").rename(tmp_path / "array.npz")
        np.savez_compressed(tmp_path / "whole.npz", t=np.arange(1000.0), w=np.ones(1000))
        whole = (tmp_path / "whole.npz").read_bytes()
        (tmp_path / "damaged.npz").write_bytes(whole[:80] + bytes(100) + whole[180:])
        (tmp_path / "empty.npz").write_bytes(b"")
        (tmp_path / "text.npz").write_bytes(b"no archive")
        for name in ("array.npz", "damaged.npz", "empty.npz", "text.npz"):
            with pytest.raises(ScenarioError, match=f"{name} is not an npz file of numbers"):
                self.read(tmp_path, name)

    @pytest.mark.parametrize(
        ("name", "message"),
        [
            ("nul\0byte.csv", "cannot be read"),
            ("w" * 300 + ".csv", "cannot be read"),
            ("folder.csv", "cannot be read"),
            ("absent.csv", "absent.csv cannot be read: No such file"),
            ("w.txt", "ends in '.txt'; it must be a .csv or .npz file"),
        ],
    )
    def test_names_that_are_no_files_of_samples(self, tmp_path, name, message):
        (tmp_path / "folder.csv").mkdir()
        (tmp_path / "w.txt").write_text("0,1")
        with pytest.raises(ScenarioError, match=message):
            self.read(tmp_path, name)


HEAD = 'name = "n"\nstop_time = 1.0\n[network]\nagents = 2\nedges = [[1, 2]]\ninitial = [0.0, 1.0]\n'
TAIL = '[weights]\nkind = "constant"\nvalue = 1.0\n[trigger]\nkind = "static"\nthreshold = 0.1\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD + "gain = " + "9" * 400 + "\n" + TAIL, r"\[network\] gain is 9999... \(400 digits\); it must be a fin"),
        (HEAD + "gain = " + "9" * 5000 + "\n" + TAIL, "is not valid TOML: .*4300 digits"),
        (HEAD + "gain = 0x" + "f" * 9000 + "\n" + TAIL, r"\[network\] gain is \d+... \(\d+ digits\)"),
        (HEAD + "gain = " + "[" * 3000 + "]" * 3000 + "\n" + TAIL, "tables or lists are nested too deeply"),
        (HEAD + "g" * 900 + " = 1\n" + TAIL, r"\[network\] has the unknown key 'g+\.\.\."),
        (HEAD + TAIL.replace("1.0", "-1"), r"\[weights\] value is -1.0; it must not be negative"),
    ],
)
@pytest.mark.parametrize("command", ["simulate", "certify"])
def test_command_line_answers_in_one_sentence_with_status_2(tmp_path, capsys, monkeypatch, command, text, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(text)
    with pytest.raises(ScenarioError, match=message):
        load_scenario("s.toml")
    assert main([command, "s.toml"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert len(captured.err) < 400


def test_a_trajectory_that_fills_the_memory_is_refused(capsys):
    assert main(["simulate", "paper-a", "--stop-time", "1e20"]) == 2
    assert "--output-interval 0.1 makes more than 1e+07 points" in capsys.readouterr().err
