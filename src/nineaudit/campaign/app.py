"""The command `campaign`, on which commands.py has the subcommands registered."""

from __future__ import annotations

from nineaudit.options import example, group

campaign_app = group(
    help="Thousands of recordings: audit them on a cluster, keep the results, ask what they say together.",
    epilog=example("nineaudit campaign run tests --rig rig.toml --lake lake"),
)


@campaign_app.callback()
def _campaign() -> None:
    pass
