//! The CPU device of airlight: every stage on rayon, in packets of sixteen rays.
