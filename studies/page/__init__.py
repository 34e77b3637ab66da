"""Parts of a study's report: its sections in words and tables, its pictures, and how they look."""
