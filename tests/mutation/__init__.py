"""Small changes of slz, one at a time: does a test notice (docs/testing.md)."""
