"""Contenders that take turns in one run: what else the machine does falls on all of them, and medians are compared."""

from time import perf_counter

import numpy as np

ROUNDS = 12


def in_turns(contenders, *, calls=1, rounds=ROUNDS):
    """Seconds of each call of each contender.

    Parameters
    ----------
    contenders : dict of callable
        By name; each is called with the number of the call, 0 to `calls` - 1.
    calls : int
        Calls of one contender before the next one's turn.
    rounds : int
        Turns of each, after a first one that warms up and is not counted.
    """
    seconds = {name: [] for name in contenders}
    for turn in range(rounds + 1):
        for name, contender in contenders.items():
            for call in range(calls):
                start = perf_counter()
                contender(call)
                if turn:
                    seconds[name].append(perf_counter() - start)
    return seconds


def report(benchmark, what, seconds, *, unit=1e3, unit_name="ms", **facts):
    """Print and keep the median of "ours", of each other contender, and the ratios of these to ours."""
    median = {name: float(np.median(taken)) for name, taken in seconds.items()}
    ratios = {name: value / median["ours"] for name, value in median.items() if name != "ours"}
    benchmark.extra_info.update(ratios=ratios, **facts)
    told = "".join(f", {name} {value:.2f}" for name, value in facts.items() if isinstance(value, float))
    print(f"\n{what}: {unit * median['ours']:.3g} {unit_name}{told}")  # noqa: T201
    for name, ratio in ratios.items():
        print(f"  {name}: {unit * median[name]:.3g} {unit_name}, {ratio:.2f} of ours")  # noqa: T201
