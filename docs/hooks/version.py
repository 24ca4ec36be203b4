"""The version that the documentation is of: at the foot of each page, and in a list of versions."""

import os

from mkdocs.config.defaults import MkDocsConfig

from lrf3d.version import __version__


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the version in the footer, and the list in the head of pages of a site that has one.

    The list is fetched from the site, which scripts/site makes; pages that are read from a folder
    fetch nothing.
    """
    config.copyright = f"lrf3d {__version__}"
    if os.environ.get("DOCS_OF_A_SITE"):
        config.extra["version"] = {"provider": "mike"}
    return config
