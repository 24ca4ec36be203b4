"""One page a command, from the program itself, so that none is missing and none is stale.

What the program says of a command comes first; what stands in docs/commands/NAME.md follows it.
"""

import html
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from lrf3d.apps.cli.commands import COMMANDS
from lrf3d.apps.cli.parser import Option, lists


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the pages into the navigation, groups of commands as groups of pages."""
    entries: list[Any] = ["commands/index.md"]
    groups: dict[str, list[Any]] = {}
    for name in COMMANDS:
        page = {name: f"commands/{file_name(name)}"}
        group, several, _ = name.partition(" ")
        if several and group not in groups:
            entries.append({group: groups.setdefault(group, [])})
        (groups[group] if several else entries).append(page)
    for item in config.nav or []:
        if "Commands" in item:
            item["Commands"] = entries
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Write the pages."""
    listed = "\n| command | what it does |\n|---|---|\n"
    for name, text in COMMANDS.items():
        _write(files, config, f"commands/{file_name(name)}", before=page(name))
        listed += f"| [`lrf3d {name}`]({file_name(name)}) | {text.partition(chr(10))[0]} |\n"
    _write(files, config, "commands/index.md", after=listed)
    return files


def _write(
    files: Files, config: MkDocsConfig, name: str, *, before: str = "", after: str = ""
) -> None:
    """Replace a page by itself with more text."""
    written, text = files.get_file_from_path(name), ""
    if written is not None:
        text = written.content_string
        files.remove(written)
    files.append(File.generated(config, name, content=before + text + after))


def file_name(name: str) -> str:
    """The file of the page of a command."""
    return f"{name.replace(' ', '-')}.md"


def page(name: str) -> str:
    """What the program says of a command, as Markdown."""
    lines = [f"# lrf3d {name}", ""]
    for title, options in lists(name):
        if not options:
            # A paragraph of a help text is one however its lines are broken.
            text = title.replace("\n", " ")
            example = text.removeprefix("Example: ")
            lines += [text if example == text else f"```sh\n{example}\n```", ""]
            continue
        lines += [f"| {title.lower()} | value | default | |", "|---|---|---|---|"]
        lines += [f"| {' | '.join(row(option))} |" for option in options]
        lines.append("")
    return "\n".join([*lines, ""])


def row(option: Option) -> list[str]:
    """The cells of an option."""
    names, value, default, text = option
    if default and not value:
        names = [*names, f"--no-{names[-1].removeprefix('--')}"]
    value, text = (html.escape(each, quote=False).replace("|", r"\|") for each in (value, text))
    return [
        "<br>".join(f"`{each}`" for each in names),
        value,
        f"`{default}`" if default else "",
        text,
    ]
