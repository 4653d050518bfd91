"""The presets, and every number and every example on their pages."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from oracles.exact_consensus import exact_run
from scipy.linalg import expm

import hybrid_model as hm
from hybrid_model.consensus.certificates.windows import RateForm, best_window, rate_over_window
from hybrid_model.consensus.exact.floquet import floquet_spectrum, transition_matrix
from hybrid_model.consensus.excitation.persistence import Signal, signal_factor
from hybrid_model.consensus.graphs.undirected import complete_edges
from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.runs.report import edge_norm, run_report
from hybrid_model.consensus.scenario.files import load_scenario
from hybrid_model.consensus.scenario.sources import preset_names
from hybrid_model.consensus.weights.gated_sine import WeightMap

DOCS = Path(__file__).parents[3] / "docs"
PAGE = (DOCS / "presets.md").read_text(encoding="utf-8")
VARIANTS = [name for name in preset_names() if name.startswith("paper-")]


def rows(heading):
    """Cells of the table rows that begin with the name of a preset, below a heading."""
    section = PAGE.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    found = re.findall(r"^\| `([\w.-]+)` \|(.*)\|$", section, flags=re.MULTILINE)
    return {name: [cell.strip() for cell in cells.split("|")] for name, cells in found}


RUNS = rows("What each reading gives")
RATES = rows("Rates that follow from excitation constants")


def agrees(text, value):
    """Whether a number is printed right: half a unit of its last digit, and a little for the value's own error."""
    mantissa, _, exponent = text.partition("e")
    unit = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return abs(float(text) - value) <= 0.5 * unit * (1 + 1e-6) + 1e-9


def test_every_preset_has_its_row():
    assert set(RUNS) == set(VARIANTS)
    assert set(RATES) == {name for name in VARIANTS if load_scenario(name).edge_weights.period is not None}


@pytest.mark.parametrize("name", VARIANTS)
def test_period_and_rate_are_those_on_the_page(name):
    scenario = load_scenario(name)
    period, rate = RUNS[name][:2]
    if scenario.edge_weights.period is None:
        assert period == "none"
        assert agrees(rate.removesuffix("*"), -math.log(np.linalg.norm(transition_matrix(scenario, 0.0, 50.0), 2)) / 50)
    else:
        assert agrees(period, scenario.edge_weights.period)
        assert agrees(rate, floquet_spectrum(scenario).rate)
        assert scenario.trigger.decay < floquet_spectrum(scenario).rate


@pytest.mark.parametrize("name", VARIANTS)
@pytest.mark.parametrize(("trigger", "first"), [("static", 2), ("dynamic", 6)])
def test_events_and_final_disagreement_are_those_on_the_page(name, trigger, first):
    scenario = load_scenario(f"{name}-{trigger}")
    events, total, gap, disagreement = RUNS[name][first : first + 4]
    run = exact_run(scenario)
    assert run.counts == [int(count) for count in events.split(",")]
    assert sum(run.counts) == int(total)
    assert agrees(gap, run.min_gap)
    assert agrees(disagreement, edge_norm(scenario, run.x_end))


@pytest.mark.parametrize("name", [name for name in VARIANTS if name != "paper-a"])
def test_the_closed_loop_runs_like_the_exact_solution(name):
    scenario = load_scenario(name)
    report = run_report(scenario, hm.simulate(closed_loop(scenario), scenario.stop_time))
    run = exact_run(scenario)
    assert report.events_per_agent == run.counts
    for times, expected in zip(report.event_times, run.event_times, strict=True):
        np.testing.assert_allclose(times, expected, rtol=0, atol=1e-7)  # the limits
    np.testing.assert_allclose(report.x_end, run.x_end, rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", list(RATES))
def test_certified_rates_are_those_on_the_page(name):
    scenario = load_scenario(name)
    period = scenario.edge_weights.period
    printed, valid, improved, best, window = RATES[name]
    rates = [rate_over_window(scenario, form, period) for form in RateForm]
    for text, rate in zip((printed, valid, improved), rates, strict=True):
        assert agrees(text, rate)
        assert rate < 0.06  # the paper's beta: no certificate of this kind reaches it
    assert rates[1] <= rates[2] <= floquet_spectrum(scenario).rate
    assert float(best) < 0.06
    assert agrees(best, rate_over_window(scenario, RateForm.IMPROVED, refined(scenario, window)))


def refined(scenario, window):
    """The best window near the one on the page, which gives three decimals of it."""
    near = float(window)
    found = best_window(scenario, RateForm.IMPROVED, shortest=0.999 * near, longest=1.001 * near)
    assert abs(found.window - near) < 2e-3
    return found.window


def test_the_signed_reading_is_unstable():
    # w = g: on each piece the active edges share 2 sin(5 t), whose integral is (2/5)(cos 5a - cos 5b).
    scenario = load_scenario("paper-a")
    factor, weights = signal_factor(scenario, Signal.DISAGREEMENT), scenario.edge_weights
    flow, total = np.eye(3), np.zeros(4)
    for piece in weights.pieces(0.0, 2 * math.pi):
        dose = 2 / 5 * (math.cos(5 * piece.start) - math.cos(5 * piece.end))
        flow = expm(-dose * (factor * piece.amplitudes) @ factor.T) @ flow
        total += dose * np.array(
            [float(w.amplitude((piece.start + piece.end) / 2)) for w in scenario.weights.waveforms]
        )
    multipliers = sorted(np.abs(np.linalg.eigvals(flow)), reverse=True)
    printed = re.search(r"are ([\d.]+), ([\d.]+) and ([\d.]+)\.", PAGE).groups()
    assert all(agrees(text, value) for text, value in zip(printed, multipliers, strict=True))
    np.testing.assert_allclose(total, 0.0, atol=1e-14)


class TestVariantsDifferFromScenarioAInOnePoint:
    def test_map(self):
        other = load_scenario("paper-a-abs")
        assert {wave.map for wave in other.weights.waveforms} == {WeightMap.ABS}
        assert other.switching == load_scenario("paper-a").switching

    def test_no_switching_and_one_tree(self):
        paper, all_edges, tree = (load_scenario(name) for name in ("paper-a", "paper-a0", "paper-t"))
        assert all_edges.weights == paper.weights
        assert all_edges.switching.period == tree.switching.period == 0.0
        assert tree.network.edges == paper.network.edges[:3]
        assert tree.weights.waveforms == paper.weights.waveforms[:3]
        assert len(tree.network.underlying_edges) == 6

    def test_lexicographic_edges(self):
        other = load_scenario("paper-b")
        assert other.network.underlying_edges == complete_edges(4)
        duties = [wave.duty_percent for wave in other.weights.waveforms]
        assert duties == pytest.approx([20 - i * 0.1 * math.pi for i in range(5)], rel=1e-15)
        assert other.switching.active == ((1, 2, 3), (3, 4, 5))

    def test_phases(self):
        waves = load_scenario("paper-c").weights.waveforms
        assert [wave.phase for wave in waves] == pytest.approx([i * 0.1 * math.pi for i in range(4)], rel=1e-15)
        assert {wave.duty_percent for wave in waves} == {20.0}

    @pytest.mark.parametrize(
        ("suffix", "dwell"), [("half-pi", math.pi / 2), ("two-pi", 2 * math.pi), ("5", 5.0), ("2.5", 2.5)]
    )
    def test_dwell_times(self, suffix, dwell):
        other, paper = load_scenario(f"paper-a-dwell-{suffix}"), load_scenario("paper-a")
        assert other.switching.dwell == dwell
        assert (other.network, other.weights, other.trigger) == (paper.network, paper.weights, paper.trigger)
