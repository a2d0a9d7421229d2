"""Interreflection goes with self-occlusion: it fills what is hidden."""

from rsibr.shading.effects.interreflection import interreflection


def test_it_follows_the_evidence(evidence):
    assert interreflection(evidence("torus")).on
    assert not interreflection(evidence("ball")).on
    dark = interreflection(evidence("torus", matte=0.01, gloss=0.0))
    assert not dark.on
    assert not dark.missed


def test_it_is_off_without_occlusion_and_told(evidence):
    found = interreflection(evidence("torus", switches={"self_occlusion": "off"}))
    assert not found.on
    assert found.missed
    off = interreflection(evidence("torus", switches={"interreflection": "off"}))
    assert off.forced == "off"
    assert off.error_if_left_out > 0
