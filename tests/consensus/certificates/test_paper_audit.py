"""docs/paper-audit.md: each number and each verdict on that page is what the code gives."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.consensus.certificates import counterexamples
from hybrid_model.consensus.certificates.analysis import analyse
from hybrid_model.consensus.certificates.bounds import Bounds
from hybrid_model.consensus.certificates.forms import BOUNDS
from hybrid_model.consensus.certificates.gaps import Gaps
from hybrid_model.consensus.certificates.rates import corollary_rate
from hybrid_model.consensus.certificates.tree_bound import BoundForm, convergence_bound
from hybrid_model.consensus.certificates.verdicts import STATEMENTS, Verdict
from hybrid_model.consensus.excitation.joint import joint_excitation
from hybrid_model.consensus.graphs.spanning_trees import TreePartition
from hybrid_model.consensus.graphs.undirected import weighted_laplacian
from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.runs.report import run_report
from hybrid_model.consensus.scenario.files import load_scenario

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "paper-audit.md"
STAR, PATH = ((1, 2), (1, 3), (1, 4)), ((1, 2), (2, 3), (3, 4))


@pytest.fixture(scope="module")
def example():
    """Bounds and runs of the paper's example with both triggers, and the counterexamples that need runs."""
    found = {}
    for name in ("static", "dynamic"):
        scenario = load_scenario(f"paper-a-{name}")
        arc = hm.simulate(closed_loop(scenario), scenario.stop_time)
        found[name] = (Bounds(analyse(scenario)), run_report(scenario, arc), arc)
    return found


@pytest.fixture(scope="module")
def cases():
    """The counterexamples of each row that has any."""
    return {known.row: [case() for case in known.counterexamples] for known in STATEMENTS if known.counterexamples}


@pytest.fixture(scope="module")
def numbers(example, cases):
    """All numbers of the page by the name that they have there."""
    static, static_run, _ = example["static"]
    dynamic, dynamic_run, arc = example["dynamic"]
    [literal], [gap], [shrinking], [partial], [norm] = (cases[row] for row in ("0b", "e3", "e1'", "d", "c"))
    analysis, printed, valid = static.analysis, static.printed, static.valid
    best = printed.disturbance / -math.expm1(-printed.rate * printed.window)
    corollary = joint_excitation(analysis.scenario)
    literal_window = convergence_bound(analysis.scenario, BoundForm.PRINTED, analysis.tree, 3 * math.pi)
    late = analysis.scenario.trigger.threshold / (Gaps(static).printed_speed * printed.kappa2)
    return {
        "rate by theorem 1, integral of W W'": literal.printed,
        "true rate": literal.actual,
        "largest multiplier with w = g": cases["a"][0].actual,
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
        "minimum gap printed, example, beta = 0": Gaps(static).printed,
        "its limit for late events, example, beta = 0": late,
        "minimum gap improved, example, beta = 0": Gaps(static).improved,
        "minimum gap improved, example, beta = 0.06": Gaps(dynamic).improved,
        "gap observed, example, beta = 0": static_run.min_gap,
        "gap observed, example, beta = 0.06": dynamic_run.min_gap,
        "rho, example": printed.rho,
        "C, example": printed.error_bound,
        "share of disagreement left, vanishing weights": cases["g"][0].actual,
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
def shown(example, cases, numbers):
    """For each row that is not false: whether what its verdict says was found."""
    tree = TreePartition(4, (*PATH, (1, 4)))
    random = np.random.default_rng(411)
    weights, x = random.uniform(0.1, 2, 4), random.standard_normal(4)
    M = tree.Gamma.T @ (tree.R_by_edge * weights) @ tree.R_by_edge.T @ tree.Gamma
    L = weighted_laplacian(4, tree.edges, weights)
    corners = np.array(np.meshgrid(*[[-1, 1]] * 4)).reshape(4, -1)
    alpha, beta, window, t = 0.7, 0.2, 1.0, 3.6
    theta = math.floor(t / window)
    true_term = math.exp(-alpha * t + (alpha - beta) * theta * window)
    printed_term, meant_term = (
        math.exp(-beta * theta * window - sign * alpha * (theta * window - t)) for sign in (1, -1)
    )
    static = convergence_bound(load_scenario("paper-a-static"), BoundForm.PRINTED)
    growth = static.rate * static.window
    theorem = static.disturbance * math.exp(2 * growth) / math.expm1(growth)
    return {
        "0a": np.allclose(tree.psi @ L @ x, tree.Lambda * (M @ tree.psi @ x)),
        # The proof needs a constant that can be larger than the one it uses; the rate is not violated all the same.
        "b": numbers["mu2 of M, example"] > numbers["mu2 of W_tau with w = g^2"]
        and numbers["alpha_v printed, example"] < numbers["Floquet rate, example"],
        "b'": numbers["m_v valid, example"] > 1,
        "d'": math.isclose(true_term, meant_term) and not math.isclose(true_term, printed_term),
        "d''": numbers["kappa_2 printed over kappa_2 needed, example, beta = 0"] > 1 + 1e-9,
        # Events of the run with beta above the rate come faster and faster, and never at once.
        "e1": cases["e1'"][0].actual > 0,
        "f": math.isclose(float(np.max(np.linalg.norm(tree.psi @ corners, axis=0))), 2 * math.sqrt(3))
        and math.isclose(tree.rho, float(np.linalg.norm(tree.R.T, 2))),
        "k": math.isclose(static.kappa2, theorem, rel_tol=1e-12),
        "l": numbers["radius printed, example, beta = 0"] > numbers["radius exact, example, beta = 0"],
        "m": np.allclose(np.ones(4) @ L, 0, atol=1e-13),
    }


def tables():
    """Rows of the page's tables as lists of cells, by the first cell of the header."""
    found = {"row": [], "number": [], "quantity": []}
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


def test_the_page_has_the_verdicts_of_the_table():
    assert tables()["row"] == [[known.row, known.text, known.verdict.value] for known in STATEMENTS]


def test_the_page_has_the_bounds_of_the_table():
    rows = [[row.quantity, row.form, row.quantity.unit, row.source, ", ".join(row.needs)] for row in BOUNDS]
    assert tables()["quantity"] == rows


def test_false_is_what_a_counterexample_violates_and_nothing_else(cases, shown):
    false = {known.row for known in STATEMENTS if known.verdict is Verdict.FALSE}
    assert set(cases) == false
    assert all(case.refutes for found in cases.values() for case in found)
    assert set(shown) == {known.row for known in STATEMENTS} - false
    assert not [row for row, holds in shown.items() if not holds]


def test_the_page_explains_every_row_in_its_section():
    headings = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("## ")]
    explained = {
        row: line.split()[1].rstrip(".")
        for line in headings
        for row in re.findall(r"[(, ]([0a-m][a-h0-9]?'{0,2})(?=[,)])", line)
    }
    assert {known.row: references(known.source)[0].split(".")[0] for known in STATEMENTS} == explained


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
