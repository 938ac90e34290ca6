//! Materials of Wavefront OBJ files: `Kd`, `Ks`, `Ns` and `illum` of a .mtl.
//!
//! Source: the appendix "Material Template Library" of the Advanced Visualizer's manual (Wavefront, 1992).

use std::collections::HashMap;
use std::path::Path;

use airlight_core::scene::Material;
use glam::Vec3;

use super::obj::{lines, number};
use super::{listed, shown};
use crate::error::FormatError;

/// A material as the statements so far say it.
struct Draft {
    name: String,
    material: Material,
    illum: Option<u32>,
}

impl Draft {
    /// Models 0 and 1 have no highlights, whatever `Ks` says.
    fn finish(mut self) -> (String, Material) {
        if matches!(self.illum, Some(0 | 1)) {
            self.material.specular = Vec3::ZERO;
        }
        (self.name, self.material)
    }
}

/// Reads a material library into `materials`; where two have one name, the first is kept.
pub(super) fn parse(
    path: &Path,
    bytes: &[u8],
    materials: &mut HashMap<String, Material>,
    warnings: &mut Vec<String>,
) -> Result<(), FormatError> {
    let text = String::from_utf8_lossy(bytes);
    let mut drafts: Vec<Draft> = Vec::new();
    let (mut clamped, mut pictures, mut clear) = (Vec::new(), Vec::new(), Vec::new());
    for (line, text) in lines(&text) {
        let fault = |what: String| FormatError::content(path, Some(format!("line {line}")), what);
        let (keyword, rest) = text.split_once(char::is_whitespace).unwrap_or((&text, ""));
        let rest = rest.trim();
        if keyword == "newmtl" {
            if rest.is_empty() {
                return Err(fault("newmtl needs the name of a material".into()));
            }
            let (name, material) = (rest.to_owned(), Material::default());
            drafts.push(Draft { name, material, illum: None });
            continue;
        }
        let Some(draft) = drafts.last_mut() else {
            match keyword {
                "Kd" | "Ks" | "Ns" | "illum" => return Err(fault(format!("{keyword} before the first newmtl"))),
                _ => continue,
            }
        };
        match keyword {
            "Kd" | "Ks" => {
                let (color, high) = color(keyword, rest).map_err(fault)?;
                if high {
                    clamped.push(format!("{keyword} of {}", draft.name));
                }
                *(if keyword == "Kd" { &mut draft.material.diffuse } else { &mut draft.material.specular }) = color;
            }
            "Ns" => {
                let value = rest.split_whitespace().next().map_or_else(
                    || Err("Ns needs a number".to_owned()),
                    |word| number(word).and_then(|v| at_least_0("Ns", v)),
                );
                let value = value.map_err(fault)?;
                if value > f64::from(Material::MAX_SHININESS) {
                    clamped.push(format!("Ns of {}", draft.name));
                }
                draft.material.shininess = value.min(f64::from(Material::MAX_SHININESS)) as f32;
            }
            // What is no number is none of the models.
            "illum" => draft.illum = rest.parse().ok(),
            "map_Kd" | "map_Ks" | "map_Ns" | "map_d" | "map_bump" | "map_Bump" | "bump" | "disp" | "decal" | "norm" => {
                pictures.push(rest.split_whitespace().last().unwrap_or(keyword).to_owned());
            }
            "d" if rest.parse().is_ok_and(|v: f64| v < 1.0) => clear.push(draft.name.clone()),
            "Tr" if rest.parse().is_ok_and(|v: f64| v > 0.0) => clear.push(draft.name.clone()),
            _ => {}
        }
    }
    let place = path.display();
    if !clamped.is_empty() {
        let most = Material::MAX_SHININESS;
        let list = listed(&clamped);
        warnings.push(format!("{place}: {list}: taken as 1, or as {most} for Ns, the largest that can be"));
    }
    if !pictures.is_empty() {
        pictures.dedup();
        warnings.push(format!("{place}: pictures on surfaces are not read: {}", listed(&pictures)));
    }
    if !clear.is_empty() {
        clear.dedup();
        warnings.push(format!("{place}: surfaces are opaque; transparency is left out: {}", listed(&clear)));
    }
    for (name, material) in drafts.into_iter().map(Draft::finish) {
        materials.entry(name).or_insert(material);
    }
    Ok(())
}

fn at_least_0(keyword: &str, v: f64) -> Result<f64, String> {
    if v >= 0.0 { Ok(v) } else { Err(format!("{keyword} {v}; it must be at least 0")) }
}

/// One number or three, and whether one was above 1.
fn color(keyword: &str, rest: &str) -> Result<(Vec3, bool), String> {
    let words: Vec<_> = rest.split_whitespace().take_while(|w| !w.starts_with('#')).collect();
    let values = match words[..] {
        ["spectral" | "xyz", ..] => {
            return Err(format!("{keyword} {}; it must be given as r g b", shown(rest)));
        }
        [v] => [number(v)?; 3],
        [r, g, b] => [number(r)?, number(g)?, number(b)?],
        _ => return Err(format!("{keyword} needs one number or three, r g b; it has {}", words.len())),
    };
    for v in values {
        at_least_0(keyword, v)?;
    }
    let color = Vec3::from_array(values.map(|v| v.min(1.0) as f32));
    Ok((color, values.iter().any(|v| *v > 1.0)))
}
