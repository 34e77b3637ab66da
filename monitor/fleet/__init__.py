"""The live fleet: messages in, vehicles watched, alerts and events out."""
