"""Branch coverage of slz and companion by the tests, including the kernels (docs/testing.md)."""
