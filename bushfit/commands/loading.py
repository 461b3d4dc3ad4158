"""Loading of models and campaigns from a model file, a results folder, or a campaign file."""

from pathlib import Path
from typing import Protocol

from bushfit.campaign.campaign import TEST_FILES, Campaign, campaigns_in, load_campaign
from bushfit.errors import ModelError, quote_path
from bushfit.model.file import load_result
from bushfit.model.result import Result
from bushfit.reading.files import sha256, view_bytes
from bushfit.reading.measurement import Source


class HasResult(Protocol):
    """Protocol of a command's output that contains a fitted model."""

    @property
    def result(self) -> Result:
        """Fitted model of the output, with its uncertainty."""


def as_result(model: Result | HasResult) -> Result:
    """Return the fitted model in the output of a command; a fitted model is returned unchanged."""
    return model if isinstance(model, Result) else model.result


def load_model(path: str | Path) -> Result:
    """Load the fitted model of a model file or of a results folder, with its uncertainty.

    Args:
        path: model file such as model.json, or folder that contains model.json.

    Returns:
        The model, with the covariance of its parameters and the warnings of its fit.

    Raises:
        ModelError: the file is missing or contains no model.
    """
    return load_result(model_file(Path(path)))


def model_file(path: Path) -> Path:
    """Find the model file of a path: model.json in a results folder, otherwise the path itself.

    Returns:
        Path of the model file, which need not exist.

    Raises:
        ModelError: a campaign, a test file, or a folder without a model.
    """
    ending = path.suffix.lower()
    if path.is_dir() and (path / "model.json").is_file():
        return path / "model.json"
    if path.is_dir() or (path.is_file() and ending in (".toml", *TEST_FILES)):
        found = "a folder without model.json" if path.is_dir() else "a campaign" if ending == ".toml" else "a test file"
        campaign = next(iter(campaigns_in(path)), path)
        steps = "to write a campaign, which bushfit run then fits: bushfit init", "to write one: bushfit run"
        step = f"{steps[campaign.suffix.lower() == '.toml']} {quote_path(campaign)}"
        models = [quote_path(path / name) for name in ("fit", "diagnose") if (path / name / "model.json").is_file()]
        raise ModelError(
            "a fitted model is needed",
            file=path,
            found=found,
            expected="a .json file, as bushfit run, the fits and diagnose write it, or its folder",
            hint=f"name {' or '.join(models)}" if models else step,
        )
    return path


def load_source(path: Path) -> Campaign | Result:
    """Load a campaign file, a model file, or the model of a results folder."""
    return load_campaign(path) if path.suffix.lower() == ".toml" and not path.is_dir() else load_model(path)


def model_source(path: Path) -> Source:
    """Return the name and the SHA-256 of a model file, as the source of an export or a prediction."""
    return Source(Path(path.name), sha256(view_bytes(path, ModelError)).result())
