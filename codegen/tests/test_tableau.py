"""Gauss–Legendre coefficients: exact symplecticity in floating point, order conditions in high precision."""

import re

import pytest
from mpmath import mpf, sqrt, workdps

from pendula_codegen.tableau import DIGITS, MAX_STAGES, RADAU_STAGES, gauss, radau

STAGES = range(1, MAX_STAGES + 1)
TINY = mpf(10) ** (10 - DIGITS)  # measured 4e-57 for the extrapolation, 2e-60 elsewhere


@pytest.mark.parametrize("s", STAGES)
def test_m_is_exactly_symplectic_in_double_precision(s):
    m = gauss(s).m
    for i in range(s):
        assert m[i][i] == 0.5
        for j in range(s):
            assert m[i][j] + m[j][i] == 1.0


@pytest.mark.parametrize("s", STAGES)
def test_m_is_rounded_a_over_b(s):
    t = gauss(s)
    for i in range(s):
        for j in range(s):
            error = abs(t.m[i][j] - t.a[i][j] / t.b[j])
            assert error <= 2.3e-16  # measured 1.1e-16, half an ulp above 1


@pytest.mark.parametrize("s", STAGES)
def test_low_parts_hold_what_rounding_lost(s):
    t = gauss(s)
    with workdps(DIGITS):
        pairs = [*zip(t.c, t.c, t.c_low, strict=True), *zip(t.b, t.b, t.b_low, strict=True)]
        for i in range(s):
            for j in range(s):
                pairs.append((t.a[i][j], t.a[i][j], t.a_low[i][j]))
                pairs.append((t.a[i][j] / t.b[j], t.m[i][j], t.m_low[i][j]))
                assert t.m_low[i][j] + t.m_low[j][i] == 0
        for exact, value, low in pairs:
            error = abs(mpf(float(value)) + mpf(float(low)) - exact)
            assert error <= mpf(2.0) ** -106  # measured 5.9e-33


@pytest.mark.parametrize("s", STAGES)
def test_order_conditions(s):
    """B(2s), C(s) and D(s) together give order 2s (Butcher)."""
    t = gauss(s)
    stages = range(s)
    with workdps(DIGITS):
        for k in range(1, 2 * s + 1):
            assert abs(sum(b * c ** (k - 1) for b, c in zip(t.b, t.c, strict=True)) - mpf(1) / k) < TINY
        for k in range(1, s + 1):
            for i in stages:
                assert abs(sum(t.a[i][j] * t.c[j] ** (k - 1) for j in stages) - t.c[i] ** k / k) < TINY
            for j in stages:
                adjoint = sum(t.b[i] * t.c[i] ** (k - 1) * t.a[i][j] for i in stages)
                assert abs(adjoint - t.b[j] * (1 - t.c[j] ** k) / k) < TINY


@pytest.mark.parametrize("s", STAGES)
def test_squared_matrix_and_extrapolation(s):
    t = gauss(s)
    stages = range(s)
    with workdps(DIGITS):
        for i in stages:
            for k in range(1, s + 1):
                twice = sum(t.a_squared[i][j] * t.c[j] ** (k - 1) for j in stages)
                if k < s:
                    assert abs(twice - t.c[i] ** (k + 1) / (k * (k + 1))) < TINY
                continued = sum(t.extrapolation[i][j] * t.c[j] ** (k - 1) for j in stages)
                assert abs(continued - (1 + t.c[i]) ** (k - 1)) < TINY


def test_two_stages_are_the_papers():
    """(48)–(51)."""
    t = gauss(2)
    with workdps(DIGITS):
        quarter, root = mpf(1) / 4, sqrt(mpf(3)) / 6
        printed = [[quarter, quarter - root], [quarter + root, quarter]]
        for row, truth in zip(t.a, printed, strict=True):
            assert all(abs(a - b) < TINY for a, b in zip(row, truth, strict=True))


@pytest.mark.parametrize("s", STAGES)
def test_header_holds_the_rounded_numbers(s, fresh_headers):
    text = fresh_headers["gauss_tableaux.hpp"]
    struct = text.split(f"struct GaussTableau<{s}> {{")[1].split("\n};")[0]
    numbers = [float(x) for x in re.findall(r"[{ ](-?\d+\.\d+(?:e-?\d+)?)(?=[,}])", struct)]
    t = gauss(s)
    matrices = [t.a, t.a_low, t.m, t.m_low, t.a_squared, t.extrapolation]
    expected = [*t.c, *t.c_low, *t.b, *t.b_low, *(x for matrix in matrices for row in matrix for x in row)]
    assert numbers == [float(x) for x in expected]


@pytest.mark.parametrize("stages", RADAU_STAGES)
def test_radau_integrates_its_order_and_ends_in_a_stage(stages):
    """B(2s − 1) and C(s) (Hairer, Wanner IV.5), and b the last row of a: stiffly accurate."""
    with workdps(DIGITS):
        method = radau(stages)
        bound = mpf(10) ** (8 - DIGITS)
        assert abs(method.c[-1] - 1) < bound
        assert all(abs(x - y) < bound for x, y in zip(method.a[-1], method.b, strict=True))
        for k in range(1, 2 * stages):
            assert (
                abs(sum(b * c ** (k - 1) for b, c in zip(method.b, method.c, strict=True)) - mpf(1) / k)
                < bound
            )
        for k in range(1, stages + 1):
            for row, node in zip(method.a, method.c, strict=True):
                assert (
                    abs(sum(x * c ** (k - 1) for x, c in zip(row, method.c, strict=True)) - node**k / k)
                    < bound
                )


def test_radau_of_three_stages_is_the_published_one():
    """c = (4 ∓ √6)/10, 1."""
    with workdps(DIGITS):
        c = [(4 - mpf(6) ** 0.5) / 10, (4 + mpf(6) ** 0.5) / 10, mpf(1)]
        assert all(abs(x - y) < mpf(10) ** (8 - DIGITS) for x, y in zip(radau(3).c, c, strict=True))
