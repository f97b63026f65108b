"""What the commands share: options that mean the same everywhere, and the form of a help text."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer


def example(*lines: str) -> str:
    """The end of a help text: an example that runs."""
    return "\b\nExample:\n" + "\n".join(f"  {line}" for line in lines)


# Help without rich's frames: they would cost 0.4 s.
group = partial(
    typer.Typer,
    no_args_is_help=True,
    rich_markup_mode=None,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Recordings = Annotated[list[Path], typer.Argument(metavar="REC...", help="Recordings of one rig.")]
Recording = Annotated[Path, typer.Argument(metavar="REC", help="The recording.")]
RigOption = Annotated[Path, typer.Option("--rig", metavar="RIG.toml", help="Rig file: the array and its units.")]
RigFile = Annotated[Path, typer.Argument(metavar="RIG.toml", help="The rig file.")]
Dbc = Annotated[
    list[Path] | None,
    typer.Option("--dbc", metavar="F", help="CAN database in place of the rig's; may be repeated."),
]
TestOption = Annotated[
    list[str] | None,
    typer.Option(
        "--test",
        metavar="KEY=VALUE",
        help="About the test: number, title, item, item_serial, date (YYYY-MM-DD), laboratory, customer, notes; may be "
        "repeated. Overrides rig file and recording.",
    ),
]
Rules = Annotated[
    Path | None, typer.Option("--rules", metavar="DIR", help="Folder of rule sheets to add, or to put in place.")
]
Log = Annotated[
    Path | None,
    typer.Option("--log", metavar="F.jsonl", help="Add a line to this log, chained by hashes (see `verify`)."),
]
Output = Annotated[Path, typer.Option("--output", metavar="F", help="New file; its suffix is the format.")]
Channels = Annotated[
    str | None, typer.Option("--channels", metavar="CH,..", help="Only these channels of the rig, as a0x,a0y,a1z.")
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite the output if it exists.")]
