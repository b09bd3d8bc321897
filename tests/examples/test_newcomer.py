"""The walk of a newcomer: its page has the commands that are in print, and it judges what runs."""

import re
import sys

import newcomer
import pytest
from newcomer import PAGE, WALKED, Step, Walk, in_terminal, steps_of
from pages import ROOT


def _tables():
    text = PAGE.read_text(encoding="utf-8")
    return dict(re.findall(r"<!-- newcomer: ([\w-]+) -->\n(.*?)<!-- end -->", text, re.DOTALL))


def _rows(table):
    return [line.strip("| ").split(" | ") for line in table.strip().splitlines()[2:]]


@pytest.mark.parametrize("name", WALKED)
def test_the_page_has_each_command_that_is_in_print(name):
    """Written by ``python benchmarks/newcomer.py``."""
    steps = steps_of(WALKED[name])
    assert steps
    printed = [f"`{step.command}`" if step.program is None else step.command for step in steps]
    rows = _rows(_tables()[name])
    assert [row[0] for row in rows] == printed
    for row, step in zip(rows, steps, strict=True):
        assert ("not run: " in row[-1]) == (step.why_not is not None), row


def test_readme_tells_the_size_of_the_installation():
    (*_, (_, total)) = _rows(_tables()["libraries"])
    (told,) = re.findall(r"An installation takes (\d+) MB", (ROOT / "README.md").read_text())
    assert told == total


@pytest.fixture
def walk(tmp_path):
    made = Walk(tmp_path, None)
    for folder in (made.folder / ".venv", made.home):
        folder.mkdir(parents=True)
    return made


def _python(program):
    return f'{sys.executable} -c "{program}"'


def test_a_step_has_its_files_and_figures(walk, capsys):
    (walk.folder / "old").write_text("as it was")
    program = (
        "import os; os.mkdir('job'); [open(f'job/{k}', 'w') for k in 'ab']; "
        "open('.venv/lib', 'w'); open('../configuration/mine', 'w'); open('a.fold', 'w'); "
        "sum(range(10**7))"
    )
    name, *figures, wrote = walk.step(Step(_python(program)))
    assert name == f"`{_python(program)}`"
    seconds, processor, silent = map(float, figures)
    assert silent <= seconds
    assert processor > 0
    assert wrote == "`a.fold`, `configuration/mine`, `job/` (2 files)"
    assert capsys.readouterr().out.endswith(f"s {_python(program)}\n")


def test_what_is_not_as_promised_is_a_fault(walk):
    walk.step(Step(_python("exit(3)"), code=3))
    walk.step(Step(_python("print('first', 'converged', sep=chr(10))"), shown="converged\n"))
    assert walk.faults == []
    walk.step(Step(_python("exit(3)")))
    walk.step(Step(_python("print('stalled')"), shown="converged\n"))
    code, text = walk.faults
    assert "ended with 3" in code
    assert text.endswith("printed:\nstalled\n\nand not:\nconverged\n")


def test_a_command_sees_a_terminal_and_a_server_is_interrupted(tmp_path):
    program = (
        "import sys, time\n"
        "try: print(sys.stdout.isatty()) or time.sleep(60)\n"
        "except KeyboardInterrupt: print('over')"
    )
    ran = in_terminal([sys.executable, "-uc", program], tmp_path, {}, serves=True)
    assert (ran.code, ran.text) == (0, "True\nover\n")


def test_a_step_that_is_left_out_is_in_the_table():
    (step,) = [each for each in steps_of(WALKED["readme"]) if each.command == "make test"]
    assert step.why_not == newcomer.LEFT_OUT["make test"]
