//! Small files of the dense formats, put together from their parts.

use std::io::Write;

/// Packs bytes as gzip.
pub(crate) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// Packs bytes as zlib.
pub(crate) fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// The types that all dense formats share: name in NRRD, code in NIfTI, name in MetaImage.
pub(crate) const TYPES: [(&str, i16, &str); 10] = [
    ("int8", 256, "MET_CHAR"),
    ("uint8", 2, "MET_UCHAR"),
    ("short", 4, "MET_SHORT"),
    ("unsigned short", 512, "MET_USHORT"),
    ("int", 8, "MET_INT"),
    ("uint32_t", 768, "MET_UINT"),
    ("long long", 1024, "MET_LONG_LONG"),
    ("uint64", 1280, "MET_ULONG_LONG"),
    ("float", 16, "MET_FLOAT"),
    ("double", 64, "MET_DOUBLE"),
];

/// Whole numbers as type `kind` of [`TYPES`].
pub(crate) fn values(numbers: &[i64], kind: usize, big: bool) -> Vec<u8> {
    let mut out = Vec::new();
    macro_rules! put {
        ($type:ty) => {
            numbers.iter().for_each(|n| {
                let n = *n as $type;
                out.extend(if big { n.to_be_bytes() } else { n.to_le_bytes() });
            })
        };
    }
    match kind {
        0 => put!(i8),
        1 => put!(u8),
        2 => put!(i16),
        3 => put!(u16),
        4 => put!(i32),
        5 => put!(u32),
        6 => put!(i64),
        7 => put!(u64),
        8 => put!(f32),
        _ => put!(f64),
    }
    out
}

/// Numbers that differ from voxel to voxel and fit every type.
pub(crate) fn counted(dims: [u32; 3]) -> Vec<i64> {
    (0..i64::from(dims.iter().product::<u32>())).map(|n| n % 127).collect()
}

/// A header of NIfTI-1.
#[derive(Clone)]
pub(crate) struct Nifti {
    pub(crate) big: bool,
    pub(crate) bytes: Vec<u8>,
}

impl Nifti {
    /// A header of a volume of `dims` values of `code`, in millimetres, with voxels of 1.
    pub(crate) fn new(big: bool, dims: [i16; 3], code: i16) -> Self {
        let mut header = Self { big, bytes: vec![0; 352] };
        header.i32(0, 348);
        for (n, value) in [3, dims[0], dims[1], dims[2], 1, 1, 1, 1].into_iter().enumerate() {
            header.i16(40 + 2 * n, value);
        }
        header.i16(70, code);
        (0..4).for_each(|n| header.f32(76 + 4 * n, 1.0));
        header.f32(108, 352.0);
        header.bytes[123] = 2;
        header.bytes[344..348].copy_from_slice(b"n+1\0");
        header
    }

    fn put<const N: usize>(&mut self, at: usize, mut bytes: [u8; N]) {
        if self.big {
            bytes.reverse();
        }
        self.bytes[at..at + N].copy_from_slice(&bytes);
    }

    pub(crate) fn i16(&mut self, at: usize, value: i16) {
        self.put(at, value.to_le_bytes());
    }

    pub(crate) fn i32(&mut self, at: usize, value: i32) {
        self.put(at, value.to_le_bytes());
    }

    pub(crate) fn f32(&mut self, at: usize, value: f32) {
        self.put(at, value.to_le_bytes());
    }

    /// The header and its data.
    pub(crate) fn file(&self, data: &[u8]) -> Vec<u8> {
        [&self.bytes[..], data].concat()
    }
}

/// A .vol of `dims` values in the box from (-1, 0, 2) to (1, 3, 4).
pub(crate) fn vol(dims: [i32; 3], data: &[u8]) -> Vec<u8> {
    let mut out = b"VOL\x03".to_vec();
    [1, dims[0], dims[1], dims[2], 1].iter().for_each(|n| out.extend(n.to_le_bytes()));
    [-1.0f32, 0.0, 2.0, 1.0, 3.0, 4.0].iter().for_each(|x| out.extend(x.to_le_bytes()));
    out.extend(data);
    out
}
