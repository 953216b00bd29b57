"""Tableaux in high precision and rounded once: Gauss–Legendre (paper eq. 45–51 for s = 2) and Radau IIA."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from mpmath import mp, mpf, polyroots, taylor, workdps

DIGITS = 60
MAX_STAGES = 8
RADAU_STAGES = (2, 3)
VECTORS = ("c", "c_low", "b", "b_low")
MATRICES = ("a", "a_low", "m", "m_low", "a_squared", "extrapolation")


def _product(values) -> mpf:
    result = mpf(1)
    for value in values:
        result *= value
    return result


@dataclass(frozen=True)
class Tableau:
    """Collocation with `stages` stages; matrices are lists of rows of mpf."""

    family: str  # "Gauss" | "Radau"
    stages: int
    c: list[mpf]
    b: list[mpf]
    a: list[list[mpf]]

    @cached_property
    def a_squared(self) -> list[list[mpf]]:
        s = range(self.stages)
        with workdps(DIGITS):
            return [[sum((self.a[i][k] * self.a[k][j] for k in s), mpf(0)) for j in s] for i in s]

    @cached_property
    def extrapolation(self) -> list[list[mpf]]:
        """ℓ_j(1 + c_i), ℓ the Lagrange basis on the nodes."""
        with workdps(DIGITS):
            return [[self._basis(j, 1 + node) for j in range(self.stages)] for node in self.c]

    def _basis(self, j: int, x: mpf) -> mpf:
        others = [k for k in range(self.stages) if k != j]
        return _product((x - self.c[k]) / (self.c[j] - self.c[k]) for k in others)

    @cached_property
    def m(self) -> list[list[float]]:
        """a_ij / b_j in double precision; of Gauss methods with m_ii = ½ and m_ij + m_ji = 1 exactly.

        The larger of the two is rounded; 1 minus it is then exact (Sterbenz), because it lies in [½, 2].
        This is a_ij b_i + a_ji b_j = b_i b_j, which makes the method symplectic, without any rounding.
        """
        s = range(self.stages)
        if self.family == "Radau":
            return [[float(self.a[i][j] / self.b[j]) for j in s] for i in s]
        m = [[0.5] * self.stages for _ in s]
        with workdps(DIGITS):
            for i in s:
                for j in s:
                    exact = self.a[i][j] / self.b[j]
                    if i != j and exact > mpf(1) / 2:
                        m[i][j] = float(exact)
                        m[j][i] = 1.0 - m[i][j]
        return m

    @cached_property
    def c_low(self) -> list[mpf]:
        return [_lost(x, float(x)) for x in self.c]

    @cached_property
    def b_low(self) -> list[mpf]:
        return [_lost(x, float(x)) for x in self.b]

    @cached_property
    def a_low(self) -> list[list[mpf]]:
        return [[_lost(x, float(x)) for x in row] for row in self.a]

    @cached_property
    def m_low(self) -> list[list[mpf]]:
        """What m lacks of a_ij / b_j; antisymmetric of Gauss methods, as m_ij + m_ji = 1."""
        s = range(self.stages)
        if self.family == "Radau":
            with workdps(DIGITS):
                return [[_lost(self.a[i][j] / self.b[j], self.m[i][j]) for j in s] for i in s]
        low = [[mpf(0)] * self.stages for _ in s]
        with workdps(DIGITS):
            for i in s:
                for j in range(i):
                    low[i][j] = _lost(self.a[i][j] / self.b[j], self.m[i][j])
                    low[j][i] = -low[i][j]
        return low

    @property
    def order(self) -> int:
        return 2 * self.stages - (self.family == "Radau")

    @property
    def text(self) -> dict[str, list]:
        """Shortest decimal literals that read back as the rounded doubles."""
        vectors = {name: getattr(self, name) for name in VECTORS}
        matrices = {name: getattr(self, name) for name in MATRICES}
        return {
            **{name: [_literal(x) for x in values] for name, values in vectors.items()},
            **{name: [[_literal(x) for x in row] for row in rows] for name, rows in matrices.items()},
        }


def _lost(exact: mpf, rounded: float) -> mpf:
    with workdps(DIGITS):
        lost = exact - mpf(rounded)
        return lost if abs(lost) > mpf(10) ** (5 - DIGITS) else mpf(0)


def _literal(x: mpf | float) -> str:
    return repr(float(x) + 0.0)  # no −0.0


def gauss(stages: int) -> Tableau:
    """The Gauss–Legendre method with `stages` stages, to DIGITS digits."""
    with workdps(DIGITS):
        return _collocation("Gauss", stages, lambda x: mp.legendre(stages, 2 * x - 1))


def radau(stages: int) -> Tableau:
    """The Radau IIA method with `stages` stages, to DIGITS digits: c_s = 1 (Hairer, Wanner, IV.5)."""
    with workdps(DIGITS):
        return _collocation(
            "Radau", stages, lambda x: mp.legendre(stages, 2 * x - 1) - mp.legendre(stages - 1, 2 * x - 1)
        )


def _collocation(family: str, stages: int, polynomial) -> Tableau:
    """The method whose nodes are the zeros of a polynomial."""
    coefficients = taylor(polynomial, 0, stages)[::-1]
    c = sorted(mp.re(root) for root in polyroots(coefficients, maxsteps=500, extraprec=4 * DIGITS))
    powers = range(1, stages + 1)
    vandermonde = mp.matrix([[node ** (k - 1) for node in c] for k in powers])
    # Collocation integrates every polynomial of degree < s exactly: Σ_j a_ij c_j^(k−1) = c_i^k / k.
    a = [list(mp.lu_solve(vandermonde, mp.matrix([node**k / k for k in powers]))) for node in c]
    b = list(mp.lu_solve(vandermonde, mp.matrix([mpf(1) / k for k in powers])))
    return Tableau(family, stages, c, b, a)
