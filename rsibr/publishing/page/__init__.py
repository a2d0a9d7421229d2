"""The page of `rsibr view`: its writer, its server, and what it holds beside the bundles of the engine."""

from rsibr.publishing.page.page import Page, view, write_page

__all__ = ["Page", "view", "write_page"]
