"""Random mutations of files and options of every command: each ends right or with one clear error, and loses no file."""

import gc
import random
import re
import shutil
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click
from commandline import call
from spoiled import FILES

from bushfit.cli import cli

ROOT = Path(__file__).parents[2]
#: Processor time that a case may take [s].
SECONDS = 10.0
MANIFEST = """
[[bushings]]
campaign = "campaign.toml"
[[bushings]]
campaign = "camp*.toml"
name = "b"
model = "model.json"
commands = ["predict"]
"""
FOLDER = ROOT / "data/reports/mystery_mount"
SIZES = ("--inner-radius", "10 mm", "--outer-radius", "18 mm", "--length", "34 mm")
PIECES = [b"", b"\0", b'"', b",", b"[", b"]", b"=", b"\n", b"9" * 300, b"\xff", b"{", b"#", b"nan", b"-", b";"]


def thinned(name: str, step: int) -> str:
    """Return every n-th row of a table of the example bushing, with its header."""
    header, *rows = (ROOT / "data/cmp_15961" / name).read_text(encoding="utf-8").splitlines()
    return "\n".join([header, *rows[::step]]) + "\n"


INPUTS = {
    **FILES, "loop.csv": thinned("loop_axial_1.csv", 15), "sweep.csv": thinned("sweep_axial.csv", 2), "list.toml": MANIFEST, "list.csv": "name,campaign,commands\na,campaign.toml,fit\n",
    "limits.toml": (ROOT / "configs/limits.toml").read_text(encoding="utf-8"),
    **{f"res/{file.name}": file.read_text(encoding="utf-8") for file in FOLDER.iterdir() if file.suffix in (".json", ".csv")},
}  # fmt: skip
#: Command lines of each command, of which one is taken at a time.
LINES: dict[str, list[tuple[str, ...]]] = {
    **{name: [("campaign.toml",)] for name in ("run", "diagnose", "fit")},
    "fit-static": [("campaign.toml",), ("campaign.toml", "--dynamic", "model.json")],
    "fit-dynamic": [("campaign.toml", "--static", "model.json")],
    "predict": [
        ("model.json",),
        ("model.json", "--campaign", "campaign.toml"),
        ("model.json", "--static"),
        ("model.json", "--over", "0.5 Hz 1 mm"),
    ],
    "respond": [("model.json", "loop.csv", "--direction", "axial"), ("model.json", "shaker.csv")],
    "compare": [("model.json", "model.json"), ("campaign.toml", "--families", "kraus")],
    "report": [("res",)],
    "batch": [("list.toml", "--limits", "limits.toml"), ("list.csv",), ("campaign.toml", "--limits", "limits.toml")],
    "inspect": [("loop.csv",), ("sweep.csv",), ("shaker.csv",)],
    "init": [("loop.csv", "sweep.csv", "--direction", "axial", *SIZES), (".", *SIZES)],
    "reduce": [("loop.csv", "--direction", "axial"), ("shaker.csv", "--mass", "0.5 kg", "--direction", "axial")],
    "plan": [("campaign.toml", "--hours", "1"), ("model.json", "--hours", "1")],
    "simulate": [("more.toml",), ("model.json",)],
    "export": [("model.json", "--format", name) for name in ("nastran", "abaqus", "adams", "prony", "csv", "xlsx")],
    "schema": [("model",), ("campaign",), ("",)],
}
#: Words in place of a value, a key or a cell.
WORDS = [
    "", "0", "-1", "1", "3.5", "1e400", "nan", "inf", "true", "null", "[]", "{}", "[[1]]", '"x"', '"10 mm"', '"-5 N"', "x", "1,5",
    '"axial"', '"DMA"', '"../x"', '"\\u0000"', '"\u202e\x9b"', '["5 Hz", "5 Hz"]', "9" * 400, '"' + "a" * 400 + '"', "1e-320",
    "1979-05-27", '"loop.csv"', '"model.json"', '"61 Shore A"', "1000000", "#REF!", '"', " ", "\x00", "\u202e", "=1+1", "|", "\t",
    "time [s]", "force [N]", "frequency [Hz]", "stiffness [N/mm]", "phase [deg]", "Kraft [kN]", '"mu"', '"inertia"', '["mu"]',
]  # fmt: skip
#: Lines in place of a line.
HEADINGS = [
    "[fit]", "[rig]", "[predict]", "[simulate]", "[compound]", "[report]", "[[specimens]]", "[[sweeps]]", "[fit.mu]", "[x]",
    '[fit."inertia.mass"]', "[simulate.effects.friction]", "[[bushings]]",
]  # fmt: skip
OPTIONS = [
    "axial", "torsion", "DMA", "inertia", "kraus+inertia", "", "x", "5:155:10 Hz", "0.1, 0.5 mm", "10 mm", "1 %", "-1", "0", "nan",
    "1e999 Hz", "1 kg", "0.1 g", "2", "sine", "5:1e9:0.001 Hz", "-300 degC", "force=N", "force=x", "axial 25 Hz 0.1 mm", "xlsx",
    "soft_l1", "model.json", "campaign.toml", "peak_to_peak:sweep", "\u202e", "a" * 500, "inertia.mass=1 kg", "500 N axial",
]  # fmt: skip


def mutated(rng: random.Random, text: str) -> bytes:
    """A file with one to four changes: of bytes, or of whole lines and of single words."""
    if rng.random() < 0.2:
        data = bytearray(text.encode())
        for _ in range(rng.randint(1, 4)):
            start = rng.randrange(len(data) + 1)
            data[start : start + rng.choice([0, 1, 3, 20, 200])] = rng.choice(PIECES)
        return bytes(data)
    lines = text.split("\n")
    for _ in range(rng.randint(1, 4)):
        at, kind = rng.choice([0, rng.randrange(len(lines))]), rng.randrange(8)
        if kind == 0 and len(lines) > 1:
            del lines[at]
        elif kind == 1:
            lines.insert(at, rng.choice([*lines, *HEADINGS]))
        elif kind == 2:
            lines[1:] = lines[:0:-1]
        else:
            parts = re.split("([,:=] *)", lines[at])
            parts[2 * rng.randrange((len(parts) + 1) // 2)] = rng.choice(WORDS)
            lines[at] = "".join(parts)
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def options(rng: random.Random, command: str) -> list[str]:
    """Up to three options of a command with random values."""
    found = cli.get_command(click.Context(cli), command)
    known = [option for option in found.params if isinstance(option, click.Option)]
    words = []
    for option in rng.choices(known, k=rng.randint(0, 3)):
        if option.name not in ("output", "scheduler", "jobs", "junit", "help", "as_json"):
            choices = [str(choice) for choice in getattr(option.type, "choices", ())]
            words += [option.opts[0], *([] if option.is_flag else [rng.choice([*choices, *OPTIONS])])]
    return words


@contextmanager
def time_limit() -> Iterator[None]:
    """Raise a TimeoutError after so much processor time, where the system can."""

    def stop(*_: object) -> None:
        raise TimeoutError(f"more than {SECONDS:g} s of processor time")

    if not hasattr(signal, "setitimer"):
        yield
        return
    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def tried(command: str, seed: int, folder: Path) -> tuple[list[str], str]:
    """One case, its command line and what is wrong with its end: "" where nothing is."""
    rng = random.Random(f"{command} {seed}")
    shutil.rmtree(folder, ignore_errors=True)
    line = rng.choice(LINES[command])
    used = [name for name in INPUTS if name in line or ("res" in line) == name.startswith("res/")]
    files = {name: text.encode() for name, text in INPUTS.items()}
    if rng.random() < 0.8:
        files |= {name: mutated(rng, INPUTS[name]) for name in rng.sample(used, rng.randint(1, 2))}
    files["x/mine.txt"] = b"mine"
    words = [command, *line, *(options(rng, command) if rng.random() < 0.5 else [])]
    words += ["-o", "x/c" if command == "init" else "x", *(["--jobs", "1"] if command == "batch" else [])]
    words += [] if command in ("schema", "report") else ["--no-plots"]
    return words, wrong_end(words, folder, files)


def wrong_end(words: list[str], folder: Path, files: dict[str, bytes]) -> str:
    """What is wrong with the end of a command line in a folder with these files; "" where nothing is."""
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    try:
        with time_limit():
            done = call(folder, *words)
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    finally:
        gc.unfreeze()  # a command freezes its objects, since its process ends with it
        gc.collect()
    said = done.stdout + done.stderr + "".join(file.read_text("utf-8") for file in folder.glob("x/batch.csv"))
    if "internal error" in said or "Traceback" in said:
        return said[-500:]
    if (done.returncode == 2 and done.stderr.count("rror: ") < 1) or done.returncode not in (0, 1, 2):
        return f"status {done.returncode} without an error: {done.stderr}"
    if done.returncode == 2 and len(done.stderr) > 5000:
        return "an error that nobody reads to its end"
    if any(sign in said for sign in "\x1b\x9b\u202e\x00"):
        return "a character that steers the terminal"
    kept = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    lost = [name for name, content in files.items() if kept.get(folder / name) != content]
    return f"lost: {lost}" if lost else ""


def faults(command: str, seeds: range, folder: Path, budget: float = float("inf")) -> tuple[int, list[str]]:
    """Number of cases that were tried within the time [s], and what was wrong."""
    begin, found = time.monotonic(), []
    for count, seed in enumerate(seeds, start=1):
        words, fault = tried(command, seed, folder)
        if fault:
            found.append(f"{command}, case {seed}: {words}\n{fault}")
        if time.monotonic() - begin > budget:
            return count, found
    return len(seeds), found
