"""Figures of a study whose values leave a logarithmic axis without an extent."""

import pytest
from matplotlib.figure import Figure

from rsibr.studies import figures

TINY = 1.1754943508222875e-38


@pytest.mark.parametrize("values", [(0.0, 0.0), (0.3, 0.3), (TINY, TINY * (1 + 40e-16)), (1.0, 1 + 1e-15)])
def test_values_that_differ_by_rounding_or_not_at_all_are_drawn(values):
    figure = Figure(layout="constrained")
    axes = figure.subplots()
    axes.plot([1.0, 2.0], values)
    figures.logarithmic(axes)
    low, high = axes.get_ylim()
    assert high / low > 5
    assert figures.svg_uri(figure).startswith("data:image/svg+xml")  # warnings are errors
