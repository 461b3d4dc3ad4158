"""`bushfit example`: a simulated campaign of the paper's bushing, to try bushfit without test files."""

from __future__ import annotations

from pathlib import Path

from bushfit.cli.options import command_called
from bushfit.cli.output import Output, with_output


@command_called("example", "-o results/example")
@with_output("bushfit-example", "tables")
def command(output: Output) -> None:
    """Write a simulated campaign of the paper's bushing, to try bushfit without test files.

    Writes campaign.toml, the test files of a hysteresis loop and two sweeps, and truth.json (the simulated model).
    """
    from bushfit import simulation
    from bushfit.campaign.campaign import load_campaign
    from bushfit.commands.simulate import simulate_campaign, simulated_tests
    from bushfit.errors import quote_path

    campaign = load_campaign(Path(simulation.__file__).with_name("example.toml"))
    _, document, files = simulate_campaign(*simulated_tests(campaign), output.formats.table_form)
    folder = output.output or Path("bushfit-example")
    output.write(folder, files, document)
    output.print(f"next: bushfit run {quote_path(folder / 'campaign.toml')}")
