"""Readers: each turns a log into measurement streams, with units checked and every thrown-away row counted."""
