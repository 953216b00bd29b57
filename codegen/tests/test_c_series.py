"""Taylor series of kernels in C whose sums are few, or none; of others see test_c_kernels.py."""

import pytest

from loaded import COMPILERS, WIDTHS
from series_error import series_error
from test_c_kernels import INSTRUCTIONS, error, truth_of
from test_model_kernels import read


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("march", INSTRUCTIONS)
def test_few_sums_with_any_instructions(compiler, march, kernel_of):
    """Whose newest terms are added one by one: EVERYTHING has too many."""
    loaded = kernel_of(read("rods", 2), compiler, march)
    assert len(loaded.table.series.series.sums) == 10
    assert max(series_error(loaded, width, width) for width in WIDTHS) < 1e-13  # measured 9.9e-15


# Its series have no sums.
LINEAR = """
def define(model, links):
    x = model.coordinate("x", "m")
    k, u = model.parameter("k", "N/m", default=1.0), model.input("u", "N")
    model.lagrangian = model.rate(x) ** 2 / 2 - k * x**2 / 2
    model.force(x, u)
"""


@pytest.mark.parametrize("compiler", COMPILERS)
def test_linear_models(compiler, own, kernel_of):
    model = own(LINEAR, "linear")
    loaded, truth = kernel_of(model, compiler), truth_of(model)
    assert error(loaded, truth, 1, 1) < 1e-15  # measured 6.8e-17
    assert max(series_error(loaded, width, width) for width in WIDTHS) < 1e-14  # measured 3.1e-16
