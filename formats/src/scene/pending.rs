//! Keys that are known and checked, though what they ask for is not built yet.

use super::error::Fault;
use super::table::{Field, Table};

/// What a value must look like.
#[derive(Clone, Copy)]
pub(super) enum Shape {
    Text,
    Whole(u32, u32),
    OneOf(&'static [&'static str]),
}

/// Checks the values of those keys that are there.
pub(super) fn check(table: &Table<'_>, shapes: &[(&str, Shape)]) -> Result<(), Fault> {
    for (key, shape) in shapes {
        if let Some(field) = table.get(key) {
            value(&field, *shape)?;
        }
    }
    Ok(())
}

fn value(field: &Field<'_>, shape: Shape) -> Result<(), Fault> {
    match shape {
        Shape::Text => field.text().map(drop),
        Shape::Whole(low, high) => field.whole(low..=high).map(drop),
        Shape::OneOf(words) => {
            let words: Vec<_> = words.iter().map(|w| (*w, Some(()))).collect();
            field.choice(&words)
        }
    }
}
