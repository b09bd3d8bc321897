"""The program: every command in its group, and what happens between the arguments and a command."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from cyclopts import (
    App,
    CoercionError,
    CycloptsError,
    Group,
    MissingArgumentError,
    Parameter,
    UnknownCommandError,
    UnknownOptionError,
    UnusedCliTokensError,
)

from miurafab.cli import (
    calibrate,
    check,
    completion,
    convert,
    cut,
    doctor,
    energy,
    fit,
    fold,
    layers,
    machine,
    preview,
    profiles,
    sheets,
    studio,
    surfaces,
    tradeoff,
    use,
    virtual,
)
from miurafab.cli.console import Screen
from miurafab.cli.declared import ARGUMENTS, EVERY_COMMAND, OPTIONS
from miurafab.cli.help import HelpFormatter
from miurafab.errors import DONE, EXIT_CODES, UsageError
from miurafab.options import Choice, Flag, Kind
from miurafab.version import __version__

DESIGN = Group("Design", sort_key=1)
MAKE = Group("Make", sort_key=2)
MACHINES = Group("Machines", sort_key=3)
MORE = Group("More", sort_key=4)

Action = tuple[Callable[..., int], Sequence[str]]
"""A command of a command, and its examples."""


@dataclass(frozen=True)
class Command:
    """A command: its ``group`` in help, what it calls, its examples, and its actions by name.

    ``help`` is for a command whose page is not that of the function that it calls.
    """

    group: Group
    call: Callable[..., int] | None
    examples: Sequence[str] = ()
    actions: Mapping[str, Action] = field(default_factory=dict)
    help: str | None = None


COMMANDS: Mapping[str, Command] = {
    "surfaces": Command(DESIGN, surfaces.surfaces, surfaces.EXAMPLES),
    "fit": Command(DESIGN, fit.fit, fit.EXAMPLES),
    "check": Command(DESIGN, check.check, check.EXAMPLES),
    "fold": Command(DESIGN, fold.fold, fold.EXAMPLES),
    "layers": Command(DESIGN, layers.layers, layers.EXAMPLES),
    "energy": Command(DESIGN, energy.energy, energy.EXAMPLES),
    "tradeoff": Command(DESIGN, tradeoff.tradeoff, tradeoff.EXAMPLES),
    "convert": Command(DESIGN, convert.convert, convert.EXAMPLES),
    "sheets": Command(MAKE, sheets.sheets, sheets.EXAMPLES),
    "preview": Command(MAKE, preview.preview, preview.EXAMPLES),
    "cut": Command(MAKE, cut.cut, cut.EXAMPLES),
    "calibrate": Command(MAKE, calibrate.calibrate, calibrate.EXAMPLES),
    "machine": Command(MACHINES, None, actions=machine.ACTIONS, help=machine.HELP),
    "profiles": Command(
        MACHINES,
        profiles.profiles,
        profiles.PROFILES_EXAMPLES,
        profiles.PROFILES_ACTIONS,
        profiles.PROFILES_HELP,
    ),
    "materials": Command(
        MACHINES,
        profiles.show_material,
        profiles.MATERIALS_EXAMPLES,
        profiles.MATERIALS_ACTIONS,
        profiles.MATERIALS_HELP,
    ),
    "use": Command(MACHINES, use.use, use.EXAMPLES),
    "virtual": Command(MACHINES, virtual.virtual, virtual.EXAMPLES),
    "studio": Command(MORE, studio.studio, studio.EXAMPLES),
    "doctor": Command(MORE, doctor.doctor, doctor.EXAMPLES),
    "completion": Command(MORE, completion.completion, completion.EXAMPLES),
}
"""Every command, in the order of the work."""

HELP = """From a curved surface to a folded origami shell, cut on a real machine.

A length has a unit (300mm, 12in) or is in mm; an angle has a unit (10deg, 0.2rad) or is in degrees.

'miurafab COMMAND --help' shows the options of a command, with examples."""


def examples() -> Iterator[str]:
    """Every example that a page of help shows."""
    for command in COMMANDS.values():
        yield from command.examples
        for _, lines in command.actions.values():
            yield from lines


def _program() -> App:
    codes = "\n".join(f"  {code:>3}  {meaning}" for code, meaning in EXIT_CODES.items())
    program = App(
        name="miurafab",
        help=HELP,
        help_format="plaintext",
        help_formatter=HelpFormatter(),
        help_epilogue=f"Exit codes:\n{codes}",
        version=f"miurafab {__version__}",
        default_parameter=Parameter(negative=(), allow_repeating=True),
    )
    for name, command in COMMANDS.items():
        made = _add(
            program, name, command.call, command.examples, group=command.group, help=command.help
        )
        for action, (call, lines) in command.actions.items():
            _add(made, action, call, lines)
    for flag, text in (("--help", "Show this page."), ("--version", "Show the version.")):
        program[flag].help = text
        program[flag].group = EVERY_COMMAND
    return program


def _add(
    parent: App,
    name: str,
    call: Callable[..., int] | None,
    lines: Sequence[str],
    **how: Any,
) -> App:
    made = App(
        name=name,
        default_command=call,
        help_epilogue="\n  ".join(("Examples:", *lines)) if lines else "",
        group_arguments=ARGUMENTS,
        group_parameters=OPTIONS,
        sort_key=len(parent.resolved_commands()),
        **how,
    )
    parent.command(made)
    made["--help"].help = "Show this page."
    made["--help"].group = EVERY_COMMAND
    made["--help"].show = True
    return made


app = _program()


def run(arguments: Sequence[str], serve_studio: studio.ServeStudio) -> int:
    """Run the command that ``arguments`` name and return its exit code.

    Raises :class:`~miurafab.errors.UsageError` for arguments that make no command, and whatever the
    command raises.
    """
    try:
        command, bound, wanted = app.parse_args(
            arguments, console=Screen(), exit_on_error=False, print_error=False
        )
    except CycloptsError as error:
        raise UsageError(_sentence(error)) from None
    handed = {"serve": serve_studio, "program": app}
    for name in wanted:
        bound.arguments[name] = handed[name]
    return command(*bound.args, **bound.kwargs) or DONE  # help and the version return None


def _sentence(error: CycloptsError) -> str:
    """What is wrong with the command line."""
    path = tuple(error.command_chain or ())
    name = " ".join(("miurafab", *path))
    unused = error.unused_tokens or [""]
    if isinstance(error, UnknownCommandError):
        what = "option" if unused[0].startswith("-") else "command"
        near = _near(unused[0], error.app or app) or f"; {name} --help lists them"
        return f"{name} has no {what} '{unused[0]}'{near}."
    if isinstance(error, UnknownOptionError):
        return _unknown_option(error.token.keyword or error.token.value, path)
    if isinstance(error, MissingArgumentError) and error.argument is not None:
        metavar = error.argument.parameter.metavar or ""
        if error.keyword:
            return f"{name}: {error.keyword} needs a value, {metavar}."
        unknown = [token for token in unused if token.startswith("--")]
        if unknown:
            return _unknown_option(unknown[0], path)
        label = f"{error.argument.name} {metavar}".strip()
        return f"{name} needs {label}: {error.argument.parameter.help}"
    if isinstance(error, CoercionError) and error.token and error.argument:
        names = error.argument.parameter.choices
        kind = Choice(names) if isinstance(names, tuple) else Flag()
        return _wrong_value(error.token.keyword or error.argument.name, error.token.value, kind)
    if isinstance(error, UnusedCliTokensError):
        return f"{name} takes no further argument '{unused[0]}'."
    return f"{name}: {str(error).rstrip('.')}."


def _unknown_option(word: str, path: Sequence[str]) -> str:
    command = app
    for name in path:
        command = command[name]
    options = command.assemble_argument_collection(default_parameter=app.default_parameter)
    known = [name for each in options for name in each.names]
    option = word.partition("=")[0]
    return f"{' '.join(('miurafab', *path))} has no option {option}{_near(option, known)}."


def _wrong_value(label: str, value: str, kind: Kind) -> str:
    """In the words of the declaration, which is what Python and TOML files answer with."""
    fault = ""
    try:
        kind.read(value)
    except ValueError as error:
        fault = str(error)
    return f"{label} {fault}."


def _near(word: str, names: Iterable[str]) -> str:
    """A hint at the one of ``names`` that is most like ``word``; empty for none."""
    near = difflib.get_close_matches(word, list(names), n=1)
    return f" (did you mean '{near[0]}'?)" if near else ""
