//! Wavefront OBJ: vertices, normals and polygons of the text form.
//!
//! Free-form curves, lines and points are left out with a warning; groups, smoothing groups and texture coordinates say
//! nothing that is needed. A corner without a normal, or with one of no length, takes that of its facet.
//!
//! Source: the appendix "Object Files" of the Advanced Visualizer's manual (Wavefront, 1992).

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

use airlight_core::scene::{Material, Mesh, Triangle};
use earcut::{Earcut, utils3d};
use glam::{DVec3, Vec3};

use super::soup::Soup;
use super::{Format, MeshFile, Open, Parsed, listed, mtl, shown};
use crate::error::FormatError;

/// The most corners of a face.
const MAX_CORNERS: usize = 1 << 16;

/// Lines with their numbers from 1, without comments that fill a line; those that end in a backslash go on in the next.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut raw = text.lines().enumerate();
    std::iter::from_fn(move || {
        let (number, first) = raw.next()?;
        let mut line = Cow::Borrowed(first.trim());
        while let Some(part) = line.strip_suffix('\\') {
            let next = raw.next().map_or("", |(_, next)| next.trim());
            line = Cow::Owned(format!("{part} {next}"));
        }
        Some((number + 1, line))
    })
    .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// A finite number.
pub(super) fn number(word: &str) -> Result<f64, String> {
    match word.parse::<f64>() {
        Ok(v) if v.is_finite() => Ok(v),
        Ok(_) => Err(format!("{}; numbers must be finite", shown(word))),
        Err(_) => Err(format!("'{}' is not a number", shown(word))),
    }
}

/// The first three numbers of a statement.
fn vector<'a>(keyword: &str, words: impl Iterator<Item = &'a str>) -> Result<DVec3, String> {
    let mut v = [0.0; 3];
    let mut found = 0;
    for (place, word) in v.iter_mut().zip(words) {
        *place = number(word).map_err(|e| format!("{keyword}: {e}"))?;
        found += 1;
    }
    if found < 3 {
        return Err(format!("{keyword} needs three numbers; it has {found}"));
    }
    Ok(DVec3::from_array(v))
}

/// The place in a list of `count` that an index of the file names: from 1, or from -1 backward.
fn resolve(what: &str, index: &str, count: usize) -> Result<usize, String> {
    let fault = || {
        let range = if count == 0 { "there is none before it".into() } else { format!("there are {count} before it") };
        format!("f names {what} {}, and {range}", shown(index))
    };
    let i: i64 = index.parse().map_err(|_| format!("f: '{}' is not a whole number", shown(index)))?;
    let place = match i {
        0 => return Err(format!("f names {what} 0; they are counted from 1, or backward from -1")),
        1.. => usize::try_from(i - 1).map_err(|_| fault())?,
        _ => usize::try_from(i.unsigned_abs()).ok().and_then(|back| count.checked_sub(back)).ok_or_else(fault)?,
    };
    if place < count { Ok(place) } else { Err(fault()) }
}

#[derive(Default)]
struct Obj {
    positions: Vec<DVec3>,
    normals: Vec<Vec3>,
    soup: Soup,
    /// The vertex of a position and a normal.
    seen: HashMap<(usize, Option<usize>), u32>,
    /// Materials in the order in which they are asked for; the first is that of faces that name none.
    names: Vec<String>,
    numbers: HashMap<String, u32>,
    current: u32,
    libraries: Vec<String>,
    lines_and_points: usize,
    free_form: usize,
    /// Buffers of the triangulation.
    corners: Vec<(usize, Option<usize>)>,
    outline: Vec<[f64; 3]>,
    flat: Vec<[f64; 2]>,
    cut: Vec<u32>,
    earcut: Earcut<f64>,
}

pub(super) fn parse(path: &Path, bytes: &[u8], open: Open<'_>) -> Result<MeshFile, FormatError> {
    let text = String::from_utf8_lossy(bytes);
    let mut obj = Obj { names: vec![String::new()], ..Obj::default() };
    for (line, text) in lines(&text) {
        obj.statement(&text).map_err(|what| FormatError::content(path, Some(format!("line {line}")), what))?;
    }
    obj.finish(path, open)
}

impl Obj {
    fn statement(&mut self, text: &str) -> Result<(), String> {
        let (keyword, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        let rest = rest.trim();
        let words = || rest.split_whitespace().take_while(|w| !w.starts_with('#'));
        match keyword {
            "v" => {
                let v = vector(keyword, words())?;
                if v.abs().max_element() > Mesh::LARGEST {
                    return Err(format!("v {v}; coordinates must be within {:e} m", Mesh::LARGEST));
                }
                self.positions.push(v);
            }
            "vn" => self.normals.push(vector(keyword, words())?.normalize_or_zero().as_vec3()),
            "f" => self.face(words())?,
            "usemtl" => self.current = self.material(rest),
            "mtllib" if rest.is_empty() => return Err("mtllib needs the name of a file".into()),
            "mtllib" => self.libraries.push(rest.to_owned()),
            "l" | "p" => self.lines_and_points += 1,
            "curv" | "curv2" | "surf" => self.free_form += 1,
            // Texture coordinates, groups, and what only free-form geometry or renderers of the time had.
            "vt" | "vp" | "g" | "s" | "mg" | "o" | "deg" | "bmat" | "step" | "cstype" | "parm" | "trim" | "hole"
            | "scrv" | "sp" | "end" | "con" | "bevel" | "c_interp" | "d_interp" | "lod" | "shadow_obj"
            | "trace_obj" | "ctech" | "stech" | "usemap" | "maplib" | "call" | "csh" | "bsp" | "bzp" | "cdc"
            | "cdp" | "res" => {}
            _ => {
                let known = "such a file has v, vn, vt, f, o, g, s, mtllib and usemtl";
                return Err(format!("'{}' is no statement of an OBJ file; {known}", shown(keyword)));
            }
        }
        Ok(())
    }

    fn material(&mut self, name: &str) -> u32 {
        if name.is_empty() {
            return 0;
        }
        *self.numbers.entry(name.to_owned()).or_insert_with(|| {
            self.names.push(name.to_owned());
            self.names.len() as u32 - 1
        })
    }

    fn face<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> Result<(), String> {
        self.corners.clear();
        self.outline.clear();
        for word in words {
            if self.corners.len() == MAX_CORNERS {
                return Err(format!("f has more than the {MAX_CORNERS} corners that a face may have"));
            }
            let mut parts = word.split('/');
            let position = resolve("vertex", parts.next().unwrap_or_default(), self.positions.len())?;
            let texture = parts.next().unwrap_or_default();
            if !texture.is_empty() && texture.parse::<i64>().is_err() {
                return Err(format!("f: '{}' is not a whole number", shown(texture)));
            }
            let normal = match parts.next().unwrap_or_default() {
                "" => None,
                index => Some(resolve("normal", index, self.normals.len())?),
            };
            if parts.next().is_some() {
                return Err(format!("f: '{}' is not a corner; one is v, v/vt, v//vn or v/vt/vn", shown(word)));
            }
            self.corners.push((position, normal.filter(|n| self.normals[*n] != Vec3::ZERO)));
            self.outline.push(self.positions[position].to_array());
        }
        let count = self.corners.len();
        if count < 3 {
            return Err(format!("f needs three corners or more; it has {count}"));
        }
        self.triangulate();
        let (known, more, most) = (self.soup.triangles.len(), self.cut.len() / 3, Mesh::MAX_TRIANGLES);
        if known + more > most {
            return Err(format!("the file has more than the {most} triangles that are taken"));
        }
        for i in (0..self.cut.len()).step_by(3) {
            let vertices = [0, 1, 2].map(|c| self.corner(self.cut[i + c] as usize));
            self.soup.triangles.push(Triangle { vertices, material: self.current });
        }
        Ok(())
    }

    /// Cuts the outline into triangles: a convex one from its first corner, another by its ears. What has no area is a
    /// fan too, whose triangles are counted as having none.
    fn triangulate(&mut self) {
        self.cut.clear();
        let count = self.corners.len();
        let corner = |i: usize| DVec3::from_array(self.outline[i % count]);
        let sum = |i: usize| (corner(i) - corner(0)).cross(corner(i + 1) - corner(0));
        let normal: DVec3 = (1..count - 1).map(sum).sum();
        let turn = |i: usize| (corner(i + 1) - corner(i)).cross(corner(i + 2) - corner(i + 1)).dot(normal);
        let convex = count == 3 || (0..count).all(|i| turn(i) > 0.0);
        if !convex && utils3d::project3d_to_2d(&self.outline, count, &mut self.flat) {
            self.earcut.earcut(self.flat.iter().copied(), &[], &mut self.cut);
        }
        if self.cut.is_empty() {
            self.cut.extend((1..count as u32 - 1).flat_map(|i| [0, i, i + 1]));
        }
    }

    /// The vertex of a corner of the face at hand.
    fn corner(&mut self, i: usize) -> u32 {
        let key = self.corners[i];
        *self.seen.entry(key).or_insert_with(|| {
            let normal = key.1.map_or(Vec3::ZERO, |n| self.normals[n]);
            self.soup.vertex(self.positions[key.0], normal)
        })
    }

    fn finish(mut self, path: &Path, open: Open<'_>) -> Result<MeshFile, FormatError> {
        let (mut warnings, mut missing, mut files) = (Vec::new(), Vec::new(), Vec::new());
        let mut library = HashMap::new();
        for names in std::mem::take(&mut self.libraries) {
            // Names are separated by spaces, and exporters write names with spaces in them.
            let whole = open(&names).map(|bytes| vec![(names.clone(), bytes)]);
            let parts = || -> Result<Vec<_>, FormatError> {
                names.split_whitespace().map(|n| Ok((n.to_owned(), open(n)?))).collect()
            };
            match whole.or_else(|e| parts().map_err(|_| e)) {
                Ok(read) => {
                    for (name, bytes) in read {
                        let place = path.with_file_name(&name);
                        mtl::parse(&place, &bytes, &mut library, &mut warnings)?;
                        files.push(PathBuf::from(name));
                    }
                }
                Err(e) => missing.push(format!("{e}; its materials are taken as the default, grey of 0.7")),
            }
        }
        let mut used = vec![0usize; self.names.len()];
        self.soup.triangles.iter().for_each(|t| used[t.material as usize] += 1);
        if used[0] > 0 {
            let (bare, all) = (used[0], self.soup.triangles.len());
            missing.push(format!("{bare} of {all} triangles have no material; they take the default, grey of 0.7"));
        }
        let unknown: Vec<_> = (1..used.len())
            .filter(|i| used[*i] > 0 && !library.contains_key(&self.names[*i]))
            .map(|i| &self.names[i])
            .collect();
        if !unknown.is_empty() && !files.is_empty() {
            let list = listed(&unknown);
            missing.push(format!("no .mtl file has {list}; the default, grey of 0.7, is taken instead"));
        } else if !unknown.is_empty() && missing.is_empty() {
            let list = listed(&unknown);
            missing.push(format!("no mtllib says what {list} is; the default, grey of 0.7, is taken instead"));
        }
        if self.lines_and_points > 0 {
            warnings.push(format!("lines and points, left out ({})", self.lines_and_points));
        }
        if self.free_form > 0 {
            warnings.push(format!("free-form curves and surfaces, left out; export polygons ({})", self.free_form));
        }
        let material = |name: String| {
            let material: Material = library.get(&name).copied().unwrap_or_default();
            (name, material)
        };
        let materials = self.names.into_iter().map(material).collect();
        Parsed { format: Format::Obj, soup: self.soup, materials, files, warnings, missing }.finish(path)
    }
}
