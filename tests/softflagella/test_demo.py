"""The demo runs independent steps side by side, and loses neither their output nor their errors."""

import subprocess

import pytest

from softflagella.demo import _beside


def test_output_of_a_command_beside_a_step_follows_the_output_of_the_step(capfd):
    with _beside("--version"):
        print("the step")
    lines = capfd.readouterr().out.splitlines()
    assert lines[0].split() == ["softflagella", "--version"]
    assert lines[1] == "the step"
    assert lines[2].startswith("softflagella ")
    assert len(lines) == 3


def test_a_command_that_fails_beside_a_step_is_an_error_with_its_message(capfd):
    with pytest.raises(subprocess.CalledProcessError), _beside("train", "no-such-folder", "--out", "m"):
        pass
    assert "no-such-folder" in capfd.readouterr().out.splitlines()[-1]


def test_a_step_that_fails_ends_the_command_beside_it(monkeypatch):
    started = []
    start = subprocess.Popen
    monkeypatch.setattr(subprocess, "Popen", lambda *a, **k: started.append(start(*a, **k)) or started[0])
    with pytest.raises(KeyboardInterrupt), _beside("steady", "paper-control"):
        raise KeyboardInterrupt
    assert started[0].poll() is not None
