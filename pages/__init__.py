"""Pages that stand alone: one HTML file with its pictures, styles, scripts and figures inside."""
