//! Reading values of a tree with their types, ranges and places.

use std::ops::RangeInclusive;

use glam::{DVec3, Vec3};

use super::error::Fault;
use super::tree::{Entry, Node, Origin, Value, shorten};

/// A table whose keys are all known.
#[derive(Clone, Debug)]
pub(super) struct Table<'a> {
    path: String,
    origin: Origin,
    entries: &'a [Entry],
}

/// A value and the dotted path that leads to it.
#[derive(Clone, Debug)]
pub(super) struct Field<'a> {
    path: String,
    node: &'a Node,
}

/// Names in a list for people: `a`, `b` or `c`.
pub(super) fn listed<S: AsRef<str>>(names: impl IntoIterator<Item = S>, quote: char, last: &str) -> String {
    let names: Vec<_> = names.into_iter().map(|n| format!("{quote}{}{quote}", n.as_ref())).collect();
    match names.split_last() {
        Some((end, [])) => end.clone(),
        Some((end, rest)) => format!("{} {last} {end}", rest.join(", ")),
        None => String::new(),
    }
}

/// The known name that `name` was probably meant to be.
pub(super) fn closest<'k>(name: &str, known: &[&'k str]) -> Option<&'k str> {
    let distance = |k: &str| strsim::damerau_levenshtein(&name.to_lowercase(), k);
    let best = known.iter().map(|k| (distance(k), *k)).min()?;
    // A third of the letters wrong is as far as a slip goes; beyond it the list of keys helps more.
    (name.len() < 64 && best.0 <= (best.1.len() / 3).max(1)).then_some(best.1)
}

fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

impl<'a> Table<'a> {
    /// The whole scene.
    pub(super) fn root(node: &'a Node, keys: &[&str]) -> Result<Self, Fault> {
        Field { path: String::new(), node }.table(keys)
    }

    fn check(self, keys: &[&str], elsewhere: impl Fn(&str) -> Option<String>) -> Result<Self, Fault> {
        let Some(wrong) = self.entries.iter().find(|e| !keys.contains(&e.key.as_str())) else { return Ok(self) };
        let name = &wrong.key;
        let help = elsewhere(name).unwrap_or_else(|| match closest(name, keys) {
            Some(meant) => format!("did you mean `{meant}`?"),
            None if keys.is_empty() => "no key is taken here".to_owned(),
            None => format!("the keys are {}", listed(keys, '`', "and")),
        });
        let inside = if self.path.is_empty() { String::new() } else { format!(" in {}", self.path) };
        Err(Fault::new(wrong.origin, format!("unknown key `{}`{inside}; {help}", shorten(name))))
    }

    /// The value of `key`, where it is there.
    pub(super) fn get(&self, key: &str) -> Option<Field<'a>> {
        let entry = self.entries.iter().find(|e| e.key == key)?;
        Some(Field { path: join(&self.path, key), node: &entry.node })
    }

    /// The value of `key`, unless it is `"none"` or `false`.
    pub(super) fn wanted(&self, key: &str) -> Option<Field<'a>> {
        self.get(key).filter(|f| !f.is_none())
    }

    /// The value of `key`, unless it asks for nothing (`"none"`, `false`, an empty list or table).
    pub(super) fn asked(&self, key: &str) -> Option<Field<'a>> {
        self.get(key).filter(|f| !f.is_plain())
    }

    /// The value of `key`; `example` shows what is missing where it is not there.
    pub(super) fn require(&self, key: &str, example: &str) -> Result<Field<'a>, Fault> {
        self.get(key).ok_or_else(|| self.fault(format!("{} is missing, as in {example}", join(&self.path, key))))
    }

    /// The value of `key` through `read`, or `default` where it is not there.
    pub(super) fn or<T>(
        &self,
        key: &str,
        default: T,
        read: impl FnOnce(Field<'a>) -> Result<T, Fault>,
    ) -> Result<T, Fault> {
        self.get(key).map_or(Ok(default), read)
    }

    /// Refuses a table that has both keys.
    pub(super) fn exclusive(&self, a: &str, b: &str) -> Result<(), Fault> {
        match (self.get(a), self.get(b)) {
            (Some(a), Some(b)) => Err(b.error(format!("{} and {} exclude each other; give one", a.path, b.path))),
            _ => Ok(()),
        }
    }

    /// Its entries without those of some keys.
    pub(super) fn without(&self, keys: &[&str]) -> Vec<Entry> {
        self.entries.iter().filter(|e| !keys.contains(&e.key.as_str())).cloned().collect()
    }

    /// An error at the table itself.
    pub(super) fn fault(&self, message: impl Into<String>) -> Fault {
        Fault::new(self.origin, message)
    }
}

impl<'a> Field<'a> {
    /// The value itself.
    pub(super) fn node(&self) -> &'a Node {
        self.node
    }

    /// An error at this value, in words that name it themselves.
    pub(super) fn error(&self, message: impl Into<String>) -> Fault {
        Fault::new(self.node.origin, message)
    }

    /// `path = value; right` at this value.
    pub(super) fn wrong(&self, right: &str) -> Fault {
        self.error(format!("{} = {}; {right}", self.path, self.node.value))
    }

    /// `path: what` at this value, for errors that come from below.
    pub(super) fn from(&self, what: impl std::fmt::Display) -> Fault {
        self.error(format!("{}: {what}", self.path))
    }

    /// The value is known but not built.
    pub(super) fn pending(&self, instead: &str) -> Fault {
        let value = match &self.node.value {
            Value::Text(_) | Value::Flag(_) | Value::Whole(_) | Value::Number(_) => format!(" = {}", self.node.value),
            _ => String::new(),
        };
        self.error(format!("{}{value} is not built yet; {instead}", self.path))
    }

    /// Whether the value is `"none"` or `false`.
    pub(super) fn is_none(&self) -> bool {
        match &self.node.value {
            Value::Text(s) => s == "none",
            Value::Flag(b) => !b,
            _ => false,
        }
    }

    /// Whether the value asks for nothing: `"none"`, `false`, an empty list or table.
    fn is_plain(&self) -> bool {
        match &self.node.value {
            Value::List(l) => l.is_empty(),
            Value::Table(t) => t.is_empty(),
            _ => self.is_none(),
        }
    }

    /// Whether the value is a table.
    pub(super) fn is_table(&self) -> bool {
        matches!(self.node.value, Value::Table(_))
    }

    fn expected(&self, what: &str) -> Fault {
        let (kind, value) = (self.node.value.kind(), &self.node.value);
        let value = match value {
            Value::Table(_) => String::new(),
            _ => format!(", {value}"),
        };
        self.error(format!("{} must be {what}; it is {kind}{value}", self.path))
    }

    /// A table with known keys.
    pub(super) fn table(&self, keys: &[&str]) -> Result<Table<'a>, Fault> {
        self.open()?.check(keys, |_| None)
    }

    fn open(&self) -> Result<Table<'a>, Fault> {
        match &self.node.value {
            Value::Table(entries) => Ok(Table { path: self.path.clone(), origin: self.node.origin, entries }),
            _ => Err(self.expected("a table")),
        }
    }

    /// A table whose `kind` says which other keys it takes. Text stands for a table that has only its kind.
    pub(super) fn kinds<'k>(
        &self,
        default: Option<&'k str>,
        kinds: &[(&'k str, &[&str])],
    ) -> Result<(&'k str, Table<'a>), Fault> {
        let names = || listed(kinds.iter().map(|k| k.0), '"', "or");
        let find = |field: &Field<'_>| {
            let name = field.text()?;
            let known = kinds.iter().find(|k| k.0 == name);
            known.copied().ok_or_else(|| field.wrong(&format!("it must be {}", names())))
        };
        if let Value::Text(_) = self.node.value {
            let (kind, _) = find(self)?;
            return Ok((kind, Table { path: self.path.clone(), origin: self.node.origin, entries: &[] }));
        }
        let table = self.open()?;
        let (kind, keys) = match (table.get("kind"), default) {
            (Some(field), _) => find(&field)?,
            (None, Some(kind)) => kinds.iter().find(|k| k.0 == kind).copied().unwrap_or((kind, &[])),
            (None, None) => return Err(table.fault(format!("{}.kind is missing; it must be {}", self.path, names()))),
        };
        let keys: Vec<_> = [&["kind"], keys].concat();
        let elsewhere = |name: &str| {
            let owners: Vec<_> = kinds.iter().filter(|k| k.1.contains(&name)).map(|k| k.0).collect();
            let owners = (!owners.is_empty()).then(|| listed(owners, '"', "and"))?;
            Some(format!("it belongs to kind {owners}, not to \"{kind}\""))
        };
        Ok((kind, table.check(&keys, elsewhere)?))
    }

    /// A list.
    pub(super) fn list(&self) -> Result<Vec<Field<'a>>, Fault> {
        match &self.node.value {
            Value::List(nodes) => {
                let name = |(i, node)| Field { path: format!("{}[{i}]", self.path), node };
                Ok(nodes.iter().enumerate().map(name).collect())
            }
            Value::Table(_) if !self.path.contains('.') => {
                Err(self.error(format!("{0} is a list of tables: write [[{0}]]", self.path)))
            }
            _ => Err(self.expected("a list")),
        }
    }

    /// Text.
    pub(super) fn text(&self) -> Result<&'a str, Fault> {
        match &self.node.value {
            Value::Text(s) => Ok(s),
            _ => Err(self.expected("a string")),
        }
    }

    /// `true` or `false`.
    pub(super) fn flag(&self) -> Result<bool, Fault> {
        match &self.node.value {
            Value::Flag(b) => Ok(*b),
            _ => Err(self.expected("true or false")),
        }
    }

    /// A finite number.
    pub(super) fn number(&self) -> Result<f64, Fault> {
        let v = match &self.node.value {
            Value::Whole(v) => *v as f64,
            Value::Number(v) => *v,
            _ => return Err(self.expected("a number")),
        };
        if v.is_finite() { Ok(v) } else { Err(self.wrong("it must be finite")) }
    }

    /// A finite number that is `right`, said in `words` as in "it must be `words`".
    pub(super) fn number_where(&self, words: &str, right: impl Fn(f64) -> bool) -> Result<f64, Fault> {
        let v = self.number()?;
        if right(v) { Ok(v) } else { Err(self.wrong(&format!("it must be {words}"))) }
    }

    /// A whole number within a range.
    pub(super) fn whole(&self, range: RangeInclusive<u32>) -> Result<u32, Fault> {
        let (low, high) = (range.start(), range.end());
        let words = format!("it must be a whole number from {low} to {high}");
        let v = match &self.node.value {
            Value::Whole(v) => u32::try_from(*v).ok(),
            // 64.0 is a slip of the keyboard, 64.5 is not.
            Value::Number(v) if v.fract() == 0.0 && (0.0..4e9).contains(v) => Some(*v as u32),
            Value::Number(_) => None,
            _ => return Err(self.expected("a whole number")),
        };
        v.filter(|v| range.contains(v)).ok_or_else(|| self.wrong(&words))
    }

    fn numbers<const N: usize>(&self, what: &str) -> Result<[f64; N], Fault> {
        match &self.node.value {
            Value::List(nodes) if nodes.len() == N => {
                let mut out = [0.0; N];
                for (v, field) in out.iter_mut().zip(self.list()?) {
                    *v = field.number()?;
                }
                Ok(out)
            }
            Value::List(nodes) => {
                let n = nodes.len();
                Err(self.error(format!("{} must be {what}; it is a list of {n}", self.path)))
            }
            _ => Err(self.expected(what)),
        }
    }

    /// Three numbers.
    pub(super) fn vector(&self) -> Result<DVec3, Fault> {
        Ok(DVec3::from_array(self.numbers("three numbers, [x, y, z]")?))
    }

    /// A number, which stands for three, or three numbers.
    pub(super) fn number_or_vector(&self) -> Result<DVec3, Fault> {
        match &self.node.value {
            Value::Whole(_) | Value::Number(_) => Ok(DVec3::splat(self.number()?)),
            _ => Ok(DVec3::from_array(self.numbers("a number or [x, y, z]")?)),
        }
    }

    /// A number or [r, g, b], none of which is negative or above `most`.
    pub(super) fn color(&self, most: f32) -> Result<Vec3, Fault> {
        let v = match &self.node.value {
            Value::Whole(_) | Value::Number(_) => [self.number()?; 3],
            _ => self.numbers("a number or [r, g, b]")?,
        };
        let v = DVec3::from_array(v).as_vec3();
        if v.is_finite() && v.min_element() >= 0.0 && v.max_element() <= most {
            return Ok(v);
        }
        Err(match most < f32::MAX {
            true => self.wrong(&format!("it must be from 0 to {most}")),
            false if v.is_finite() => self.wrong("it must be at least 0"),
            false => self.wrong("it must be at most 3.4e38"),
        })
    }

    /// The lower and the upper corner of a box.
    pub(super) fn bounds(&self) -> Result<(DVec3, DVec3), Fault> {
        const WHAT: &str = "two corners, [[x, y, z], [x, y, z]]";
        let corners = match &self.node.value {
            Value::List(_) => self.list()?,
            _ => return Err(self.expected(WHAT)),
        };
        let [min, max] = &corners[..] else { return Err(self.expected(WHAT)) };
        let (min, max) = (min.vector()?, max.vector()?);
        let size = max - min;
        if size.is_finite() && size.min_element() > 0.0 {
            Ok((min, max))
        } else {
            Err(self.wrong("each coordinate of the second corner must be above that of the first"))
        }
    }

    /// One of some words; those without a value are not built yet.
    pub(super) fn choice<T: Copy>(&self, words: &[(&str, Option<T>)]) -> Result<T, Fault> {
        let text = self.text()?;
        match words.iter().find(|w| w.0 == text) {
            Some((_, Some(value))) => Ok(*value),
            Some((_, None)) => {
                let built = listed(words.iter().filter(|w| w.1.is_some()).map(|w| w.0), '"', "and");
                Err(self.pending(&format!("available: {built}")))
            }
            None => Err(self.wrong(&format!("it must be {}", listed(words.iter().map(|w| w.0), '"', "or")))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_find_their_key() {
        let keys = ["extinction", "albedo", "file"];
        assert_eq!(closest("extintion", &keys), Some("extinction"));
        assert_eq!(closest("Albedo", &keys), Some("albedo"));
        assert_eq!(closest("flie", &keys), Some("file"));
        assert_eq!(closest("scattering", &keys), None);
        assert_eq!(closest("", &keys), None);
    }

    #[test]
    fn lists_read_as_people_write_them() {
        assert_eq!(listed(["a"], '`', "and"), "`a`");
        assert_eq!(listed(["a", "b", "c"], '"', "or"), "\"a\", \"b\" or \"c\"");
    }
}
