"""The live service: HTTP, database, Zenoh and the fleet's monitor, wired together, and what each needs to run."""
