"""The subcommands of `campaign`, which register themselves on its app; they return what is to be printed."""

from __future__ import annotations

from nineaudit.campaign import health_command, run_command, table_commands  # noqa: F401  (register themselves)
from nineaudit.campaign.app import campaign_app

__all__ = ["campaign_app"]
