"""What is wrong with a directory of logs, in words, without estimating anything."""

from rivid.check.findings import DayReport, Finding, Report
from rivid.check.look import check

__all__ = ["DayReport", "Finding", "Report", "check"]
