//! Benchmarks of airlight, a group a stage and a group a frame.
