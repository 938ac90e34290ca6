//! Volumes, from files that other programs wrote and files that no program should.

mod common;
mod reference;
mod vdb;
mod vdb_write;
