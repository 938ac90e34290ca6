//! Keys that are known and checked, though what they ask for is not built yet.

use super::error::Fault;
use super::table::{Field, Table};

/// What a value must look like.
#[derive(Clone, Copy)]
pub(super) enum Shape {
    Text,
    /// A finite number that satisfies the test, which the words say.
    Number(&'static str, fn(f64) -> bool),
    Whole(u32, u32),
    Color,
    OneOf(&'static [&'static str]),
    /// A whole number in this range, or this word.
    WholeOr(u32, u32, &'static str),
}

impl Shape {
    pub(super) const POSITIVE: Self = Self::Number("above 0", |v| v > 0.0);
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
        Shape::Number(words, right) => field.number_where(words, right).map(drop),
        Shape::Whole(low, high) => field.whole(low..=high).map(drop),
        Shape::Color => field.color(f32::MAX).map(drop),
        Shape::OneOf(words) => {
            let words: Vec<_> = words.iter().map(|w| (*w, Some(()))).collect();
            field.choice(&words)
        }
        Shape::WholeOr(low, high, word) => match field.text() {
            Ok(text) if text == word => Ok(()),
            Ok(_) => Err(field.wrong(&format!("it must be \"{word}\" or a whole number from {low} to {high}"))),
            Err(_) => field.whole(low..=high).map(drop),
        },
    }
}

/// `[[surface]]`.
pub(super) fn surfaces(root: &Table<'_>) -> Result<(), Fault> {
    let Some(list) = root.asked("surface") else { return Ok(()) };
    let mut first = None;
    for field in list.list()? {
        let surface = field.table(&["file", "shape", "material"])?;
        surface.exclusive("file", "shape")?;
        if surface.get("file").is_none() {
            surface.require("shape", "shape = \"plane\", or file = \"room.obj\"")?;
        }
        let shapes: &[_] = &["box", "plane", "sphere", "cornell-box"];
        check(&surface, &[("file", Shape::Text), ("shape", Shape::OneOf(shapes))])?;
        if let Some(material) = surface.get("material") {
            let material = material.table(&["diffuse", "specular", "shininess"])?;
            let at_least_0 = Shape::Number("at least 0", |v| v >= 0.0);
            check(&material, &[("diffuse", Shape::Color), ("specular", Shape::Color), ("shininess", at_least_0)])?;
        }
        first.get_or_insert(field);
    }
    first.map_or(Ok(()), |f| Err(f.pending("leave [[surface]] out")))
}
