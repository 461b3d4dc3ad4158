"""Evaluation of one row by a worker: the commands on a campaign, and a record of their results."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from threadpoolctl import threadpool_limits

from bushfit.batch import store
from bushfit.batch.document import ROW_SCHEMA, Estimate, RowFile
from bushfit.batch.manifest import Row, RowSettings
from bushfit.batch.quantities import FIT_QUALITY, LOSS_FACTOR, STIFFNESS, measured_at, measured_curve
from bushfit.campaign.campaign import Campaign, load_campaign
from bushfit.caveat import Caveat, to_entries
from bushfit.effects import get_effect
from bushfit.errors import BatchError, BushfitError, ModelError
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.geometry import get_places
from bushfit.geometry.point import Point
from bushfit.model.file import load_result
from bushfit.model.result import Result
from bushfit.prediction.caveats import warnings_of
from bushfit.prediction.stiffness import predict as predict_stiffness
from bushfit.reading.files import view_bytes
from bushfit.reading.measurement import Loop, Sweep
from bushfit.report.results import Formats, encode_all
from bushfit.version import __version__

if TYPE_CHECKING:
    from bushfit.diagnosis.record import Diagnosis

#: Amount of an added effect, relative to the typical value of its parameter, up to which the effect is zero.
_ZERO = 1e-3
#: Limit of the threads of linear algebra, set once per process, because the rows of a batch use the cores.
limit_threads = cache(threadpool_limits)


@dataclass(frozen=True)
class RowTask:
    """Function that evaluates one part (a row of the batch) on a worker, with the settings that all rows share.

    Args:
        output: results folder of the batch.
        points: operating points of stiffness and loss factor.
        formats: formats of the files that each row writes.
        resume: True to keep the results of a row that an earlier run evaluated with the same inputs.
        version: version of bushfit, which the workers must run, too.
    """

    output: Path
    points: tuple[Point, ...]
    formats: Formats
    resume: bool
    version: str = __version__

    def __call__(self, row: Row) -> tuple[RowFile, bool]:
        """Evaluate a row and save its results.

        Returns:
            Results for the table of the batch, and True if they were kept from an earlier run.

        Raises:
            BatchError: this process runs another version of bushfit.
        """
        if self.version != __version__:
            problem, hint = "a worker runs another bushfit version", "install the same version on all workers"
            raise BatchError(problem, found=__version__, expected=self.version, hint=hint)
        limit_threads(1)
        settings = asdict(row.settings), asdict(self.formats), [str(point) for point in self.points]
        key = store.digest(json.dumps([__version__, ROW_SCHEMA, *settings], sort_keys=True).encode())
        if self.resume and (earlier := store.load_row(self.output, row, key)):
            return earlier, True
        start, files = time.perf_counter(), dict[str, bytes]()
        try:
            record, files = evaluate(row, self.points, self.formats)
        except BushfitError as error:
            record = RowFile(status="failed", error=str(error))
        except Exception as error:  # whatever happens to a row costs that row, and is reported
            kind = "out of memory" if isinstance(error, MemoryError) else "an internal error of bushfit"
            record = RowFile(status="failed", error=f"{kind}: {type(error).__name__}: {error}")
        digests = {name: store.digest(content) for name, content in files.items()}
        record = replace(record, key=key, seconds=round(time.perf_counter() - start, 4), files=digests)
        try:
            store.save_row(self.output, row, files, record)
        except OSError as error:
            record = RowFile(status="failed", error=f"the results cannot be written: {error}")
        return record, False


def evaluate(row: Row, points: Sequence[Point], formats: Formats) -> tuple[RowFile, dict[str, bytes]]:
    """Evaluate one part of a batch: run the commands of its row, and collect what the batch compares.

    Args:
        row: row with its campaign and commands.
        points: operating points of stiffness and loss factor.
        formats: formats of the result files.

    Returns:
        Results for the table of the batch, and the contents of the result files by name.

    Raises:
        BushfitError: inputs that cannot be used.
    """
    campaign = load_campaign(Path(row.campaign))
    result, diagnosis, files, response_warnings = run_commands(campaign, row.settings, formats)
    tests: tuple[Loop | Sweep, ...] = (*campaign.loops, *campaign.sweeps)
    sources = [test.source for test in tests if test.source]
    inputs = {Path(row.campaign).name: campaign.sha256} | {str(source.file): source.sha256 for source in sources}
    further = filter(None, (row.settings.model, row.settings.history))
    inputs |= {path: store.digest(view_bytes(Path(path), ModelError)) for path in further}
    quantities, warnings = estimate_quantities(result, points)
    measured, at_bound = dict[str, Estimate](), dict(result.at_bound)
    for point in points:
        measured |= measured_at(campaign.sweeps, point, result.quality.noise if result.quality else 0.0)
    for name in result.at_bound:
        parameter = result.model.parameters[name]
        amount = result.model.values[name] - (parameter.neutral or 0.0)
        if "." in name and parameter.neutral is not None and abs(amount) <= _ZERO * parameter.typical:
            del at_bound[name]  # an added effect of zero is a result and not a bound
    effects = diagnosis.effects if diagnosis else ()
    twins = [twin for name in (diagnosis.result.unresolved if diagnosis else ()) for twin in get_effect(name).twins]
    record = RowFile(
        status="done",
        inputs=inputs,
        campaign_name=campaign.name,
        verdict=diagnosis.verdict if diagnosis else None,
        effects=[effect.label for effect in effects],
        alternatives=[*dict.fromkeys((*(rival.label for effect in effects for rival in effect.alternatives), *twins))],
        **to_entries(warnings_of(result, [*warnings, response_warnings], diagnosis.notes if diagnosis else ())),
        quantities=quantities,
        measured=measured,
        at_bound=at_bound,
        curve=measured_curve(campaign.sweeps),
    )
    return record, files


def run_commands(
    campaign: Campaign, settings: RowSettings, formats: Formats
) -> tuple[Result, Diagnosis | None, dict[str, bytes], list[Caveat]]:
    """Run the commands on one campaign: run alone, or any of fit, diagnose, predict and respond, in this order.

    Args:
        campaign: campaign of one part.
        settings: complete settings of the part.
        formats: formats of the result files; the tables of a prediction are always written.

    Returns:
        The last result, the diagnosis (None without diagnose), the contents of the result files by name, and the
        warnings of the response to a history.
    """
    from bushfit.commands.diagnose import diagnose  # only workers need the commands, which are slow to import
    from bushfit.commands.fit import fit
    from bushfit.commands.predict import predict
    from bushfit.commands.respond import respond
    from bushfit.commands.run import run

    commands, with_tables = settings.commands or (), replace(formats, tables=True)
    if "run" in commands:
        ran = run(campaign)
        prediction = [file for file in ran.predicted.files if file.name != "measured"]
        files = encode_all(ran.files, formats) | encode_all(prediction, with_tables)
        return ran.result, ran.diagnosed.diagnosis if ran.diagnosed else None, files, []
    start = result = load_result(Path(settings.model)) if settings.model else None
    diagnosis, joint, files = None, None, {}
    data = PreparedCampaign.from_campaign(campaign) if set(commands) - {"predict", "respond"} else None
    if "fit" in commands and data:
        fitted = fit(data, directions=settings.directions or (), effects=settings.effects or ())
        result, files = fitted.result, encode_all(fitted.files, formats)
        joint = None if settings.directions or settings.effects else fitted
        if "diagnose" in commands:  # as in `run`: model.json is that of diagnose
            files["joint.json"] = files.pop("model.json")
    if "diagnose" in commands and data:
        options = {name: getattr(settings, name) for name in ("max_effects", "tolerance", "adopt", "without")}
        options_given = {name: value for name, value in options.items() if value is not None}
        diagnosed = diagnose(data, model=start, joint=joint, **options_given)
        result, diagnosis = diagnosed.result, diagnosed.diagnosis
        files |= encode_all(diagnosed.files, formats)
    assert result is not None  # the manifest refuses rows without fit, diagnose or model
    if "predict" in commands:
        files |= encode_all(predict(result, campaign).files, with_tables)
    warnings = list[Caveat]()
    if "respond" in commands and settings.history:
        response = respond(result, settings.history, lowpass=settings.lowpass)
        files, warnings = files | encode_all(response.files, with_tables), list(response.warnings)
    return result, diagnosis, files, warnings


def estimate_quantities(result: Result, points: Sequence[Point]) -> tuple[dict[str, Estimate], list[Sequence[Caveat]]]:
    """Estimate parameters, quality of the fit, and stiffness and loss factor at operating points, with intervals.

    Returns:
        Estimates [SI] by name of the quantity, and the warnings of the prediction at each point.

    Raises:
        BatchError: an amplitude with a wrong unit, such as an angle in the axial direction.
    """
    unknown, warnings = (None, None, None), list[Sequence[Caveat]]()
    units = {name: parameter.unit for name, parameter in result.model.parameters.items()}
    rows: list[tuple[Any, ...]] = [
        (name, result.model.values[name], *(result.interval(name) or unknown[:2]), result.covariance.stderr(name))
        for name in units
    ]
    if result.quality:
        rows += [(quantity.name, getattr(result.quality, key), *unknown) for key, quantity in FIT_QUALITY.items()]
    for point in points:
        places = get_places(point.place, result.specimens)
        place = places[0]
        if len(places) > 1:
            expected = " or ".join(f'"{name} ..."' for name in places)
            raise BatchError("several places fit this operating point", found=str(point), expected=expected)
        if place.motion != point.motion:
            problem = "the unit of this amplitude does not suit this direction or specimen"
            expected = f"an amplitude in {place.display.displacement.name}"
            raise BatchError(problem, found=str(point), expected=expected)
        predicted = predict_stiffness(result, place, [point.frequency], [point.amplitude])
        bands = {f"{STIFFNESS} {point}": predicted.stiffness, f"{LOSS_FACTOR} {point}": predicted.loss_factor}
        rows += [(name, *band.ends[:, 0].tolist(), None) for name, band in bands.items()]
        units[f"{STIFFNESS} {point}"] = place.motion.stiffness_unit
        warnings.append(predicted.warnings)
    estimates = {}
    for name, value, *ends in rows:
        low, high, stderr = (x if x is not None and np.isfinite(x) else None for x in ends)
        estimates[name] = Estimate(value, low, high, stderr, units.get(name, "1"))
    return estimates, warnings
