"""Workers and gateways: how a gateway sees the vehicles that other processes watch, and who watches which."""
