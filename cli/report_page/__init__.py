"""The page of `wingwatch report`: what a flight came to, for a colleague."""
