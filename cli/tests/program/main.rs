//! The program as its users meet it: what it writes, and that every kind of bad input ends in one clear error, the
//! right exit code, no file left behind, and neither a panic nor a hang nor all of the memory.

mod absent;
mod animation;
mod bench;
mod cameras;
mod compare;
mod conformance;
mod damage;
mod estimators;
mod limits;
mod outputs;
mod reports;
mod scenes;
mod surfaces;
mod transfers;
mod volumes;
mod workbench;
