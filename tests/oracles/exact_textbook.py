"""Exact events of the nine automata of `textbook_models.py`, from closed forms and integrals; no code of the package.

Each function returns ``(events, x_end)``: name and time in s of each jump up to the end time, and the states there.
"""

import math

import numpy as np
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.special import ellipkinc


def _until(t_end, flights):
    """Collect events from an iterator of (name, time, state after it, state at a time in s after it)."""
    events, at = [], None
    for name, time, later in flights:
        if time > t_end:
            break
        if name:
            events.append((name, time))
        start, at = time, later
    return events, np.array(at(t_end - start))


def drag_ball(t_end, g=9.81, drag=0.05, e=0.85, height=1.0):
    """Fall and rise against quadratic drag: tanh and tan, with the terminal speed sqrt(g/drag)."""
    terminal = math.sqrt(g / drag)

    def falling(top, t):
        a = g * t / terminal
        return top - math.log(math.cosh(a)) / drag, -terminal * math.tanh(a)

    def flights():
        t, top, up = 0.0, height, 0.0
        yield "", 0.0, lambda s: falling(height, s)
        while True:
            fall = terminal / g * math.acosh(math.exp(drag * top))
            t += up + fall
            u = e * terminal * math.tanh(g * fall / terminal)
            up, top = terminal / g * math.atan(u / terminal), math.log1p((u / terminal) ** 2) / (2.0 * drag)

            def later(s, up=up, top=top):
                if s > up:
                    return falling(top, s - up)
                a = g * (up - s) / terminal
                return top + math.log(math.cos(a)) / drag, terminal * math.tan(a)

            yield "jump", t, later

    return _until(t_end, flights())


def neurons(t_end, currents=(1.3, 1.25), lift=0.04, start=(0.0, 0.35)):
    """Exponentials towards the currents; the next to fire is the one that is first at 1."""
    currents = np.array(currents)

    def relaxing(x):
        return lambda s: currents + (x - currents) * math.exp(-s)

    def flights():
        t, x = 0.0, np.array(start)

        yield "", 0.0, relaxing(x)
        while True:
            waits = np.maximum(np.log((currents - x) / (currents - 1.0)), 0.0)
            first = int(np.argmin(waits))
            t, x = t + waits[first], currents + (x - currents) * math.exp(-waits[first])
            x[1 - first] += lift
            x[first] = 0.0
            yield ("a_fires", "b_fires")[first], t, relaxing(x.copy())

    return _until(t_end, flights())


def _affine(matrix, constant):
    """Return the flow of x' = matrix x + constant."""
    n = len(constant)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = matrix, constant
    return lambda t, x: (expm(whole * t) @ np.append(x, 1.0))[:n]


def _rises(flow, x, element, level, sign, step, most=10_000):
    """Return when ``sign * (x[element] - level)`` first rises through zero, as it does once in a step at most."""

    def margin(t):
        return sign * (flow(t, x)[element] - level)

    # The start may be a zero of it.
    a = step * 1e-3
    for _ in range(most):
        if margin(a) < 0.0 <= margin(a + step):
            return brentq(margin, a, a + step, xtol=1e-15, rtol=1e-15)
        a += step
    raise AssertionError("no crossing")


def buck(t_end, supply=12.0, L=0.1, C=0.2, R=2.5, reference=2.0, band=0.2):
    """Matrix exponentials from switching to switching."""
    matrix = [[0.0, -1.0 / L], [1.0 / C, -1.0 / (R * C)]]
    flows = [_affine(matrix, [on * supply / L, 0.0]) for on in (0, 1)]

    def flights():
        t, x, on = 0.0, np.zeros(2), 1
        while True:
            flow = flows[on]
            yield ("" if t == 0.0 else ("off", "on")[on]), t, lambda s, x=x, flow=flow: flow(s, x)
            level, sign = (reference + band, 1.0) if on else (reference - band, -1.0)
            wait = _rises(flow, x, 0, level, sign, 2e-3)
            t, x, on = t + wait, flow(wait, x), 1 - on

    return _until(t_end, flights())


def stick_slip(t_end, belt=0.5, k=1.0, holds=1.5, drags=1.0):
    """While it slips, the block swings about drags/k until its speed is the belt's again."""
    rate = math.sqrt(k)
    reach = (holds - drags) / k
    slip = (2.0 * math.pi - 2.0 * math.atan(reach * rate / belt)) / rate

    def slipping(s):
        c, d = math.cos(rate * s), math.sin(rate * s)
        return drags / k + reach * c + belt / rate * d, -reach * rate * d + belt * c

    def flights():
        t, x = 0.0, 0.0
        while True:
            yield ("sticks" if t else ""), t, lambda s, x=x: (x + belt * s, belt)
            t += (holds / k - x) / belt
            yield "slips", t, slipping
            t, x = t + slip, (2.0 * drags - holds) / k

    return _until(t_end, flights())


def pendulum_at_wall(t_end, wall=-0.3, e=0.95, start=1.2):
    """Energy between impacts is kept: speeds at the wall are a geometric series, times elliptic integrals."""

    def from_top(energy, angle):
        """Time from the greatest angle to an angle; energy is 1 - cos of the greatest."""
        m = energy / 2.0
        phase = math.asin(max(-1.0, min(1.0, math.sin(angle / 2.0) / math.sqrt(m))))
        return ellipkinc(math.pi / 2.0, m) - ellipkinc(phase, m)

    def swinging(energy, s):
        """State at s after the greatest angle, before the wall."""
        top = math.acos(1.0 - energy)
        angle = brentq(lambda a: from_top(energy, a) - abs(s), wall, top, xtol=1e-15, rtol=1e-15)
        speed = math.sqrt(max(0.0, 2.0 * (energy - 1.0 + math.cos(angle))))
        return angle, -math.copysign(speed, s)

    def flights():
        energy, t = 1.0 - math.cos(start), 0.0
        yield "", 0.0, lambda s: swinging(1.0 - math.cos(start), s)
        half, rest = from_top(energy, wall), 1.0 - math.cos(wall)
        while True:
            t += half
            energy = rest + e**2 * (energy - rest)
            half = from_top(energy, wall)
            yield "jump", t, lambda s, energy=energy, half=half: swinging(energy, s - half)
            t += half

    return _until(t_end, flights())


def circle_billiard(t_end, start=(0.3, 0.0), velocity=(0.6, 0.8)):
    """All chords are of one length and turn by one angle."""
    r, w = np.array(start), np.array(velocity)
    speed2 = w @ w
    first = (-(r @ w) + math.sqrt((r @ w) ** 2 - speed2 * (r @ r - 1.0))) / speed2
    hit = r + first * w
    chord = 2.0 * (hit @ w) / speed2
    turn = math.pi - 2.0 * math.acos(min(1.0, hit @ w / math.sqrt(speed2)))
    turn = -turn if hit[0] * w[1] - hit[1] * w[0] < 0.0 else turn
    # From one hit to the next the whole picture turns by pi minus twice the angle between radius and path.
    after = w - 2.0 * (w @ hit) * hit

    def flights():
        yield "", 0.0, lambda s: [*(r + s * w), *w]
        k = 0
        while True:
            c, d = math.cos(k * turn), math.sin(k * turn)
            turned = np.array([[c, -d], [d, c]])
            yield "jump", first + k * chord, lambda s, m=turned: [*(m @ (hit + s * after)), *(m @ after)]
            k += 1

    return _until(t_end, flights())


def rimless_wheel(t_end, slope=0.08, half=0.3, start=(-0.2, 0.6)):
    """Energy between impacts gives the speed as a function of the angle; times are integrals of its inverse."""
    final = slope + half

    def flights():
        t, angle, speed = 0.0, *start
        while True:
            energy = speed**2 / 2.0 + math.cos(angle)

            def rate(a, energy=energy):
                return math.sqrt(2.0 * (energy - math.cos(a)))

            def took(a, angle=angle, rate=rate):
                return quad(lambda b: 1.0 / rate(b), angle, a, epsabs=1e-13, epsrel=1e-13)[0]

            def later(s, angle=angle, took=took, rate=rate):
                found = brentq(lambda a: took(a) - s, angle, final, xtol=1e-15, rtol=1e-15) if s else angle
                return found, rate(found)

            yield ("jump" if t else ""), t, later
            t, angle, speed = t + took(final), slope - half, math.cos(2.0 * half) * rate(final)

    return _until(t_end, flights())


def reset_loop(t_end, gain=2.0, wanted=1.0):
    """One matrix exponential between resets."""
    flow = _affine([[0.0, 1.0, 0.0], [-1.0, -1.0, gain], [-1.0, 0.0, 0.0]], [0.0, wanted, wanted])

    def flights():
        t, x, sign = 0.0, np.zeros(3), 1
        while True:
            yield ("empty" if t else ""), t, lambda s, x=x: flow(s, x)
            wait = _rises(flow, x, 0, wanted, sign, 2e-2)
            t, x, sign = t + wait, flow(wait, x) * [1.0, 1.0, 0.0], -sign

    return _until(t_end, flights())


def sampled_pd(t_end, period=0.1, kp=4.0, kd=2.0, start=(1.0, 0.0)):
    """Parabolas."""

    def flights():
        (x, v), k = start, 0
        yield "", 0.0, lambda s: start
        while True:
            u = -kp * x - kd * v
            yield "sample", k * period, lambda s, x=x, v=v, u=u: (x + s * (v + s * u / 2.0), v + s * u)
            x, v, k = x + period * (v + period * u / 2.0), v + period * u, k + 1

    return _until(t_end, flights())
