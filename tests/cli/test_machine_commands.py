"""``miurafab machine`` and ``miurafab virtual``: answers, exit codes, one sentence."""

import io
import json
import signal
import subprocess
import sys

import pytest
from command_line import sentence

from miurafab.cli.machine import ACTIONS


def answer_of(done):
    """The JSON object that is all of a command's output."""
    assert (done.returncode, done.stderr) == (0, "")
    return json.loads(done.stdout)


@pytest.mark.parametrize("action", [a for a in ACTIONS if a != "list"])
def test_every_action_tells_a_port_that_does_not_exist(run, tmp_path, action):
    (tmp_path / "saved").write_text("$0=10\n")
    (tmp_path / "job.nc").write_text("M4 S1\nG1 X5 F600\nM5\n")
    files = {"backup": ["saved"], "restore": ["saved"], "frame": ["job.nc"]}
    file = files.get(action, [])
    move = ["--x", "1mm"] if action == "jog" else []
    done = run("machine", action, *file, *move, "--port", "/dev/no-such-port")
    assert "The port /dev/no-such-port does not exist" in sentence(done, 3)


def test_list_answers_json(run):
    done = run("machine", "list", "--json")
    assert isinstance(answer_of(done)["ports"], list)


def test_info_and_settings_of_the_virtual_machine(run):
    answer = answer_of(run("machine", "info", "--port", "virtual", "--json"))
    assert (answer["version"], answer["state"], answer["rx_bytes"]) == ("1.1h", "Idle", 128)
    done = run("machine", "settings", "--port", "virtual")
    assert done.returncode == 0
    assert "X maximum rate" in done.stdout
    assert "500.000" in done.stdout


def test_backup_then_restore_changes_nothing(run, tmp_path):
    assert run("machine", "backup", "saved.txt", "--port", "virtual").returncode == 0
    assert (tmp_path / "saved.txt").read_text().startswith("$0=10\n$1=25\n")
    done = run("machine", "restore", "saved.txt", "--port", "virtual")
    assert done.returncode == 0
    assert "has these settings already" in done.stdout
    (tmp_path / "saved.txt").write_text("$110=4000\n$32=1\n")
    done = run("machine", "restore", "saved.txt", "--port", "virtual", "--json")
    assert answer_of(done)["changed"] == {"$110": "4000.000", "$32": "1"}


def test_jog_moves_by_lengths_with_units(run):
    done = run("machine", "jog", "--x", "1cm", "--port", "virtual", "--json")
    assert answer_of(done)["machine_position"] == [10.0, 0.0, 0.0]


def test_what_the_console_heard_is_one_answer(run, monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.StringIO("$N\n"))
    answer = answer_of(run("machine", "console", "--port", "virtual", "--json"))
    assert answer["said"][1:] == ["$N0=", "$N1=", "ok"]


def test_what_the_controller_refuses_is_exit_3(run):
    assert "homing is switched off" in sentence(run("machine", "home", "--port", "virtual"), 3)


@pytest.mark.parametrize(
    ("arguments", "code", "named"),
    [
        (("virtual", "--pty", "--tcp", "localhost:0"), 2, "not both"),
        (("virtual", "--tcp", "localhost"), 2, "'localhost' is not HOST:PORT"),
        (("virtual", "--tcp", "192.0.2.1:7"), 3, "Cannot listen at 192.0.2.1:7"),
        (("virtual", "--settings", "no-such-machine"), 2, "'no-such-machine' is not a known"),
        (("virtual", "--speed", "0"), 2, "speed"),
        (("virtual", "--beam-log", "no/such/folder/x.csv"), 2, "no/such/folder/x.csv"),
        (("machine", "restore", "gone.txt", "--port", "virtual"), 2, "gone.txt does not exist"),
        (("machine", "jog", "--port", "virtual"), 2, "distance along X"),
        (("machine", "jog", "--x", "1 parsec", "--port", "virtual"), 2, "parsec"),
    ],
)
def test_bad_input_is_one_sentence(run, arguments, code, named):
    assert named in sentence(run(*arguments), code)


@pytest.mark.skipif(sys.platform == "win32", reason="ends it as a terminal on POSIX does")
def test_the_first_line_of_virtual_is_its_address_and_ctrl_c_ends_it_well():
    for options, start in ((["--pty"], "/dev/"), (["--tcp", "127.0.0.1:0"], "socket://127.0.0.1:")):
        command = [sys.executable, "-m", "miurafab", "virtual", *options]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as process:
            assert process.stdout.readline().startswith(start)
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=20)
        assert (process.returncode, out) == (0, "")
        assert "0 bytes lost" in err
