"""docs/paper-audit.md: each number and each verdict on that page is what the code gives."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hybrid_model as hm
from fmu.compiled import compiled
from hybrid_model.consensus import counterexamples
from hybrid_model.consensus.analysis import analyse
from hybrid_model.consensus.bounds import Bounds
from hybrid_model.consensus.certificates import BoundForm, convergence_bound
from hybrid_model.consensus.corollary import corollary_rate
from hybrid_model.consensus.excitation import Signal, signal_factor
from hybrid_model.consensus.graphs import weighted_laplacian
from hybrid_model.consensus.joint_excitation import joint_excitation
from hybrid_model.consensus.network import closed_loop
from hybrid_model.consensus.report import run_report
from hybrid_model.consensus.scenario import load_scenario
from hybrid_model.consensus.spanning_trees import TreePartition
from hybrid_model.consensus.weights import WeightMap

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "paper-audit.md"
STAR, PATH = ((1, 2), (1, 3), (1, 4)), ((1, 2), (2, 3), (3, 4))


def largest_signed_multiplier():
    """Of the example with the signed weights w = g: the absolute ones with the sign of the sine."""
    scenario = load_scenario("paper-a")
    waveforms = tuple(replace(w, map=WeightMap.ABS) for w in scenario.weights.waveforms)
    scenario = replace(scenario, weights=replace(scenario.weights, waveforms=waveforms))
    factor, flow = signal_factor(scenario, Signal.DISAGREEMENT), np.eye(3)
    for piece in scenario.edge_weights.pieces(0.0, 2 * math.pi):
        if not piece.is_idle:
            sign = np.sign(np.sin(5 * (piece.start + piece.end) / 2))
            dose = sign * float(piece.shared_carrier.integral(piece.start, piece.end))
            values, vectors = np.linalg.eigh((factor * piece.amplitudes) @ factor.T)
            flow = (vectors * np.exp(-dose * values)) @ vectors.T @ flow
    return float(np.max(np.abs(np.linalg.eigvals(flow))))


@pytest.fixture(scope="module")
def example():
    """Bounds and runs of the paper's example with both triggers, and the counterexamples that need runs."""
    found = {}
    for name in ("static", "dynamic"):
        scenario = load_scenario(f"paper-a-{name}")
        arc = hm.simulate(compiled(closed_loop(scenario)), scenario.stop_time)
        found[name] = (Bounds(analyse(scenario)), run_report(scenario, arc), arc)
    return found


@pytest.fixture(scope="module")
def numbers(example):
    """All numbers of the page by the name that they have there."""
    static, static_run, _ = example["static"]
    dynamic, dynamic_run, arc = example["dynamic"]
    literal, gap = counterexamples.literal_excitation(), counterexamples.minimum_gap()
    shrinking, partial = counterexamples.shrinking_gaps(), counterexamples.partial_window()
    norm = counterexamples.integrated_norm(3)
    analysis, printed, valid = static.analysis, static.printed, static.valid
    best = printed.disturbance / -math.expm1(-printed.rate * printed.window)
    corollary = joint_excitation(analysis.scenario)
    literal_window = convergence_bound(analysis.scenario, BoundForm.PRINTED, analysis.tree, 3 * math.pi)
    late = analysis.scenario.trigger.threshold / (static.printed_speed * printed.kappa2)
    return {
        "rate by theorem 1, integral of W W'": literal.printed,
        "true rate": literal.actual,
        "largest multiplier with w = g": largest_signed_multiplier(),
        "mu1 of W_tau with w = g^2": analysis.tree_weights.mu1,
        "mu2 of W_tau with w = g^2": analysis.tree_weights.mu2,
        "integral of g_1^2 over pi s, per time of one opening": float(
            (wave := analysis.scenario.weights.waveforms[0]).integral(0.0, math.pi)
        )
        / (math.pi / 2 * wave.duty_percent / 100),
        "alpha_v printed, example": printed.rate,
        "alpha_v valid, example": valid.rate,
        "rate improved, example": static.improved_rate,
        "Floquet rate, example": static.floquet_rate,
        "m_v valid, example": valid.overshoot,
        "integral of norm(M) over mu2, three directions": norm.actual / norm.printed,
        "mu2 of M, example": analysis.tree_coordinates.mu2,
        "mu2bar of M, example": analysis.tree_coordinates.mu2_bar,
        "eq. (7) at half a window": partial.printed,
        "integral at half a window": partial.actual,
        "kappa_2 printed over kappa_2 needed, example, beta = 0": printed.kappa2 / best,
        "radius printed, example, beta = 0": static.printed_radius,
        "radius valid, example, beta = 0": static.valid_radius,
        "radius energy, example, beta = 0": static.energy_radius,
        "radius exact, example, beta = 0": static.exact_radius,
        "shortest gap, first 3 s": shrinking.printed,
        "shortest gap, next 3 s": shrinking.actual,
        "derivative over its stated bound, example, beta = 0.06": counterexamples.derivative_at_own_event(
            dynamic.analysis.scenario, arc, 20_000
        ).actual,
        "minimum gap printed, two agents": gap.printed,
        "gap observed, two agents": gap.actual,
        "minimum gap with kappa_2 alone, two agents": counterexamples.corrected_gap_without_kappa1(),
        "minimum gap printed, example, beta = 0": static.printed_gap,
        "its limit for late events, example, beta = 0": late,
        "minimum gap improved, example, beta = 0": static.improved_gap,
        "minimum gap improved, example, beta = 0.06": dynamic.improved_gap,
        "gap observed, example, beta = 0": static_run.min_gap,
        "gap observed, example, beta = 0.06": dynamic_run.min_gap,
        "rho, example": printed.edge_factor,
        "C, example": printed.error_bound,
        "share of disagreement left, vanishing weights": counterexamples.vanishing_weights().actual,
        "alpha_v printed with the corollary's window 3 pi, example": literal_window.rate,
        "mu1 of N guaranteed by the repaired corollary, example": corollary.mu1_of_paths,
        "mu1 of N, example": analysis.disagreement.mu1,
        "rate by the repaired corollary, example": corollary_rate(corollary, 1.0),
        "largest certifiable alpha_v, star": counterexamples.certifiable_rate(4, STAR, 0.4 * math.pi),
        "largest certifiable alpha_v, path": counterexamples.certifiable_rate(4, PATH, 0.4 * math.pi),
        "mean of the states at 50 s, example": float(dynamic_run.x_end.mean()),
        "events, example, beta = 0": sum(static_run.events_per_agent),
        "events, example, beta = 0.06": sum(dynamic_run.events_per_agent),
    }


@pytest.fixture(scope="module")
def verdicts(numbers):
    """The verdict of each row, from what decides about it."""
    cases = counterexamples

    def judged(is_true, otherwise):
        return "correct" if is_true else otherwise

    tree = TreePartition(4, (*PATH, (1, 4)))
    random = np.random.default_rng(411)
    weights, x = random.uniform(0.1, 2, 4), random.standard_normal(4)
    M = tree.Gamma.T @ (tree.R_by_edge * weights) @ tree.R_by_edge.T @ tree.Gamma
    L = weighted_laplacian(4, tree.edges, weights)
    corners = np.array(np.meshgrid(*[[-1, 1]] * 4)).reshape(4, -1)
    alpha, beta, window, t = 0.7, 0.2, 1.0, 3.6
    theta = math.floor(t / window)
    true_term = math.exp(-alpha * t + (alpha - beta) * theta * window)
    printed_term = math.exp(-beta * theta * window - alpha * (theta * window - t))
    static = convergence_bound(load_scenario("paper-a-static"), BoundForm.PRINTED)
    growth = static.rate * static.window
    theorem = static.disturbance * math.exp(2 * growth) / math.expm1(growth)
    on_edges_outside = numbers["mu2 of M, example"] > numbers["mu2 of W_tau with w = g^2"]
    best_tree = max(numbers["largest certifiable alpha_v, star"], numbers["largest certifiable alpha_v, path"])
    return {
        "0a": judged(np.allclose(tree.psi @ L @ x, tree.Lambda * (M @ tree.psi @ x)), "false"),
        "0b": judged(not cases.literal_excitation().refutes, "false"),
        "a": judged(numbers["largest multiplier with w = g"] <= 1, "false"),
        "b": judged(not on_edges_outside, "gap"),
        "b'": judged(numbers["m_v valid, example"] <= 1, "gap"),
        "c": judged(not cases.integrated_norm(3).refutes, "false"),
        "d": judged(not cases.partial_window().refutes, "false"),
        "d'": judged(math.isclose(true_term, printed_term), "typo"),
        "d''": judged(numbers["kappa_2 printed over kappa_2 needed, example, beta = 0"] <= 1 + 1e-9, "loose"),
        "e1": judged(not cases.shrinking_gaps().refutes, "false"),
        "e2": judged(numbers["derivative over its stated bound, example, beta = 0.06"] <= 1, "false"),
        "e3": judged(not cases.minimum_gap().refutes, "false"),
        "f": judged(
            math.isclose(float(np.max(np.linalg.norm(tree.psi @ corners, axis=0))), 2 * math.sqrt(3))
            and math.isclose(tree.rho, float(np.linalg.norm(tree.R.T, 2))),
            "false",
        ),
        "g": judged(not cases.vanishing_weights().refutes and not cases.no_common_tree(100.0).refutes, "false"),
        "h": judged(best_tree > 0.06, "false"),
        "k": judged(math.isclose(static.kappa2, theorem, rel_tol=1e-12), "false"),
        "m": judged(np.allclose(np.ones(4) @ L, 0, atol=1e-13), "false"),
    }


def tables():
    """Rows of the page's tables as lists of cells, by the first cell of the header."""
    found = {"row": [], "number": []}
    kind = None
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else []
        if not cells:
            kind = None
        elif kind is None:
            kind = cells[0]
        elif set(line) - set("|-"):
            found[kind].append(cells)
    return found


def half_a_unit(text):
    """Half a unit in the last place that is written."""
    mantissa, _, exponent = text.partition("e")
    decimals = len(mantissa.partition(".")[2])
    return 0.5 * 10.0 ** (int(exponent or 0) - decimals)


def test_every_number_of_the_page_is_what_the_code_gives(numbers):
    rows = tables()["number"]
    assert {name for name, *_ in rows} == set(numbers)
    wrong = []
    for name, text, unit in rows:
        # A tenth of the last place for what rounding to the nearest leaves to the numerics.
        if abs(numbers[name] - float(text)) > 1.1 * half_a_unit(text):
            wrong.append((name, text, numbers[name]))
        assert unit in {"1", "s", "1/s"}
    assert not wrong


def test_every_verdict_of_the_page_is_what_the_code_gives(verdicts):
    assert {row: verdict for row, _, verdict in tables()["row"]} == verdicts


def test_the_page_explains_every_row(verdicts):
    headings = " ".join(line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("## "))
    explained = set(re.findall(r"[(, ]([0a-m][a-h0-9]?'{0,2})(?=[,)])", headings))
    assert set(verdicts) <= explained


REFERENCE = re.compile(r"audit,?\s+(?:#\s*)?(?:end\s+of\s+)?sections?\s+((?:\d[\d.]*(?:, (?=\d)| and | to )?)+)")


def sections():
    """Numbers of the page's sections."""
    return set(re.findall(r"^#{2,3} (\d+(?:\.\d+)?)\.? ", PAGE.read_text(encoding="utf-8"), re.MULTILINE))


def references(text):
    """Numbers of the sections that a text refers to."""
    return [number for match in REFERENCE.findall(text) for number in re.findall(r"\d+(?:\.\d+)*", match)]


def test_references_are_found_however_they_are_written():
    text = (
        "(audit, section 5.2) audit section 1. audit, sections 3 to 5) audit, end of section 5.2; audit,\n section 11"
    )
    assert references(text) == ["5.2", "1", "3", "5", "5.2", "11"]


def test_every_section_that_the_package_refers_to_is_on_the_page():
    files = [path for folder in ("hybrid_model", "cosim", "fmu", "docs") for path in (ROOT / folder).rglob("*.*")]
    texts = {path: path.read_text(encoding="utf-8") for path in files if path.suffix in {".py", ".md", ".toml"}}
    found = {path: references(text) for path, text in texts.items()}
    assert sum(map(len, found.values())) > 50
    known = sections()
    missing = {str(path.relative_to(ROOT)): set(numbers) - known for path, numbers in found.items()}
    assert not {path: numbers for path, numbers in missing.items() if numbers}
    # No other page of that name, and no reference that the pattern above does not see.
    for path, text in texts.items():
        assert not re.search(r"(?<!paper-)audit\.md", text), path
        for match in re.finditer(r"\baudit\b", text):
            near = text[match.start() : match.start() + 60]
            assert REFERENCE.match(near) or is_the_page(text, match.start(), near), (path, near)


def is_the_page(text, place, near):
    """Whether the word belongs to the page's own name, or to the sentences that say what "audit" means."""
    return text[:place].endswith("paper-") or near.startswith(("audit" + chr(34), "audit, section N", "audit = docs/"))
