"""What an agent hears: a receiver that passes broadcasts on, or a channel that delays them and loses some."""

from __future__ import annotations

import numpy as np

import hybrid_model as hm
from hybrid_model.declare.variables import Value

MODULUS = 2147483647.0
MULTIPLIER = 48271.0
"""The minimal standard generator: Park, Miller, Stockmeyer, Communications of the ACM 36(7), 1993, 105-110."""


class Receiver(hm.HybridAutomaton):
    """Passes the neighbours' broadcasts on to all parts of the agent that use them."""

    degree = hm.Dimension("number of neighbours")
    neighbours = hm.Input(0.0, shape="degree", discrete=True, description="broadcast values of the neighbours")
    received = hm.Output(shape="degree", discrete=True, description="the same values")

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """What arrives."""
        return {"received": 1.0 * s.neighbours}


class LossyChannel(hm.HybridAutomaton):
    """The links from an agent's neighbours: each broadcast arrives after a delay, or is lost.

    The receiver keeps the value that arrived last, so that agents hold different copies of one broadcast value and the
    average of the states is no longer conserved (audit, section 11.8). The broadcast at the start is known to all.

    A broadcast is noticed by the sender's count. Whether it is lost is decided by a number of the minimal standard
    generator, one sequence a link: products of two whole numbers below 2**31 and 2**16, exact in floating point, so
    that every execution loses the same broadcasts. Broadcasts under way wait in a ring of `slots` places a link; one
    too many ends the run, for the flow set then is left.
    """

    degree = hm.Dimension("number of neighbours")
    slots = hm.Dimension("broadcasts that may be under way on a link at once")
    neighbours = hm.Input(0.0, shape="degree", discrete=True, description="broadcast values of the neighbours")
    sent = hm.Input(0.0, shape="degree", discrete=True, description="numbers of broadcasts of the neighbours")
    received = hm.DiscreteState(0.0, shape="degree", output=True, description="value that arrived last")
    lost = hm.DiscreteState(0, shape="degree", integer=True, output=True, description="broadcasts lost on each link")
    seen = hm.DiscreteState(
        -1,
        shape="degree",
        integer=True,
        internal=True,
        description="broadcasts taken note of; -1 before the start",
    )
    accepted = hm.DiscreteState(0, shape="degree", integer=True, internal=True, description="broadcasts put under way")
    arrived = hm.DiscreteState(0, shape="degree", integer=True, internal=True, description="broadcasts that arrived")
    values = hm.DiscreteState(0.0, shape=("degree", "slots"), internal=True, description="values under way")
    arrivals = hm.DiscreteState(
        0.0, shape=("degree", "slots"), internal=True, unit="s", description="times at which they arrive"
    )
    random = hm.DiscreteState(
        1, shape="degree", integer=True, internal=True, description="state of each link's random numbers"
    )
    delay = hm.Parameter(0.0, unit="s", description="time from a broadcast to its arrival")
    loss = hm.Parameter(0.0, description="probability that a broadcast is lost")
    arrival_clock = hm.Clock("arrival", description="ticks when broadcasts arrive")

    def flow_set(self, s: hm.Values) -> Value:
        """No more broadcasts under way than there are places."""
        return s.values.shape[1] + 0.5 - np.max(s.accepted - s.arrived)

    def news(self, s: hm.Values) -> Value:
        """Some neighbour has broadcast."""
        return np.max(s.sent - s.seen) - 0.5

    def take_note(self, s: hm.Values) -> dict[str, Value]:
        """Draw for each new broadcast, and put those that are not lost under way; at the start take the values over.

        The first look is a jump, not a start value, because at the start the senders' values are still being computed.
        """
        is_start = s.seen < -0.5
        new = np.where(is_start, 0.0, np.where(s.sent > s.seen + 0.5, 1.0, 0.0)) > 0.5
        product = MULTIPLIER * s.random
        drawn = product - MODULUS * np.floor(product / MODULUS)
        is_lost = np.where(new, np.where(drawn < s.loss * MODULUS, 1.0, 0.0), 0.0)
        kept = np.where(new, 1.0 - is_lost, 0.0)
        chosen = kept[:, None] * self._place(s, s.accepted) > 0.5
        return {
            "received": np.where(is_start, s.neighbours, s.received),
            "seen": s.sent,
            "random": np.where(new, drawn, s.random),
            "lost": s.lost + is_lost,
            "accepted": s.accepted + kept,
            "values": np.where(chosen, s.neighbours[:, None], s.values),
            "arrivals": np.where(chosen, s.t + s.delay, s.arrivals),
        }

    def next_arrival(self, s: hm.Values) -> Value:
        """Time at which the next broadcast arrives."""
        return np.min(self._arrivals(s))

    def arrive(self, s: hm.Values) -> dict[str, Value]:
        """Take over the broadcasts that arrive now."""
        here = self._arrivals(s) <= s.t
        value = np.sum(self._place(s, s.arrived) * s.values, axis=1)
        return {
            "received": np.where(here, value, s.received),
            "arrived": s.arrived + np.where(here, 1.0, 0.0),
        }

    transitions = (hm.Jump("message", news, take_note), hm.TimeEvent("arrival", next_arrival, arrive))

    def _place(self, s: hm.Values, number: Value) -> Value:
        """1 at the place in the ring of the broadcast with a number, on each link."""
        count = s.values.shape[1]
        place = number - count * np.floor(number / count)
        return np.where(np.arange(count)[None, :] == place[:, None], 1.0, 0.0)

    def _arrivals(self, s: hm.Values) -> Value:
        """Time at which the first broadcast under way arrives on each link; infinite if there is none."""
        waiting = s.accepted > s.arrived + 0.5
        return np.where(waiting, np.sum(self._place(s, s.arrived) * s.arrivals, axis=1), np.inf)


def link_seeds(seed: int, receiver: int, senders: list[int]) -> list[int]:
    """Return the start states of the random numbers of an agent's links.

    Parameters
    ----------
    seed : int
        Seed of the scenario.
    receiver : int
        Number of the agent.
    senders : list of int
        Numbers of its neighbours.

    Returns
    -------
    list of int
        One for each link, from 1 to 2**31 - 2; different for different links, whatever the order of the edges.
    """
    draws = [np.random.SeedSequence((seed, receiver, sender)).generate_state(1, np.uint64)[0] for sender in senders]
    return [1 + int(draw) % (int(MODULUS) - 1) for draw in draws]
