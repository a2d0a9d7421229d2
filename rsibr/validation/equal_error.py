"""Time in which the path tracer of a reference reaches the error of a picture."""

from __future__ import annotations

from rsibr.validation.estimate import Estimate


def path_tracing_seconds(error: Estimate, noise_floor: float, samples: float, seconds: float) -> float:
    """Time of the reference's path tracer to the same relMSE [s]; its relMSE is proportional to 1/samples.

    Parameters
    ----------
    error : Estimate
        RelMSE of the picture; its upper bound counts if it is below the noise of the reference.
    noise_floor : float
        RelMSE of a perfect picture due to the noise of the reference.
    samples, seconds : float
        Samples a texel or pixel of the reference, and its render time [s].

    Examples
    --------
    >>> path_tracing_seconds(Estimate(0.01, 0.0, 7), noise_floor=0.0001, samples=1024, seconds=50.0)
    0.5
    """
    reached = error.ci95[1] if error.below_noise_floor else error.value
    share = noise_floor / reached if reached > 0 else 0.0
    return seconds * max(share, 1.0 / samples)  # at least one sample
