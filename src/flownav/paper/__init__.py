"""The paper reproduced: its tables and figures from the synthetic rig and from flights, beside what it printed."""
