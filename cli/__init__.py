"""The command line: the composition root, where parts are wired together."""
