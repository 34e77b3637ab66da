"""Online estimation of one aircraft: signals into solutions of every mode, by both estimators."""
