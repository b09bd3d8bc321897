"""Options of the command line, made of the declarations in :mod:`miurafab.options`.

A command that takes the options of a dataclass is wrapped by :func:`takes` and gets those that were
given as keyword arguments, as text: ``--min-edge 3mm`` becomes ``min_edge="3mm"``. It hands them to
the library function, which reads them. An option of one command alone is made by :func:`option`
from a :class:`~miurafab.options.Kind`, and read here.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, get_origin

from cyclopts import Group, Parameter, Token

from miurafab.cli.ending import flag, spelled
from miurafab.errors import OptionError
from miurafab.options import Choice, Declared, Flag, Kind, Several, Text, declared

Named = str | Path
"""What is a name or a file: text, for which shells complete files."""

ARGUMENTS = Group("Arguments", sort_key=0)
OPTIONS = Group("Options", sort_key=1)
EVERY_COMMAND = Group("General", sort_key=99)


def argument(label: str, help: str, choices: Sequence[str] | None = None) -> Parameter:
    """What is given by its place; ``label`` stands for it in help."""
    return Parameter(name=label, help=help, group=ARGUMENTS, choices=choices)


def option(
    kind: Kind,
    help: str,
    *names: str,
    group: Group = OPTIONS,
    default_text: str | None = None,
    negative: str = "",
) -> Parameter:
    """An option of one command, read by ``kind``.

    ``names`` replace the parameter's own name. ``default_text`` says what holds where the
    parameter's default is None; ``negative`` is the option that switches a flag off.
    """
    if isinstance(kind, Flag):
        return Parameter(
            name=names,
            help=help,
            group=group,
            show_default=default_text,
            negative=(negative,) if negative else (),
        )

    def read(type_: Any, tokens: Sequence[Token]) -> Any:
        values = [_read(kind, token, names) for token in tokens]
        return values if get_origin(type_) is list else values[-1]

    return Parameter(
        name=names,
        help=help,
        group=group,
        metavar=kind.metavar,
        show_default=default_text or (lambda value: "" if value is None else kind.show(value)),
        converter=read,
        choices=kind.names if isinstance(kind, Choice) else None,
        allow_leading_hyphen=True,
    )


def _read(kind: Kind, token: Token, names: Sequence[str]) -> Any:
    try:
        return kind.read(token.value)
    except ValueError as fault:
        long = names[-1] if names else token.keyword or ""
        name = long.lstrip("-").replace("-", "_")
        raise OptionError(name, str(fault)) from None


TargetArgument = Annotated[
    Named,
    argument(
        "TARGET",
        "A named surface (hypar:height=0.5), a formula (formula:z=x*y/2), a design .toml, a mesh "
        "file, or an image of heights (dem.png:height=20).",
    ),
]
MachineOption = Annotated[
    str | None, option(Text("NAME"), "A machine profile: a shipped name or a TOML file.")
]
MaterialOption = Annotated[
    str | None, option(Text("NAME"), "A material: a shipped name or a TOML file.")
]


def takes(
    *classes: Callable[[], type], without: Collection[str] = (), only: Collection[str] = ()
) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Add the options that ``classes`` declare, but those ``without``, or these ``only``, to a
    command.

    They stand in place of its ``**given``. Each of ``classes`` is a function that imports the
    class. It is called when the options are first needed: ``miurafab --help`` must not wait for the
    rooms that hold the classes.
    """
    return lambda command: _Command(command, classes, without, only)


class _Command:
    """A command whose signature, which cyclopts reads, is completed when it is first read."""

    def __init__(
        self,
        command: Callable[..., int],
        classes: Sequence[Callable[[], type]],
        without: Collection[str],
        only: Collection[str],
    ) -> None:
        self._command = command
        self._classes = classes
        self._without, self._only = without, only
        self.__doc__ = command.__doc__
        self.__name__ = command.__name__
        self.__module__ = command.__module__

    def __call__(self, *arguments: Any, **options: Any) -> int:
        return self._command(*arguments, **options)

    @cached_property
    def __signature__(self) -> inspect.Signature:
        own = inspect.signature(self._command, eval_str=True)
        parameters = [
            parameter
            for parameter in own.parameters.values()
            if parameter.kind is not inspect.Parameter.VAR_KEYWORD
        ]
        groups: dict[str, Group] = {"": OPTIONS}
        parameters += [
            parameter
            for each in self._classes
            for parameter in _parameters(each(), groups)
            if parameter.name not in self._without
            and (not self._only or parameter.name in self._only)
        ]
        return own.replace(parameters=parameters)

    # cyclopts reads the annotations of an object; of this one they are made when asked for.
    @property
    def __annotations__(self) -> dict[str, Any]:  # type: ignore[override]
        return {name: each.annotation for name, each in self.__signature__.parameters.items()}


def _parameters(cls: type, groups: dict[str, Group]) -> Iterator[inspect.Parameter]:
    """The options of ``cls`` as parameters that hold text, under the ``groups`` of their headings.

    Help shows the groups in the order in which they come into being.
    """
    for name, entry in declared(cls).items():
        group = groups.setdefault(entry.group, Group(entry.group, sort_key=1 + len(groups)))
        yield inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=None,
            annotation=_annotation(entry, group),
        )


def _annotation(entry: Declared, group: Group) -> Any:
    parameter = Parameter(
        name=flag(entry.name),
        help=spelled(entry.help),
        group=group,
        metavar=entry.kind.metavar,
        show_default=spelled(entry.default_text) or False,
        allow_leading_hyphen=True,
    )
    if isinstance(entry.kind, Flag):
        return Annotated[bool | None, parameter]
    if isinstance(entry.kind, Several):  # --force a --force b is --force a,b
        return Annotated[list[str] | None, parameter, Parameter(converter=_joined(entry.kind))]
    if isinstance(entry.kind, Choice):
        return Annotated[str | None, parameter, Parameter(choices=entry.kind.names)]
    return Annotated[str | None, parameter]


def _joined(kind: Several) -> Callable[[Any, Sequence[Token]], str]:
    return lambda type_, tokens: kind.separator.join(token.value for token in tokens)


def split(given: Mapping[str, Any], cls: type) -> tuple[dict[str, Any], dict[str, Any]]:
    """The options ``given`` that ``cls`` declares, and the rest."""
    own = declared(cls)
    return (
        {name: value for name, value in given.items() if name in own},
        {name: value for name, value in given.items() if name not in own},
    )
