"""Mutation testing of slz: whether tests detect small changes (docs/testing.md)."""
