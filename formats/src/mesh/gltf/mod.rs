//! glTF 2.0: triangles, strips and fans of the default scene (else the first, else all nodes that are no other's child),
//! placed by their nodes.
//!
//! Skins, animations, morph targets, lines, points and pictures are left out with a warning; extensions that a file
//! requires are refused by name, except that of integer positions and normals (`KHR_mesh_quantization`).
//!
//! Source: Khronos, *glTF 2.0 Specification*, 2.0.1.

mod data;
mod json;
mod material;

use std::collections::HashMap;
use std::path::Path;

use airlight_core::scene::{Material, Mesh, Triangle, normal_map};
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};

use self::data::Data;
use self::json::{Asset, Node, Primitive, Root};
use super::soup::Soup;
use super::{Format, MeshFile, Open, Parsed, listed, shown};
use crate::error::FormatError;

/// What a binary file begins with.
pub(super) const MAGIC: &[u8] = b"glTF";

/// Extensions that a file may require.
const READ: &[&str] = &["KHR_mesh_quantization"];
/// Extensions that change nothing of what is read.
const HARMLESS: &[&str] = &["KHR_texture_transform", "KHR_texture_basisu", "EXT_texture_webp", "KHR_xmp_json_ld"];

/// A fault before the path of the file is put to it.
enum Fault {
    /// Of the document as a whole.
    Whole(String),
    /// At a place in it.
    At(String, String),
    /// Something that is not read.
    Unsupported(String),
    /// Of another file.
    File(FormatError),
}

impl Fault {
    fn of(self, path: &Path) -> FormatError {
        match self {
            Self::Whole(what) => FormatError::content(path, None, what),
            Self::At(place, what) => FormatError::content(path, place, what),
            Self::Unsupported(what) => FormatError::unsupported(path, what),
            Self::File(error) => error,
        }
    }
}

/// Reads a .glb: a header of 12 bytes, a chunk of JSON, a chunk of bytes.
pub(super) fn parse_binary(path: &Path, bytes: &[u8], open: Open<'_>) -> Result<MeshFile, FormatError> {
    let (json, blob) = chunks(bytes).map_err(|fault| fault.of(path))?;
    let mut file = parse(path, json, blob, open)?;
    file.format = Format::Glb;
    Ok(file)
}

fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), Fault> {
    let word = |at: usize| {
        let four = bytes.get(at..at + 4)?;
        Some(u32::from_le_bytes(four.try_into().ok()?))
    };
    let short = |at: usize| Fault::At(format!("byte {at}"), format!("the file is cut short; it has {}", bytes.len()));
    let version = word(4).ok_or_else(|| short(4))?;
    if version != 2 {
        return Err(Fault::Unsupported(format!("binary glTF of version {version}; airlight reads version 2")));
    }
    let claimed = word(8).ok_or_else(|| short(8))?;
    if u64::from(claimed) > bytes.len() as u64 {
        let what = format!("its header says {claimed} bytes, and the file has {}; it is cut short", bytes.len());
        return Err(Fault::Whole(what));
    }
    let (mut at, mut json, mut blob) = (12, None, None);
    while at + 8 <= bytes.len() && (json.is_none() || blob.is_none()) {
        let (Some(length), Some(kind)) = (word(at), bytes.get(at + 4..at + 8)) else { break };
        let chunk = bytes.get(at + 8..).and_then(|rest| rest.get(..length as usize)).ok_or_else(|| {
            let left = bytes.len() - at - 8;
            Fault::At(format!("byte {at}"), format!("a chunk of {length} bytes, of which {left} are there"))
        })?;
        match (kind, json.is_some()) {
            (b"JSON", false) => json = Some(chunk),
            (b"BIN\0", true) => blob = Some(chunk),
            (_, true) => {}
            (_, false) => return Err(Fault::At(format!("byte {at}"), "the first chunk must be JSON".into())),
        }
        at += 8 + (length as usize).next_multiple_of(4);
    }
    Ok((json.ok_or_else(|| short(at))?, blob))
}

/// Reads a document; `blob` is the binary chunk beside it.
pub(super) fn parse(path: &Path, json: &[u8], blob: Option<&[u8]>, open: Open<'_>) -> Result<MeshFile, FormatError> {
    let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
    let root: Root = serde_json::from_slice(json).map_err(|e| {
        // The error ends with its own words for the place.
        let text = e.to_string();
        let what = text.split(" at line ").next().unwrap_or_default().to_owned();
        FormatError::content(path, format!("line {}, column {}", e.line(), e.column()), format!("not glTF: {what}"))
    })?;
    document(&root, blob, open).map_err(|fault| fault.of(path))?.finish(path)
}

fn document(root: &Root, blob: Option<&[u8]>, open: Open<'_>) -> Result<Parsed, Fault> {
    let Asset { version, min_version } = &root.asset;
    // A later 2.x says with minVersion what a reader must know.
    if !version.starts_with("2.") || min_version.as_ref().is_some_and(|least| least != "2.0") {
        let asked = min_version.as_ref().unwrap_or(version);
        return Err(Fault::Unsupported(format!("glTF of version {}; airlight reads version 2.0", shown(asked))));
    }
    let unread: Vec<_> = root.extensions_required.iter().filter(|e| !READ.contains(&e.as_str())).collect();
    if !unread.is_empty() {
        let list = listed(&unread);
        let what = format!("it requires {list}, which is not read; export without it (and without compression)");
        return Err(Fault::Unsupported(what));
    }
    let (mut warnings, mut files) = (Vec::new(), Vec::new());
    let known = |e: &&String| !READ.contains(&e.as_str()) && !HARMLESS.contains(&e.as_str());
    let odd: Vec<_> = root.extensions_used.iter().filter(known).collect();
    if !odd.is_empty() {
        warnings.push(format!("extensions that are not read: {}", listed(&odd)));
    }
    let mut materials = material::materials(root, &mut warnings)?;
    let mut reader = Reader { root, data: Data::load(root, blob, open, &mut files)?, left_out: LeftOut::default() };
    let soup = reader.soup()?;
    reader.left_out.tell(root, &mut warnings);
    let mut missing = Vec::new();
    let bare = soup.triangles.iter().filter(|t| t.material as usize == materials.len()).count();
    if bare > 0 {
        let all = soup.triangles.len();
        missing.push(format!("{bare} of {all} triangles have no material; they take the default, grey of 0.7"));
    }
    materials.push((String::new(), Material::default()));
    Ok(Parsed { format: Format::Gltf, soup, materials, files, warnings, missing })
}

/// What is passed over.
#[derive(Default)]
struct LeftOut {
    lines_and_points: usize,
    morphs: usize,
    skins: usize,
    colors: usize,
    flat_nodes: usize,
}

impl LeftOut {
    fn tell(&self, root: &Root, warnings: &mut Vec<String>) {
        for (count, what) in [
            (self.lines_and_points, "primitives of lines or points, left out"),
            (self.morphs, "primitives with morph targets, which are left out"),
            (self.skins, "nodes with skins, which are left out: the mesh stands in its bind pose"),
            (self.colors, "primitives with vertex colours, which are left out"),
            (self.flat_nodes, "nodes scaled to nothing along an axis"),
            (root.animations.len(), "animations, left out"),
        ] {
            if count > 0 {
                warnings.push(format!("{what} ({count})"));
            }
        }
    }
}

/// A primitive's own triangles.
struct Piece {
    positions: Vec<DVec3>,
    /// As many, or none.
    normals: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    material: u32,
}

struct Reader<'a> {
    root: &'a Root,
    data: Data<'a>,
    left_out: LeftOut,
}

impl Reader<'_> {
    /// All triangles of the scene.
    fn soup(&mut self) -> Result<Soup, Fault> {
        let instances = self.instances()?;
        self.check_size(&instances)?;
        let mut soup = Soup::default();
        let mut read: HashMap<usize, Vec<Piece>> = HashMap::new();
        for (node, mesh, map) in &instances {
            if !read.contains_key(mesh) {
                read.insert(*mesh, self.mesh(*mesh)?);
            }
            if map.matrix3.determinant() == 0.0 {
                self.left_out.flat_nodes += 1;
            }
            for piece in &read[mesh] {
                add(&mut soup, piece, map).map_err(|what| Fault::At(format!("nodes[{node}]"), what))?;
            }
        }
        Ok(soup)
    }

    /// Nodes with a mesh: their number, the mesh, and where they stand. Each node is met once, as trees have it.
    fn instances(&mut self) -> Result<Vec<(usize, usize, DAffine3)>, Fault> {
        let nodes = &self.root.nodes;
        let roots: Vec<usize> = match (self.root.scene, self.root.scenes.first()) {
            (Some(i), _) => {
                let all = self.root.scenes.len();
                let fault = || Fault::At("scene".into(), format!("there is no scene {i}; the file has {all}"));
                self.root.scenes.get(i).ok_or_else(fault)?.nodes.clone()
            }
            (None, Some(first)) => first.nodes.clone(),
            (None, None) => {
                let children: std::collections::HashSet<_> = nodes.iter().flat_map(|n| &n.children).collect();
                (0..nodes.len()).filter(|n| !children.contains(n)).collect()
            }
        };
        let mut met = vec![false; nodes.len()];
        let mut waiting: Vec<_> = roots.into_iter().rev().map(|node| (node, DAffine3::IDENTITY)).collect();
        let mut instances = Vec::new();
        while let Some((i, above)) = waiting.pop() {
            let at = |what: String| Fault::At(format!("nodes[{i}]"), what);
            let node =
                nodes.get(i).ok_or_else(|| at(format!("there is no such node; the file has {}", nodes.len())))?;
            if std::mem::replace(&mut met[i], true) {
                return Err(at("it is reached twice; nodes must form trees, without cycles".into()));
            }
            let map = above * place(node).map_err(at)?;
            self.left_out.skins += usize::from(node.skin.is_some());
            if let Some(mesh) = node.mesh {
                let all = self.root.meshes.len();
                if mesh >= all {
                    return Err(at(format!("there is no mesh {mesh}; the file has {all}")));
                }
                instances.push((i, mesh, map));
            }
            waiting.extend(node.children.iter().rev().map(|child| (*child, map)));
        }
        Ok(instances)
    }

    /// Many nodes may show one mesh; what that comes to is added up before it is made.
    fn check_size(&self, instances: &[(usize, usize, DAffine3)]) -> Result<(), Fault> {
        let triangles = |p: &Primitive| -> u64 {
            let corners = p.indices.or(p.attributes.get("POSITION").copied()).and_then(|a| self.data.count(a).ok());
            match (p.mode, corners.unwrap_or(0)) {
                (4, n) => n / 3,
                (_, n) => n,
            }
        };
        let of_mesh = |m: &json::Mesh| m.primitives.iter().fold(0u64, |sum, p| sum.saturating_add(triangles(p)));
        let meshes: Vec<u64> = self.root.meshes.iter().map(of_mesh).collect();
        let total = instances.iter().fold(0u64, |sum, (_, mesh, _)| sum.saturating_add(meshes[*mesh]));
        if total > Mesh::MAX_TRIANGLES as u64 {
            let (nodes, most) = (instances.len(), Mesh::MAX_TRIANGLES);
            return Err(Fault::Whole(format!("its {nodes} nodes show {total} triangles; at most {most} are taken")));
        }
        // A triangle, three vertices of it with normals, and as much again while the mesh is made of them.
        const EACH: u64 = 2 * (size_of::<Triangle>() + 3 * (size_of::<DVec3>() + size_of::<Vec3>())) as u64;
        let free = airlight_core::host::free_memory().unwrap_or(u64::MAX);
        if total * EACH > free {
            let what =
                format!("{total} triangles may take {} bytes, and {free} bytes of memory are free", total * EACH);
            return Err(Fault::Whole(what));
        }
        Ok(())
    }

    fn mesh(&mut self, index: usize) -> Result<Vec<Piece>, Fault> {
        let mut pieces = Vec::new();
        for (i, primitive) in self.root.meshes[index].primitives.iter().enumerate() {
            let piece = self.piece(primitive);
            pieces.extend(piece.map_err(|what| Fault::At(format!("meshes[{index}].primitives[{i}]"), what))?);
        }
        Ok(pieces)
    }

    fn piece(&mut self, primitive: &Primitive) -> Result<Option<Piece>, String> {
        match primitive.mode {
            0..=3 => {
                self.left_out.lines_and_points += 1;
                return Ok(None);
            }
            4..=6 => {}
            mode => return Err(format!("mode {mode}; it must be from 0 to 6")),
        }
        if let Some(name) = ["KHR_draco_mesh_compression", "EXT_meshopt_compression"]
            .iter()
            .find(|name| primitive.extensions.contains_key(**name))
            .filter(|_| primitive.attributes.get("POSITION").is_some_and(|p| self.has_no_data(*p)))
        {
            return Err(format!("its data is compressed with {name}, which is not read; export without compression"));
        }
        self.left_out.morphs += usize::from(!primitive.targets.is_empty());
        self.left_out.colors += usize::from(primitive.attributes.contains_key("COLOR_0"));
        let Some(&positions) = primitive.attributes.get("POSITION") else {
            return Err("it has no attribute POSITION".into());
        };
        let positions: Vec<_> = self.data.vectors(positions)?.into_iter().map(DVec3::from_array).collect();
        if let Some(i) = positions.iter().position(|p| !p.is_finite()) {
            return Err(format!("POSITION {i} is {}; coordinates must be finite", positions[i]));
        }
        let mut normals = Vec::new();
        if let Some(&accessor) = primitive.attributes.get("NORMAL") {
            normals = self.data.vectors(accessor)?.into_iter().map(DVec3::from_array).collect();
            if normals.len() != positions.len() {
                return Err(format!("NORMAL has {} elements and POSITION {}", normals.len(), positions.len()));
            }
            if let Some(i) = normals.iter().position(|n| !n.is_finite()) {
                return Err(format!("NORMAL {i} is {}; normals must be finite", normals[i]));
            }
        }
        let count = positions.len();
        let corners = match primitive.indices {
            Some(accessor) => self.data.indices(accessor)?,
            None => (0..u32::try_from(count).map_err(|_| format!("{count} vertices"))?).collect(),
        };
        if let Some(i) = corners.iter().position(|c| *c as usize >= count) {
            return Err(format!("index {i} names vertex {} of {count}", corners[i]));
        }
        if primitive.mode == 4 && !corners.len().is_multiple_of(3) {
            return Err(format!("{} indices; triangles have three each", corners.len()));
        }
        // What follows the last material is the default.
        let all = self.root.materials.len();
        let material = primitive.material.unwrap_or(all);
        if primitive.material.is_some_and(|m| m >= all) {
            return Err(format!("there is no material {material}; the file has {all}"));
        }
        let triangles = triangles(primitive.mode, &corners);
        Ok(Some(Piece { positions, normals, triangles, material: material as u32 }))
    }

    fn has_no_data(&self, accessor: usize) -> bool {
        self.root.accessors.get(accessor).is_some_and(|a| a.buffer_view.is_none() && a.sparse.is_none())
    }
}

/// Triangles of a list (mode 4), a strip (5) or a fan (6), all turning the same way.
fn triangles(mode: u32, corners: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        4 => corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
        5 => {
            let turned = |(i, c): (usize, &[u32])| if i % 2 == 0 { [c[0], c[1], c[2]] } else { [c[0], c[2], c[1]] };
            corners.windows(3).enumerate().map(turned).collect()
        }
        _ => corners.get(1..).unwrap_or_default().windows(2).map(|c| [c[0], c[1], corners[0]]).collect(),
    }
}

/// The map from a node to what it stands in.
fn place(node: &Node) -> Result<DAffine3, String> {
    let map = match node.matrix {
        Some(m) => {
            if [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0] {
                return Err("its matrix is not affine; the last row must be 0 0 0 1".into());
            }
            let column = |i: usize| DVec3::new(m[i], m[i + 1], m[i + 2]);
            DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(4), column(8)), column(12))
        }
        None => {
            let [x, y, z, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
            let turn = DQuat::from_xyzw(x, y, z, w);
            if !(turn.length_squared().is_normal() && turn.length_squared().is_finite()) {
                return Err(format!("its rotation {turn} is no quaternion; its length must be 1"));
            }
            let scale = DVec3::from_array(node.scale.unwrap_or([1.0; 3]));
            let translation = DVec3::from_array(node.translation.unwrap_or_default());
            DAffine3::from_scale_rotation_translation(scale, turn.normalize(), translation)
        }
    };
    if map.is_finite() { Ok(map) } else { Err("its transform is not finite".into()) }
}

/// Adds the vertices of a piece that its triangles have.
fn add(soup: &mut Soup, piece: &Piece, map: &DAffine3) -> Result<(), String> {
    let turn = normal_map(map);
    let mirrored = map.matrix3.determinant() < 0.0;
    let mut places = vec![u32::MAX; piece.positions.len()];
    for corners in &piece.triangles {
        let mut vertices = [0; 3];
        for (vertex, corner) in vertices.iter_mut().zip(corners) {
            let corner = *corner as usize;
            if places[corner] == u32::MAX {
                let position = map.transform_point3(piece.positions[corner]);
                if !(position.is_finite() && position.abs().max_element() <= Mesh::LARGEST) {
                    let most = Mesh::LARGEST;
                    return Err(format!("it takes a vertex to {position}; coordinates must be within {most:e} m"));
                }
                let normal = piece.normals.get(corner).map_or(DVec3::ZERO, |n| (turn * *n).normalize_or_zero());
                places[corner] = soup.vertex(position, normal.as_vec3());
            }
            *vertex = places[corner];
        }
        if mirrored {
            vertices.swap(1, 2);
        }
        soup.triangles.push(Triangle { vertices, material: piece.material });
    }
    Ok(())
}
