"""Checks of options: what is taken, and one line for what is not."""

import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.methods import options

TOO_LONG = 10**400


@pytest.mark.parametrize(
    ("check", "given", "found"),
    [
        (lambda v: options.whole("size", v, 1, 9), np.int64(3), 3),
        (lambda v: options.number("bias", v), np.float32(2.0), 2.0),
        (lambda v: options.number("bias", v, above=0.0), 3, 3.0),
        (lambda v: options.flag("borders", v), np.True_, True),
        (lambda v: options.colour("k_d", v).tolist(), 0.5, [0.5] * 3),
        (lambda v: options.colour("k_d", v).tolist(), (0, 1, 2), [0, 1, 2]),
        (lambda v: options.table("w_d", v).tolist(), [0, 1], [[0] * 3, [1] * 3]),
        (lambda v: options.choice("filter", v, ("box", "phong")), "box", "box"),
    ],
)
def test_good_values_are_taken_from_numpy_too(check, given, found):
    assert check(given) == found


@pytest.mark.parametrize(
    ("check", "bad"),
    [
        (lambda v: options.whole("o", v, 1, 9), [0, 10, 2.5, True, "3", None, TOO_LONG]),
        (lambda v: options.power_of_two("o", v, 8), [0, 3, 16, True, 2.0]),
        (lambda v: options.number("o", v, above=0.0), [0, -1, np.nan, np.inf, "1", True, [1], 1e7, TOO_LONG]),
        (lambda v: options.flag("o", v), [0, 1, "no", [], None]),
        (lambda v: options.colour("o", v), [-1, (1, 2), "1", True, np.nan, np.inf, 1e300, TOO_LONG, [[1, 2, 3]]]),
        (lambda v: options.table("o", v), [1, [1], [[1, 2]], [[1, 2, 3], [1]], [-1, 1], [True, False], "ab"]),
        (lambda v: options.choice("o", v, ("box",)), ["bx", 1, None]),
    ],
)
def test_bad_values_are_refused_in_one_line_that_names_the_option(check, bad):
    for value in bad:
        with pytest.raises(InputError, match=r"^option o: ") as refused:
            check(value)
        assert len(str(refused.value)) < 300
