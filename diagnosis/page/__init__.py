"""Parts of the report: its sections in words and tables, its pictures, and how they look."""
