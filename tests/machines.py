"""The dialects of test machines and laboratories: our numbers in the form of their exports."""

from dialects import Dialect

#: Exports of test machines and of laboratories, each with where such a file can be seen, or the description it follows.
MACHINES = {
    # MTS TestSuite TW, timed acquisition: github.com/TomWang0428/MTS_data, MTS_Data_Example/.../DAQ- Crosshead
    "MTS TestSuite": Dialect(
        language="daq", order=[1, 2, 0], delimiter="\t", unit=None, units={"s": "sec"}, encoding="utf-8-sig",
        end="\r\n", before=["File Path: C:\\Tests\\Run 4.txt", "Test: compression 3", "Date: 1/2/2026", "", ""],
    ),
    # MTS TestSuite for tension and torsion: header and units row that public scripts write and read back
    "MTS tension and torsion": Dialect(
        language="test suite", unit=None, units={"s": "sec"},
        others=[(0, "Axial Segment Count", "cycles", "2"), (2, "Temperature", "C", "23.4"),
                (5, "Axial Strain", "mm/mm", "0.01"), (6, "Axial Stress", "MPa", "1.5")],
    ),
    # MTS elastomer test system: from descriptions of its reports: tabs, a header block, p-p in the headers
    "MTS elastomer": Dialect(
        "sweep", language="mts", delimiter="\t", unit=None, end="\r\n", double=True,
        before=["Test Name{0}Dynamic Characterization", "Operator{0}A. B.", "Date{0}1/2/2026 10:00:00 AM",
                "Preload{0}500{0}N", ""],
        others=[(2, "Mean Load", "N", "501.2"), (4, "Dynamic Load p-p", "N", "234.5")],
    ),
    "MTS elastomer, one header row": Dialect(
        "sweep", language="mts", delimiter="\t", unit="{0} ({1})", double=True, others=[(0, "Point", "", "1")],
    ),
    # Instron Bluehill, raw data: github.com/yadbor/bluer, inst/extdata/.../Specimen_RawData_6.csv
    "Bluehill": Dialect(
        language="bluehill", unit=None, units={"s": "sec"}, units_row="({0})",
        before=['Text Inputs : Specimen label,"22L.3"', "General : Start Date,13/11/2026 5:14 PM", ""],
        others=[(3, "Segment ID", "", "22476"), (4, "Total Cycle Count", "", "0")],
    ),
    # Instron Bluehill in Chinese: github.com/Chongran-Zhao/VHB4910_data, uniaxial-loading-unloading/original_data
    "Bluehill, Chinese": Dialect(
        language="chinese", encoding="gb18030", unit=None, units_row="({0})", quotes=True, before=[""], end="\r\n",
    ),
    # Instron Bluehill, one header row: github.com/WhiteRabbit2006/instron_data_processing, tests/sample_data
    "Bluehill, kN": Dialect(
        language="english", unit="{0} ({1})", units={"N": "kN"}, others=[(3, "AVE2", "%", "0.1")],
    ),
    # Instron WaveMatrix, tracking: headers that public scripts read, such as "Load(Linear:Load) (N)"
    "WaveMatrix": Dialect(
        language="wave matrix", unit="{0} ({1})", quoted_header=True, end="\r\n",
        others=[(1, "Cycle Elapsed Time", "s", "0.1"), (2, "Total Cycles", "", "1"), (3, "Step", "", "2"),
                (4, "Total Cycle Count(Linear Waveform)", "", "1")],
    ),
    # Zwick testXpert, TRA in French: github.com/a-hilhorst/Tensile-test-Analysis,
    # imap_versions/other_machine_outputs_examples/Allong 1.TRA
    "testXpert, French": Dialect(
        language="test xpert french", unit=None, quoted_header=True, encoding="latin-1", end="\r\n", order=[0, 2, 1],
        before=['"Épaisseur éprouvette",1,"mm"', '"Capteur de force",""', '"v1",1,"mm/min"'],
        others=[(1, "Traverse absolue", "mm", "-794.864")],
    ),
    # Zwick testXpert in German: columns that public scripts read (Prüfzeit, Standardweg, Standardkraft, Traverse abs.)
    "testXpert, German": Dialect(
        language="test xpert", delimiter=";", decimal=",", unit=None, encoding="cp1252", end="\r\n",
        others=[(3, "Traverse abs.", "mm", "12,5")],
    ),
    # Zwick testXpert with a servo-hydraulic machine: from the headers of the German dialects above
    "testXpert, dynamic": Dialect("sweep", language="test xpert", delimiter="\t", decimal=",", encoding="cp1252"),
    # BOSE ElectroForce WinTest: header and units row that public scripts check, "Points,Elapsed Time,..."
    "WinTest": Dialect(
        language="win test", unit=None, units={"s": "Sec"}, quoted_header=True, trailing=True,
        before=['"Timed Data"', ""], others=[(0, "Points", "", "1"), (2, "Scan Time", "Sec", "0.1")],
    ),
    # Shimadzu Trapezium X, raw data: from descriptions of its three quoted header rows
    "Trapezium": Dialect(
        language="trapezium", order=[0, 2, 1], unit=None, units={"s": "sec"}, quoted_header=True, before=['"1 _ 1"'],
    ),
    # TA Instruments Trios, text: github.com/bsaintmichel/read-rheol, sample_Trios_1.txt
    "Trios": Dialect(
        "coupon", language="trios", delimiter="\t", unit=None, end="\r\n",
        before=["Filename{0}EPDM 3", "Instrument name{0}ARG2_1", "[Parameters]", "Gap{0}1.0 mm", "", "[step]",
                "Frequency sweep - 2"],
        others=[(0, "Step time", "s", "7.12227"), (3, "Oscillation stress", "Pa", "2.99096"),
                (4, "Oscillation strain rate", "1/s", "0.205296")],
    ),
    # TA Instruments Trios, CSV and angular frequency: github.com/bsaintmichel/read-rheol, sample_Trios_2.csv
    "Trios, CSV": Dialect(
        "coupon", language="trios omega", unit=None, units={"Hz": "rad/s", "MPa": "Pa"},
        before=["Filename,EPDM 3", "[step]", "Amplitude sweep - 1"],
        others=[(0, "Step time", "min", "7.1"), (2, "Temperature", "°C", "22.3"), (4, "Normal stress", "Pa", "12.5")],
    ),
    # Malvern rSpace: github.com/bsaintmichel/read-rheol, sample_Malvern.csv
    "rSpace": Dialect(
        "coupon", language="rspace", delimiter=";", decimal=",", unit="{0}({1})", units={"MPa": "Pa"},
        others=[(0, "Action Name", "", "Sweep"), (1, "Time (sequence)", "s", "112,3"),
                (6, "Temperature", "°C", "20,93")],
    ),
    # Anton Paar RheoCompass: github.com/desdelgado/rheology-data-toolkit, tests/test_data/Anton_Paar
    "RheoCompass": Dialect(
        "coupon", language="rheo compass", delimiter="\t", encoding="utf-16-le with mark", end="\r\n", unit=None,
        units_row="[{0}]", units={"MPa": "Pa"},
        before=["Project:{0}EPDM", "", "Test:{0}Frequency sweep", "", "Interval and data points:{0}1{0}18"],
        others=[(0, "Interval data:", "", ""), (1, "Point No.", "", "1"), (6, "Torque", "mN·m", "0.05"),
                (7, "Status", "", "Dy_auto")],
    ),
    # Anton Paar RheoCompass with symbols: github.com/imewei/rheojax, tests/fixtures/rheocompass/frequency_sweep.csv
    "RheoCompass, symbols": Dialect(
        "coupon", language="rheo compass omega", delimiter=";", decimal=",", encoding="utf-16", unit=None,
        units_row="[{0}]", units={"Hz": "rad/s", "MPa": "kPa"}, before=["Interval data:{0}1{0}18"],
        others=[(4, "η*", "Pa·s", "12,5")],
    ),
    # RepTate, .osc: github.com/jorge-ramirez-upm/RepTate, docs/source/manual/Applications/TTS/general.rst
    "RepTate": Dialect(
        "coupon", language="osc", delimiter="\t    ", unit=None, order=[0, 2, 3, 1], units={"Hz": "rad/s", "MPa": "Pa"},
        before=["T=0;Mw=94.9;chem=PI;origin=DA;label=PI88k;PDI=1.03;"], others=[(3, "Temp", "°C", "-0.0079")],
    ),
    # Gabo Eplexor, as CSV: headers that github.com/MarcusNi96/dma-prony-validation, data/raw/process_dma.py, and
    # github.com/NREL/pyvisco read
    "Eplexor": Dialect(
        "coupon", language="symbols", delimiter=";", decimal=",", unit=None,
        others=[(0, "Nr.", "", "1"), (2, "T", "°C", "22,3"), (6, "F dyn.", "N", "1,25")],
    ),
    # a laboratory's own CSV of an Eplexor's file: github.com/MarcusNi96/dma-prony-validation, data/epdm_70/dma
    "Eplexor, by a script": Dialect(
        "coupon", language="snake", unit="{0}_{1}", units={"Hz": "hz", "%": "pct", "MPa": "pa"}, order=[0, 2, 3, 1],
        others=[(0, "run", "", "sd_10hz"), (2, "temperature", "C", "22.27"), (5, "force_dyn", "N", "0.36")],
    ),
    # NETZSCH and other DMA in German, French, Spanish and Chinese: the words of their manuals, in the form of Excel
    "DMA, German": Dialect("coupon", language="german", delimiter=";", decimal=",", encoding="cp1252"),
    "DMA, French": Dialect("coupon", language="french", delimiter=";", decimal=",", unit="{0} ({1})", units={"%": "‰"}),
    "DMA, Spanish": Dialect("coupon", language="spanish", delimiter="\t", decimal=",", units={"MPa": "kPa"}),
    "DMA, Chinese": Dialect("coupon", language="chinese", encoding="gb18030", unit="{0}\uff08{1}\uff09"),
    "DMA, psi": Dialect("coupon", units={"MPa": "psi", "%": "mm/m"}, unit="{0}, {1}", delimiter="\t"),
    # Schenck Hydropuls and the like, evaluated in German laboratories: from the symbols and words of DIN 53513
    "Hydropuls": Dialect(
        "sweep", language="symbols", delimiter=";", decimal=",", unit=None, encoding="utf-8-sig",
        before=["Hydropuls PL 10", "Prüfling;Buchse 3", "Vorlast;500;N"], others=[(2, "Fm", "N", "501,2")],
    ),
    "Hydropuls, SS": Dialect(
        "sweep", language="amplitude SS", delimiter="\t", decimal=",", unit="{0} / {1}", double=True,
    ),
    # Metravib viscoanalysers in French laboratories: from the words of ISO 4664 in French
    "Metravib": Dialect(
        "sweep", language="metravib", delimiter="\t", decimal=",", unit="{0} ({1})",
        others=[(1, "Température", "°C", "23,1")],
    ),
    # pandas with its index, as github.com/desdelgado/rheology-data-toolkit saves tables, and R with names of rows
    "pandas": Dialect("sweep", others=[(0, "", "", "0")]),
    "R": Dialect("sweep", quoted_header=True, others=[(0, "", "", "1"), (3, "temperature", "K", "296.15")]),
}  # fmt: skip
