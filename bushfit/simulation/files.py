"""A simulated campaign as files, as a laboratory would hand them over, with the truth beside them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from typing_extensions import Doc, TypedDict

from bushfit.campaign.toml import body_lines, table_lines
from bushfit.errors import typed
from bushfit.geometry import Specimen
from bushfit.model.document import ModelFile
from bushfit.reading.tablefile import Form, ending, to_bytes
from bushfit.simulation.measured import Simulated


class SimulationDocument(TypedDict):
    """A simulated campaign."""

    truth: Annotated[ModelFile, Doc("the model behind it, as in truth.json.")]
    files: Annotated[list[str], Doc("that were written, by name.")]


def to_files(simulated: Simulated, form: Form = "csv") -> dict[str, bytes]:
    """The campaign as files: tables, `campaign.toml` that names them, and `truth.json`, the model behind them.

    A resonance test is what `bushfit reduce` takes; `campaign.toml` says how.
    """
    from bushfit.model.file import to_document
    from bushfit.reading.rawtable import raw_loop_table, raw_resonance_table, raw_sweep_table

    tables = {
        **{loop.name: raw_loop_table(loop) for loop in simulated.loops},
        **{sweep.name: raw_sweep_table(sweep) for sweep in simulated.sweeps},
        **{test.name: raw_resonance_table(test) for _, test in simulated.resonances},
    }
    return {
        **{f"{name}.{ending(form)}": to_bytes(name, table, form) for name, table in tables.items()},
        "campaign.toml": _campaign_toml(simulated, form).encode(),
        "truth.json": (json.dumps(to_document(simulated.result), indent=1) + "\n").encode(),
    }


def _campaign_toml(simulated: Simulated, form: Form) -> str:
    seed, end = simulated.plan.seed, ending(form)
    lines = [f"# Simulated by bushfit simulate with seed {seed}: no rubber was tested. The model is in truth.json."]
    lines += body_lines(simulated.truth.bushing, simulated.specimens)
    plan = simulated.plan
    if plan.level_gain_error or plan.level_phase_error:  # which no repeat shows, so that a fit has to be told
        errors = {"gain_error": (plan.level_gain_error, "1"), "phase_error": (plan.level_phase_error, "rad")}
        lines += ["", "[rig]", *(f'{key} = "{size:.6g} {unit}"' for key, (size, unit) in errors.items())]
    for kind, tests in (("loops", simulated.loops), ("sweeps", simulated.sweeps)):
        for each in tests:
            lines += table_lines(kind, f"{each.name}.{end}", each.direction, each.temperature)
    for mass, test in simulated.resonances:
        file, folder = (typed(Path(name)) for name in (f"{test.name}.{end}", test.name))
        tested = "specimen" if isinstance(test.direction, Specimen) else "direction"
        place = typed(Path(str(test.direction)))
        lines += ["", "# A sweep comes of this resonance test with:"]
        lines += [f'# bushfit reduce {file} --mass "{mass:.6g} kg" --{tested} {place} -o {folder}']
        lines += [f"# {line}" for line in table_lines("sweeps", f"{test.name}/sweep.{end}", test.direction) if line]
    return "\n".join(lines) + "\n"
