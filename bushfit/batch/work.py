"""One row, as a worker does it: the jobs of the single commands, and a record of what they found."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, cast

from bushfit.batch import ledger
from bushfit.batch.document import Found, Record
from bushfit.batch.manifest import Row, Settings
from bushfit.batch.quantities import Point, curve_of
from bushfit.campaign.campaign import Campaign, load_campaign
from bushfit.commands.diagnose import DiagnosisOutput, diagnose
from bushfit.diagnosis.record import Diagnosis
from bushfit.effects import get_effect
from bushfit.errors import BatchError, BushfitError
from bushfit.fitting.data import Data
from bushfit.model.file import load_result
from bushfit.model.result import End, Result
from bushfit.prediction.caveats import warnings_of
from bushfit.prediction.stiffness import Band
from bushfit.prediction.stiffness import predict as predict_stiffness
from bushfit.reading.measurement import Loop, Sweep
from bushfit.report.results import Formats, encode_all
from bushfit.version import __version__


@dataclass(frozen=True)
class Orders:
    """What all rows of a batch share: where results go, points and files to make, whether to trust what stands."""

    output: Path
    points: tuple[Point, ...]
    formats: Formats
    resume: bool
    version: str = __version__


def work(rows: Sequence[Row], orders: Orders) -> list[Record]:
    """The records of some rows; every row's results are kept before the next is begun.

    Raises:
        BatchError: this process runs another version of bushfit than the one that ordered the work.
    """
    if orders.version != __version__:
        raise BatchError(
            "a worker runs another bushfit", found=__version__, expected=orders.version, hint="install the same on all"
        )
    _one_thread()
    return [_row(row, orders) for row in rows]


@cache
def _one_thread() -> Any:
    """Linear algebra on one thread in this process, for its lifetime: cores are for rows, and sums keep their order."""
    from threadpoolctl import threadpool_limits

    return threadpool_limits(1)


def _row(row: Row, orders: Orders) -> Record:
    wanted = ledger.key(row, orders.points, orders.formats)
    if orders.resume and (before := ledger.valid_record(orders.output, row, wanted)):
        return {**before, "kept": True}
    begin = time.perf_counter()
    files: dict[str, bytes] = {}
    try:
        record: Record = {"schema": ledger.SCHEMA, "key": wanted, "status": "done", "seconds": 0.0}
        record.update(cast("Record", _worked(row, orders, files)))  # a part of it
    except BushfitError as error:
        files, record = {}, failed(str(error))
    except Exception as error:  # whatever befalls a row, it costs that row and is said
        kind = "out of memory" if isinstance(error, MemoryError) else "a fault in bushfit itself"
        files, record = {}, failed(f"{kind}: {type(error).__name__}: {error}")
    record["seconds"] = round(time.perf_counter() - begin, 4)
    record["files"] = {name: ledger.digest(content) for name, content in files.items()}
    try:
        ledger.keep(orders.output, row, files, record)
    except OSError as error:
        return failed(f"the results cannot be written: {error}")
    return record


def failed(error: str) -> Record:
    """The record of a row that came to nothing, such as one that no worker survived."""
    return {"schema": ledger.SCHEMA, "status": "failed", "error": error, "seconds": 0.0}


def _worked(row: Row, orders: Orders, files: dict[str, bytes]) -> Found:
    """Run a row's commands, gather their files, and say what was found."""
    settings, path = row.settings, Path(row.campaign)
    inputs = {path.name: ledger.digest(path.read_bytes())} if path.is_file() else {}
    campaign = load_campaign(path)
    tests: tuple[Loop | Sweep, ...] = (*campaign.loops, *campaign.sweeps)
    inputs |= {str(test.source.file): test.source.sha256 for test in tests if test.source}
    if settings.model:
        inputs[settings.model] = ledger.digest(Path(settings.model).read_bytes())
    if "run" in (settings.commands or ()):
        from bushfit.commands.run import run

        ran = run(campaign)  # whose tables of the prediction come in any case, as those of predict
        files |= encode_all(ran.files, orders.formats)
        predicted = [file for file in ran.predicted.files if file.name != "measured"]
        files |= encode_all(predicted, replace(orders.formats, tables=True))
        result, diagnosed = ran.result, ran.diagnosed
    else:
        result, diagnosed = _one_by_one(campaign, settings, orders.formats, files)
    found = _verdict(diagnosed.diagnosis) if diagnosed else Found()
    numbers = numbers_of(result, orders.points, found.get("warnings", []))
    dates = (str(test.source.conditions.get("date", "")) for test in tests if test.source)
    measured: Found = {"date": next(filter(None, dates), None), "curve": curve_of(campaign.sweeps)}
    return {"campaign_name": campaign.name, "inputs": inputs, **found, **numbers, **measured}


def _one_by_one(
    campaign: Campaign, settings: Settings, formats: Formats, files: dict[str, bytes]
) -> tuple[Result, DiagnosisOutput | None]:
    """fit, diagnose and predict, as far as they are asked for, each going on from the one before."""
    from bushfit.commands.fit import fit
    from bushfit.commands.predict import predict

    commands = settings.commands or ()
    start = result = load_result(Path(settings.model)) if settings.model else None
    data = Data.of(campaign) if set(commands) - {"predict"} else None
    diagnosed = joint = None
    if "fit" in commands and data:
        fitted = fit(data, directions=settings.directions or (), effects=settings.effects or ())
        result, made = fitted.result, encode_all(fitted.files, formats)
        joint = None if settings.directions or settings.effects else fitted
        if "diagnose" in commands:  # as `run` calls them: model.json is with what diagnose added
            made["joint.json"] = made.pop("model.json")
        files |= made
    if "diagnose" in commands and data:
        asked = {key: getattr(settings, key) for key in ("max_effects", "tolerance", "adopt", "without")}
        given = {key: value for key, value in asked.items() if value is not None}
        diagnosed = diagnose(data, model=start, joint=joint, **given)
        result = diagnosed.result
        files |= encode_all(diagnosed.files, formats)
    assert result is not None  # the manifest has seen to it that there is a model
    if "predict" in commands:
        files |= encode_all(predict(result, campaign).files, replace(formats, tables=True))
    return result, diagnosed


def _verdict(diagnosis: Diagnosis) -> Found:
    """What a diagnosis adds to the record of a row."""
    return {
        "verdict": diagnosis.verdict,
        "effects": [named.label for named in diagnosis.effects],
        "alternatives": [
            *(name for named in diagnosis.effects for name in named.alternatives),
            *(twin for name in diagnosis.result.unresolved for twin in get_effect(name).twins),
        ],
        "warnings": list(diagnosis.notes),
    }


def numbers_of(result: Result, points: Sequence[Point], notes: Sequence[str]) -> Found:
    """Parameters, quality, and stiffness and loss factor at the points, each with what is known of its error."""
    parameters: dict[str, list[float | str | None]] = {}
    at_bound: dict[str, End] = {}
    for name, parameter in result.model.parameters.items():
        interval = result.interval(name)
        value, stderr = result.model.values[name], result.covariance.stderr(name)
        parameters[name] = [*map(_finite, (value, *(interval or (None, None)), stderr)), parameter.unit]
        # an added effect whose size rests at zero, within a thousandth of its usual size, is an answer like any other
        zero = parameter.neutral if "." in name else None
        if name in result.at_bound and (zero is None or abs(value - zero) > 1e-3 * parameter.typical):
            at_bound[name] = result.at_bound[name]
    said, at = [], {}
    for point in points:
        if (place := result.place(point.place)).motion != point.motion:
            expected = f"an amplitude in {place.display.displacement.name}"
            raise BatchError("this amplitude is none of the place", found=str(point), expected=expected)
        prediction = predict_stiffness(result, place, [point.frequency], [point.amplitude])
        at[str(point)] = {"stiffness": _band(prediction.stiffness), "loss factor": _band(prediction.loss_factor)}
        said.append(prediction.warnings)
    quality = result.quality
    return {
        "parameters": parameters,
        "at_bound": at_bound,
        "nrmse": quality.nrmse if quality else None,
        "reduced_chi_square": quality.reduced_chi_square if quality else None,
        "points": at,
        "warnings": warnings_of(result, said, notes),
    }


def _band(band: Band) -> list[float | None]:
    return [_finite(float(values[0])) for values in (band.value, band.low, band.high)]


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
