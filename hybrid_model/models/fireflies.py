"""Fireflies: oscillators that flash, and advance each other by flashing, until they flash together."""

import numpy as np

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class Fireflies(hm.HybridAutomaton):
    """Fireflies that all see each other, as one automaton.

    Phases grow as ``phase' = 1`` and a firefly flashes at 1: it starts at 0 again, and the phase of every other becomes
    ``min(1, (1 + coupling) phase)``. Who is brought to 1 flashes at the same t, and from then on stays together with
    the one that it was absorbed by. Fireflies due at one instant flash in their order; who flashes does not depend on
    it.

    From almost every start all fireflies come to flash together after finitely many flashes: Mirollo and Strogatz,
    SIAM J. Appl. Math. 50(6), 1645-1662 (1990), whose concave rise is ``log(phase)`` here, raised by
    ``log(1 + coupling)``. Of two fireflies, one has the phase p when the other has just flashed; at the next flash the
    phase is ``(1 + coupling)(1 - p)``, or they are together if that is 1 or more. The fixed point
    ``(1 + coupling)/(2 + coupling)`` repels by the factor ``1 + coupling`` a flash. The model is that of the fireflies
    among the examples of the HyEQ Toolbox (Sanfelice, Copp, Nanez, HSCC 2013), except that an absorbed firefly there
    goes from below 1 to 0 in one jump.
    """

    count = hm.Dimension("number of fireflies")
    phase = hm.State(0.0, shape="count", description="phase of each firefly; it grows by 1 per second", output=True)
    flashes = hm.DiscreteState(
        0, shape="count", integer=True, description="number of flashes of each firefly since the start", output=True
    )
    coupling = hm.Parameter(0.3, description="part by which a flash raises the phases of the others")
    together = hm.Parameter(1e-9, unit="s", description="fireflies due within this time flash in their order")
    flash = hm.Clock("flash", description="ticks with each flash")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """All at the same speed."""
        return {"phase": np.ones(s.phase.shape)}

    def flow_set(self, s: hm.Values) -> Value:
        """All phases between 0 and 1."""
        return hm.least(np.min(s.phase), 1.0 - np.max(s.phase))

    def some_ripe(self, s: hm.Values) -> Value:
        """Some phase is at 1."""
        return np.max(s.phase) - 1.0

    def flash_first(self, s: hm.Values) -> dict[str, Value]:
        """The first firefly at 1, up to `together`, flashes, and the others advance."""
        # Rounding must not decide who is first of those that flash together.
        ripe = np.where(s.phase >= np.max(s.phase) - s.together, 1.0, 0.0)
        first = ripe * np.where(np.add.accumulate(ripe) < 1.5, 1.0, 0.0)
        advanced = np.minimum(1.0, (1.0 + s.coupling) * s.phase)
        return {"phase": np.where(first > 0.5, 0.0, advanced), "flashes": s.flashes + first}

    transitions = (hm.Jump("flash", some_ripe, flash_first),)


class Firefly(hm.HybridAutomaton):
    """One firefly, coupled to others by their numbers of flashes: an input that changes at events only.

    A pulse is a flash of another that this firefly has received and not yet acted on. Each is a jump of its own, so
    several at one instant act one after the other, as in `Fireflies`.
    """

    others = hm.Dimension("number of fireflies that this one sees")
    phase = hm.State(0.0, description="phase; it grows by 1 per second", output=True)
    flashes = hm.DiscreteState(0, integer=True, description="number of flashes since the start", output=True)
    seen = hm.DiscreteState(
        0, integer=True, internal=True, computed=True, description="number of flashes of others acted on"
    )
    received = hm.Input(0.0, shape="others", discrete=True, description="numbers of flashes of the others")
    coupling = hm.Parameter(0.3, description="part by which a flash of another raises the phase")
    flash = hm.Clock("flash", description="ticks with each flash")

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """What was flashed before the start is not acted on."""
        return {"seen": np.sum(s.received)}

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Even speed."""
        return {"phase": 1.0}

    def flow_set(self, s: hm.Values) -> Value:
        """Phase between 0 and 1."""
        return hm.least(s.phase, 1.0 - s.phase)

    def pulse_waits(self, s: hm.Values) -> Value:
        """Some other has flashed."""
        return np.sum(s.received) - s.seen - 0.5

    def advance(self, s: hm.Values) -> dict[str, Value]:
        """Act on one flash of another."""
        return {"phase": np.minimum(1.0, (1.0 + s.coupling) * s.phase), "seen": s.seen + 1}

    def ripe(self, s: hm.Values) -> Value:
        """Phase at 1."""
        return s.phase - 1.0

    def flash_now(self, s: hm.Values) -> dict[str, Value]:
        """Flash and start at 0 again."""
        return {"phase": 0.0, "flashes": s.flashes + 1}

    transitions = (hm.Jump("pulse", pulse_waits, advance), hm.Jump("flash", ripe, flash_now))


class FireflyNetwork(hm.Composition):
    """Fireflies that all see each other, each an automaton of its own: `Firefly` times n, coupled by their flashes.

    Flashes at the times of `Fireflies` with the same start.

    Parameters
    ----------
    phases : sequence of float
        Start phases, one a firefly, between 0 and 1.
    coupling : float
        Part by which a flash raises the phases of the others.
    name : str
        Name of the composition.

    Raises
    ------
    DeclarationError
        If a phase or the coupling is not a finite number.
    """

    def __init__(self, phases: list[float], coupling: float = 0.3, name: str = "FireflyNetwork") -> None:
        names = [f"firefly{k + 1}" for k in range(len(phases))]
        parts = {
            part: Firefly(part, others=len(phases) - 1, phase=phase, coupling=coupling)
            for part, phase in zip(names, phases, strict=True)
        }
        wires = {f"{part}.received": [f"{other}.flashes" for other in names if other != part] for part in names}
        super().__init__(name, parts, wires)
