//! `--set KEY=VALUE`: values of the command line in place of those of the file.

use super::error::Fault;
use super::tree::{Entry, Node, Origin, Value, shorten};

/// Puts every override into the tree, the later ones over the earlier.
pub(super) fn apply(root: &mut Node, sets: &[(String, String)]) -> Result<(), Fault> {
    for (i, (key, value)) in sets.iter().enumerate() {
        let value = parse(value, i)?;
        put(root, key, value, i)?;
    }
    Ok(())
}

/// TOML, or a bare word that stands for itself.
fn parse(text: &str, set: usize) -> Result<Node, Fault> {
    let origin = Origin::Set(set);
    let trimmed = text.trim();
    match Node::value(trimmed, set) {
        Ok(node) => Ok(node),
        Err(_) if trimmed.is_empty() => Err(Fault::new(origin, "the value is empty; \"\" is empty text")),
        // What begins like TOML was meant to be TOML.
        Err(fault) if trimmed.starts_with(['"', '\'', '[', '{']) || trimmed.contains(['\n', '\r']) => {
            Err(Fault::new(origin, fault.message))
        }
        Err(_) => Ok(Node { origin, value: Value::Text(trimmed.to_owned()) }),
    }
}

fn put(root: &mut Node, key: &str, value: Node, set: usize) -> Result<(), Fault> {
    let origin = Origin::Set(set);
    let fault = |message: String| Err(Fault::new(origin, message));
    let steps: Vec<_> = key.split('.').map(str::trim).collect();
    if steps.iter().any(|s| s.is_empty()) {
        return fault("a key is a dotted path, as in light.0.intensity".into());
    }
    // As deep as TOML files may go; values of overrides are dropped recursively.
    if steps.len() > 80 {
        return fault("the path has more than 80 steps".into());
    }
    let mut node = root;
    for (depth, &step) in steps.iter().enumerate() {
        let path = steps[..depth].join(".");
        let index = step.parse::<usize>().ok();
        match &node.value {
            Value::List(list) if index.is_none_or(|i| i >= list.len()) => return fault(no_entry(&path, list.len())),
            // A number after a key that is absent is the index of a list that does not exist.
            Value::Table(_) if index.is_some() && depth == 0 => return fault(format!("`{step}` is no key of a scene")),
            Value::Table(entries) if index.is_some() && entries.is_empty() => return fault(no_entry(&path, 0)),
            Value::List(_) | Value::Table(_) => {}
            other => {
                let kind = other.kind();
                return fault(format!("{path} is {kind}, {other}; it has no `{}`", shorten(step)));
            }
        }
        node = child(node, step, origin);
    }
    *node = value;
    Ok(())
}

/// The entry `step` of a list or table; a table gets it where it is absent.
fn child<'a>(node: &'a mut Node, step: &str, origin: Origin) -> &'a mut Node {
    match &mut node.value {
        Value::List(list) => &mut list[step.parse::<usize>().unwrap_or_default()],
        Value::Table(entries) => {
            let at = entries.iter().position(|e| e.key == step).unwrap_or_else(|| {
                let node = Node { origin, value: Value::Table(Vec::new()) };
                entries.push(Entry { key: step.to_owned(), origin, node });
                entries.len() - 1
            });
            &mut entries[at].node
        }
        _ => unreachable!("the caller has checked that the node holds others"),
    }
}

fn no_entry(path: &str, length: usize) -> String {
    let things = match path {
        "light" | "surface" => path.to_owned(),
        _ => return format!("{path} has {length} entries"),
    };
    match length {
        0 => format!("there are no {things}s"),
        1 => format!("there is 1 {things}, {things}.0"),
        n => format!("there are {n} {things}s, {things}.0 to {things}.{}", n - 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(text: &str, key: &str, value: &str) -> Result<Node, String> {
        let mut root = Node::document(text).unwrap();
        apply(&mut root, &[(key.to_owned(), value.to_owned())]).map_err(|f| f.message)?;
        Ok(root)
    }

    /// The value at a dotted path, as errors show it.
    fn shown(root: &Node, path: &str) -> String {
        let mut node = root;
        for step in path.split('.') {
            node = match (&node.value, step.parse::<usize>()) {
                (Value::List(list), Ok(i)) => &list[i],
                _ => &node.get(step).unwrap().node,
            };
        }
        node.value.to_string()
    }

    #[test]
    fn any_key_is_reached_and_created() {
        let text = "[medium]\nalbedo = [0.1, 0.2, 0.3]\n[[light]]\nintensity = 1\n[[light]]\nintensity = 2\n";
        for (key, value, expected) in [
            ("light.1.intensity", "3.5", "3.5"),
            ("light.0.position", "[1, 2, 3]", "[1, 2, 3]"),
            ("medium.albedo.2", "1", "1"),
            ("estimate.environment.bands", "4", "4"),
            ("medium.file", "my clouds/a b.vdb", "\"my clouds/a b.vdb\""),
            ("medium.file", "\"a.vdb\"", "\"a.vdb\""),
            ("medium.file", "2024-scan.nrrd", "\"2024-scan.nrrd\""),
            ("environment.visible", " false ", "false"),
            ("medium.phase", "{ kind = \"rayleigh\" }", "{ … }"),
        ] {
            let root = set(text, key, value).unwrap();
            assert_eq!(shown(&root, key), expected, "{key}={value}");
        }
        let root = set(text, "light.1.intensity", "7").unwrap();
        assert_eq!(shown(&root, "light.0.intensity"), "1");
        assert_eq!(root.locate("medium.albedo"), Node::document(text).unwrap().locate("medium.albedo"));
    }

    #[test]
    fn what_is_not_there_is_told() {
        let text = "[medium]\nalbedo = 0.5\n[[light]]\nkind = \"point\"\n[[light]]\n";
        let told = |key: &str, value: &str| set(text, key, value).unwrap_err();
        assert_eq!(told("light.3.intensity", "2"), "there are 2 lights, light.0 to light.1");
        assert_eq!(told("light.x", "2"), "there are 2 lights, light.0 to light.1");
        assert_eq!(told("surface.0.file", "a.obj"), "there are no surfaces");
        assert_eq!(told("medium.albedo.1", "2"), "medium.albedo is a number, 0.5; it has no `1`");
        assert_eq!(told("medium.blobs.1.a", "2"), "medium.blobs has 0 entries");
        assert_eq!(told("medium..albedo", "2"), "a key is a dotted path, as in light.0.intensity");
        assert_eq!(told("", "2"), "a key is a dotted path, as in light.0.intensity");
        assert_eq!(told("0", "2"), "`0` is no key of a scene");
        assert_eq!(told("medium.file", " "), "the value is empty; \"\" is empty text");
        assert!(told("medium.albedo", "[1, 2").starts_with("not TOML: "));
        assert!(told("medium.albedo", "1\n[camera]\nfov = 3").starts_with("not TOML: "));
        assert!(told(&["a"; 100].join("."), "1").contains("more than 80"));
    }

    #[test]
    fn later_overrides_win() {
        let mut root = Node::document("").unwrap();
        let sets = ["1", "2"].map(|v| ("quality.step".to_owned(), v.to_owned()));
        apply(&mut root, &sets).unwrap();
        assert_eq!(shown(&root, "quality.step"), "2");
        assert_eq!(root.locate("quality.step"), Origin::Set(1));
    }
}
