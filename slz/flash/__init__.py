"""Flash LiDAR: from waveforms of a focal plane to ranges, map points and hazards (Bulyshev et al., ALHAT)."""
