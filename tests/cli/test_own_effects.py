"""Effects of the user's own: a file that is trusted, a package that is installed, and what is refused."""

import json
import os
import shutil
import subprocess
import sys

import pytest
from shell import document, refused

EXAMPLE = "data/example_effect/quadratic_damping.py"


def test_an_installed_package_is_fitted_named_and_in_every_result(root, tmp_path):
    install = ["-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation", "--target", str(tmp_path / "site")]
    shutil.copytree(root / "data/example_effect", tmp_path / "source")
    subprocess.run([sys.executable, *install, str(tmp_path / "source")], check=True)
    text = (root / "configs/own_law.toml").read_text(encoding="utf-8")
    (tmp_path / "own.toml").write_text(text.partition("[effects]")[0] + "[bushing]" + text.partition("[bushing]")[2])
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path / "site"), str(root)])}

    def run(*arguments: str, code: str = "from bushfit.cli import main; main()") -> str:
        command = [sys.executable, "-c", code, *arguments]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    run("simulate", "own.toml", "-o", "tests")
    diagnosed = json.loads(run("diagnose", "tests/campaign.toml", "-o", "d", "--no-plots", "--json"))
    assert diagnosed["verdict"] == "named"
    model = document(tmp_path / "d/model.json")
    assert model["laws"]["quadratic_damping"] == {
        "package": "bushfit-quadratic-damping", "version": "1.0", "file": "", "sha256": ""
    }  # fmt: skip
    assert model["parameters"]["quadratic_damping.c"]["value"] == pytest.approx(5.0, rel=0.03)
    assert "Law of bushfit-quadratic-damping 1.0" in (tmp_path / "d/report.html").read_text(encoding="utf-8")
    run(code="from bushfit.testing import check_effect; check_effect('quadratic_damping')")
    environment["PYTHONPATH"] = str(root)
    with pytest.raises(AssertionError, match=r"expected: bushfit-quadratic-damping 1\.0"):
        run("predict", "d/model.json", "-o", "p")


def test_a_file_is_run_only_with_permission_and_only_as_it_was(bushfit, root, tmp_path):
    law = tmp_path / "quadratic_damping.py"
    shutil.copy(root / EXAMPLE, law)
    text = (root / "configs/own_law.toml").read_text(encoding="utf-8")
    (tmp_path / "own.toml").write_text(text.replace(f"../{EXAMPLE}", law.name))
    refused(bushfit("simulate", tmp_path / "own.toml", "-o", tmp_path / "x", status=2), tmp_path / "x", "--trust")
    bushfit("simulate", tmp_path / "own.toml", "-o", tmp_path / "x", "--trust")
    campaign = tmp_path / "x/campaign.toml"
    bushfit("fit", campaign, "--effect", "quadratic_damping", "-o", tmp_path / "f", "--no-plots", "--trust")
    predict = ("predict", tmp_path / "f/model.json", "-o", tmp_path / "p", "--no-plots")
    refused(bushfit(*predict, status=2), tmp_path / "p", "--trust", str(law))
    bushfit(*predict, "--trust")
    law.write_text(law.read_text(encoding="utf-8") + "# changed\n", encoding="utf-8")
    changed = bushfit(*predict, "--force", "--trust", status=2).stderr
    assert "has changed since the model was fitted" in changed


@pytest.mark.parametrize(
    ("name", "code", "words"),
    [
        ("my_law", "import no_such_module\n", ["ModuleNotFoundError"]),
        ("my_law", "def modulus(p, omega, strain): ...\n", ["EFFECT"]),
        ("my_law", "EFFECT = {}\n", ["the functions that its kind requires"]),
        ("my_law", "EFFECT = {'sentense': 'x'}\nmodulus = stress = print\n", ["the effect my_law of"]),
        ("my_law", "x = (\n", ["SyntaxError"]),
        ("viscous", "", ["cannot have this name", "viscous"]),
    ],
)
def test_a_law_that_is_none_or_has_the_name_of_another(name, code, words, bushfit, root, tmp_path):
    (tmp_path / f"{name}.py").write_text(code or (root / EXAMPLE).read_text(encoding="utf-8"))
    text = (root / "configs/own_law.toml").read_text(encoding="utf-8")
    (tmp_path / "own.toml").write_text(text.replace(f"../{EXAMPLE}", f"{name}.py"))
    done = bushfit("simulate", tmp_path / "own.toml", "-o", tmp_path / "x", "--trust", status=2)
    refused(done, tmp_path / "x", "own.toml", *words)
