"""A campaign as text, with the two tables that it names."""

from __future__ import annotations

import math
from pathlib import Path

from bushfit.campaign.campaign import Campaign, load_campaign

BUSHING = """
[bushing]
name = "CMP 15 961"
inner_radius = "10 mm"
outer_radius = "18 mm"
length = "34 mm"
"""


TESTS = """
[[loops]]
file = "loop.csv"
direction = "axial"

[[sweeps]]
file = "sweep.csv"
direction = "radial"
"""


LOOP = "displacement [mm],force [N],time [s]\n" + "".join(f"{math.sin(i)},{math.sin(i + 0.1)},{i}\n" for i in range(20))


SWEEP = "frequency [Hz],amplitude [mm],stiffness [N/mm],loss factor [-]\n" + "".join(
    f"{f},0.1,600,0.1\n" for f in (5, 15, 25)
)


def campaign_from(text: str, folder: Path) -> Campaign:
    file = folder / "campaign.toml"
    file.write_text(text)
    return load_campaign(file)
