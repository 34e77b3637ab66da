"""What changed in a vehicle at an onset: the time before it is the reference for the time since.

docs/methods/diagnosis.md, section 10.
"""

from wingwatch.diagnosis.change.diagnose import diagnose_change
from wingwatch.diagnosis.change.report import write_change_report
from wingwatch.diagnosis.change.result import ChangeDiagnosis, Explanation, Outcome
from wingwatch.diagnosis.change.words import change_as_json, sentence_of

__all__ = [
    "ChangeDiagnosis", "Explanation", "Outcome", "change_as_json", "diagnose_change", "sentence_of",
    "write_change_report",
]  # fmt: skip
