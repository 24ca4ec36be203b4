"""``lrf3d completion``: a completion script for the shell, generated from the help pages."""

from argparse import Namespace

from lrf3d.apps.cli.commands import COMMANDS
from lrf3d.apps.cli.console import Console, print_text
from lrf3d.apps.cli.parser import lists

# This lets zsh run completions for bash.
_ZSH = "autoload -U +X bashcompinit && bashcompinit\n"

_BASH = """\
_lrf3d() {{
    local word="${{COMP_WORDS[COMP_CWORD]}}" words=""
    case "${{COMP_WORDS[*]:1:COMP_CWORD-1}}" in
        "") words="{commands} help --version" ;;
{cases}
    esac
    case "${{COMP_WORDS[COMP_CWORD-1]}}" in
{values}
    esac
    COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -F _lrf3d lrf3d
"""


def completion(_: None, args: Namespace, console: Console) -> None:
    """Print a script that lets a shell complete commands, options and choices."""
    options = {name: [each for _title, row in lists(name) for each in row] for name in COMMANDS}
    groups = dict[str, list[str]]()
    for name in COMMANDS:
        first, *second = name.split(" ")
        groups.setdefault(first, []).extend(second)
    # Commands of a group come before the group, since they begin with its name.
    words = {
        name: [flag for each in found for flag in each.names if flag[:2] == "--"]
        for name, found in options.items()
    }
    words |= {name: seconds for name, seconds in groups.items() if seconds}
    cases = [f'        "{name}"*) words="{" ".join(found)}" ;;' for name, found in words.items()]
    choices = {
        each.names[-1]: each.value.replace("|", " ")
        for found in options.values()
        for each in found
        if "|" in each.value and each.value == each.value.lower()
    }
    values = [f'        {name}) words="{found}" ;;' for name, found in choices.items()]
    script = _BASH.format(
        commands=" ".join(groups), cases="\n".join(cases), values="\n".join(values)
    )
    print_text(script if args.shell == "bash" else _ZSH + script)
