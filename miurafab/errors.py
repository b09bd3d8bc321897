"""Every error a user can meet is one sentence that names the thing and the way out.

The tree (the exit code of the command line in brackets)::

    MiurafabError
    ├── InputError [2]          the input is wrong: a file, an option, a value
    │   ├── UsageError          a command line that is no command of miurafab
    │   ├── OptionError         an option that cannot be taken, by its name
    │   ├── UnitError           a length, angle or feed that cannot be read
    │   ├── ProfileError        a machine or material profile, by file and key
    │   ├── TargetError         a surface, profile curve or mesh that cannot be a target
    │   ├── PatternError        a pattern file that cannot be read or made
    │   ├── LayoutError         a pattern, bed and material that admit no layout
    │   └── GcodeError          a G-code program that cannot be read or must not be sent
    ├── MachineError [3]        the machine, its port or its controller failed
    │   ├── PortError           the port cannot be opened, or went away
    │   ├── ControllerError     the controller answered an error or an alarm
    │   └── JobStopped [130]    the job ended early at somebody's wish
    └── PersonNeeded [5]        the work waits for a person, such as for fresh material

Numerical failure is not here: a fit that does not converge is a result with advice. An exception
outside this tree is a defect of miurafab; the command line turns it into a sentence and a log file.
"""

from __future__ import annotations

import re
from collections.abc import Callable

DONE, NO, BAD_INPUT, MACHINE_FAILED, DEFECT, WAITING, INTERRUPTED = 0, 1, 2, 3, 4, 5, 130
EXIT_CODES = {
    DONE: "done",
    NO: "the answer is no: a check failed, a limit is not met",
    BAD_INPUT: "bad input or usage",
    MACHINE_FAILED: "the machine or its port failed",
    DEFECT: "a defect of miurafab; the message names a log file",
    WAITING: "waiting for a person, such as for fresh material",
    INTERRUPTED: "interrupted by Ctrl-C or at the keyboard",
}
"""What each exit code of the command line means."""

_LONGEST = 1500
"""Characters of a sentence; it may quote a line of a file, which has any length."""
_LONG_WORD = re.compile(r"[^\s/\\]{300,}")
_OPTION = re.compile(r"`([a-z][a-z0-9_]*)`")


def spell_options(sentence: str, spell: Callable[[str], str]) -> str:
    """``sentence`` with each option's name, which stands in backticks, as ``spell`` writes it.

    A room below the command line knows the name of an option and not how it is written: the
    command line writes ``--min-edge``, a design file ``min_edge``, the page a label.

    >>> spell_options("Raise `min_edge`.", lambda name: "--" + name.replace("_", "-"))
    'Raise --min-edge.'
    """
    return _OPTION.sub(lambda match: spell(match[1]), sentence)


def is_plain(text: str) -> bool:
    """Whether ``text`` is UTF-8 of one line without control characters.

    A name or a sentence may go to a terminal and into XML, where control characters do harm. The
    bytes of a file name that are not UTF-8 are lone surrogates in Python.

    >>> is_plain("Sättel 鞍.fold"), is_plain("a\\x1b[2J"), is_plain("caf\\udce9.fold")
    (True, False, False)
    """
    return not any(_is_control(letter) for letter in text)


def shown(text: str) -> str:
    """``text`` for a terminal or an XML file: control characters other than line ends and tabs are
    written as in Python.

    >>> shown("a\\x1b[2J\\n")
    'a\\\\x1b[2J\\n'
    """
    if is_plain(text):
        return text
    return "".join(
        letter.encode("unicode_escape").decode("ascii")
        if _is_control(letter) and letter not in "\n\t"
        else letter
        for letter in text
    )


def _is_control(letter: str) -> bool:
    """Control characters (C0, DEL, C1), the signs that turn the direction of text, surrogates, and
    what XML 1.0 (section 2.2) excludes.
    """
    return (
        letter < " "
        or "\x7f" <= letter <= "\x9f"
        or "\u202a" <= letter <= "\u202e"
        or "\u2066" <= letter <= "\u2069"
        or "\ud800" <= letter <= "\udfff"
        or letter in "\u2028\u2029\ufffe\uffff"
    )


def _short(sentence: str) -> str:
    """``sentence`` with what it quotes from a file cut short."""
    sentence = _LONG_WORD.sub(lambda match: f"{match[0][:100]}...{match[0][-20:]}", sentence)
    return (
        sentence if len(sentence) <= _LONGEST else f"{sentence[: _LONGEST - 40]}...{sentence[-20:]}"
    )


class MiurafabError(Exception):
    """A failure whose message is a complete sentence for the user.

    ``exit_code`` is what the command line exits with. ``str`` quotes the names of options;
    ``sentence`` has them in backticks, for :func:`spell_options`.
    """

    exit_code = BAD_INPUT

    def __init__(self, sentence: str) -> None:
        one_line = shown(sentence).replace("\n", "\\n").replace("\t", "\\t")
        super().__init__(_short(one_line))

    @property
    def sentence(self) -> str:
        """The message as it was raised."""
        return super().__str__()

    def __str__(self) -> str:
        return spell_options(self.sentence, lambda name: f"'{name}'")


class InputError(MiurafabError):
    """Something the user gave is wrong."""


class UsageError(InputError):
    """A command line that is no command of miurafab."""


class OptionError(InputError):
    """An option that cannot be taken.

    ``option`` is its name, None where the fault lies between several. The sentence is made of
    ``where`` (a file or a table; empty for none), the name and the ``complaint``.
    """

    def __init__(self, option: str | None, complaint: str, where: str = "") -> None:
        sentence = complaint if option is None else f"`{option}` {complaint}"
        if where:  # a file writes the name of an option as it is
            sentence = f"{where}: " + spell_options(sentence, lambda name: f"'{name}'")
        super().__init__(sentence.rstrip(".") + ".")
        self.option = option
        self.complaint = complaint
        self.where = where


class UnitError(InputError):
    """A quantity that cannot be read."""


class ProfileError(InputError):
    """A machine or material profile with a fault, named by file and key."""


class TargetError(InputError):
    """A surface, profile curve or mesh that cannot serve as a target."""


class PatternError(InputError):
    """A pattern file that cannot be read, or a pattern that cannot be built."""


class LayoutError(InputError):
    """A pattern that cannot be laid out on this bed with this material."""


class GcodeError(InputError):
    """A G-code program that cannot be read or must not be sent."""


class MachineError(MiurafabError):
    """The machine, its port or its controller failed."""

    exit_code = MACHINE_FAILED


class PortError(MachineError):
    """The port cannot be opened, or went away."""


class ControllerError(MachineError):
    """The controller answered an error or went into alarm."""


class PersonNeeded(MiurafabError):
    """The work waits for a person, such as for fresh material, and nobody is there."""

    exit_code = WAITING


class JobStopped(MachineError):
    """The job was ended early, with the beam off, at somebody's wish."""

    exit_code = INTERRUPTED
