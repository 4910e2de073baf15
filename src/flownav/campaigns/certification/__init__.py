"""A requirement flown and judged: its cells, the flights, the certificate."""
