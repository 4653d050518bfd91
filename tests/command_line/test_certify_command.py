"""`hybrid-fmu certify` as its users see it."""

import json

import matplotlib.pyplot as plt
import pytest
from small_scenario import small_scenario

from cosim.cli.main import main


@pytest.fixture
def scenario(tmp_path):
    """Write a scenario with some entries changed."""

    def write(**changes):
        path = tmp_path / "small.toml"
        path.write_text(small_scenario(stop_time=3.0, **changes))
        return str(path)

    return write


def test_json_object(scenario, capsys):
    assert main(["certify", scenario(), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found) == ["rate", "radius", "min_gap", "pe", "notes"]
    radius, gap = found["radius"], found["min_gap"]
    assert radius["observed"] <= radius["exact"] <= radius["energy"] <= radius["valid"]
    assert gap["valid"] <= gap["improved"] <= gap["observed"]
    # The path on three agents: the Laplacian's eigenvalues are 1 and 3.
    assert found["rate"]["floquet"] == pytest.approx(1.0, rel=1e-9)
    assert found["rate"]["valid"] <= found["rate"]["improved"] <= 1.0


def test_details(scenario, capsys):
    assert main(["certify", scenario(), "--json", "--details"]) == 0
    found = json.loads(capsys.readouterr().out)
    exact = next(v for v in found["details"] if (v["quantity"], v["form"]) == ("radius", "exact"))
    assert exact["value"] == found["radius"]["exact"]
    assert exact["unit"] == "unit of x"
    assert "section 7" in exact["source"]
    assert {h["name"] for h in found["hypotheses"]} >= set(exact["needs"])


def test_table(scenario, capsys):
    assert main(["certify", scenario(kind="dynamic", more="decay = 0.7")]) == 0
    text = capsys.readouterr().out
    assert "rate of convergence [1/s]" in text
    assert "ultimate radius of ||x_e|| [unit of x, times exp(-0.7 t)]" in text
    assert "holds  beta below the Floquet rate: beta is 0.7/s, the Floquet rate 1/s." in text


def test_a_disconnected_union_is_null_and_said(scenario, capsys):
    assert main(["certify", scenario(value="[1.0, 0.0]"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["rate"]["floquet"] is None
    assert found["radius"]["exact"] is None
    assert "Hypothesis 'connected union' fails" in found["notes"][0]
    assert "{1, 2} and {3}" in found["notes"][0]


def test_an_unknown_preset_is_wrong_usage(capsys):
    assert main(["certify", "nowhere"]) == 2
    assert "no preset 'nowhere'" in capsys.readouterr().err


def test_thresholds_that_vanish_too_fast_are_named_and_cut_the_run(scenario, capsys):
    """beta = 3/s above the rate 1/s: events grow ever denser, and the bounds that are left are given all the same."""
    path = scenario(kind="dynamic", more="decay = 3.0")
    assert main(["certify", path, "--json", "--max-jumps", "500"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["radius"]["exact"] is None
    assert found["rate"]["floquet"] == pytest.approx(1.0, rel=1e-9)
    notes = " ".join(found["notes"])
    assert "beta below the Floquet rate' fails" in notes
    assert "The run ended before the stop time" in notes
    assert main(["certify", path, "--max-jumps", "0"]) == 2
    assert "--max-jumps '0': give a whole number, 1 or more." in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changes", "missing"),
    [
        ({}, ()),
        ({"value": "[1.0, 0.0]"}, ()),
        ({"kind": "dynamic", "more": "decay = 3.0"}, ()),
        ({"value": "1e-6"}, ()),
        ({"kind": "relative", "threshold": "", "more": "sigma = 0.5\nfloor = 0.01"}, ("errors",)),
    ],
    ids=["plain", "disconnected", "vanishing", "without broadcasts", "relative"],
)
def test_figures_are_written_with_the_certificates(scenario, tmp_path, capsys, changes, missing):
    out = tmp_path / "found"
    # Both formats, which is the default, are written once.
    formats = ["--figure-format", "png"] if changes else []
    assert main(["certify", scenario(**changes), "--json", "--max-jumps", "200", "--out", str(out), *formats]) == 0
    assert json.loads((out / "certificates.json").read_text()) == json.loads(capsys.readouterr().out)
    names = {"states", "edge_norm", "broadcasts", "gaps", "errors", "conservatism"} - set(missing)
    drawn = {path.stem for path in out.glob("*.png")}
    # Without a number to measure bounds by there is no conservatism to draw.
    assert names - {"conservatism"} <= drawn <= names
    assert {path.stem for path in out.glob("*.pdf")} == (set() if changes else drawn)
    for path in out.glob("*.png"):
        pixels = plt.imread(path)
        assert min(pixels.shape[:2]) > 200
        assert pixels.std() > 0.01
