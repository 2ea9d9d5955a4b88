"""The subcommands, and what an error looks like."""

from collections.abc import Sequence
from typing import Annotated, Any

import typer

from tagsway import __version__
from tagsway.cli import (
    batch,
    calibrate,
    compare,
    design,
    identify,
    impulse,
    plan,
    render,
    retune,
    shape,
    simulate,
    tags,
)
from tagsway.errors import InputError, NotIdentifiableError, TagswayError

DONE, OTHER, UNUSABLE, NOT_DETERMINED = 0, 1, 2, 3
"""Exit codes."""

INTERRUPTED = 130
"""What Typer makes of Ctrl-C."""

app = typer.Typer(
    name="identify",
    help="Film a payload that carries two AprilTags, get a motion that leaves it at rest.",
    epilog="Where the first word is no subcommand, it is the file: identify video.mp4 is identify run video.mp4.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"tagsway {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None: ...


app.command("run")(identify.run)
app.command("batch")(batch.batch)
app.command("calibrate")(calibrate.calibrate)
app.command("compare")(compare.compare)
app.command("design")(design.design)
app.command("render")(render.render)
app.command("retune")(retune.retune)
app.command("shaper")(shape.shaper)
app.command("simulate")(simulate.simulate)
app.command("tags")(tags.tags)
app.command("trajectory")(shape.trajectory)
app.command("impulse")(impulse.impulse)
app.command("plan")(plan.plan)

SUBCOMMANDS = frozenset(str(command.name) for command in app.registered_commands)


def run(arguments: Sequence[str]) -> int:
    """Run the command and return its exit code; an error is one line on standard error."""
    try:
        code = app(_with_subcommand(list(arguments)), standalone_mode=False)
    except NotIdentifiableError as error:
        return _complain(error, NOT_DETERMINED)
    except InputError as error:
        return _complain(error, UNUSABLE)
    except TagswayError as error:
        return _complain(error, OTHER)
    except (KeyboardInterrupt, typer.Abort):
        return _complain("interrupted", OTHER)
    except BrokenPipeError:
        return OTHER
    except OSError as error:
        return _complain(f"{error.filename or 'a file'}: {(error.strerror or str(error)).lower()}", OTHER)
    except Exception as error:
        if hasattr(error, "format_message"):  # Typer's own: an unknown option, a missing argument
            return _complain(_usage(error, arguments), UNUSABLE)
        return _complain(
            f"unexpected {type(error).__name__}: {error}; this is a fault in tagsway, please report it", OTHER
        )
    if code == INTERRUPTED:
        return _complain("interrupted", OTHER)
    return code if isinstance(code, int) else DONE


def _with_subcommand(arguments: list[str]) -> list[str]:
    """Put `run` before a first word that is no subcommand, and before options of a run; no word asks for help."""
    own = ("-h", "--help", "--version")
    if arguments and arguments[0] not in SUBCOMMANDS and arguments[0] not in own:
        return ["run", *arguments]
    return arguments or ["--help"]


def _usage(error: Any, arguments: Sequence[str]) -> str:
    """Return what Typer says of an option, with the value that it leaves out."""
    for name in getattr(getattr(error, "param", None), "opts", ()):
        if name in arguments[:-1]:
            return f"{name} is {arguments[arguments.index(name) + 1]!r}: {error.message}"
    return f"{error.format_message().rstrip('.')}; see identify --help"


def _complain(error: object, code: int) -> int:
    typer.echo(f"error: {' '.join(str(error).split())}", err=True)
    return code
