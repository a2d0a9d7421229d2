"""Bundle of a bake for the page: arrays and numbers in one script tag, and the engine's own source."""

from rsibr.publishing.bundle.bundle import Bundle, bundle_of
from rsibr.publishing.bundle.engine_source import engine_script

__all__ = ["Bundle", "bundle_of", "engine_script"]
