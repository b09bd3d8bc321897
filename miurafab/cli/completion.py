"""``miurafab completion``: a script that lets a shell complete commands and options."""

from __future__ import annotations

import sys
from typing import Annotated

from cyclopts import App, Parameter

from miurafab.cli.console import Console
from miurafab.cli.declared import argument
from miurafab.errors import DONE

EXAMPLES = ("miurafab completion bash", "miurafab completion powershell")

SHELLS = ("bash", "zsh", "fish", "powershell")


def completion(
    shell: Annotated[str, argument("SHELL", f"One of {', '.join(SHELLS)}.", SHELLS)],
    /,
    *,
    program: Annotated[App, Parameter(parse=False)],
    console: Console = Console(),
) -> int:
    """Print a script that completes commands and options in a shell.

    bash: add 'eval "$(miurafab completion bash)"' to ~/.bashrc.

    zsh: write the script to a file named _miurafab in a folder of $fpath; compinit finds it.

    fish: write the script to ~/.config/fish/completions/miurafab.fish.

    PowerShell: add 'miurafab completion powershell | Out-String | Invoke-Expression' to $PROFILE.
    """
    # The command line takes one of SHELLS only, which a str does not say.
    script = program.generate_completion(shell=shell)  # type: ignore[arg-type]
    # zsh calls a function by the name of its file, which is that of the program
    script = script.replace("\n_cyclopts_miurafab() {", "\n_miurafab() {")
    console.answer({"shell": shell, "script": script}, lambda: print(script, file=sys.stdout))
    return DONE
