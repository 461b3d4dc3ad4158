"""The tables [[loops]] and [[sweeps]] of a campaign file: a test's file, and what it does not say itself."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from bushfit.campaign.quantities import Count, Frequency, Share, Temperature, motion, table, text
from bushfit.errors import CampaignError
from bushfit.geometry import Direction
from bushfit.reading.headers import LOOP_COLUMNS, SWEEP_COLUMNS, AmplitudeConvention
from bushfit.reading.layout import FileFormat
from bushfit.reading.measurement import Stepped, Waveform
from bushfit.validation import Name, Text, converted, unknown_key


def _roles(known: Collection[str], what: str) -> BeforeValidator:
    """A validator that refuses other keys than these roles of columns; `what` the file has of each."""
    written = {"properties": {role: text(f"{what} of {role.replace('_', ' ')}") for role in known}}
    closed = {"type": "object", **written, "additionalProperties": False}

    def check_keys(raw: dict[str, Any]) -> dict[str, Any]:
        for role in raw:
            if role not in known:
                raise unknown_key(role, known)
        return raw

    return table(check_keys, closed)


#: Takes the direction of a specimen for none.
_SHEAR = converted(lambda raw, _: None if raw == "shear" else raw, {"enum": [*Direction, "shear"]})


@dataclass(frozen=True)
class TestFile(FileFormat):
    """What [[loops]] and [[sweeps]] say alike: a file, what was tested in it, and under which conditions.

    Args:
        file: relative to the campaign file.
        direction: of the bushing; a specimen has none, which may be written "shear".
        specimen: by its name in [[specimens]]; the bushing unless stated.
        noise: relative standard deviation of a point, where it is known.
        weight: of the test in the fit, a share of the weight that its noise gives it.
        temperature: [K]; it selects the rows of a file that has several, as direction and specimen_number do where a
            column tells them.
        rows: that make the test: for columns by their headers, the text there.
        order: number of the test in the session; its place among all [[loops]], then all [[sweeps]], unless stated.
        preload, date, operator, specimen_number: carried on to results as they are written.
    """

    __test__ = False

    file: Text
    direction: Annotated[Direction | None, _SHEAR] = None
    specimen: Name | None = None
    noise: Share | None = None
    weight: Annotated[float, Field(gt=0, le=1)] = 1.0
    temperature: Temperature | None = None
    rows: Mapping[str, Text] = field(default_factory=dict)
    order: Count | None = None
    preload: Text | None = None
    date: Text | None = None
    operator: Text | None = None
    specimen_number: Text | None = None


@dataclass(frozen=True)
class LoopFile(TestFile):
    """[[loops]]: a file and what it does not say itself. See reading.read_loop.

    Args:
        columns: by their headers, where these are not the usual names.
        units: that the file does not carry.
        force_sign: -1 where the load cell counts the other way round.
        rate: of a file without time: speed of a triangle [m/s or rad/s].
        frequency: of a file without time, with waveform [Hz].
        waveform: of a file without time, with frequency.
    """

    columns: Annotated[Mapping[str, Text], _roles(LOOP_COLUMNS, "header")] = field(default_factory=dict)
    units: Annotated[Mapping[str, Text], _roles(LOOP_COLUMNS, "unit")] = field(default_factory=dict)
    force_sign: Literal[1, -1] = 1
    rate: Annotated[float, motion("/s"), Field(gt=0)] | None = None
    frequency: Frequency | None = None
    waveform: Waveform | None = None

    def __post_init__(self) -> None:
        if (self.frequency is None) != (self.waveform is None) or (self.rate and self.frequency):
            raise ValueError(
                CampaignError(
                    "these keys do not settle the time of a loop",
                    found=", ".join(key for key in ("rate", "frequency", "waveform") if getattr(self, key)),
                    expected='rate, or frequency and waveform ("sine" or "triangle") together',
                    hint='state waveform = "sine" beside it' if self.frequency and not self.rate else None,
                )
            )


@dataclass(frozen=True)
class SweepFile(TestFile):
    """[[sweeps]]: a file and what it does not say itself. See reading.read_sweep.

    Args:
        columns: by their headers, where these are not the usual names.
        units: that the file does not carry.
        amplitude: how the file counts amplitudes; as its header says unless stated, else zero-to-peak.
        at_amplitude: of a file without a column for it, with its unit: "0.1 mm", "0.15 %".
        at_frequency: likewise [Hz].
        stepped: what was stepped while the other was held, where the order of the rows does not tell it.
    """

    columns: Annotated[Mapping[str, Text], _roles(SWEEP_COLUMNS, "header")] = field(default_factory=dict)
    units: Annotated[Mapping[str, Text], _roles(SWEEP_COLUMNS, "unit")] = field(default_factory=dict)
    amplitude: AmplitudeConvention | None = None
    at_amplitude: Text | None = None
    at_frequency: Frequency | None = None
    stepped: Stepped | None = None
