"""Reports: self-contained HTML pages of a run, of several runs side by side, and of a plan."""

from bench.report.compare import write_comparison
from bench.report.page import write_report
from bench.report.planned import write_plan
from bench.report.view import Curve, Evidence, FitView, OverTimes, Plan, PlanView

__all__ = [
    "Curve",
    "Evidence",
    "FitView",
    "OverTimes",
    "Plan",
    "PlanView",
    "write_comparison",
    "write_plan",
    "write_report",
]
