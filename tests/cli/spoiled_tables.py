"""What is spoiled in the tables of tests, how, and what the one error has to say."""

# fmt: off
from __future__ import annotations

import numpy as np
from damage import added, column, every, kept, row, text, wide

#: (name, change of the lines of the loop, what the error says ...)
IN_LOOP = [
    ("no file", lambda _: None, "loop.csv: there is no such file", "check the path for a typing error"),
    ("empty", lambda _: "", "loop.csv: the file is empty", "export it again"),
    ("header only", kept(1), "loop.csv: too few rows", "at least 10"),
    ("a tenth of a cycle", kept(12), "loop.csv: the loop does not contain a whole cycle", "export the whole cycle, or several"),
    ("binary", lambda _: b"\x00\x01\x02" * 100, "loop.csv, line 1: this is not text", 'export it as "CSV UTF-8", or state encoding = "..." in the campaign'),
    ("a workbook cut short", lambda _: b"PK\x03\x04" + b"x" * 100, "loop.csv: the workbook cannot be read", "save it again as xlsx"),
    ("a web page", lambda _: "<html><body>503 Service Unavailable</body></html>\n", "loop.csv, line 1: there is only one column", 'a header row such as "time [s],displacement [mm],force [N]", separated by comma,'),
    ("no header", lambda lines: text(lines[1:]), "loop.csv, line 1: there is no header", 'a header row such as "time [s],displacement [mm],force [N]"'),
    ("no units", every("time [s],displacement [mm],force [N]", "time,displacement,force"), 'loop.csv, line 1, column "displacement": the displacement has no unit', 'write "displacement [mm]" in the header, or units = { displacement = "mm" } in the'),
    ("unknown unit", every("force [N]", "force [Nn]"), 'loop.csv, line 1, column "force [Nn]": unknown unit', "a unit such as mm, N, kN/mm, deg, Hz or %"),
    ("unit of another kind", every("force [N]", "force [mm]"), 'loop.csv, line 1, column "force [mm]": the unit does not fit', "a force, such as N"),
    ("unknown columns", every("force [N]", "gadget"), "loop.csv, line 1: there is no column for the force", 'name the column in the campaign: columns = { force = "..." }'),
    ("two force columns", lambda lines: text([line + "," + (line.split(",")[2] if at == 0 else "1") for at, line in enumerate(lines)]), "loop.csv, line 1: more than one column could be the force", "give each column its own header"),
    ("cells of text", lambda lines: text([lines[0], *(line.replace("0.", "abc", 1) for line in lines[1:])]), 'loop.csv, line ', 'column "time [s]": this is no finite number', "a number such as 12.5", "more such rows"),
    ("cells too many", lambda lines: text([lines[0], *(line + ",1" * (at % 2) for at, line in enumerate(lines[1:]))]), "the row does not match the header", "3 cells", "more such rows"),
    ("decimal commas in a comma file", every(".", ","), "loop.csv, line 2: the row does not match the header", "separate the columns by semicolons if numbers have a decimal comma"),
    ("time stands still", column(0, "1.0"), 'loop.csv, line 3, column "time [s]": time does not increase', "a later time on every row"),
    ("no displacement", column(1, "0"), 'loop.csv, column "displacement [mm]": the displacement never changes', "a loop"),
    ("no force", column(2, "0"), 'loop.csv, column "force [N]": the force never changes', "a loop"),
    ("force falls with displacement", lambda lines: text([lines[0], *(",".join([*line.split(",")[:2], str(-float(line.split(",")[2]))]) for line in lines[1:])]), 'loop.csv, column "force [N]": the force falls where the displacement rises', "if the force has the opposite sign, write force_sign = -1 in the campaign"),
    ("displacement and force swapped", every("displacement [mm],force [N]", "force [N],displacement [mm]"), "loop.csv: the loop releases energy, which no bushing does", "are the columns of displacement and force swapped, or do the rows run backwards in time?"),
    ("metres for millimetres", every("displacement [mm]", "displacement [m]"), "campaign.toml, loop: no rubber bears the amplitude of this test", "a strain of 6200 %"),
    ("newtons for kilonewtons", every("force [N]", "force [kN]"), "campaign.toml: the moduli of these tests are outside those of all rubbers", "MPa is that of no rubber: check the units"),
    ("no time", lambda lines: text([line.partition(",")[2] for line in lines]), "loop.csv, line 1: there is no column for the time", 'name the column in the campaign: columns = { time = "..." }, or state rate = "10 mm/min",'),
    ("an amplitude of its own for every cycle", lambda lines: text([lines[0], *(f"{n / 50},{a * np.sin(n * np.pi / 25):.5f},{400 * a * np.sin(n * np.pi / 25 + 0.1):.3f}" for n in range(300) for a in [1 + n // 50])]), "loop.csv: no part of the record is a loop", "record more cycles of each amplitude, best five"),
    ("displacements of 1e300", column(1, "1e300"), 'loop.csv, line 2, column "displacement [mm]": this is no finite number, or one beyond every rig'),
    ("displacements of 1e-300", lambda lines: "\n".join([lines[0], *(f"{cells[0]},{cells[1]}e-300,{cells[2]}" for cells in (line.split(",") for line in lines[1:]))]), 'loop.csv, column "displacement [mm]": the displacement never changes'),
    ("a time of 1e-300", lambda lines: "\n".join([lines[0], *(f"{number}e-300,{line.partition(',')[2]}" for number, line in enumerate(lines[1:]))]), 'loop.csv, column "time [s]": the record takes no time'),
    ("zeros far behind the head", lambda lines: ("\n".join(lines) + "\n").encode() * 40 + bytes(5), "loop.csv, line ", "this is not text", "found: byte 0x00"),
    ("zeros in a file of Latin letters", lambda lines: ("\n".join(lines) + "\n\xe4\n").encode("latin-1") * 40 + b"1,2\x00,3\n", "loop.csv, line ", "this is not text", "found: byte 0x00"),
    ("a header that clears the screen", every("force [N]", "for\x1b[2Jce\u202e"), "loop.csv, line 1: there is no column for the force", "for\\x1b[2Jce\\u202e"),
]
#: The same of the sweep.
IN_SWEEP = [
    ("no file", lambda _: None, "sweep.csv: there is no such file", "an existing file"),
    ("header only", kept(1), "sweep.csv: too few rows", "at least 3"),
    ("frequency of zero", row(2, "5,", "0,"), 'sweep.csv, line 2, column "frequency [Hz]": the frequency is not positive', "a number above zero"),
    ("amplitude of zero", row(2, ",0.1,", ",0,"), 'sweep.csv, line 2, column "amplitude [mm]": the amplitude is not positive', "a number above zero"),
    ("an amplitude of metres", every("amplitude [mm]", "amplitude [m]"), "campaign.toml, sweep: no rubber bears the amplitude of this test", "m, axial: a strain of "),
    ("negative stiffness", row(2, "505", "-505"), 'sweep.csv, line 2, column "stiffness [N/mm]": the stiffness is not positive', "a number above zero"),
    ("loss factor as an angle", every("loss factor [-]", "loss factor [deg]"), 'sweep.csv, line 1, column "loss factor [deg]": the unit does not fit', "a ratio, such as %"),
    ("loss factor missing", lambda lines: text([line.rpartition(",")[0] for line in lines]), "sweep.csv, line 1: no pair of columns gives a complex stiffness", 'correct the header, or name the columns in the campaign: columns = { stiffness = "..." }'),
    ("stiffness without unit", every("stiffness [N/mm]", "stiffness"), 'sweep.csv, line 1, column "stiffness": the stiffness has no unit', 'write "stiffness [N/mm]" in the header, or units = { stiffness = "N/mm" } in the campaign'),
    ("stiffness in newtons", every("stiffness [N/mm]", "stiffness [N]"), 'sweep.csv, line 1, column "stiffness [N]": the unit does not fit', "a stiffness, such as N/mm"),
    ("semicolons in the header alone", row(1, ",", ";"), "sweep.csv, line 1: there is no column for the frequency", 'name the column in the campaign: columns = { frequency = "..." }'),
    ("a torsion sweep as axial", lambda lines: text(lines).replace("amplitude [mm]", "amplitude [deg]").replace("[N/mm]", "[N m/rad]"), 'sweep.csv, line 1, column "amplitude [deg]": the unit does not fit', "a length, such as mm"),
    ("repeat is a half", lambda lines: text([lines[0] + ",repeat", *(line + ",0.5" for line in lines[1:])]), 'sweep.csv, line 2, column "repeat": this is no repeat number', "a whole number"),
    ("loss factor of a hundred", column(3, "100"), 'sweep.csv, line 2, column "loss factor [-]": no bushing has this loss', "check the unit: a phase in deg or rad, a loss factor in % or as a ratio [-]"),
    ("strain of a bushing", every("amplitude [mm]", "strain [%]"), "sweep.csv, line 1: this is a test of strain and modulus", 'and specimen = "its name" here'),
    ("no amplitude", lambda lines: text([line.replace(line.split(",")[1] + ",", "", 1) for line in lines]), "sweep.csv, line 1: there is no column for the amplitude", 'or state at_amplitude = "0.1 mm" if all rows have it'),
    ("two temperatures", added("T [°C]", "-20", "22"), 'sweep.csv, column "T [°C]": this file contains tests at several temperatures', "-20.0, 22.0 degC", 'state temperature = "-20.0 degC"'),
    ("unknown unit of temperature", added("temperature [degR]", "22"), 'sweep.csv, line 1, column "temperature [degR]": unknown unit', 'found: "degR"'),
    ("temperatures without unit", added("temperature", "-20", "22"), 'sweep.csv, line 1, column "temperature": the temperature has no unit', 'units = { temperature = "degC" }'),
    ("negative relative error", added("relative error [-]", "-0.01"), 'sweep.csv, line 2, column "relative error [-]": the relative error is not positive', "a number above zero"),
    ("wide table with a row less", wide("155,655,655\n", ""), "sweep.csv, line 2: the blocks of this wide table differ", "5 rows; loss factor of 2 amplitudes, 6 rows"),
    ("wide table of what?", wide("tan delta\n", ""), "sweep.csv, line 2: the quantity of a block of this wide table is not stated", "tan delta above each block"),
    ("wide table without units", wide("f [Hz],0.1 mm,0.2 mm", "f [Hz],A=0.1,A=0.2"), "sweep.csv, line 2: this wide table states one quantity in two ways", "one unit for each quantity"),
    *((f"{what} of {size}", column(place, size), "sweep.csv, line 2, column ") for place, what in enumerate(("frequencies", "amplitudes", "stiffnesses")) for size in ("1e-300", "1e300")),
    ("a frequency of 1e-300", row(2, "5,", "1e-300,"), 'sweep.csv, line 2, column "frequency [Hz]": no rig records values this small', 'found: "1e-300"'),
]
#: The same of a resonance test.
IN_RESONANCE = [
    ("an acceleration without a unit", row(1, "base acceleration [g]", "base acceleration"), 'shaker.csv, line 1, column "base acceleration": the base acceleration has no unit', "an acceleration, such as m/s^2"),
    ("a force for an acceleration", row(1, "mass acceleration [g]", "mass acceleration [N]"), 'shaker.csv, line 1, column "mass acceleration [N]": the unit does not fit', "an acceleration, such as m/s^2"),
    ("a phase without a unit", row(1, "phase [deg]", "phase"), 'shaker.csv, line 1, column "phase": the phase has no unit', "an angle, such as deg"),
    ("no phase", row(1, "phase [deg]", "remark"), "shaker.csv, line 1: the columns give no complex transmissibility", "base acceleration and mass acceleration and phase"),
    ("transmissibility alone", row(1, "base acceleration [g],mass acceleration [g]", "set point,|T|"), "shaker.csv, line 1: the acceleration of the base is not stated", '--base-acceleration "0.1 g"'),
    ("the phase is zero throughout", column(3, "0"), "shaker.csv: the phases show no loss with either sign", "check the unit of the phases"),
    ("degrees as radians", row(1, "phase [deg]", "phase [rad]"), "shaker.csv: the phases show no loss with either sign", "check the unit of the phases"),
    ("base and mass swapped", row(1, "base acceleration [g],mass acceleration [g]", "mass acceleration [g],base acceleration [g]"), "shaker.csv: the ", "check "),
    ("the base stands still in a row", row(9, ",0.1000,", ",0.0000,"), 'shaker.csv, line 9, column "base acceleration [g]": the base acceleration is not positive', "a number above zero"),
    ("a row short", kept(11), "shaker.csv: too few rows", "at least 12"),
    ("the mass moves as the base does", lambda lines: column(2, "0.1000")(column(3, "-1")(lines).splitlines()), "shaker.csv: ", "check "),
]
