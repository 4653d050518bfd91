"""What was shown of the paper's statements: one table, read by `certify`, docs/paper-audit.md and the tests.

False is only what a counterexample violates, and the table holds it. A proof that does not work is a gap: it says
nothing against the statement.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass

from hybrid_model.consensus.certificates import counterexamples
from hybrid_model.consensus.certificates.counterexamples import Counterexample

__all__ = ["STATEMENTS", "Statement", "Verdict", "statement"]


class Verdict(enum.Enum):
    """What was shown of a statement."""

    CORRECT = "correct"
    """It holds as printed."""
    FALSE = "false"
    """A counterexample violates it."""
    GAP = "gap"
    """A step of its proof does not hold or is missing; no counterexample is known, so whether it holds is open."""
    LOOSE = "loose"
    """It holds, and can be improved for nothing."""
    TYPO = "typo"
    """Its context shows that something else is meant."""


@dataclass(frozen=True)
class Statement:
    """One statement of the paper.

    Parameters
    ----------
    row : str
        Its name in the table.
    text : str
        What is stated.
    verdict : Verdict
        What was shown.
    source : str
        Where docs/paper-audit.md explains it.
    counterexamples : tuple of callable
        Cases that violate it; none unless the verdict is FALSE.
    """

    row: str
    text: str
    verdict: Verdict
    source: str
    counterexamples: tuple[Callable[[], Counterexample], ...] = ()

    @property
    def remark(self) -> str:
        """The verdict and where it is explained, for a line beside a number."""
        words = {
            Verdict.FALSE: "false by a counterexample",
            Verdict.GAP: "gap in the proof; whether it holds is open",
            Verdict.LOOSE: "holds, and can be improved",
        }
        return f"{words.get(self.verdict, self.verdict.value)}: {self.source}"


def statement(row: str) -> Statement:
    """The statement of a row; KeyError if there is none."""
    return _BY_ROW[row]


STATEMENTS = (
    Statement("0a", "network model, edge states, tree coordinates, psi", Verdict.CORRECT, "audit, section 1"),
    Statement(
        "0b",
        '"W is persistently exciting" by definition 1 with g = W, in theorem 1',
        Verdict.FALSE,
        "audit, section 2",
        (counterexamples.literal_excitation,),
    ),
    Statement(
        "a",
        "weights of the simulation, w = g, bring consensus",
        Verdict.FALSE,
        "audit, section 9",
        (counterexamples.signed_weights,),
    ),
    Statement("b", "rate alpha_v of theorem 1 with mu2 of W_tau", Verdict.GAP, "audit, section 3"),
    Statement("b'", "factor m_v, left open", Verdict.GAP, "audit, section 3"),
    Statement(
        "c",
        "the integral of norm(M) is at most mu2",
        Verdict.FALSE,
        "audit, section 5.1",
        (counterexamples.integrated_norm,),
    ),
    Statement(
        "d",
        "eq. (7), a geometric sum with theta terms",
        Verdict.FALSE,
        "audit, section 5.2",
        (counterexamples.partial_window,),
    ),
    Statement("d'", "exponent -alpha(theta T - t)", Verdict.TYPO, "audit, section 5.2"),
    Statement("d''", "kappa_2 covers the sum", Verdict.LOOSE, "audit, section 5.2"),
    Statement("e1", "no Zeno behaviour if beta is greater than alpha_v", Verdict.LOOSE, "audit, section 6"),
    Statement(
        "e1'",
        "then gaps have a positive lower bound for all time",
        Verdict.FALSE,
        "audit, section 6",
        (counterexamples.shrinking_gaps,),
    ),
    Statement(
        "e2",
        "x' is -k D W D'x(t1) up to the next event",
        Verdict.FALSE,
        "audit, section 6",
        (counterexamples.derivative_on_a_path,),
    ),
    Statement(
        "e3",
        "minimum gap with kappa_1 + kappa_2",
        Verdict.FALSE,
        "audit, section 6",
        (counterexamples.minimum_gap,),
    ),
    Statement("f", "rho and C", Verdict.CORRECT, "audit, section 4"),
    Statement(
        "g",
        "corollary on switching topologies",
        Verdict.FALSE,
        "audit, section 8",
        (counterexamples.vanishing_weights, counterexamples.no_common_tree),
    ),
    Statement(
        "h",
        "beta = 0.06 is below alpha_v in the example",
        Verdict.FALSE,
        "audit, section 9",
        (counterexamples.decay_of_the_example,),
    ),
    Statement(
        "k",
        "kappa_2 in theorem 2 and at the end of its proof agree for beta = 0",
        Verdict.CORRECT,
        "audit, section 5.2",
    ),
    Statement("l", "radius rho kappa_2 of theorem 2, proved by c and d", Verdict.GAP, "audit, section 5.2"),
    Statement("m", "the average is conserved", Verdict.CORRECT, "audit, section 12"),
)
"""All statements that were checked, in the order of the paper."""

_BY_ROW = {known.row: known for known in STATEMENTS}
