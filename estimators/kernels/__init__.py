"""What estimators share that is compiled: small linear algebra, a level read with noise."""
