"""The report of a study on one page that needs nothing else: no network, no other file, and no script to be read."""

from __future__ import annotations

from nlsolve.show.report.page import Picture, machine_facts, write_report

__all__ = ["Picture", "machine_facts", "write_report"]
