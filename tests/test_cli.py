"""The command line: exit codes, who says what where, progress in a log and on a terminal."""

import os
import pty
import subprocess
from importlib.metadata import version
from types import SimpleNamespace

import pytest
from helpers.small import command, executable, roadmap, scenario_file, strict_json
from numba import njit

from glider_stream.base import compiling, progress
from glider_stream.cli import cli
from glider_stream.cli.group import Command
from glider_stream.roadmap.store import read_roadmap, write_roadmap

LOG = "build: 1,540 of 1,540 pairs, "


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "small.h5"
    write_roadmap(roadmap(), path)
    return path


def test_build_says_what_it_made(tmp_path, capsys):
    scenario, output = scenario_file(tmp_path), tmp_path / "out.h5"
    said = command(capsys, "build", scenario, "-o", output, "--threads", 1)
    assert said.code == 0
    assert said.out.startswith("Roadmap: 77 nodes, 929 edges\n")
    assert "on 1 threads" in said.out
    assert read_roadmap(output).target.tobytes() == roadmap().target.tobytes()
    # no terminal: a log
    assert said.err.startswith(LOG)
    *log, note, wrote = said.err.splitlines()
    assert wrote == f"wrote {output}"
    assert log[-1].endswith(" left")
    assert note.startswith(
        "note: legs leave a node in 7 directions of 36, fewer than 9: a query finds a slower route than"
    )
    assert "dense:  nodes 95 m apart at a depth, 0.45 legs; legs in 7 of 36" in said.out
    assert "\x1b" not in said.err


def test_set_reaches_the_scenario(tmp_path, capsys):
    output = tmp_path / "out.h5"
    kinds = ["--set", "neighbours.kind=all", "--set", "sampling.shape=[2,2,2]"]
    said = command(capsys, "build", scenario_file(tmp_path), "-o", output, *kinds)
    assert said.code == 0
    road = read_roadmap(output)
    assert len(road.position) == 10
    assert road.evaluated == 4 * 6 * 2  # 6 nodes at the surface, 4 below
    assert 'kind = "all"\n' in road.provenance.scenario


def test_query_finds_a_path(file, tmp_path, capsys):
    path = tmp_path / "path.json"
    said = command(capsys, "query", file, "-o", path, "-o", tmp_path / "again.JSON")
    assert (said.code, said.err) == (0, f"wrote {path}, {tmp_path / 'again.JSON'}\n")
    assert said.out.startswith("path from (-190, 190, 0) to (160, -160, 0): 4 legs, ")
    assert said.out.endswith(f"; for a closer bound, `glider-stream bound {file}`\n")
    other = command(capsys, "query", file, "--goal=100,-100,-75").out
    assert "at most" in other
    assert "closer bound" not in other  # that would be of the scenario's own ends
    assert said.out.count("\n") == 6
    assert strict_json(path.read_text())["found"] is True
    assert (tmp_path / "again.JSON").read_text() == path.read_text()


@pytest.mark.parametrize(
    "start", [("--start", "-30,20,-50"), ("--start=-30, 20, -50",), ("--start=-3e1,20.,-50.0",)]
)
def test_query_between_other_points(file, capsys, start):
    said = command(capsys, "query", file, *start, "--goal", "100,20,-10")
    assert said.code == 0
    assert said.out.startswith("path from (-30, 20, -50) to (100, 20, -10): ")


def test_no_path_is_exit_code_1(tmp_path, capsys):
    file, path = tmp_path / "bare.h5", tmp_path / "path.json"
    nothing = ["--set", "integration.steps=1", "--set", "integration.tolerance=0.001"]
    built = command(capsys, "build", scenario_file(tmp_path), "-o", file, *nothing)
    assert built.code == 0
    assert "note: the roadmap has no edge: of " in built.err
    said = command(capsys, "query", file, "-o", path)
    assert (said.code, said.out) == (1, "")
    assert said.err.startswith("no path from (-190, 190, 0) to (160, -160, 0); ")
    assert said.err.count("\n") == 1
    table = strict_json(path.read_text())
    assert table["found"] is False
    assert table["why"] in said.err


def test_info_in_words_and_in_json(file, capsys):
    said = command(capsys, "info", file)
    assert (said.code, said.err) == (0, "")
    assert said.out == f"{roadmap()}\n"
    said = command(capsys, "info", file, "--json")
    assert (said.code, said.err) == (0, "")
    table = strict_json(said.out)
    assert table == roadmap().as_dict()
    assert table["nodes"] == 77
    assert table["counts"]["connected"] == table["edges"]


def test_info_of_a_roadmap_without_edges_is_json(tmp_path, capsys):
    lonely = ["--set", "sampling.shape=[1,1,1]", "--set", "query.goal=[0.0,0.0,0.0]"]
    file = tmp_path / "lonely.h5"
    assert command(capsys, "build", scenario_file(tmp_path), "-o", file, *lonely).code == 0
    said = command(capsys, "info", file, "--json")
    table = strict_json(said.out)
    assert (table["edges"], table["evaluated"], table["connected_share"]) == (0, 0, 0)


@pytest.mark.parametrize("name", [(), *((name,) for name in cli.commands)])
def test_every_command_has_help(capsys, name):
    said = command(capsys, *name, "--help")
    assert (said.code, said.err) == (0, "")
    assert said.out.startswith("Usage: glider-stream")


def test_the_version(capsys):
    assert version("glider-stream") in command(capsys, "--version").out


def test_stopping_shows_no_traceback(capsys, monkeypatch, file):
    def stop(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("glider_stream.opened.open", stop)
    said = command(capsys, "info", file)
    # click ends the line of the ^C
    assert (said.code, said.out, said.err.lstrip()) == (130, "", "glider-stream: stopped\n")


# progress


class Step(SimpleNamespace):
    def __str__(self):
        return f"{self.done} of {self.total}"


def test_a_log_gets_a_line_now_and_then_and_at_the_end(capsys, monkeypatch):
    clock = iter([0.0, 0.0, 4.0, 11.0, 11.0, 12.0, 13.0])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock))
    with progress.reporter("build") as report:
        for done in (1, 2, 3, 4, 10):
            report(Step(done=done, total=10))
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.splitlines() == ["build: 1 of 10", "build: 3 of 10", "build: 10 of 10"]


def test_a_command_says_once_that_it_compiles(capsys, monkeypatch):
    def compile_two():
        for add in (lambda a: a + 1, lambda a: a + 2):
            njit(add)(1)

    Command("small", callback=compile_two).main([], standalone_mode=False)
    assert capsys.readouterr().err == ""  # there is a cache, and these are not kept in it: they are small
    monkeypatch.setattr(compiling, "cache_folder", lambda: None)
    Command("compile", callback=compile_two).main([], standalone_mode=False)
    assert capsys.readouterr() == ("", f"{compiling.COMPILING}\n")
    Command("nothing", callback=lambda: None).main([], standalone_mode=False)
    assert capsys.readouterr().err == ""


@pytest.mark.slow
def test_a_terminal_gets_a_live_bar(tmp_path):
    roadmap()  # the kernels are compiled by now
    master, terminal = pty.openpty()
    output = tmp_path / "out.h5"
    arguments = [executable(), "build", scenario_file(tmp_path), "-o", output]
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "100"}
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=terminal, env=environment) as running:
        os.close(terminal)
        shown = b""
        while True:
            try:
                part = os.read(master, 4096)
            except OSError:  # the last holder of the terminal has gone
                break
            if not part:
                break
            shown += part
        said = running.stdout.read().decode()
    os.close(master)
    assert running.returncode == 0
    assert said.startswith("Roadmap: 77 nodes")
    text = shown.decode()
    assert "\x1b[" in text
    assert "━" in text
    assert "1,540 of 1,540 pairs" in text.replace("\r\n", " ")
    assert output.exists()
