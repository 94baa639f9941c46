"""Which branches of slz and companion the tests take, the kernels' own included (docs/testing.md)."""
