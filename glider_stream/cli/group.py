"""The command that holds all others."""

import click


@click.group(context_settings={"help_option_names": ["-h", "--help"]}, no_args_is_help=False)
@click.version_option(package_name="glider-stream")
def cli() -> None:
    """Plan underwater glider routes in ocean currents."""
