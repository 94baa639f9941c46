"""Out-of-core surveys: points sorted into blocks on disk, maps derived per tile, zones joined across them."""
