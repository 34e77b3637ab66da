"""Files of a diagnosis job's folder: the service writes them, the worker reads them, and the other way round."""

__all__ = ["AIRCRAFT", "CHANGE", "FLIGHT", "MAP", "REPORT", "REQUEST", "RESULT", "SAMPLES"]

FLIGHT, MAP, AIRCRAFT, REQUEST = "flight", "map.toml", "aircraft.toml", "request.json"
SAMPLES = "samples.npz"
"""The last minutes of a vehicle with an alert, in the place of a flight."""
CHANGE = "change"
"""Key of a request about an alert."""
REPORT, RESULT = "report.html", "result.json"
