"""Choices of the split-sum method."""

from __future__ import annotations

from typing import Literal

Albedo = Literal["dfg", "exact"]
"""Factor of a glossy lobe: F₀ A + F₉₀ B, or the lobe's own directional albedo."""
