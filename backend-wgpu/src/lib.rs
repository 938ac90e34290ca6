//! x
#![allow(missing_docs)]
mod cut;
mod source;
