"""The version of the installed package; reading it takes longer than ``import lrf3d``."""

from importlib.metadata import version

__version__ = version("lrf3d")
