"""The command `campaign`: its subcommands are registered on it by the modules named at the end.

The subcommands return what is to be printed. Heavy modules are imported inside the functions.
"""

from __future__ import annotations

from nineaudit.options import example, group

campaign_app = group(
    help="Thousands of recordings: audit them on a cluster, keep the results, ask what they say together.",
    epilog=example("nineaudit campaign run tests --rig rig.toml --lake lake"),
)


@campaign_app.callback()
def _campaign() -> None:
    pass


from nineaudit.campaign import health_command, run_command, table_commands  # noqa: E402, F401  (registers on it)
