//! Buffers, buffer views and accessors: every claim is held against the bytes that are there.

use std::collections::HashMap;
use std::path::PathBuf;
use std::rc::Rc;

use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use super::super::{Open, shown};
use super::Fault;
use super::json::{Accessor, Buffer, Root};

/// The bytes of a document's buffers.
pub(super) struct Data<'a> {
    root: &'a Root,
    buffers: Vec<Rc<Vec<u8>>>,
}

/// Type of a component.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(code: u32) -> Result<Self, String> {
        Ok(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return Err(format!("componentType {code}; it must be 5120 to 5123, 5125 or 5126")),
        })
    }

    fn is_index(self) -> bool {
        matches!(self, Self::U8 | Self::U16 | Self::U32)
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The value of `bytes`, of which there are [`size`](Self::size).
    fn value(self, bytes: &[u8], normalized: bool) -> f64 {
        let part = |v: f64, most: f64| if normalized { (v / most).max(-1.0) } else { v };
        match (self, bytes) {
            (Self::I8, &[a]) => part(i8::from_le_bytes([a]).into(), 127.0),
            (Self::U8, &[a]) => part(a.into(), 255.0),
            (Self::I16, &[a, b]) => part(i16::from_le_bytes([a, b]).into(), 32767.0),
            (Self::U16, &[a, b]) => part(u16::from_le_bytes([a, b]).into(), 65535.0),
            (Self::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]).into(),
            (Self::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]).into(),
            _ => unreachable!("the caller cuts as many bytes as the type has"),
        }
    }
}

impl<'a> Data<'a> {
    /// Gets the bytes of every buffer; adds the files that were read to `files`.
    pub(super) fn load(
        root: &'a Root,
        blob: Option<&[u8]>,
        open: Open<'_>,
        files: &mut Vec<PathBuf>,
    ) -> Result<Self, Fault> {
        let mut known: HashMap<&str, Rc<Vec<u8>>> = HashMap::new();
        let mut buffers = Vec::new();
        for (i, buffer) in root.buffers.iter().enumerate() {
            let at = |what: String| Fault::At(format!("buffers[{i}]"), what);
            let bytes = match (&buffer.uri, blob) {
                (None, Some(blob)) if i == 0 => Rc::new(blob.to_vec()),
                (None, _) => {
                    let what = "it has no uri and is not the first of a .glb with a BIN chunk; its bytes are nowhere";
                    return Err(at(what.into()));
                }
                (Some(uri), _) => match known.get(uri.as_str()) {
                    Some(bytes) => Rc::clone(bytes),
                    None => {
                        let bytes = Rc::new(fetch(uri, open, files).map_err(|fault| match fault {
                            Fault::Whole(what) => at(what),
                            other => other,
                        })?);
                        known.insert(uri, Rc::clone(&bytes));
                        bytes
                    }
                },
            };
            check_length(buffer, bytes.len()).map_err(at)?;
            buffers.push(bytes);
        }
        Ok(Self { root, buffers })
    }

    /// `count` elements of `size` bytes, `stride` bytes apart, from byte `offset` of a buffer view.
    fn window(
        &self,
        view: usize,
        offset: u64,
        count: u64,
        size: usize,
        stride: Option<u64>,
    ) -> Result<(&[u8], usize), String> {
        let views = &self.root.buffer_views;
        let v =
            views.get(view).ok_or_else(|| format!("there is no bufferView {view}; the file has {}", views.len()))?;
        let all = self.buffers.len();
        let buffer = self
            .buffers
            .get(v.buffer)
            .ok_or_else(|| format!("bufferView {view} names buffer {}; the file has {all}", v.buffer))?;
        // A buffer may be followed by padding that is not its own.
        let own = usize::try_from(self.root.buffers[v.buffer].byte_length).unwrap_or(usize::MAX).min(buffer.len());
        let span = |from: u64, length: u64| {
            let (from, to) = (usize::try_from(from).ok()?, usize::try_from(from.checked_add(length)?).ok()?);
            Some(from..to)
        };
        let bytes = span(v.byte_offset, v.byte_length).and_then(|s| buffer[..own].get(s)).ok_or_else(|| {
            let (length, from) = (v.byte_length, v.byte_offset);
            format!("bufferView {view} is {length} bytes from byte {from} of a buffer that has {own}")
        })?;
        let stride = stride.unwrap_or(size as u64);
        if stride < size as u64 {
            return Err(format!("bufferView {view} has byteStride {stride} for elements of {size} bytes"));
        }
        let needed = match count {
            0 => Some(0),
            _ => (count - 1).checked_mul(stride).and_then(|n| n.checked_add(size as u64)),
        };
        let window = needed.and_then(|n| span(offset, n)).and_then(|s| bytes.get(s)).ok_or_else(|| {
            let has = bytes.len();
            format!(
                "{count} elements of {size} bytes, {stride} apart, from byte {offset} do not fit bufferView {view}, \
                 which has {has} bytes"
            )
        })?;
        Ok((window, stride as usize))
    }

    fn accessor(&self, index: usize) -> Result<&'a Accessor, String> {
        let all = &self.root.accessors;
        all.get(index).ok_or_else(|| format!("there is no accessor {index}; the file has {}", all.len()))
    }

    /// How many elements an accessor claims to have.
    pub(super) fn count(&self, index: usize) -> Result<u64, String> {
        Ok(self.accessor(index)?.count)
    }

    /// Vectors of an accessor.
    pub(super) fn vectors(&self, index: usize) -> Result<Vec<[f64; 3]>, String> {
        let accessor = self.accessor(index)?;
        let name = |what: String| format!("accessors[{index}]: {what}");
        let component = Component::of(accessor.component_type).map_err(name)?;
        if accessor.kind != "VEC3" || component == Component::U32 {
            let what = format!("{} of componentType {}", shown(&accessor.kind), accessor.component_type);
            return Err(name(format!("{what}; vectors are VEC3 of 5120 to 5123 or 5126")));
        }
        self.elements(accessor, component).map_err(name)
    }

    /// Indices of an accessor.
    pub(super) fn indices(&self, index: usize) -> Result<Vec<u32>, String> {
        let accessor = self.accessor(index)?;
        let name = |what: String| format!("accessors[{index}]: {what}");
        let component = Component::of(accessor.component_type).map_err(name)?;
        if accessor.kind != "SCALAR" || !component.is_index() || accessor.normalized {
            let what = format!("{} of componentType {}", shown(&accessor.kind), accessor.component_type);
            return Err(name(format!("{what}; indices are SCALAR of 5121, 5123 or 5125, and not normalized")));
        }
        let values = self.elements::<1>(accessor, component).map_err(name)?;
        Ok(values.into_iter().map(|[v]| v as u32).collect())
    }

    fn elements<const N: usize>(&self, accessor: &Accessor, component: Component) -> Result<Vec<[f64; N]>, String> {
        let size = N * component.size();
        let read = |bytes: &[u8]| {
            let mut out = [0.0; N];
            for (v, part) in out.iter_mut().zip(bytes.chunks_exact(component.size())) {
                *v = component.value(part, accessor.normalized);
            }
            out
        };
        let stride_of = |view: usize| self.root.buffer_views.get(view).and_then(|v| v.byte_stride);
        let all = |window: &[u8], stride: usize| -> Vec<[f64; N]> {
            // The last element may lack the gap behind it.
            window.chunks(stride).filter_map(|part| part.get(..size)).map(&read).collect()
        };
        let mut values = match (accessor.buffer_view, &accessor.sparse) {
            (Some(view), _) => {
                let (window, stride) =
                    self.window(view, accessor.byte_offset, accessor.count, size, stride_of(view))?;
                all(window, stride)
            }
            (None, Some(_)) => {
                // Zeros that no byte stands for: as many as the buffers have bytes, and no more on a claim alone.
                let bytes: usize = self.buffers.iter().map(|b| b.len()).sum();
                let count = usize::try_from(accessor.count).ok().filter(|c| *c <= bytes).ok_or_else(|| {
                    format!(
                        "{} elements without a bufferView in a file whose buffers have {bytes} bytes",
                        accessor.count
                    )
                })?;
                vec![[0.0; N]; count]
            }
            (None, None) => {
                return Err("it has neither bufferView nor sparse; compressed meshes are not read".into());
            }
        };
        if let Some(sparse) = &accessor.sparse {
            let kind = Component::of(sparse.indices.component_type)?;
            if !kind.is_index() {
                let code = sparse.indices.component_type;
                return Err(format!("sparse.indices of componentType {code}; it must be 5121, 5123 or 5125"));
            }
            let (from, count) = (&sparse.indices, sparse.count);
            let (places, step) = self.window(from.buffer_view, from.byte_offset, count, kind.size(), None)?;
            let from = &sparse.values;
            let (news, stride) = self.window(from.buffer_view, from.byte_offset, count, size, None)?;
            for (place, new) in places.chunks(step).zip(all(news, stride)) {
                let place = kind.value(place, false) as usize;
                let known = values.len();
                *values.get_mut(place).ok_or_else(|| format!("sparse.indices names element {place} of {known}"))? = new;
            }
        }
        Ok(values)
    }
}

fn check_length(buffer: &Buffer, has: usize) -> Result<(), String> {
    if buffer.byte_length <= has as u64 {
        return Ok(());
    }
    Err(format!("byteLength is {}, and it has {has} bytes; the data is cut short", buffer.byte_length))
}

/// The bytes of a URI: in itself (`data:`), or in a file beside.
fn fetch(uri: &str, open: Open<'_>, files: &mut Vec<PathBuf>) -> Result<Vec<u8>, Fault> {
    if let Some(data) = uri.strip_prefix("data:") {
        let Some((kind, text)) = data.split_once(',') else {
            return Err(Fault::Whole("its data: URI has no comma between type and data".into()));
        };
        if !kind.ends_with(";base64") {
            let what = format!("a data: URI of type '{}'; it must be base64", shown(kind));
            return Err(Fault::Whole(what));
        }
        let config = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
        let engine = GeneralPurpose::new(&alphabet::STANDARD, config);
        let decoded = engine.decode(text.trim());
        return decoded.map_err(|e| Fault::Whole(format!("its data: URI is not base64: {e}")));
    }
    let scheme = uri.split_once(':').map(|(scheme, _)| scheme);
    // A single letter is a drive.
    if let Some(scheme) = scheme.filter(|s| s.len() > 1 && s.bytes().all(|b| b.is_ascii_alphanumeric())) {
        let what = format!("its uri has the scheme '{scheme}:'; files beside and data: are read");
        return Err(Fault::Whole(what));
    }
    let name = percent_encoding::percent_decode_str(uri).decode_utf8_lossy();
    let bytes = open(&name).map_err(Fault::File)?;
    files.push(PathBuf::from(name.into_owned()));
    Ok(bytes)
}
