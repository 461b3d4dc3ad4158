"""Pictures of hysteresis loops: force over displacement of each place, measured and modelled, and what is left."""

from collections.abc import Iterator

import numpy as np
import pandas as pd
from markupsafe import Markup

from bushfit.effects.contract import Array
from bushfit.geometry import Place
from bushfit.report.page.chart import MOST_LEVELS, MOST_PLACES, Panel, Rule, Series, chart, colors, every_nth, span_of
from bushfit.report.page.readback import ReportData
from bushfit.report.tables import columns_of, complete, moved_of, numbers, spread

#: Rows of all loops of a page, with which it stays below 500 kB; but no loop has fewer than `_FEWEST`.
_MOST_ROWS, _FEWEST = 2400, 24
#: Width of a point of a loop [pixels].
_DOT = 2.6


def loop_panels(found: ReportData) -> list[Panel]:
    """Force over displacement of each place, measured and modelled, and measured less model."""
    tested = [(place, rows) for _, place, rows in found.measured("loop")]
    counts = [min(rows["test"].nunique(), MOST_LEVELS) for _, rows in tested]
    most = max(_FEWEST, _MOST_ROWS // max(1, sum(sorted(counts)[-MOST_PLACES:])))
    frequencies = {test.test: test.frequency_Hz[0] for test in found.tests}
    panels = list[Panel]()
    for place, rows in tested:
        if loops := dict(_last_cycles(place, rows, frequencies)):
            steps = {name: every_nth(loop.shape[1], most) for name, loop in loops.items()}
            every = max(step.step for step in steps.values())
            rarely = f", one row in {every}" if every > 1 else ""
            notes = [f"The last cycle of each loop. Points: measured{rarely}. Lines: model."]
            if left := rows["test"].nunique() - len(loops):
                notes.append(f"{left} further loops are left out of the picture; loops.csv has all.")
            pictures = _charts(place, {name: loop[:, steps[name]] for name, loop in loops.items()})
            panels.append(Panel(str(place), pictures, notes))
    return panels[:MOST_PLACES]


def _last_cycles(place: Place, rows: pd.DataFrame, frequencies: dict[str, float]) -> Iterator[tuple[str, Array]]:
    """The loops of a place, at most eight: displacement, measured and modelled force of the last cycle, (3, n)."""
    resisting = columns_of(place)[2]
    headers = moved_of(place), resisting, f"model {resisting}"
    rows = complete(rows, "time [s]", *headers)
    names = list(dict.fromkeys(rows["test"]))
    for name in (names[at] for at in spread(len(names), MOST_LEVELS)):
        mine = rows[rows["test"] == name]
        (time,) = numbers(mine, "time [s]")
        period = 1.0 / frequencies[name] if frequencies.get(name) else np.inf
        yield name, numbers(mine, *headers)[:, time >= time.max() - period]


def _charts(place: Place, loops: dict[str, Array]) -> list[Markup]:
    moved, resisting, _ = place.motion.words
    unit = place.display.force.name
    labels = f"{moved} [{place.display.displacement.name}]", f"{resisting} [{unit}]"
    whole, left, spans, off = [], [], [], []
    for (name, (x, measured, model)), color in zip(loops.items(), colors(len(loops)), strict=True):
        whole.append(Series(name, color, line=(x, model), points=(x, measured)))
        left.append(Series(name, color, points=(x, measured - model)))
        spans.append(f"{name}: measured {span_of(measured)} {unit}, model {span_of(model)}")
        off.append(f"{name}: {span_of(measured - model)} {unit}")
    loops_in_words = f"{labels[1]} over {labels[0]}, measured and model; {'; '.join(spans)}"
    left_in_words = f"{resisting}, measured less model, over {moved}; {'; '.join(off)}"
    return [
        chart(f"{place}: hysteresis", labels, whole, loops_in_words, dot=_DOT),
        chart(f"{place}: measured less model", labels, left, left_in_words, dot=_DOT, rules=[Rule(0.0, "")]),
    ]
