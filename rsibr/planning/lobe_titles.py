"""Titles of lobes for readers: what a lobe is, and its roughness."""

from __future__ import annotations

from collections.abc import Sequence

from rsibr.lobes.basis import COATED_FROM, LAMBERT
from rsibr.lobes.fit import ProxyLobe
from rsibr.lobes.split import Lobe
from rsibr.planning.lobes import effect_of


def lobe_titles(lobes: Sequence[Lobe]) -> dict[str, str]:
    """Title of each lobe of a material, by the lobe's name.

    Parameters
    ----------
    lobes : sequence of Lobe
        All lobes of the material: the clear coat is known by those below it.

    Returns
    -------
    dict of str to str
        "diffuse", "diffuse under a coat", "glossy, α 0.25", "glossy under a coat, α 0.25", "clear coat, α 0.015" or
        "mirror"; a repeated title is numbered.

    Examples
    --------
    >>> import mitsuba as mi
    >>> from rsibr.lobes.split import LobeSplit
    >>> lobe_titles(LobeSplit.of(mi.load_dict({"type": "conductor"})).lobes)
    {'mirror': 'mirror'}
    """
    titles = [_title(lobe, lobes) for lobe in lobes]
    seen = [titles[: place + 1].count(title) for place, title in enumerate(titles)]
    return {
        lobe.name: title if count == 1 else f"{title} ({count})"
        for lobe, title, count in zip(lobes, titles, seen, strict=True)
    }


def _title(lobe: Lobe, lobes: Sequence[Lobe]) -> str:
    what = effect_of(lobe, lobes).replace("_", " ")
    if what != "clear coat" and lobe.proxy is not None and _is_under_coat(lobe.proxy):
        what += " under a coat"
    return f"{what}, α {lobe.alpha:.2g}" if lobe.kind == "glossy" else what


def _is_under_coat(proxy: ProxyLobe) -> bool:
    """Whether the terms under a coat, the last ones of a roughness that has them, have most of the energy."""
    coated = bare = 0.0
    for alpha, coefficients in zip(proxy.alphas, proxy.coefficients, strict=True):
        has_coated = alpha == LAMBERT or (alpha >= COATED_FROM and len(coefficients) == 3)
        # Schlick's grazing term, the second of a glossy roughness, is small at most angles
        bare += float(coefficients[0].sum())
        coated += float(coefficients[-1].sum()) if has_coated else 0.0
    return coated > bare
