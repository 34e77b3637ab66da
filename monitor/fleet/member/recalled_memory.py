"""How far what the database keeps of a vehicle has come to its monitor, and what of the flight has gone back."""

from dataclasses import dataclass

from wingwatch.baselines import ChangeRecord
from wingwatch.monitor.ports import VehicleMemory

__all__ = ["RecalledMemory"]


@dataclass(slots=True)
class RecalledMemory:
    """Of one vehicle while it is watched.

    Attributes:
        read: whether it has been read; until then nothing is written in its place.
        late: whether it came after the monitor had been made.
        change: the newest change of the baseline in it.
        renewal: a later one, while it is read again; renewed: the last one that was taken in.
        saved_blocks: blocks that the references rest on that were kept last.
    """

    read: bool
    late: bool = False
    change: int = 0
    renewal: ChangeRecord | None = None
    renewed: ChangeRecord | None = None
    saved_blocks: int = 0

    @property
    def may_be_written(self) -> bool:
        """Whether what the flight teaches may take its place: nothing is written over what has not been read."""
        return self.read and self.renewal is None

    def note_late(self, memory: VehicleMemory) -> None:
        """It has been read after the monitor had been made, and the monitor has adopted it."""
        self.read = self.late = True
        self._note_read(memory, sum(r.blocks for r in memory.references.values()))

    def note_change(self, change: ChangeRecord) -> None:
        """Somebody has changed it: it is to be read again."""
        self.renewal = change

    def note_renewed(self, memory: VehicleMemory, blocks: int) -> None:
        """It has been read again, and the monitor goes on with it and with so many blocks."""
        self._note_read(memory, blocks)

    def take_news(self, blocks: int) -> bool:
        """Whether the references rest on more blocks than were kept; these count as kept from now on."""
        news = blocks > self.saved_blocks
        self.saved_blocks = max(blocks, self.saved_blocks)
        return news

    def _note_read(self, memory: VehicleMemory, blocks: int) -> None:
        self.change, self.renewed, self.renewal = memory.change, self.renewal, None
        self.saved_blocks = blocks
