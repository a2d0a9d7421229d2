"""Error of the fitted lobes in a plan: recorded for each lobe, and flagged where it is too large."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from rsibr.lobes.fit_error import COSINES
from rsibr.planning.material_probe import MaterialProbe
from rsibr.planning.plan import Effect, LobePlan, Plan, flagged

UNFITTED = "unfitted"
"""Name of the effect: reflected light that the fitted lobes gather from wrong directions."""

WELL_FITTED = 0.1
"""Share of the light gathered from wrong directions, at the worst angle, up to which a material counts as fitted.

Measured under `city`, 48²: presets and isotropic plugins stay below 0.09, and the relMSE of `rsibr` from 12 views below
3.2e-3; an anisotropic metal has 0.55 and 4e-2, a car paint that is half retroreflective 0.22 and 3e-2.
"""

_WHAT_TO_DO = (
    "store more views, and compare `cabral1999`, which has no model, and `rsibr-fine`, which has the same fit, "
    "by `rsibr validate`"
)


def unfitted(material: MaterialProbe) -> Effect:
    """Flag a material whose lobes the model does not represent: at the worst angle, above `WELL_FITTED`."""
    fit = material.fit
    worst = int(np.argmax(fit.whole))
    found = f"{100 * fit.mean:.2g} % on average, {100 * fit.whole[worst]:.2g} % at {_angles()[worst]:.0f}°"
    return flagged(
        UNFITTED, float(fit.whole[worst]), WELL_FITTED, "of the light from wrong directions, at the worst angle",
        f"the fitted lobes err by {found}: {_WHAT_TO_DO}", f"the fitted lobes err by {found}",
    )  # fmt: skip


def with_fit_errors(lobes: Iterable[LobePlan], material: MaterialProbe) -> tuple[LobePlan, ...]:
    """Return the lobes with the errors of their fits, rounded to four digits."""
    found = {
        lobe.name: tuple(errors.round(4).tolist())
        for lobe, errors in zip(material.lobes, material.fit.lobes, strict=True)
        if lobe.kind != "mirror"
    }
    return tuple(
        replace(lobe, fit_angles=_angles(), fit_errors=found[lobe.name]) if lobe.name in found else lobe
        for lobe in lobes
    )


def unfitted_advice(plan: Plan) -> str:
    """Clause for the refusal of a promise, on a fit that is too bad to keep it; empty if the fit is good."""
    effect = plan[UNFITTED]
    return f" ({effect.why})" if effect.missed else ""


def _angles() -> tuple[float, ...]:
    return tuple(np.degrees(np.arccos(COSINES)).round(1).tolist())
