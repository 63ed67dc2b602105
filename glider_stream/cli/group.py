"""The command that holds all others."""

from typing import Any

import click

from ..base.output import noting_files
from ..base.terminal import say


class Command(click.Command):
    """A command that says when it has to compile kernels, and which files it wrote."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        from ..base.compiling import telling_of_compiling

        with telling_of_compiling(lambda message: say(message, error=True)), noting_files() as written:
            answer = super().invoke(ctx)
            # a refusal, or the honest no, stays one sentence
            if written:
                say(f"wrote {', '.join(map(str, dict.fromkeys(written)))}", error=True)
            return answer


class Group(click.Group):
    """A group of such commands."""

    command_class = Command


@click.group(cls=Group, context_settings={"help_option_names": ["-h", "--help"]}, no_args_is_help=False)
@click.version_option(package_name="glider-stream")
def cli() -> None:
    """Plan underwater glider routes in ocean currents."""
