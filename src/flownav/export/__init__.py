"""A record in the formats that other tools read: MCAP, TUM, EuRoC, Parquet, CSV and ULog."""
