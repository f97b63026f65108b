"""The commands `rules` and `rig`: what a rule means, what a rig file may hold. They return what is to be printed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, TypeVar

import typer

from nineaudit.errors import ConfigurationError
from nineaudit.options import Rules, example, group
from nineaudit.units import counted

T = TypeVar("T")

rules_app = group(help="List, explain and check the rules.", epilog=example("nineaudit rules explain RB301"))
rig_app = group(
    help="Check a rig file, or start one from a published layout.",
    epilog=example("nineaudit rig presets naap-3222"),
)


def in_turn(paths: Iterable[Path], load: Callable[[Path], T]) -> list[T]:
    """What each file or folder holds. ConfigurationError: of several that are wrong, one line each."""
    loaded, wrong = [], []
    for path in paths:
        try:
            loaded.append(load(path))
        except ConfigurationError as error:
            wrong.append(error)
    if len(wrong) > 1:
        raise ConfigurationError("\n".join(map(str, wrong)))
    if wrong:
        raise wrong[0]
    return loaded


@rules_app.command("list", epilog=example("nineaudit rules list"))
def rules_list(rules: Rules = None) -> str:
    """Code, severity and title of every rule."""
    from nineaudit import checking, commands

    return "\n".join(commands.rules_lines(checking.load_book(rules)))


@rules_app.command("explain", epilog=example("nineaudit rules explain RQ202"))
def rules_explain(
    code: Annotated[str, typer.Argument(metavar="CODE", help="Code of the rule.")], rules: Rules = None
) -> str:
    """What a rule means, its equation with its source, its limits, and what to do about a violation."""
    from nineaudit.rulebook import explain, load_rulebook

    return explain(load_rulebook(rules)[code.upper()])


@rules_app.command("check", epilog=example("nineaudit rules check my-rules"))
def rules_check(
    places: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Folders of rule sheets, or sheets in them.")],
) -> str:
    """Check the sheets of a folder, and that each fits its check. Of a sheet, the whole folder is checked."""
    from nineaudit import checking

    folders = dict.fromkeys(place.parent if place.suffix == ".toml" else place for place in places)
    books = in_turn(folders, checking.load_book)
    return "\n".join(
        f"{folder}: the sheets are in order; {counted(len(book.rules), 'rule')} with those of nineaudit"
        for folder, book in zip(folders, books, strict=True)
    )


@rules_app.command("schema", epilog=example("nineaudit rules schema > rule.schema.json"))
def rules_schema() -> str:
    """JSON Schema of a rule sheet, for editors."""
    from nineaudit import commands, rulebook

    return commands.as_json(rulebook.rules_schema())


@rig_app.command("check", epilog=example("nineaudit rig check rig.toml"))
def rig_check(rigs: Annotated[list[Path], typer.Argument(metavar="RIG.toml...", help="The rig files.")]) -> str:
    """Check rig files, and show how each was understood."""
    from nineaudit import commands
    from nineaudit.rig import load_rig

    return "\n".join(line for rig in in_turn(rigs, load_rig) for line in commands.rig_lines(rig))


@rig_app.command("schema", epilog=example("nineaudit rig schema > rig.schema.json"))
def rig_schema() -> str:
    """JSON Schema of the rig file, for editors."""
    from nineaudit import commands, rig

    return commands.as_json(rig.rig_schema())


@rig_app.command("presets", epilog=example("nineaudit rig presets", "nineaudit rig presets naap-3222 > rig.toml"))
def rig_presets(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Print a rig file of this one.")] = None,
    arms: Annotated[str | None, typer.Option(metavar="MM,...", help="Arm lengths, such as 50,50,50")] = None,
) -> str:
    """List the published layouts, or print a rig file that uses one."""
    from nineaudit import commands
    from nineaudit.presets import preset_text

    if name is None:
        return "\n".join(commands.preset_lines())
    return preset_text(name, commands.numbers(arms, "--arms")).removesuffix("\n")
