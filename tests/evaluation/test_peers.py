"""The comparison with peers: how a run goes on, what a failure says, what records compare, the document."""

import copy
import importlib
import json
import subprocess
import sys
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[2]
RECORD = json.loads((PROJECT / "benchmarks/records/peers.json").read_text())


@pytest.fixture(scope="module")
def peers():
    """The scripts, as modules by name."""
    names = ("run", "compare", "table", "problems", "problems_gyre", "record")
    here, known = PROJECT / "benchmarks", {name: sys.modules.pop(name, None) for name in names}
    sys.path[:0] = [str(here / "peers"), str(here)]
    yield {name: importlib.import_module(name) for name in ("run", "compare", "table")}
    del sys.path[:2]
    for name, module in known.items():
        sys.modules.pop(name, None)
        if module is not None:
            sys.modules[name] = module


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", r"no message \(signal SIGSEGV\)"),
        ("import sys; sys.exit(3)", r"no message \(exit code 3\)"),
        ("raise ValueError('so it is')", r"ValueError: so it is \(exit code 1\)"),
        ("pass", r"no message \(exit code 0\)"),
    ],
)
def test_a_script_without_an_answer_says_how_it_ended(peers, tmp_path, text, said):
    script, job = tmp_path / "script.py", tmp_path / "job.json"
    script.write_text(text)
    job.write_text("{}")
    with pytest.raises(RuntimeError, match=f"^{said}$"):
        peers["run"].run_script(Path(sys.executable), str(script), job)


def test_what_failed_is_asked_again_and_what_answered_is_not(peers, tmp_path, monkeypatch):
    run, asked = peers["run"], []
    peer = next(one for one in run.PEERS if one.name == "OMPL RRT*")

    def script(python, name, job):
        asked.append(json.loads(job.read_text()))
        if len(asked) == 1:
            raise RuntimeError("no route today")
        job.with_suffix(".answer").write_text('{"routes_s": [1.0]}')

    monkeypatch.setattr(run, "environment", lambda peer, folder: Path("python"))
    monkeypatch.setattr(run, "run_script", script)
    assert run.ask(peer, tmp_path, {"runs": 1})["failed"] == "no route today"
    assert run.ask(peer, tmp_path, {"runs": 1})["routes_s"] == [1.0]
    assert run.ask(peer, tmp_path, {"runs": 1})["routes_s"] == [1.0]
    assert len(asked) == 2
    assert asked[0]["planner"] == "RRTstar"


def test_an_environment_of_another_checkout_is_made_anew(peers, tmp_path, monkeypatch):
    run, asked = peers["run"], []
    peer = run.PEERS[0]

    def pip(command, **_):
        asked.append(command)
        return subprocess.CompletedProcess(command, 0, "", "")

    monkeypatch.setattr(run.venv, "create", lambda place, **_: place.mkdir(parents=True, exist_ok=True))
    monkeypatch.setattr(run.subprocess, "run", pip)
    python = run.environment(peer, tmp_path)
    assert run.environment(peer, tmp_path) == python
    assert len(asked) == 1
    (python.parents[1] / "installed").write_text("--editable\nelsewhere[ocean]")
    assert run.environment(peer, tmp_path) == python
    assert len(asked) == 2


def test_every_peer_has_an_answer_of_its_own_and_a_script(peers):
    run = peers["run"]
    files = [run.answer_of(peer, Path()) for peer in run.PEERS]
    assert len(set(files)) == len(files)
    assert all((run.HERE / peer.script).exists() for peer in run.PEERS)


def test_a_record_has_not_moved_from_itself_and_a_slower_route_has(peers):
    compare, rows = peers["compare"], RECORD["rows"]
    assert compare.moved(rows, rows) == f"None of {len(compare.ratios(rows))} ratios moved."
    later = copy.deepcopy(rows)
    row = next(row for row in later if row["peer"] == "glider-stream" and "over_level_set" in row)
    row["over_level_set"] *= 1.01
    line = compare.moved(rows, later)
    assert line.startswith(f"{row['problem']}, glider-stream, route: ")
    assert line.endswith("(+1.0 %)")
    assert ": gone, was " in compare.moved(rows, [one for one in rows if one["peer"] != "HALEM"])


def test_the_answer_names_where_a_peer_is_faster(peers):
    compare = peers["compare"]
    told = {"what": "", "can": "", "problem": "lake"}
    rows = [told | {"peer": "glider-stream", "route_s": 103.0}, told | {"peer": "HALEM", "route_s": 100.0}]
    assert compare.answer(rows).startswith("On 0 of 1 problems")
    assert "slower on lake (HALEM, 3.0 %)" in compare.answer(rows)
    rows[1]["peer"] = compare.BOUND  # no route is that of a level set
    assert compare.beside_ours(rows) == []


def test_the_tables_of_the_document_are_those_of_the_record(peers, tmp_path):
    document = tmp_path / "peers.md"
    text = (PROJECT / "docs/peers.md").read_text()
    document.write_text(text)
    peers["table"].rewrite(document, RECORD)
    assert document.read_text() == text
    assert text.count("<!-- table ") == text.count("<!-- end -->") == 8


def test_an_unknown_peer_is_refused(peers, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["run.py", "sea.nc", "--folder", str(tmp_path), "--again", "nobody"])
    with pytest.raises(SystemExit):
        peers["run"].arguments()
    assert "no peer and no problem is called `nobody`" in capsys.readouterr().err
