"""Files as laboratories write them: what is read has the right values, and what is in doubt is asked about."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exports import AMPLITUDE, DISPLACEMENT, EXPORTS, FORCE, FREQUENCY, STIFFNESS, TIME

from bushfit.errors import BushfitError
from bushfit.inspection.gathering import gather
from bushfit.reading.measurement import Loop

SWEEP = {"frequency": FREQUENCY, "amplitude": 1e-3 * AMPLITUDE, "stiffness": 1e3 * STIFFNESS}
LOOP = {"time": TIME, "displacement": 1e-3 * DISPLACEMENT, "force": FORCE}


@pytest.mark.parametrize("name", EXPORTS)
def test_an_export_is_read_right_or_raises_a_question(name: str, tmp_path: Path) -> None:
    export = EXPORTS[name]
    file = tmp_path / export.name
    file.write_bytes(export.content if isinstance(export.content, bytes) else export.content.encode())
    stated: dict[str, Any] = {"direction": "axial", "columns": {}, "units": {}, **export.stated}
    if export.kind is None:
        with pytest.raises(BushfitError) as caught:
            [source.inspect() for source in gather([file], stated)[0]]
        assert [word for word in export.words if word not in str(caught.value)] == []
        return
    for seen in [source.inspect() for source in gather([file], stated)[0]]:
        measured = seen.measured
        assert measured is not None
        assert measured.source is not None
        notes = " | ".join(measured.source.notes)
        assert seen.kind == export.kind
        assert [word for word in export.words if word not in notes] == []
        for column, values in (export.reference or (LOOP if isinstance(measured, Loop) else SWEEP)).items():
            found = getattr(measured, column)
            if column == "time":  # clocks have no zero, and rounded ones are spread to within a step
                np.testing.assert_allclose(found - found[0], values, atol=0.06 if "spread" in notes else 2e-3)
            else:
                np.testing.assert_allclose(found, values, rtol=2e-6, atol=2e-5 * np.abs(values).max())
