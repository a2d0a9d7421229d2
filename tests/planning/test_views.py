"""In how many views each lobe is stored apart."""

import numpy as np
import pytest

from rsibr.geometry.viewpoints import VIEW_COUNTS
from rsibr.planning.plan import LobePlan
from rsibr.planning.views import lobe_views, own_views, parts_spared
from rsibr.scene.config import EffectsConfig, ViewsConfig


def lobes(*needed):
    return tuple(LobePlan(f"lobe-{k}", views > 0, views, 0.1, 1e-5, "") for k, views in enumerate(needed))


def decision(needed, subdivision, forced="auto", **effects):
    views = ViewsConfig(subdivision=subdivision)
    effect, found = lobe_views(lobes(*needed), views, EffectsConfig(lobe_views=forced, **effects))
    assert effect.error_if_left_out == 0
    return effect, [lobe.own_views for lobe in found]


@pytest.mark.parametrize(
    ("needed", "subdivision", "expected"),
    [
        ((12, 42, 12), 1, [12, None, 12]),
        ((0, 42, 12), 1, [12, None, 12]),
        ((12, 12, 12), 1, [12, 12, 12]),
        ((12, 12, 12), 3, [12, 12, 12]),
        ((12, 42, 162), 2, [42, 42, None]),
        ((42, 12, 2562), 3, [42, 42, None]),
        ((12, 42, 162, 12), 3, [12, 42, 162, 12]),
    ],
)
def test_a_lobe_has_the_views_that_it_needs(needed, subdivision, expected):
    effect, found = decision(needed, subdivision)
    assert not effect.on
    assert not effect.missed
    assert found == expected


@pytest.mark.parametrize(
    ("needed", "subdivision"), [((12, 42), 1), ((42, 42, 12), 1), ((162, 162, 162), 1), ((642, 42, 642), 2)]
)
def test_where_all_lobes_but_one_need_all_views_every_view_keeps_them_apart(needed, subdivision):
    effect, found = decision(needed, subdivision)
    assert effect.on
    assert found == [None] * len(needed)


@pytest.mark.parametrize(("needed", "own"), [((12, 0), [None, None]), ((12, 12, 0), [12, 12, None])])
def test_a_delta_lobe_stays_apart_in_all_views(needed, own):
    """The last lobe: its noisy layer is left out of reconstructions, so no other may be added to it."""
    effect, found = lobe_views(lobes(*needed), ViewsConfig(subdivision=1), EffectsConfig(), [f"lobe-{len(needed) - 1}"])
    assert [lobe.own_views for lobe in found] == own
    assert effect.on == (None in own[:1])


def test_forced_on_and_off():
    assert decision((12, 12), 2, "on")[1] == [None, None]
    effect, found = decision((162, 162, 642), 2, "off")
    assert effect.missed
    assert found == [42, 42, 42]
    effect, found = decision((12, 12, 162), 2, "off")
    assert not effect.missed
    assert found == [12, 12, 42]


@pytest.mark.parametrize(
    ("needed", "subdivision", "effects", "why"),
    [
        ((12, 12), 0, {}, "fewer than 12"),
        ((12,), 2, {}, "one lobe"),
        ((0, 0), 2, {}, "one map"),
        ((12, 12), 2, {"lobes": "off"}, "not kept apart"),
    ],
)
@pytest.mark.parametrize("forced", ["auto", "off"])
def test_where_nothing_can_be_saved_nothing_is_missed(needed, subdivision, effects, why, forced):
    effect, found = decision(needed, subdivision, forced, **effects)
    assert not effect.missed
    assert why in effect.why
    assert found == [None] * len(needed)


def test_views_of_ones_own_are_not_nested(tmp_path):
    views = ViewsConfig.model_validate({"file": str(tmp_path / "views.json")})
    effect, found = lobe_views(lobes(12, 12, 42), views, EffectsConfig(lobe_views="off"))
    assert "nested" in effect.why
    assert all(lobe.own_views is None for lobe in found)


def test_what_is_spared_is_what_is_added_up(rng):
    """Against a count of the layers and sums, view by view."""
    for _ in range(50):
        count = int(rng.choice(VIEW_COUNTS[:4]))
        own = own_views(lobes(*rng.choice((0, *VIEW_COUNTS), size=rng.integers(2, 6)).tolist()), count)
        done = (np.array(own)[:, None] <= np.arange(count)).sum(axis=0)
        assert parts_spared(own, count) == np.maximum(done - 1, 0).sum() + (done == len(own)).sum()
        assert 1 not in done  # one alone is added to nothing
