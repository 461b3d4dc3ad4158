"""What all commands hold to: files, statuses, streams, help, the Tab key, how far long work is, and a Ctrl-C."""

import contextlib
import io
import json
import os
import pickle
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from shell import CAMPAIGN, GEOMETRY, names, values
from spoiled import FILES, MODEL
from threadpoolctl import threadpool_info, threadpool_limits

import bushfit as package
from bushfit.cli import cli, main
from bushfit.cli import output as common

COMMANDS = cli.list_commands(click.Context(cli))
#: Lines of the longest help on a terminal of 80 columns.
LONGEST = 70
EXAMPLES = re.compile(r"^  Examples?:\n((?:    .*\n)+)\Z", re.MULTILINE)
PREDICT = ("predict", "model.json", "-o", "x", "--no-plots", "--json", "-q")
BATCH = ("batch", "campaign.toml", "more.toml", "-o", "x", "--jobs", "1", "--no-plots", "--json", "-q")
BUSHFIT = (sys.executable, "-m", "bushfit")
SIMULATE = ("simulate", "model/model.json")


@pytest.mark.parametrize(
    "arguments",
    [
        ("fit-static", CAMPAIGN), ("fit-dynamic", CAMPAIGN), ("fit", CAMPAIGN), ("run", CAMPAIGN),
        ("predict", "model/model.json"), ("compare", "model", "model/model.json"), ("simulate", "model/model.json"),
        ("plan", "model/model.json", "--hours", "1.5"), ("export", "model/model.json", "--format", "abaqus"),
    ],
    ids=lambda arguments: arguments[0],
)  # fmt: skip
def test_json_alone_on_standard_output_and_quiet_is_quiet(bushfit, tmp_path, arguments):
    done = bushfit(*arguments, "-o", tmp_path / "x", "--json", "-q", "--no-plots")
    assert isinstance(json.loads(done.stdout), dict)
    assert done.stderr == ""
    assert not list((tmp_path / "x").glob("*.png"))
    loud = bushfit(*arguments, "-o", tmp_path / "y", "-v", "--no-plots")
    assert "wrote " in loud.stdout
    assert not any(line for line in loud.stderr.splitlines() if not re.match("warning: |  ", line))


@pytest.mark.parametrize(
    ("arguments", "file"),
    [
        (("fit-static", CAMPAIGN), "static.json"),
        (("compare", CAMPAIGN, "model"), "differences.csv"),
        (("export", "model/model.json", "--format", "nastran"), "bushing.bdf"),
        (("predict", "model/model.json"), "axial.csv"),
        (("simulate", "model/model.json"), "truth.json"),
        (("inspect", "data/cmp_15961/sweep_axial.csv"), "inspect.png"),
        (("init", "data/cmp_15961/sweep_axial.csv", *GEOMETRY), "campaign.toml"),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)
def test_results_are_not_replaced_unasked(bushfit, tmp_path, arguments, file):
    """Nor ever a file that bushfit did not write, which --force does not change."""
    (tmp_path / file).write_text("mine")
    for more in ((), ("--force",)):
        refused = bushfit(*arguments, "-o", tmp_path, *more, status=2)
        assert f"found: {file}" in refused.stderr
        assert "move it away" in refused.stderr
        assert names(tmp_path) == {file}
        assert (tmp_path / file).read_text() == "mine"
    (tmp_path / file).unlink()
    bushfit(*arguments, "-o", tmp_path)
    again = bushfit(*arguments, "-o", tmp_path, status=0 if arguments[0] == "inspect" else 2)
    assert ("--force replaces them" in again.stderr) == (arguments[0] != "inspect")
    assert arguments[0] == "inspect" or not again.stdout, "nothing is printed in vain"
    lost = bushfit(arguments[0], "lost.csv", *arguments[2:], "-o", tmp_path, status=2)
    assert "lost.csv: there is no such file" in lost.stderr, "first what goes in, then what comes out"
    bushfit(*arguments, "-o", tmp_path, "--force")


def test_an_input_of_the_run_is_not_replaced(own, typed):
    """Measurements named as results are; a model that is where the new one goes; a campaign that is simulated."""
    for test in ("loop_axial_1", "sweep_axial"):
        (own / f"data/cmp_15961/{test}.csv").rename(own / f"{test.partition('_')[0]}s.csv")
    text = (own / CAMPAIGN).read_text(encoding="utf-8")
    for test in ("loop_axial_1", "sweep_axial"):
        text = text.replace(f"../data/cmp_15961/{test}.csv", f"{test.partition('_')[0]}s.csv")
    (own / "campaign.toml").write_text(text.replace("../data", "data"), encoding="utf-8")
    before = {file.name: file.read_bytes() for file in own.glob("*.*")}
    for command in (("fit", "campaign.toml"), ("simulate", "campaign.toml")):
        refused = typed(*command, "-o", ".", "--force", "--no-plots", status=2)
        assert re.search("an input of this run|the campaign does not state what to simulate", refused.stderr)
    typed("fit", "campaign.toml", "-o", "x", "--no-plots")
    refused = typed("diagnose", "campaign.toml", "--model", "x/model.json", "-o", "x", "--force", status=2)
    assert "x/model.json: a result would replace an input of this run" in refused.stderr
    assert {file.name: file.read_bytes() for file in own.glob("*.*")} == before


@pytest.mark.parametrize("command", COMMANDS)
def test_a_help_is_short_and_says_what_is_written(typed, command):
    told = typed(command, "-h").stdout
    assert len(told.splitlines()) <= LONGEST
    assert re.search("[Ww]rites", told)
    for option in ("-o, --output", "-v, --verbose", "-q, --quiet", "--json", "--force"):
        assert option in told
    assert ("--no-plots" in told) == ("--plot-format" in told)
    placeholders = re.findall(r"^  (?:-\w, )?--[\w-]+ ([A-Z[-].*?)(?:  |, -|$)", told, re.MULTILINE)
    assert [each for each in placeholders if re.search(r"\s|TEXT|RANGE|INTEGER|FLOAT", each)] == []
    if "--direction" in told and command != "batch":  # which is as of fit
        of_direction = told.partition("--direction")[2].partition("\n  -")[0]
        assert {"axial", "radial", "torsion"} <= set(re.findall(r"\w+", of_direction))
    assert f"  {command} " in typed().stdout


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_examples_of_the_help_work(typed, root, tmp_path, command):
    for name in ("configs", "data"):
        shutil.copytree(root / name, tmp_path / name)
    told = typed(command, "-h").stdout
    found, plain = EXAMPLES.search(told), ["--no-plots"] * ("--no-plots" in told)
    assert found, "an example at the end"
    for line in found[1].splitlines():
        program, *arguments = shlex.split(line)
        assert (program, arguments[0]) == ("bushfit", command)
        assert typed(*arguments, *plain).stdout, "a result is printed"


ASKED = [
    ("fit-", {"plain,fit-static", "plain,fit-dynamic"}), ("fit|x.toml|--prof", {"plain,--profile"}),
    ("fit|x.toml|--loss|", {"plain,linear", "plain,soft_l1"}), ("export|m.json|--format|na", {"plain,nastran"}),
    ("run|conf", {"file,conf"}), ("init|x.csv|--direction|ra", {"plain,radial"}),
    ("inspect|configs/cmp_15961.toml|--unit|mm|--thou", {"plain,--thousands"}),
]  # fmt: skip


def asking(*words: str) -> dict[str, str]:
    """What a shell puts into the environment, the cursor behind the last word."""
    line = ["bushfit", *words]
    return {"_BUSHFIT_COMPLETE": "bash_complete", "COMP_WORDS": " ".join(line), "COMP_CWORD": str(len(line) - 1)}


@pytest.mark.parametrize(("words", "offered"), ASKED, ids=[words for words, _ in ASKED])
def test_tab_offers(root, monkeypatch, words, offered):
    monkeypatch.chdir(root)
    done = CliRunner().invoke(cli, prog_name="bushfit", env=asking(*words.split("|")))
    assert (done.exit_code, set(done.stdout.split("\n")) - {""}, done.stderr) == (0, offered, "")


def test_the_installed_command_answers_a_shell():
    program = str(Path(sys.executable).with_name("bushfit"))
    env = {**os.environ, **asking("simu")}
    assert subprocess.run([program], env=env, capture_output=True, check=True).stdout == b"plain,simulate\n"


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, content in FILES.items():
        Path(name).write_text(content)
    return tmp_path


def assert_one_line(status: int, err: bytes) -> None:
    assert status == 2, err
    assert err.startswith(b"bushfit: "), err
    assert err.count(b"\n") == 1, err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize(
    "arguments",
    [
        PREDICT, pytest.param(BATCH, marks=pytest.mark.slow), ("--help",), ("schema", "model", "-q"),
    ],
    ids=lambda it: it[0],
)  # fmt: skip
def test_a_full_device(arguments, folder):
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run([*BUSHFIT, *arguments], stdout=full, stderr=subprocess.PIPE, check=False)
    assert_one_line(done.returncode, done.stderr)
    assert b"standard output cannot be written: No space left on device" in done.stderr


def test_a_pipe_that_nobody_reads(folder):
    """The result is written before it is printed; what people are told besides is not needed."""
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run([*BUSHFIT, *PREDICT], stdout=write, stderr=subprocess.PIPE, check=False)
    assert_one_line(done.returncode, done.stderr)
    assert (folder / "x" / "axial.csv").exists()
    done = subprocess.run([*BUSHFIT, *PREDICT[:-2], "--force"], stdout=write, stderr=subprocess.PIPE, check=False)
    assert (done.returncode, b"error" in done.stderr) == (0, False), "a text need not be read to the end"
    done = subprocess.run([*BUSHFIT, *PREDICT[:-2], "--force"], stdout=subprocess.PIPE, stderr=write, check=False)
    assert done.returncode == 0
    assert (folder / "x" / "axial.csv").exists()
    missed = subprocess.run([*BUSHFIT, "predict", "lost.json"], stdout=subprocess.PIPE, stderr=write, check=False)
    os.close(write)
    assert missed.returncode == 2


def test_json_is_utf8_in_any_code_page_and_no_text_steers_the_terminal(folder):
    """The name of the bushing is in no code page; a warning would clear the screen, and turn the line around."""
    said = "\x1b[2J\x9b2J\u202ecleared"
    model = MODEL | {"warnings": [said], "bushing": MODEL["bushing"] | {"name": "衬套"}}
    (folder / "model.json").write_text(json.dumps(model), encoding="utf-8")
    settings = {**os.environ, "PYTHONIOENCODING": "cp1252", "COLUMNS": "auto"}
    command = [*BUSHFIT, "simulate", "model.json", "-o", "x", "--json"]
    done = subprocess.run(command, capture_output=True, env=settings, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout.decode("utf-8"))["truth"]["bushing"]["name"] == "衬套"
    done = subprocess.run([*BUSHFIT, *PREDICT[:2], "-o", "y", "--no-plots"], capture_output=True, check=False)
    assert done.returncode == 0
    assert b"warning: \\x1b[2J\\x9b2J\\u202ecleared" in done.stderr
    assert not any(sign in done.stderr.decode() for sign in "\x1b\x9b\u202e")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no such signal")
@pytest.mark.parametrize(("after", "sent"), [(0.1, signal.SIGINT), (0.5, signal.SIGINT), (1.5, signal.SIGTERM)])
def test_an_early_ctrl_c_and_a_request_to_end(after, sent, folder):
    """From the first line of bushfit on, which here says that it has begun."""
    code = (
        "import signal, sys; sys.argv = ['bushfit', 'run', 'campaign.toml']\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # what runs in the background ignores it
        "print(flush=True)\n"
        "from bushfit.__main__ import main; main()"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as run:
        assert run.stdout
        run.stdout.readline()
        time.sleep(after)
        run.send_signal(sent)
        err = run.communicate()[1]
    assert_one_line(run.returncode, err.lstrip(b"\n"))
    assert err.endswith(b"bushfit: aborted\n")
    assert not (folder / "results").exists()


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def said(work: Path, monkeypatch: pytest.MonkeyPatch, heard: io.StringIO, *words: object) -> str:
    monkeypatch.chdir(work)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setattr("sys.argv", ["bushfit", *map(str, words)])
    with contextlib.redirect_stderr(heard), contextlib.redirect_stdout(heard), pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 0, heard.getvalue()
    return heard.getvalue()


def test_a_terminal_is_shown_how_far_it_is(work, tmp_path, monkeypatch):
    monkeypatch.setattr(common, "_PATIENCE", 0.0)
    told = said(work, monkeypatch, Terminal(), *SIMULATE, "-o", tmp_path / "x")
    assert "sweeps simulated" in told
    assert "0/2" in told
    assert told.endswith(f"truth.json to {tmp_path / 'x'}\n"), "what was shown is gone, and the result stands"
    profiled = said(work, monkeypatch, Terminal(), "fit", CAMPAIGN, "--profile", "--no-plots", "-o", tmp_path / "fit")
    assert re.search(r"[0-5]/5", profiled)


def test_the_manual_is_one_file_whose_links_stay_in_it(bushfit, root, tmp_path):
    bushfit("manual", "diagnosis", "-o", tmp_path / "m")
    text = (tmp_path / "m/manual.html").read_text(encoding="utf-8")
    pages = {page.stem for page in (root / "bushfit/manual").glob("*.md")}
    identifiers = re.findall(r' id="([^"]+)"', text)
    assert len(identifiers) == len(set(identifiers))
    assert pages <= set(identifiers)
    targets = set(re.findall(r'href="([^"]+)"', text))
    assert {target for target in targets if not target.startswith(("#", "https://"))} == set()
    assert {target[1:] for target in targets if target.startswith("#")} <= set(identifiers)
    assert len(targets) > 30
    assert "src=" not in text
    assert text.count("<table") > 20


def test_the_example_runs_and_gives_back_its_parameters(bushfit, table_1, tmp_path):
    done = bushfit("example", "-o", tmp_path / "my example")
    assert f'next: bushfit run "{tmp_path}/my example/campaign.toml"' in done.text
    assert "Simulated by bushfit simulate" in (tmp_path / "my example/campaign.toml").read_text(encoding="utf-8")
    fitted = values(bushfit("fit", tmp_path / "my example/campaign.toml", "-o", tmp_path / "f", "--no-plots", "--json"))
    assert fitted == pytest.approx(table_1, rel=0.05)


def test_a_function_of_the_library_uses_one_thread_and_can_be_pickled(monkeypatch):
    def threads() -> set[int]:
        return {pool["num_threads"] for pool in threadpool_info()}

    monkeypatch.setattr("bushfit.commands.loading.load_model", threads)
    monkeypatch.delitem(vars(package), "load_model", raising=False)
    with threadpool_limits(2):
        assert package.load_model() == {1}
        assert threads() == {2}
    del vars(package)["load_model"]
    assert pickle.loads(pickle.dumps(package.fit)) is package.fit
