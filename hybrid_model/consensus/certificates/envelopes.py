"""Bounds on the broadcast errors of each trigger law, as sums of exponentials ``c exp(-beta t)``."""

from __future__ import annotations

import math

from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.own_trigger import OwnTrigger
from hybrid_model.consensus.scenario.trigger import TriggerKind

__all__ = ["Envelope", "error_envelope", "sampled_threshold", "slowest_decay"]

Envelope = tuple[tuple[float, float], ...]
"""Pairs (c, beta): ``|e_i(t)| <= sum of c exp(-beta t)``."""


def error_envelope(scenario: Scenario) -> Envelope | None:
    """The bound on the errors that the trigger law enforces at every time; None if there is none known in advance.

    An empty sum means that there are no errors. With sampled checks the error overshoots the threshold between two
    checks; `sampled_threshold` gives the bound then.
    """
    trigger = scenario.trigger
    if not scenario.channel.ideal:
        return None
    if trigger.kind is TriggerKind.CONTINUOUS:
        return ()
    if isinstance(trigger, OwnTrigger):
        return None if trigger.error_bound is None else trigger.error_bound.exponentials
    if trigger.has_level and trigger.kind is not TriggerKind.SAMPLED:
        return trigger.threshold_in_time.exponentials
    return None


def slowest_decay(scenario: Scenario) -> float:
    """The beta [1/s] of the part of the errors that fades last, which decides about radii and rates.

    The trigger's own number where no bound on the errors is known in advance.
    """
    return min((beta for _, beta in error_envelope(scenario) or ()), default=scenario.trigger.decay)


def sampled_threshold(
    scenario: Scenario, radius: float, transient: float, degrees: list[int], largest_weight: float
) -> float | None:
    """The c' with ``|e_i(t)| <= c' exp(-beta t)`` if the trigger looks only every h seconds (audit, section 11.7).

    Within h the state moves by at most ``h k omega (sqrt(d_i) R(c') + 2 c' d_i)`` with ``R(c') = radius c' +
    transient``. The largest error is the fixed point ``c' = e^{beta h} (c + that)``.

    Parameters
    ----------
    scenario : Scenario
        With a sampled trigger.
    radius : float
        R for c = 1.
    transient : float
        Bound on ``exp(beta t) ||x_e(t)||`` from the initial state.
    degrees : list of int
        d_i, number of edges of each agent that ever carry weight.
    largest_weight : float
        omega [1/s].

    Returns
    -------
    float or None
        c'; None if h is too long for the fixed point to exist.
    """
    trigger = scenario.trigger
    growth = math.exp(trigger.decay * trigger.period)
    found = 0.0
    for degree in degrees:
        speed = trigger.period * scenario.network.gain * largest_weight
        slope = growth * speed * (math.sqrt(degree) * radius + 2 * degree)
        if slope >= 1:
            return None
        found = max(found, growth * (trigger.threshold + speed * math.sqrt(degree) * transient) / (1 - slope))
    return found
