"""The commands `record info` and `record export`."""

from pathlib import Path
from typing import Annotated

import typer

from weberlink.cli.arguments import CommandGroup, Json, folder_target
from weberlink.cli.output import errors, fail, write
from weberlink.system.order import FAILED

record = typer.Typer(name="record", cls=CommandGroup, help="Describe or convert recordings.", no_args_is_help=True)
Recordings = Annotated[list[Path], typer.Argument(metavar="FILE...", help="One recording, or both sides' (MCAP).")]


@record.command()
def info(
    recordings: Recordings,
    json_out: Json = None,
) -> None:
    """Describe a recording: its sides, gaps and figures."""
    from weberlink.apps.recordings import describe  # noqa: PLC0415

    with errors():
        description = describe(recordings)
    write(description.document, json_out, description.show)


@record.command()
def export(
    recordings: Recordings,
    to: Annotated[
        str,
        typer.Option(
            "--to",
            metavar="FORMAT",
            help="csv, parquet (extra: weberlink[parquet]), ros, or lerobot (extra: weberlink[lerobot]).",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", callback=folder_target, help="Folder of the files; default: that of the recording."
        ),
    ] = None,
    fps: Annotated[int, typer.Option("--fps", metavar="HZ", help="Frames per second of a LeRobot dataset.")] = 30,
    task: Annotated[
        str, typer.Option("--task", metavar="TEXT", help="What was done, in words, for a LeRobot dataset.")
    ] = "teleoperation",
) -> None:
    """Convert a recording to tables, for ROS tools, or for LeRobot."""
    from weberlink.apps.recordings import DatasetOptions, ExportError  # noqa: PLC0415
    from weberlink.apps.recordings import export as run  # noqa: PLC0415

    try:
        with errors():
            lines = run(recordings, to, out, DatasetOptions(fps, task))
    except ExportError as error:
        fail(str(error), FAILED)
    typer.echo("\n".join(lines))
