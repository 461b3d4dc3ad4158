"""Texts of short campaigns of the virtual rig: few frequencies, two repeats."""

MOUNT = """
[bushing]
name = "Mount"
inner_radius = "12 mm"
outer_radius = "24 mm"
length = "50 mm"
"""
_RIG = """
[simulate]
seed = 629
repeats = 2
noise = "0.3 %"
gain_error = "0.2 %"
{}
[simulate.parameters]
mu = "0.78 MPa"
m = "0.16 MPa*s^alpha"
alpha = 0.27
sigma_fmax = "11 kPa"
eps_half = 0.014
"""
#: A loop, with its direction, amplitude and frequency to be put in.
LOOP = """
[[simulate.loops]]
direction = "{}"
amplitude = "{}"
frequency = "{}"
cycles = 2
"""
#: A sweep, of a direction or a specimen, with its name and amplitudes.
SWEEP = """
[[simulate.sweeps]]
{} = "{}"
amplitudes = {}
frequencies = ["5 Hz", "20 Hz", "50 Hz", "90 Hz", "150 Hz"]
"""
SWEEPS = {
    "axial": SWEEP.format("direction", "axial", '["0.1 mm", "0.2 mm", "0.5 mm"]'),
    "radial": SWEEP.format("direction", "radial", '["0.1 mm", "0.2 mm", "0.5 mm"]'),
    "torsion": SWEEP.format("direction", "torsion", '["0.3 deg", "0.6 deg", "1.5 deg"]'),
}


def rig(force_noise: str, *more: str) -> str:
    """The rig and the rubber, with further lines of [simulate]."""
    return _RIG.format("\n".join([f'force_noise = "{force_noise}"', *more]))
