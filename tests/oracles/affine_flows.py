"""Closed forms of affine flows and of the first time at which a linear margin rises to zero along them.

Each class is one family, in the numbers in which its closed form is exact or nearly so. ``first_rise(normal, drift,
margin, reach)`` takes the margin's value at the start, which is below zero, and returns the first time in (0, reach]
at which the margin is zero, with the margin's slope there; None if there is none.
"""

import cmath
import math
from decimal import Decimal
from fractions import Fraction

import numpy as np

GRAZE = 1e-10
"""A maximum of a margin nearer to zero than this is undecidable: rounding in the state of a run is near 1e-14."""


class Undecidable(Exception):
    """In floats the answer hangs on rounding."""


def decimal(value):
    """A number with 28 digits."""
    if isinstance(value, Fraction):
        return Decimal(value.numerator) / value.denominator
    return Decimal(value)


def _dot(normal, x):
    return sum((c * v for c, v in zip(normal, x, strict=True)), type(x[0])(0))


class Line:
    """x' constant: rational numbers, no rounding at all."""

    number = Fraction

    def __init__(self, x0, mode, u):
        self.x0 = x0
        self.rate = [Fraction(b) + Fraction(g) * u for b, g in zip(mode.offset, mode.gain, strict=True)]

    def at(self, tau):
        return [x + tau * r for x, r in zip(self.x0, self.rate, strict=True)]

    def first_rise(self, normal, drift, margin, reach):
        slope = _dot(normal, self.rate) + drift
        if slope <= 0:
            return None
        return (-margin / slope, float(slope)) if -margin <= slope * reach else None


class Exponential:
    """x' = a x + b, scalar: logarithms in decimals."""

    number = staticmethod(decimal)

    def __init__(self, x0, mode, u):
        self.x0 = x0[0]
        self.a = decimal(mode.matrix[0][0])
        self.b = decimal(mode.offset[0]) + decimal(mode.gain[0]) * u

    def at(self, tau):
        if not self.a:
            return [self.x0 + self.b * tau]
        limit = -self.b / self.a
        return [limit + (self.x0 - limit) * (self.a * tau).exp()]

    def first_rise(self, normal, drift, margin, reach):
        assert not drift
        rate = self.a * self.x0 + self.b
        if normal[0] * rate <= 0:
            return None
        step = -margin / normal[0]
        # x - x0 = rate (exp(a tau) - 1)/a, to be `step`.
        ratio = 1 + self.a * step / rate
        if ratio <= 0:
            return None
        tau = ratio.ln() / self.a if self.a else step / rate
        slope = float(normal[0] * rate * ratio)
        return (tau, slope) if tau <= reach else None


class Parabola:
    """p' = v, v' = b: quadratic equations in decimals."""

    number = staticmethod(decimal)

    def __init__(self, x0, mode, u):
        self.p, self.v = x0
        self.b = decimal(mode.offset[1]) + decimal(mode.gain[1]) * u

    def at(self, tau):
        return [self.p + self.v * tau + self.b * tau * tau / 2, self.v + self.b * tau]

    def first_rise(self, normal, drift, margin, reach):
        square = normal[0] * self.b / 2
        slope = normal[0] * self.v + normal[1] * self.b + drift
        if square == 0:
            return (-margin / slope, float(slope)) if slope > 0 and -margin <= slope * reach else None
        top = -slope / (2 * square)
        if square < 0 and top > 0 and abs(margin - slope * slope / (4 * square)) < GRAZE and top < 2 * reach:
            raise Undecidable("a parabola that grazes")
        discriminant = slope * slope - 4 * square * margin
        if discriminant <= 0 or (square < 0 and slope <= 0):
            return None
        # The smaller root of a hill, the positive root of a valley: in both the slope at the root is sqrt(D).
        root = discriminant.sqrt()
        tau = 2 * -margin / (slope + root)
        return (tau, float(root)) if tau <= reach else None


class Rotation:
    """x' = omega J (x - centre) in the plane: arc cosines in floats."""

    number = float

    def __init__(self, x0, mode, u):
        self.omega = float(mode.matrix[1][0])
        rate = [float(b) + float(g) * u for b, g in zip(mode.offset, mode.gain, strict=True)]
        # x' = i omega x + rate has its centre where both cancel.
        self.centre = 1j * complex(*rate) / self.omega
        self.arm = complex(*x0) - self.centre

    def at(self, tau):
        z = self.centre + self.arm * cmath.exp(1j * self.omega * tau)
        return [z.real, z.imag]

    def first_rise(self, normal, drift, margin, reach):
        assert not drift
        turned = complex(*normal).conjugate() * self.arm
        radius, rest = abs(turned), margin - turned.real
        if radius < GRAZE:
            return None
        if abs(radius + rest) < GRAZE:
            raise Undecidable("a circle that grazes")
        if radius + rest < 0:
            return None
        # radius cos(|omega| tau - phase) + rest rises through zero where the angle is -acos(-rest/radius).
        phase = -math.copysign(1.0, self.omega) * cmath.phase(turned)
        angle = math.acos(max(-1.0, -rest / radius))
        tau = ((phase - angle) % (2 * math.pi)) / abs(self.omega)
        slope = abs(self.omega) * math.sqrt(radius**2 - rest**2)
        return (tau, slope) if tau <= reach else None


class Modal:
    """x' = A x + b with A diagonalisable: sums of exponentials, whose first root is approached from the left.

    With ``f'' <= K`` on the step, the parabola ``f + f' h + K h^2/2`` lies above f, so f has no root before the
    parabola has one: no root can be stepped over, and near a root the step is Newton's.
    """

    number = float

    def __init__(self, x0, mode, u):
        matrix = np.array(mode.matrix, dtype=float)
        rate = np.array([float(b) + float(g) * u for b, g in zip(mode.offset, mode.gain, strict=True)])
        self.values, self.vectors = np.linalg.eig(matrix)
        self.limit = np.linalg.solve(matrix, -rate)
        self.weights = np.linalg.solve(self.vectors, (np.array(x0, dtype=float) - self.limit).astype(complex))

    def at(self, tau):
        return [float(v) for v in self.limit + (self.vectors @ (self.weights * np.exp(self.values * tau))).real]

    def first_rise(self, normal, drift, margin, reach):
        terms = list(zip((np.array(normal) @ self.vectors * self.weights).tolist(), self.values.tolist(), strict=True))
        rest = margin - sum(g for g, _ in terms).real
        longest = 0.3 / max(abs(v) for _, v in terms)
        tau, before = 0.0, 0.0
        while tau <= reach:
            parts = [(g * cmath.exp(v * tau), v) for g, v in terms]
            f = rest + drift * tau + sum(p for p, _ in parts).real
            slope = drift + sum(p * v for p, v in parts).real
            if f > -GRAZE and (abs(slope) < math.sqrt(GRAZE) or before > 0.0 > slope):
                raise Undecidable("a curve that grazes")
            before = slope
            bend = sum(abs(p) * abs(v) ** 2 * max(1.0, math.exp(v.real * longest)) for p, v in parts) + 1e-300
            step = -2.0 * f / (slope + math.sqrt(slope**2 - 2.0 * bend * f)) if f < 0.0 else 0.0
            if step < 1e-15 * (1.0 + tau):
                return tau, slope
            tau += min(step, longest)
        return None
