"""The pictures of the README and the list of changes, as pages and files of the site.

They stand outside of docs/, and in the repository only once.
"""

from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

PICTURES = (".png", ".webp")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add assets/*.png and *.webp as pictures/, and CHANGELOG.md as a page."""
    root = Path(config.config_file_path).parent
    for path in sorted((root / "assets").iterdir()):
        if path.suffix in PICTURES:
            files.append(File.generated(config, f"pictures/{path.name}", abs_src_path=str(path)))
    changes = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    files.append(File.generated(config, "changes.md", content=changes))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Let links to assets/, which show pictures in a clone, lead to pictures/ of the site."""
    return markdown.replace("../assets/", "pictures/")
