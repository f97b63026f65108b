"""What became of one recording of a run."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nineaudit.errors import NineauditError
from nineaudit.identity import Identity

if TYPE_CHECKING:
    from nineaudit.auditing import Audit


@dataclass(frozen=True, eq=False)
class Outcome:
    """One recording of a run: its `audit`, or the `error` for which it could not be audited, and then what is known of
    the `test` from the rig and the options."""

    path: Path
    audit: Audit | None = None
    error: NineauditError | None = None
    test: Identity = field(default_factory=Identity)

    @property
    def verdict(self) -> str:
        return "not_audited" if self.audit is None else str(self.audit.verdict)

    def document(self) -> dict[str, Any]:
        """``nineaudit/result/1`` of the audit, or of the failure."""
        from nineaudit.auditing import versions
        from nineaudit.report import failure_document, result_document

        if self.error is not None:
            return failure_document(self.path, self.error, versions(), self.test)
        assert self.audit is not None
        return result_document(self.audit)

    def lines(self) -> list[str]:
        """What the terminal shows."""
        from nineaudit.report import lines

        return [f"{self.path.name}: NOT AUDITED"] if self.audit is None else lines(self.audit)

    def exit_code(self, fail_on: str) -> int:
        """0 gate passed, 1 gate failed, 3 not audited."""
        from nineaudit.engine import gate

        if self.audit is None:
            return 3
        return 0 if gate(self.audit.findings, fail_on) else 1
