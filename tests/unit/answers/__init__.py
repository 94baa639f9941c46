"""Tests of the record of answers."""
