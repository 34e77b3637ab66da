"""Message classes generated from proto/ by tools/generate_protocol.py; do not edit the _pb2 files."""
