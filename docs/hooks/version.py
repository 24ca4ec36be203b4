"""The version that the documentation is of, at the foot of each page."""

from mkdocs.config.defaults import MkDocsConfig

from lrf3d.version import __version__


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the version in the footer."""
    config.copyright = f"lrf3d {__version__}"
    return config
