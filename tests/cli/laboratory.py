"""A campaign as laboratories keep it, with a known truth: two bushings, a coupon and a mount of one compound.

`bushfit simulate` makes the tests. Their files are rewritten in other units and layouts: three preloads in one table in
inches and pounds, two temperatures in one in degrees Fahrenheit, a loop with decimal commas. The truth comes from the
rig of the score card, which shares no code with bushfit.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from time_rig import DIRECTIONS, Bushing, Change, Rubber, Tests, respond

RUBBER = Rubber(0.9e6, 0.17e6, 0.26, 13e3, 0.012)
SOFTENING, SHIFT = 0.004, 0.03
PRELOAD = {"c2": 0.4, "c3": 8.0, "friction": 2.0, "friction_square": 10.0, "rate": 0.5, "rate_square": 2.0}
FACTOR, COMPLIANCE = 1.06, 1e-8
#: Parameters beside those of the rubber, as model.json names them, in SI units.
EFFECTS = {
    "temperature.softening": SOFTENING,
    "temperature.shift": SHIFT,
    **{f"preload.{name}": value for name, value in PRELOAD.items()},
    "stiffness_factor.rear left": FACTOR,
}
BODIES = """
name = "mount 7"

[[bushings]]
name = "front"
inner_radius = "10 mm"
outer_radius = "18 mm"
length = "34 mm"

[[bushings]]
name = "rear left"
inner_diameter = "24 mm"
outer_diameter = "48 mm"
length = "50 mm"
factor = "free"

[[specimens]]
name = "DMA"
kind = "modulus"

[[specimens]]
name = "pad"
kind = "shear"
area = "772 mm^2"
thickness = "6 mm"
elements = 2
"""
PLAN = f"""{BODIES}
[simulate]
seed = 20
repeats = 2
noise = "0.3 %"
force_noise = "0.2 %"
gain_error = "0.1 %"
parameters = {{ mu = "0.9 MPa", m = "0.17 MPa*s^alpha", alpha = 0.26, sigma_fmax = "13 kPa", eps_half = 0.012 }}
loops = [
  {{ bushing = "front", direction = "axial", amplitude = "1 mm", frequency = "0.1 Hz" }},
  {{ bushing = "rear left", direction = "axial", amplitudes = ["0.3 mm", "0.9 mm"], frequency = "0.2 Hz", cycles = 4, \
pause = "2 s" }},
]
sweeps = [
  {{ bushing = "front", direction = "axial", preload = "none", amplitudes = ["0.1 mm", "0.4 mm"], \
frequencies = ["5 Hz", "20 Hz", "60 Hz", "150 Hz"] }},
  {{ bushing = "front", direction = "axial", preload = "1.5 mm", amplitudes = ["0.1 mm", "0.4 mm"], \
frequencies = ["150 Hz", "5 Hz", "60 Hz", "20 Hz"] }},
  {{ bushing = "front", direction = "axial", preload = "-1.5 mm", amplitudes = ["0.4 mm", "0.1 mm"], \
frequencies = ["150 Hz", "60 Hz", "20 Hz", "5 Hz"] }},
  {{ bushing = "rear left", direction = "radial", temperature = "23 degC", amplitudes = ["0.05 mm", "0.2 mm"], \
frequencies = ["150 Hz", "60 Hz", "20 Hz", "5 Hz"] }},
  {{ bushing = "rear left", direction = "radial", temperature = "40 degC", amplitudes = ["0.05 mm", "0.2 mm"], \
frequencies = ["5 Hz", "60 Hz", "20 Hz", "150 Hz"] }},
  {{ specimen = "DMA", stepped = "amplitude", amplitudes = ["0.1 %", "1 %", "8 %"], frequencies = ["40 Hz", "10 Hz"] }},
]
resonances = [{{ specimen = "pad", mass = "0.5 kg", base_acceleration = "1 g", \
frequencies = {{ start = "40 Hz", stop = "200 Hz", step = "8 Hz" }} }}]
validation = [{{ bushing = "front", direction = "axial", motion = "sines", frequencies = ["2 Hz", "50 Hz"], \
amplitudes = ["0.2 mm", "0.05 mm"], duration = "2 s" }}]

[simulate.effects]
stiffness_factor = {{ "rear left" = {FACTOR} }}
rig_compliance = {{ compliance = "{COMPLIANCE} m/N" }}
temperature = {{ softening = {SOFTENING}, shift = {SHIFT} }}
preload = {{ {", ".join(f"{name} = {value}" for name, value in PRELOAD.items())} }}
"""


def _test(kind: str, file: str, *keys: str) -> str:
    return "\n".join([f"[[{kind}]]", f'file = "{file}"', *keys, ""])


_FRONT = ('bushing = "front"', 'direction = "axial"')
CAMPAIGN = "\n".join(
    [
        BODIES,
        _test("loops", "loop_front.csv", *_FRONT),
        _test("loops", "sim/loop_rear left axial_2.csv", 'bushing = "rear left"', 'direction = "axial"'),
        *(_test("sweeps", "front.csv", *_FRONT, f'preload = "{preload}"') for preload in ("1.5 mm", "0 mm", "-1.5 mm")),
        *(
            _test("sweeps", "rear.csv", 'bushing = "rear left"', 'direction = "radial"', f'temperature = "{warm} degC"')
            for warm in (40, 23)
        ),
        _test("sweeps", "sim/sweep_DMA.csv", 'specimen = "DMA"'),
        _test("validation", "sim/record_front axial.csv", *_FRONT),
        '[fit]\neffects = ["temperature", "rig_compliance"]',
        '[fit."rig_compliance.compliance"]\nvalue = "0.01 mm/kN"\nvary = false\n',
    ]
)


def rewrite_files(folder: Path) -> None:
    """Write the simulated tests in `sim` again as another laboratory would, and the campaign of them."""

    def simulated(name: str) -> pd.DataFrame:
        return pd.read_csv(folder / f"sim/{name}.csv")

    loop = simulated("loop_front axial_1")
    loop = pd.DataFrame(
        {"Zeit [ms]": 1e3 * loop.iloc[:, 0], "Weg [mm]": loop.iloc[:, 1], "Kraft [kN]": 1e-3 * loop.iloc[:, 2]}
    )
    loop.to_csv(folder / "loop_front.csv", sep=";", decimal=",", index=False)
    front, rear = [], []
    for number, preload in ((3, -1.5), (1, 0.0), (2, 1.5)):
        frequency, amplitude, run, stiffness, loss = simulated(f"sweep_front axial_{number}").to_numpy().T
        columns = (
            frequency,
            2.0 * amplitude / 0.0254,
            run,
            stiffness * 25.4 / 4.4482216152605,
            np.degrees(np.arctan(loss)),
        )
        front.append(np.column_stack((*columns, np.full(len(run), preload))))
    for number, fahrenheit in ((4, 73.4), (5, 104.0)):
        frequency, amplitude, run, stiffness, loss = simulated(f"sweep_rear left radial_{number}").to_numpy().T
        storage = 1e-3 * stiffness / np.hypot(1.0, loss)
        columns = (frequency, 1e3 * amplitude, run, storage, storage * loss)
        rear.append(np.column_stack((*columns, np.full(len(run), fahrenheit))))
    for name, tables, header in (
        ("front", front, "Frequency [Hz],Displacement p-p [mil],run,K* [lbf/in],Phase [deg],preload [mm]"),
        ("rear", rear, "f [Hz],amplitude [um],repeat,K' [kN/mm],K'' [kN/mm],temperature [degF]"),
    ):
        np.savetxt(folder / f"{name}.csv", np.vstack(tables), "%.8g", ",", header=header, comments="")
    (folder / "mount.toml").write_text(CAMPAIGN, encoding="utf-8")


@dataclass(frozen=True)
class Sample:
    """A specimen for the rig of the score card: strain per displacement [1/m], stiffness per modulus [m]."""

    per_displacement: float
    per_modulus: float

    def strain(self, _: str) -> float:
        return self.per_displacement

    def stiffness(self, _: str) -> float:
        return self.per_modulus


_BODIES = {
    "front": Bushing(0.010, 0.018, 0.034),
    "rear left": Bushing(0.012, 0.024, 0.050),
    "DMA": Sample(0.5, 1.0),
    "pad": Sample(0.5 / 0.006, 2 * 772e-6 / 0.006),
}


def truth(
    place: str,
    frequency: object,
    amplitude: object,
    *,
    preload: float = 0.0,
    temperature: float = 23.0,
    rig: bool = False,
) -> np.ndarray:
    """Complex stiffness [N/m], or modulus [Pa] of the coupon, at operating points, by integration over time.

    Args:
        place: body and direction, such as "front axial", or a specimen.
        frequency, amplitude: of each point [Hz], [m] or strain [1], (n,).
        preload: static displacement [m].
        temperature: of the rubber [degC].
        rig: with the compliance of the rig.
    """
    frequency, amplitude = np.asarray(frequency, dtype=float), np.asarray(amplitude, dtype=float)
    body, _, direction = place.rpartition(" ")
    body, direction = (body, direction) if direction in DIRECTIONS else (place, "axial")
    count, warmer = len(frequency), temperature - 23.0
    point = np.full(count, DIRECTIONS.index(direction)), np.arange(count), np.ones(count, int), np.zeros(count, bool)
    tests = Tests(_BODIES[body], frequency, amplitude, *point)
    static, c2 = preload * _BODIES[body].strain(direction), np.sqrt(np.log(10.0) * 17.44 * 51.6 / SHIFT)
    softer, shifted = np.exp(-SOFTENING * warmer), np.exp(-SHIFT * warmer * c2 / (c2 + warmer))
    growth = {
        name: np.exp(PRELOAD[name] * static + PRELOAD[f"{name}_square"] * static**2) for name in ("friction", "rate")
    }
    size = FACTOR if body == "rear left" else 1.0
    stiffer = {
        "mu": size * (temperature + 273.15) / 296.15,
        "m": size * softer * shifted**RUBBER.alpha * growth["rate"],
        "sigma_fmax": size * softer * growth["friction"],
    }
    mu = stiffer["mu"] * RUBBER.mu

    def curved(strain: np.ndarray) -> np.ndarray:
        """Stress of the elastic law about the preload beyond 2 mu e; only tests of the front bushing state one."""
        total = strain + static
        bent = PRELOAD["c2"] * (total**2 - static**2) + PRELOAD["c3"] * (total**3 - static**3)
        return 2.0 * mu * bent * (place == "front axial")

    gives = (lambda force: COMPLIANCE * force) if rig else None
    return respond(tests, RUBBER, Change(rubber=stiffer, stress=curved, gives=gives)).stiffness
