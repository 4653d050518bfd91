"""Is this a hybrid arc of that automaton? A verifier that shares no code with the simulator.

Where the simulator locates events and goes from one to the next, the verifier only looks at samples: the automaton's
maps are evaluated there, and between them the flow map is integrated by another method. So it checks the simulator as
it checks a hand-written loop, another tool, or measured data. See `hybrid_model.verification.flows` and
`hybrid_model.verification.jumps`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.arguments import require_automaton, require_inputs, require_options, require_starts
from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.calls import explained
from hybrid_model.declare.signals import InputValue
from hybrid_model.errors import DataError
from hybrid_model.progress import Counted, Wanted
from hybrid_model.record.arc import HybridArc
from hybrid_model.record.samples import Samples
from hybrid_model.verification.flows import FlowCheck
from hybrid_model.verification.jumps import JumpCheck
from hybrid_model.verification.report import Findings, Verification
from hybrid_model.verification.slack import Slack
from hybrid_model.verification.subject import Subject, Tolerances


@explained(tolerances=Tolerances)
def verify(
    automaton: Automaton,
    data: Any,
    *,
    inputs: Mapping[str, InputValue] | None = None,
    starts: Mapping[str, npt.ArrayLike] | None = None,
    tolerances: Tolerances | None = None,
    method: str = "LSODA",
    progress: Wanted = None,
) -> Verification:
    """Check whether samples are a hybrid arc of an automaton, by the definition of Goebel, Sanfelice and Teel.

    Hybrid Dynamical Systems (2012), definition 2.6, and the rules of docs/semantics.md: hybrid time counts as it must;
    numbers are finite; flows stay in the flow set, follow the flow map, keep discrete states, and pass by neither a
    jump that is due nor a time event; every jump is one of the automaton's that is due, and lands where its map leads.
    Between two samples the sets are looked at in nine places and at the peaks that these show: an excursion that is
    much shorter than the gap between two samples can stay unseen. Two jumps that become due at one instant within the
    tolerances may come in either order.

    Parameters
    ----------
    automaton : Automaton
        With the parameter values of the run.
    data : HybridArc, Samples or pandas.DataFrame
        All states at points of hybrid time, both sides of every jump; see `Samples` for tables and files.
    inputs : mapping, optional
        Input name -> number, array, function of time or `Signal`, as in `simulate`. Functions are called between the
        first and the last time of the data only. An input that is not given is read
        off the data: those of an arc at every time; a discrete one of samples holds from each sample to the next, a
        continuous one runs straight. One that the data do not have keeps its start value.
    starts : mapping, optional
        As in `simulate`: the values of parameters and inputs of that run in place of the declared ones. The states that
        it began with are in the data.
    tolerances : Tolerances, optional
        How exact the samples are.
    method : str
        Integrator of ``scipy.integrate.solve_ivp`` for the flow map, by its name; one that the simulation has not used.
    progress : bool or callable, optional
        Whether to tell on stderr how far it is and how long it takes, once it has taken two seconds: by default where
        that is a terminal; or who is told, ``progress(done, total)``.

    Returns
    -------
    Verification
        Its `ok`, and its `violations` with hybrid time, rule and sentence.

    Raises
    ------
    DataError
        If the data are no samples, or none at all, or a state is missing or has the wrong shape.
    DeclarationError
        If `automaton` is no instance of an automaton, an input is unknown, or a value has the wrong shape.
    SimulationError
        For options of another type, and a method of another name.
    """
    require_automaton("verify", automaton)
    require_inputs(inputs)
    require_starts(starts)
    require_options("tolerances", tolerances, Tolerances, first="rtol")
    data = data if isinstance(data, HybridArc) else _samples(data)
    if isinstance(data, Samples) and not len(data):
        raise DataError(
            f"the data hold no sample, so nothing can be said about {automaton.name}: give at least one row."
        )
    subject = Subject(automaton, data, inputs, starts)
    slack = Slack(subject, tolerances or Tolerances())
    findings = Findings(subject.samples)
    usable = _finite(subject, findings)
    _hybrid_time(subject.samples, findings)
    flows = list(_flows(subject.samples, usable))
    jumps = np.flatnonzero((np.diff(subject.samples.j) == 1) & usable[:-1] & usable[1:])
    t = subject.samples.t
    pieces = sum((last - first) * (1 + int(t[last] > t[first])) for first, last in flows) + len(jumps)
    with Counted(f"verifying {automaton.name}", pieces, progress) as work:
        flow_check = FlowCheck(subject, slack, findings, method, work.note)
        for first, last in flows:
            flow_check.check(first, last)
        jump_check = JumpCheck(subject, slack, findings)
        for k in jumps:
            jump_check.check(int(k))
            work.note()
    lengths = [subject.samples.t[last] - subject.samples.t[first] for first, last in flows]
    return Verification(
        automaton.name, findings.violations(), len(subject.samples), int(np.sum(np.array(lengths) > 0.0)), len(jumps)
    )


def _samples(data: Any) -> Samples:
    if isinstance(data, Samples):
        return data
    if hasattr(data, "columns") and hasattr(data, "reset_index"):
        return Samples.from_dataframe(data)
    if isinstance(data, (str, Path)):
        raise DataError(
            f"{data} is the name of a file: write hm.Samples.from_csv({str(data)!r}), or hm.load_arc for .npz."
        )
    raise DataError(f"a {type(data).__name__} holds no samples of a run: give a HybridArc, Samples or a DataFrame.")


def _finite(subject: Subject, findings: Findings) -> npt.NDArray[np.bool_]:
    """Report what is not finite, and return which samples can be used."""
    samples = subject.samples
    table = np.column_stack([samples.t, subject.x, subject.z])
    names = ["t", *subject.names]
    bad = ~np.isfinite(table)
    for k in np.flatnonzero(np.any(bad, axis=1)):
        i = int(np.argmax(bad[k]))
        findings.add(int(k), 10, "finite", f"{names[i]} is {table[k, i]}: states and times are finite numbers.")
    return np.asarray(~np.any(bad, axis=1))


def _hybrid_time(samples: Samples, findings: Findings) -> None:
    """Check that t never falls, that j counts jumps one by one, and that jumps take no time."""
    for k, (dt, dj) in enumerate(zip(np.diff(samples.t), np.diff(samples.j), strict=True)):
        t0, t1 = samples.t[k : k + 2]
        if dj not in (0, 1):
            findings.add(k + 1, 1, "count", f"j goes from {samples.j[k]} to {samples.j[k + 1]}: it counts one by one.")
        elif dt < 0.0:
            findings.add(k + 1, 1, "order of time", f"t goes back from {t0:.9g} s to {t1:.9g} s.")
        elif dj == 1 and dt > 0.0:
            findings.add(k + 1, 1, "instant", f"t goes from {t0:.9g} s to {t1:.9g} s in a jump: jumps take no time.")


def _flows(samples: Samples, usable: npt.NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Yield the first and the last sample of every stretch of one j along which t does not fall."""
    first = 0
    for k in range(1, len(samples) + 1):
        joined = (
            k < len(samples)
            and usable[k - 1]
            and usable[k]
            and samples.j[k] == samples.j[k - 1]
            and samples.t[k] >= samples.t[k - 1]
        )
        if not joined:
            if usable[k - 1]:
                yield first, k - 1
            first = k
