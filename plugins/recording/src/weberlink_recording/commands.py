"""The command `record`, which describes and converts recordings."""

from pathlib import Path
from typing import Annotated

import typer

from weberlink.cli.arguments import CommandGroup, Json, folder_target
from weberlink.cli.output import fail, failing, write
from weberlink.order import FAILED

record = typer.Typer(name="record", cls=CommandGroup, help="Describe or convert recordings.", no_args_is_help=True)
Recordings = Annotated[list[Path], typer.Argument(metavar="FILE...", help="One recording, or both sides' (MCAP).")]
Files = Annotated[list[Path], typer.Argument(metavar="FILE...", help="One recording, or both sides' (MCAP); or logs.")]

# Each command imports what it needs when it runs.


@record.command()
def info(files: Files, json_out: Json = None) -> None:
    """Describe a recording, and verify its journal or logs; status 1 if lines were changed or are missing."""
    from weberlink_recording.export import describe  # noqa: PLC0415

    description = describe(files)
    write(description.document, json_out, description.show)
    if description.broken is not None:
        fail(description.broken, FAILED)


@record.command()
def export(
    recordings: Recordings,
    to: Annotated[
        str, typer.Option("--to", metavar="FORMAT", help="csv, ros, or with the extra parquet: parquet, lerobot.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", callback=folder_target, help="Where to; default: the folder of the recording."),
    ] = None,
    fps: Annotated[int, typer.Option(metavar="HZ", help="Frames per second of a LeRobot dataset.")] = 30,
    task: Annotated[
        str, typer.Option(metavar="TEXT", help="What was done, in words, for a LeRobot dataset.")
    ] = "teleoperation",
) -> None:
    """Convert a recording to tables, for ROS tools, or for LeRobot."""
    from weberlink_recording import export as records  # noqa: PLC0415

    with failing(records.ExportError):
        lines = records.export(recordings, to, out, fps, task)
    typer.echo("\n".join(lines))
