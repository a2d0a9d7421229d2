"""Titles of lobes, from Mitsuba's materials and from lobes made by hand."""

from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi
import numpy as np
import pytest

from rsibr.lobes.basis import LAMBERT
from rsibr.lobes.fit import ProxyLobe
from rsibr.lobes.split import MIRROR, LobeSplit
from rsibr.planning.lobe_titles import lobe_titles


@dataclass
class Fitted:
    """What a title is made of."""

    name: str
    alpha: float
    kind: str
    proxy: ProxyLobe | None = None


def proxy(alpha, *strengths):
    """One term of each strength, the same in all channels."""
    return ProxyLobe((alpha,), (np.array(strengths)[:, None] * np.ones(3),))


def test_a_car_paint_is_its_coat_its_flakes_and_its_base():
    lobes = [
        Fitted("diffuse", LAMBERT, "diffuse", proxy(LAMBERT, 0.02, 0.3)),
        Fitted("glossy-0.25", 0.25, "glossy", proxy(0.25, 0.1, 0.0, 0.9)),
        Fitted("glossy-0.0152", 0.0152, "glossy", proxy(0.0152, 0.02, 0.45)),
    ]
    assert list(lobe_titles(lobes).values()) == [
        "diffuse under a coat",
        "glossy under a coat, α 0.25",
        "clear coat, α 0.015",
    ]


def test_alone_or_wide_no_lobe_is_a_coat_and_equal_titles_are_numbered():
    assert lobe_titles([Fitted("glossy-0.05", 0.05, "glossy", proxy(0.05, 0.9, 0.1))]) == {
        "glossy-0.05": "glossy, α 0.05"
    }
    lobes = [Fitted(f"glossy-{alpha}", alpha, "glossy", proxy(alpha, 0.9, 0.0, 0.1)) for alpha in (0.301, 0.302)]
    assert list(lobe_titles(lobes).values()) == ["glossy, α 0.3", "glossy, α 0.3 (2)"]
    assert lobe_titles([Fitted("mirror", MIRROR, "mirror")]) == {"mirror": "mirror"}


@pytest.mark.parametrize(
    ("bsdf", "titles", "alpha"),
    [
        ({"type": "diffuse"}, ["diffuse"], None),
        ({"type": "plastic"}, ["diffuse under a coat", "mirror"], None),
        ({"type": "roughconductor", "material": "Al", "alpha": 0.2}, ["glossy, α"], 0.2),
        ({"type": "roughplastic", "alpha": 0.05}, ["diffuse under a coat", "clear coat, α"], 0.05),
    ],
    ids=["diffuse", "plastic", "roughconductor", "roughplastic"],
)
def test_materials_of_mitsuba_are_named_by_what_they_are(bsdf, titles, alpha):
    ggx = {} if alpha is None else {"distribution": "ggx"}
    found = list(lobe_titles(LobeSplit.of(mi.load_dict(bsdf | ggx)).lobes).values())
    fitted = found[-1].partition("α ")[2]
    assert [title.removesuffix(f" {fitted}") for title in found] == titles
    assert fitted == "" if alpha is None else float(fitted) == pytest.approx(alpha, rel=0.1)
