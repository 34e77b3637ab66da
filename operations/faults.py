"""What a user did wrong, in one sentence: which exceptions are the user's, and how they are said."""

import sys
from pathlib import Path

__all__ = ["CommandError", "user_error", "say"]


class CommandError(Exception):
    """Bad usage or bad input; the text is one sentence for the user."""


def say(text: str) -> None:
    """One line to the person at the terminal, on standard error."""
    print(f"wingwatch: {text}", file=sys.stderr, flush=True)


def user_error(error: BaseException) -> str | None:
    """The sentence of an exception that bad input causes; None for any other, which is a fault of the program.

    The classes are looked up only now, since every command would have to load all of them otherwise.
    """
    if isinstance(error, CommandError):
        return str(error)
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{Path(error.filename)}: {error.strerror.lower()}; correct the path or its permissions"
    sentences = _loaded_sentence_types()
    return " ".join(str(error).split()) if isinstance(error, sentences) else None


def _loaded_sentence_types() -> tuple[type[BaseException], ...]:
    """Exceptions of other packages whose text is one sentence; what is not loaded cannot have been raised."""
    names = {
        "wingwatch.aircraft.loading": ("AircraftFileError",),
        "wingwatch.aircraft.aircraft_file": ("AircraftDataError",),
        "wingwatch.aircraft.linearisation": ("TrimError",),
        "wingwatch.aircraft.jsbsim_model": ("JsbsimError",),
        "wingwatch.aircraft.avl_file": ("AvlError",),
        "wingwatch.telemetry.readers": ("TableError",),
        "wingwatch.telemetry.maps": ("MapError",),
        "wingwatch.telemetry.flight": ("FlightError",),
        "wingwatch.telemetry.logs.log": ("LogError",),
        "wingwatch.telemetry.recording.recording_file": ("RecordingError",),
        "wingwatch.telemetry.keys": ("KeyNameError",),
        "wingwatch.telemetry.zenoh_link": ("LinkError",),
        "wingwatch.telemetry.link_security": ("LinkSecurityError",),
        "wingwatch.baselines.connection": ("DatabaseError",),
        "wingwatch.diagnosis.measured": ("DiagnosisError",),
        "wingwatch.studies.grid": ("StudyError",),
        "wingwatch.api.server": ("AddressError", "CertificateError"),
        "wingwatch.notifications.channel": ("ChannelError",),
    }
    return tuple(
        getattr(sys.modules[module], name)
        for module, classes in names.items()
        if module in sys.modules
        for name in classes
    )
