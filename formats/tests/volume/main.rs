//! Volumes, from files that other programs wrote and files that no program should.

mod build;
mod common;
mod damage;
mod dense;
mod headers;
mod reference;
mod vdb;
mod vdb_write;
