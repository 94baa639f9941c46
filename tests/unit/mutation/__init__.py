"""Tests of the tools that judge the tests."""
