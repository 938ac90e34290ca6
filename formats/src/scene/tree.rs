//! A scene file as a tree of values that know where they stand.

use std::fmt;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::Fault;

/// Where a value comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    /// The scene as a whole.
    Document,
    /// These bytes of the file.
    File { start: usize, end: usize },
    /// The override of that number.
    Set(usize),
}

/// A value. Two are equal wherever they stand.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub(super) origin: Origin,
    pub(super) value: Value,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Text(String),
    Whole(i64),
    Number(f64),
    Flag(bool),
    Date(String),
    List(Vec<Node>),
    Table(Vec<Entry>),
}

/// A key of a table and its value. Two are equal wherever they stand.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) key: String,
    pub(super) origin: Origin,
    pub(super) node: Node,
}

impl PartialEq for Node {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key && self.node == other.node
    }
}

/// The most characters of the user's text that an error repeats.
const SHOWN: usize = 60;

/// The user's text, cut where it is long.
pub(super) fn shorten(text: &str) -> String {
    if text.chars().count() <= SHOWN {
        return text.to_owned();
    }
    text.chars().take(SHOWN).chain(['…']).collect()
}

impl fmt::Display for Value {
    /// The value as an error shows it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Text(s) => write!(f, "{:?}", shorten(s)),
            Self::Whole(v) => write!(f, "{v}"),
            Self::Number(v) if v.is_nan() => f.write_str("nan"),
            // The form that keeps the exponent: 1e300 is not three hundred zeros.
            Self::Number(v) => write!(f, "{v:?}"),
            Self::Flag(v) => write!(f, "{v}"),
            Self::Date(v) => f.write_str(v),
            Self::List(nodes) => {
                f.write_str("[")?;
                for (i, node) in nodes.iter().take(4).enumerate() {
                    if i > 0 {
                        f.write_str(", ")?;
                    }
                    node.value.fmt(f)?;
                }
                f.write_str(if nodes.len() > 4 { ", …]" } else { "]" })
            }
            Self::Table(_) => f.write_str("{ … }"),
        }
    }
}

impl Value {
    /// What kind of value it is, in words.
    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::Text(_) => "a string",
            Self::Whole(_) => "a whole number",
            Self::Number(_) => "a number",
            Self::Flag(_) => "a truth value",
            Self::Date(_) => "a date",
            Self::List(_) => "a list",
            Self::Table(_) => "a table",
        }
    }
}

impl Node {
    /// The table of a TOML document.
    pub(super) fn document(text: &str) -> Result<Self, Fault> {
        let table = DeTable::parse(text).map_err(|e| syntax(&e))?;
        let entries = entries(table.into_inner(), &|span| Origin::File { start: span.start, end: span.end })?;
        Ok(Self { origin: Origin::Document, value: Value::Table(entries) })
    }

    /// One value, as the override of number `set` gives it.
    pub(super) fn value(text: &str, set: usize) -> Result<Self, Fault> {
        let value = DeValue::parse(text).map_err(|e| syntax(&e))?;
        convert(value, &|_| Origin::Set(set))
    }

    /// The value of `key`, where this is a table that has it.
    pub(super) fn get(&self, key: &str) -> Option<&Entry> {
        match &self.value {
            Value::Table(entries) => entries.iter().find(|e| e.key == key),
            _ => None,
        }
    }

    /// The value of a path of keys and, in lists, numbers from 0.
    pub(super) fn at<S: AsRef<str>>(&self, path: &[S]) -> Option<&Self> {
        path.iter().try_fold(self, |node, step| match &node.value {
            Value::List(nodes) => nodes.get(step.as_ref().parse::<usize>().ok()?),
            _ => node.get(step.as_ref()).map(|e| &e.node),
        })
    }

    /// As [`Node::at`], to change it.
    pub(super) fn at_mut<S: AsRef<str>>(&mut self, path: &[S]) -> Option<&mut Self> {
        path.iter().try_fold(self, |node, step| match &mut node.value {
            Value::List(nodes) => nodes.get_mut(step.as_ref().parse::<usize>().ok()?),
            Value::Table(entries) => entries.iter_mut().find(|e| e.key == step.as_ref()).map(|e| &mut e.node),
            _ => None,
        })
    }

    /// Where the value of a dotted path stands, or else the innermost table on the way that is there.
    pub(super) fn locate(&self, path: &str) -> Origin {
        let mut node = self;
        for key in path.split('.') {
            match node.get(key) {
                Some(entry) => node = &entry.node,
                None => break,
            }
        }
        node.origin
    }
}

fn syntax(error: &toml::de::Error) -> Fault {
    let origin = error.span().map_or(Origin::Document, |s| Origin::File { start: s.start, end: s.end });
    Fault::new(origin, format!("not TOML: {}", error.message().replace('\n', "; ")))
}

type Place<'a> = &'a dyn Fn(std::ops::Range<usize>) -> Origin;

/// The entries of a table in the order of the file.
fn entries(table: DeTable<'_>, place: Place<'_>) -> Result<Vec<Entry>, Fault> {
    let mut list: Vec<_> = table.into_iter().collect();
    list.sort_by_key(|(key, _)| key.span().start);
    let convert = |(key, value): (Spanned<_>, Spanned<_>)| {
        let origin = place(key.span());
        let key: std::borrow::Cow<'_, str> = key.into_inner();
        Ok(Entry { key: key.into_owned(), origin, node: convert(value, place)? })
    };
    list.into_iter().map(convert).collect()
}

fn convert(value: Spanned<DeValue<'_>>, place: Place<'_>) -> Result<Node, Fault> {
    let origin = place(value.span());
    let value = match value.into_inner() {
        DeValue::String(s) => Value::Text(s.into_owned()),
        DeValue::Integer(i) => {
            let parsed = i64::from_str_radix(i.as_str(), i.radix());
            Value::Whole(parsed.map_err(|_| Fault::new(origin, "this whole number does not fit 64 bits"))?)
        }
        DeValue::Float(x) => {
            let parsed = x.as_str().parse::<f64>();
            Value::Number(parsed.map_err(|_| Fault::new(origin, "this is not a number"))?)
        }
        DeValue::Boolean(b) => Value::Flag(b),
        DeValue::Datetime(d) => Value::Date(d.to_string()),
        DeValue::Array(list) => {
            let nodes: Result<_, _> = list.into_iter().map(|v| convert(v, place)).collect();
            Value::List(nodes?)
        }
        DeValue::Table(table) => Value::Table(entries(table, place)?),
    };
    Ok(Node { origin, value })
}
