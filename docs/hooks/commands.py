"""One page a command, from the program itself, so that none is missing and none is stale.

What the program says of a command comes first; what stands in docs/commands/NAME.md follows it.
"""

import html
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from lrf3d.cli.app import app

Commands = Iterator[tuple[tuple[str, ...], Any]]


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the pages into the navigation, groups of commands as groups of pages."""
    entries: list[Any] = ["commands/index.md"]
    groups: dict[str, list[Any]] = {}
    listed = list(commands(typer.main.get_command(app)))
    in_groups = {path[0] for path, _ in listed if len(path) > 1}
    for path, _ in listed:
        page = {" ".join(path): f"commands/{'-'.join(path)}.md"}
        if path[0] in in_groups:
            if path[0] not in groups:
                groups[path[0]] = []
                entries.append({path[0]: groups[path[0]]})
            groups[path[0]].append(page)
        else:
            entries.append(page)
    for item in config.nav or []:
        if "Commands" in item:
            item["Commands"] = entries
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Write the pages."""
    program = typer.main.get_command(app)
    listed = []
    for path, command in commands(program):
        name = f"commands/{'-'.join(path)}.md"
        written = files.get_file_from_path(name)
        more = ""
        if written is not None:
            more = written.content_string
            files.remove(written)
        files.append(File.generated(config, name, content=page(path, command) + more))
        summary = command.help.splitlines()[0]
        listed.append(f"| [`lrf3d {' '.join(path)}`]({Path(name).name}) | {summary} |")
    index = files.get_file_from_path("commands/index.md")
    assert index is not None
    content = index.content_string + "\n| command | what it does |\n|---|---|\n" + "\n".join(listed)
    files.remove(index)
    files.append(File.generated(config, "commands/index.md", content=content + "\n"))
    return files


def commands(command: Any, path: tuple[str, ...] = ()) -> Commands:
    """All commands that do something, with their names; a group may do something by itself."""
    for name, inner in command.commands.items():
        group = hasattr(inner, "commands")
        if not group or inner.invoke_without_command:
            yield (*path, name), inner
        if group:
            yield from commands(inner, (*path, name))


def page(path: tuple[str, ...], command: Any) -> str:
    """What the program says of a command, as Markdown."""
    arguments = [item for item in command.params if item.param_type_name == "argument"]
    options = [item for item in command.params if item.param_type_name == "option"]
    names = " ".join(
        shown_name(item) if item.required else f"[{shown_name(item)}]" for item in arguments
    )
    example = command.epilog.removeprefix("Example: ")
    lines = [
        f"# lrf3d {' '.join(path)}",
        "",
        # A paragraph of a help text is one however its lines are broken.
        *(text.replace("\n", " ") + "\n" for text in command.help.split("\n\n")),
        "```text",
        f"lrf3d {' '.join(path)} {names}".rstrip() + " [OPTIONS]",
        "```",
        "",
        "```sh",
        example,
        "```",
        "",
    ]
    lines += ["| argument | |", "|---|---|"] if arguments else []
    for item in arguments:
        lines.append(f"| `{shown_name(item)}` | {cell(item.help)}{choices(item)} |")
    lines += ["", "| option | value | default | |", "|---|---|---|---|"]
    for item in options:
        given = "<br>".join(f"`{name}`" for name in [*item.opts, *item.secondary_opts])
        lines.append(f"| {given} | {cell(value(item))} | {default(item)} | {cell(item.help)} |")
    return "\n".join(lines) + "\n\n"


def shown_name(argument: Any) -> str:
    """How an argument is called."""
    return str(argument.metavar or argument.name.upper()).strip("[]")


def choices(parameter: Any) -> str:
    """The choices that there are."""
    allowed = getattr(parameter.type, "choices", ())
    names = ", ".join(f"`{getattr(item, 'value', item)}`" for item in allowed)
    return f" One of {names}." if allowed else ""


def value(option: Any) -> str:
    """What an option takes."""
    if option.is_flag:
        return ""
    allowed = getattr(option.type, "choices", ())
    if allowed:
        return " or ".join(str(getattr(item, "value", item)) for item in allowed)
    kinds = {"int range": "integer", "int": "integer", "float": "number", "str": "text"}
    kinds["float range"] = "number"
    kind = option.metavar or kinds.get(option.type.name, option.type.name)
    least, most = getattr(option.type, "min", None), getattr(option.type, "max", None)
    if least is not None and most is not None:
        return f"{kind}, {least:g} to {most:g}"
    return kind if least is None else f"{kind} ≥ {least:g}"


def default(option: Any) -> str:
    """What holds where an option is not given."""
    if option.required:
        return "needed"
    if option.is_flag:
        return "" if not option.secondary_opts else f"`{option.opts[0]}`"
    if option.default is None:
        return ""
    return f"`{getattr(option.default, 'value', option.default)}`"


def cell(text: str | None) -> str:
    """Text that may stand in a cell of a table."""
    return html.escape(text or "", quote=False).replace("|", r"\|")
