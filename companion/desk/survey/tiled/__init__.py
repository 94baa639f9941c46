"""Surveys of any size: points sorted into blocks on disk, maps drawn tile by tile, zones joined across."""
