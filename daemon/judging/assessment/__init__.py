"""Assessment of a campaign: from run records and declarations to cells, comparisons, surprises."""

from daemon.judging.assessment._assess import (
    assess,
    evidence_text,
    mission_completed,
    reference_comparisons,
    undecided_cells,
)
from daemon.judging.assessment._campaign_difference import (
    CampaignDifference,
    ComparedCampaigns,
    JudgedCampaign,
    QuantityChange,
    VerdictChange,
    compare_campaigns,
)
from daemon.judging.assessment._cell_verdicts import base_name, expected_verdict, severity
from daemon.judging.assessment._marks import Expectations, find_marks

__all__ = [
    "CampaignDifference",
    "ComparedCampaigns",
    "Expectations",
    "JudgedCampaign",
    "QuantityChange",
    "VerdictChange",
    "assess",
    "base_name",
    "compare_campaigns",
    "evidence_text",
    "expected_verdict",
    "find_marks",
    "mission_completed",
    "reference_comparisons",
    "severity",
    "undecided_cells",
]
