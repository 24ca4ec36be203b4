"""The page's one element: the component of ``run_view.js`` with its setup."""

from pathlib import Path
from typing import Any

import nicegui.elements.scene as nicegui_scene
from nicegui.element import Element

_THREE = Path(nicegui_scene.__file__).parent / "dist"


class RunView(
    Element,
    component="run_view.js",
    esm={"lrf3d-view": "page", "nicegui-scene": str(_THREE)},
):
    """The scene with its words and buttons.

    Args:
        setup: The data of scene and run for the page.
    """

    def __init__(self, setup: dict[str, Any]) -> None:
        super().__init__()
        self._props["setup"] = setup
