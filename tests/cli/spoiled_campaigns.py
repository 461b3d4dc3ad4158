"""What is spoiled in a campaign, and what the one error has to say: problem, place and, where there is one, hint."""

# fmt: off
from __future__ import annotations

BUSHING = '[bushing]\nname = "x"\ninner_radius = "10 mm"\nouter_radius = "18 mm"\nlength = "34 mm"\n'
#: (text of the campaign, text instead of it, what the error says ...)
IN_CAMPAIGN = [
    ("[bushing]", "[bushings]", "campaign.toml, bushings: unknown key", 'did you mean "bushing"?'),
    ('name = "Test bushing"\n', "", "campaign.toml, bushing.name: a key is missing", "name = ..."),
    ('name = "Test bushing"', 'name = ""', "campaign.toml, bushing.name: this value is not understood", "a text that is not empty"),
    ('name = "Test bushing"', 'name = "a\\u001b[2J"', "campaign.toml, bushing.name: this value is not understood", "one line without control characters"),
    ('"10 mm"', "10", "campaign.toml, bushing.inner_radius: a number without a unit", 'write "10 mm"'),
    ('"10 mm"', '"-10 mm"', "campaign.toml, bushing.inner_radius: this value is not understood", "greater than 0"),
    ('"10 mm"', '"nan mm"', "campaign.toml, bushing.inner_radius: this is no quantity", 'a length with its unit, such as "10 mm"'),
    ('"10 mm"', '"1e999 mm"', "campaign.toml, bushing.inner_radius: the number is too large", 'a length with its unit, such as "10 mm"'),
    ('"10 mm"', '"10,5 mm"', "campaign.toml, bushing.inner_radius: this is no quantity", "write numbers with a decimal point"),
    ('"10 mm"', '"18 mm"', "campaign.toml, inner_radius, outer_radius: impossible bushing", "check that radii were given, not diameters, and that they are not swapped"),
    ('"34 mm"', "34 mm", "campaign.toml, line 5, column 13: this is not valid TOML", "put texts and quantities in quotes"),
    ("length =", "lenght =", "campaign.toml, bushing.lenght: unknown key", 'did you mean "length"?'),
    ('length = "34 mm"', 'length = "34 mm"\ncolour = "black"', "campaign.toml, bushing.colour: unknown key", "one of name, inner_radius, outer_radius, length"),
    ('length = "34 mm"', 'length = "1 mm"\nshape = "calibrated"', "campaign.toml, shape: no finite elements were computed for this shape", "inner/outer 0.15 to 0.92 and length/outer 0.1 to 60"),
    ("[[loops]]", "[loops]", "campaign.toml, loops: this value is not understood", "a list"),
    ('"loop.csv"', '"lop.csv"', "lop.csv: there is no such file", 'did you mean "loop.csv"?'),
    ('"loop.csv"', '"."', ".: this is not a file", "a file"),
    ('"loop.csv"', '"sweep.csv"', "sweep.csv, line 1: there is no column for the displacement", 'name the column in the campaign: columns = { displacement = "..." }'),
    ('"loop.csv"', '"campaign.toml"', "campaign.toml, line 1: there is only one column", 'a header row such as "time [s],displacement [mm],force [N]", separated by comma,'),
    ('"loop.csv"', '"loop.csv"\nrate = "10 mm"', "campaign.toml, loops #1.rate: the unit does not fit", "a speed, such as mm/min"),
    ('"loop.csv"', '"loop.csv"\nrate = "10 mm/min"\nfrequency = "0.1 Hz"\nwaveform = "sine"', "campaign.toml, loops #1: these keys do not settle the time of a loop", 'rate, or frequency and waveform ("sine" or "triangle") together'),
    ('"loop.csv"', '"loop.csv"\nnoise = "200 %"', "campaign.toml, loops #1.noise: this value is not understood", "less than 1"),
    ('"loop.csv"', '"loop.csv"\ncolumns = {force = "Kraft" }', 'loop.csv, line 1: there is no column "Kraft"', "the header that was named for the force"),
    ('"loop.csv"', '"loop.csv"\nunits = {force = "mm" }', 'loop.csv, line 1, column "force [N]": two units for the force', "one unit, from the header, the units row or the campaign"),
    ('"loop.csv"', '"loop.csv"\nencoding = "klingon"', "loop.csv: unknown encoding", 'a name such as "utf-8", "utf-16", "cp1252", "latin-1" or "gb18030"'),
    ('"loop.csv"', '"loop.csv"\nheader_line = 0', "loop.csv: there is no header on this line", "lines count from 1"),
    ('"loop.csv"', '"loop.csv"\nsheet = "Tabelle1"', "loop.csv: this is no workbook", "a file with groups"),
    ('direction = "axial"', 'direction = "up"', "campaign.toml, loops #1.direction: this value is not understood", "'axial', 'radial' or 'torsion'"),
    ('direction = "axial"\n\n[[sweeps]]', "\n[[sweeps]]", "campaign.toml, loop.csv: a test without a direction", "direction ="),
    ('file = "sweep.csv"', 'file = "sweep.csv"\namplitude = "rms"', "campaign.toml, sweeps #1.amplitude: this value is not understood", "'zero-to-peak' or 'peak-to-peak'"),
    ('file = "sweep.csv"', 'file = "loop.csv"', "loop.csv, line 1: no pair of columns gives a complex stiffness", 'correct the header, or name the columns in the campaign: columns = { stiffness = "..." }'),
    ('[[sweeps]]\nfile = "sweep.csv"\ndirection = "axial"\n', '[[loops]]\nfile = "./loop.csv"\ndirection = "axial"\n', "loop.csv, line 1: a file is listed twice", "each file once, or a column that tells its tests apart"),
    ('file = "sweep.csv"', 'file = "sweep.csv"\nat_amplitude = "0.1 mm"', 'sweep.csv, line 8, column "amplitude [mm]": the amplitude is not the one that is stated', "take at_amplitude out of the campaign"),
    ('file = "sweep.csv"', 'file = "sweep.csv"\nat_frequency = "5 Hz"', 'sweep.csv, line 3, column "frequency [Hz]": the frequency is not the one that is stated', "take at_frequency out of the campaign"),
    *(('"10 mm"', f'"{size} mm"', "campaign.toml, bushing.inner_radius: no bushing has this", "a length from 1e-10 to 100 m") for size in ("1e-300", "1e300", "1e200")),
    ('"34 mm"', '"1 nm"', "campaign.toml, length: impossible bushing", "1e-06 to 100 m"),
]
#: The same for keys that the plain campaign does not use.
IN_MORE = [
    ('min = "0.5 MPa"', 'min = "5 MPa"', "more.toml, fit.mu: these limits hold no value", "min below max within 1000 to 1e+09 Pa, and value between them"),
    ("vary = true", 'vary = "yes"', "more.toml, fit.mu.vary: this value is not understood", "true or false"),
    ('step = "10 Hz"', 'step = "1e-9 Hz"', "more.toml, predict.frequencies: this is no range of frequencies", "0 < start <= stop, step > 0"),
    (', step = "10 Hz"', "", "more.toml, predict.frequencies: this is no range of frequencies", '{ start = "5 Hz", stop = "155 Hz", step = "10 Hz" }, or a list such as ["5 Hz", "15 Hz"]'),
    ('\namplitudes = ["0.1 mm"]', "\namplitudes = []", "more.toml, predict.amplitudes: this value is not understood", "at least one value"),
    ('residuals = "complex"', 'effects = ["stiffness_factor.mount"]', "more.toml, stiffness_factor.mount: no such direction or specimen", "one of axial, radial, torsion"),
    ('residuals = "complex"', 'effects = ["inertai"]', "more.toml, [fit] effects: unknown effect", "did you mean inertia?"),
    ('residuals = "complex"', 'effects = ["inertia", "inertia"]', "more.toml, [fit] effects: an effect is listed twice", "inertia"),
    ("seed = 1", "seed = -1", "more.toml, simulate.seed: this value is not understood", "greater than or equal to 0"),
    ('mu = "1.09 MPa"\n', "", "more.toml, [simulate.parameters]: parameters without a value", "all of mu, m, alpha, sigma_fmax, eps_half"),
    ("alpha = 0.24", "alpha = 2.4", "more.toml, alpha: impossible value", "0.02 to 1 (order of the fractional derivative)"),
    ('amplitude = "1 mm"', 'amplitude = "1 mm"\namplitudes = ["1 mm"]', "more.toml, simulate.loops #1: one of these keys is too many", "amplitude = ..., or amplitudes = [...] of a programme"),
    ('frequency = "0.1 Hz"', "", "more.toml, simulate.loops #1: a key is missing", "frequency = ..., or frequencies = [...] of a programme"),
    ('frequency = "0.1 Hz"', 'frequencies = ["0.001 Hz", "10 Hz"]', "simulate.loops: a programme of loops is too long to simulate", "pause for less, or simulate slow and fast loops as programmes of their own"),
    ('specimen = "DMA"', 'specimen = "DMB"', "more.toml, simulate.sweeps #2: this specimen is not in the campaign", "one of DMA"),
    ('specimen = "DMA"', 'specimen = "DMA"\ndirection = "axial"', "more.toml, simulate.sweeps #2: a specimen has no such direction", 'direction = "shear", or none'),
    ('specimen = "DMA"\n', "", "more.toml, simulate.sweeps #2: a test without a direction", 'or specimen = "DMA"'),
    ('direction = "radial"', 'direction = "torsion"', "more.toml, simulate.resonances #1: no mass swings on this", "a direction with a displacement, or a specimen in shear"),
    ('"500 Hz"', '"60 Hz"', "more.toml, simulate.resonances #1: no frequencies of a shaker", "at least 12, through the resonance"),
]
#: (name, content of the campaign, what the error says ...)
WHOLE_CAMPAIGNS = [
    ("no campaign", None, "campaign.toml: there is no such file", "check the path for a typing error"),
    ("empty campaign", "", "campaign.toml: the file is empty", "export it again"),
    ("comments only", "# nothing\n", "campaign.toml: the campaign has no tests", "[[loops]] or [[sweeps]] tables"),
    ("campaign without tests", BUSHING, "campaign.toml: the campaign has no tests", 'add [[loops]] with file = "..." and direction = "axial"'),
    ("binary campaign", b"\x89PNG\r\n\x1a\n\0\0", "campaign.toml, line 3: the file is not UTF-8 text", "save it as UTF-8, or convert it: iconv -f LATIN1 -t UTF-8 old > new"),
    ("campaign in latin-1", BUSHING.replace('"x"', '"Gummi f\u00fcr T\u00fcr"').encode("latin-1"), "campaign.toml, line 2: the file is not UTF-8 text", "save it as UTF-8, or convert it: iconv -f LATIN1 -t UTF-8 old > new"),
    ("campaign of 1 MB", BUSHING + "#" * 1_000_001, "campaign.toml: the file is too large", "give a campaign file, not a measurement"),
    ("a key of many parts", BUSHING + ".".join("a" * 5000) + " = 1\n", "campaign.toml, line 6: the tables are nested too deeply", "keys of a few parts, such as simulate.effects.inertia.mass"),
    ("deep lists", "a = " + "[" * 5000, "campaign.toml: the tables are nested too deeply", "keys of a few parts, such as simulate.effects.inertia.mass"),
]
