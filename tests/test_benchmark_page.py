"""The page of the benchmarks has each of them, by the command that made it."""

import re

import table


def test_each_entry_is_a_program_with_a_line_on_the_page():
    page = table.PAGE.read_text(encoding="utf-8")
    for entry in table.ENTRIES:
        assert (table.FOLDER / f"{entry.program}.py").is_file()
        assert f"| [{entry.program}](#{entry.program}) | {entry.shows} |" in page
    made = re.findall(r"^`(python benchmarks/.*)`$", page, re.MULTILINE)
    commands = [entry.command for entry in table.ENTRIES]
    assert [command for command in commands if command in made] == made


def test_an_entry_that_needs_what_is_not_there_is_told():
    made = table.run(table.Entry("times", "", "nothing", needs="no-such-program"))
    assert (made.code, made.text) == (None, "no-such-program is not installed")
    assert "| nothing | no-such-program is not installed |" in table.page([made])


def test_what_a_benchmark_prints_and_its_code_are_kept(tmp_path, monkeypatch):
    (tmp_path / "small.py").write_text("print('a | b  ')\nraise SystemExit(1)\n")
    monkeypatch.setattr(table, "FOLDER", tmp_path)
    made = table.run(table.Entry("small", "", "two letters"))
    assert (made.code, made.text) == (1, "a | b  \n")
    assert "```console\na | b\n```\n" in table.page([made])
