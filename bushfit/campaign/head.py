"""[report]: what stands at the head of a report, and the logo beside it."""

import base64
from dataclasses import dataclass
from pathlib import Path

from bushfit.errors import CampaignError
from bushfit.reading.files import view_bytes
from bushfit.validation import Name

#: A logo at most [bytes]: it stands in every model file of its campaign.
LARGEST_LOGO = 64_000
#: How a PNG file begins, and what the head of an SVG file holds; such a head at most [bytes].
_PNG, _SVG, _HEAD = b"\x89PNG\r\n\x1a\n", b"<svg", 4096


@dataclass(frozen=True)
class ReportSettings:
    """[report]: what stands at the head of the report, as it is to be read there.

    Args:
        customer: whose part it is.
        part_number: of the bushing.
        drawing: its number, with the issue.
        compound: the rubber, by its name.
        laboratory: that tested it.
        date: of the report.
        logo: a PNG or SVG file, relative to the campaign file.
    """

    customer: Name | None = None
    part_number: Name | None = None
    drawing: Name | None = None
    compound: Name | None = None
    laboratory: Name | None = None
    date: Name | None = None
    logo: Name | None = None

    @property
    def lines(self) -> dict[str, str]:
        """What is stated in words, in the order in which it is read."""
        return {key: value for key, value in vars(self).items() if value is not None and key != "logo"}


def embedded(file: Path) -> str:
    """A logo as a data URI: the picture itself, for a page that stands alone.

    Raises:
        CampaignError: the file is missing, too large, or neither PNG nor SVG.
    """
    data = view_bytes(file, CampaignError, largest=LARGEST_LOGO, hint="save the logo with fewer pixels, or as SVG")
    if data.startswith(_PNG):
        kind = "png"
    elif _SVG in data[:_HEAD]:
        kind = "svg+xml"
    else:
        begins = f"a file that begins with {data[:12]!r}"
        raise CampaignError("this is no picture that a page can show", file=file, found=begins, expected="PNG or SVG")
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
