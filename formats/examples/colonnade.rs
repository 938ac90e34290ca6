//! Makes the hall of `scenes/colonnade.toml`:
//! `cargo run --release -p airlight-formats --example colonnade -- OUT.obj`, with OUT.mtl beside it.
//!
//! A nave between two rows of columns that carry arcades, with aisles outside them. The wall on +X has five arched windows
//! through which the sun falls, the wall at the far end a round one; all else is closed, so that light comes in by no other
//! way. Columns are turned from a profile and smooth; walls, arches and beams are flat. Metres, +Y up, the floor at y = 0,
//! the hall along z. Everything follows from the constants below.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use airlight_core::glam::{DVec2, DVec3};

/// Half of the hall's width and length, and its height.
const HALF: DVec2 = DVec2::new(6.0, 12.0);
const HEIGHT: f64 = 7.0;
/// Bays from end to end; a column stands at each end of a bay but at the walls.
const BAYS: u32 = 6;
/// How far the rows of columns stand from the middle, and half of the arcades' thickness.
const ROW: f64 = 3.1;
const THIN: f64 = 0.3;
/// Thickness of the walls with windows.
const THICK: f64 = 0.7;
/// Radius and height of a column's profile, from the floor to the block that it carries.
const PROFILE: [(f64, f64); 14] = [
    (0.46, 0.16),
    (0.49, 0.22),
    (0.46, 0.29),
    (0.39, 0.32),
    (0.42, 0.37),
    (0.38, 0.42),
    (0.345, 0.50),
    (0.35, 1.40),
    (0.325, 2.80),
    (0.29, 3.90),
    (0.32, 3.95),
    (0.29, 4.00),
    (0.34, 4.12),
    (0.43, 4.24),
];
/// Sides of a column.
const AROUND: u32 = 20;
/// Pieces of an arch.
const ARCH: u32 = 14;

/// The text of the file; equal vertices and normals are written once.
#[derive(Default)]
struct Obj {
    text: String,
    vertices: HashMap<String, usize>,
    normals: HashMap<String, usize>,
}

impl Obj {
    fn line(&mut self, line: &str) {
        self.text += line;
        self.text.push('\n');
    }

    /// The number of a vertex or a normal, which is written where it is new.
    fn number(&mut self, keyword: &str, v: DVec3, digits: usize) -> usize {
        // Without a negative zero, and without zeros at the end.
        let short = |v: f64| {
            let text = format!("{v:.digits$}");
            let text = text.trim_end_matches('0').trim_end_matches('.');
            (if text == "-0" { "0" } else { text }).to_owned()
        };
        let line = format!("{keyword} {} {} {}", short(v.x), short(v.y), short(v.z));
        let known = if keyword == "v" { &mut self.vertices } else { &mut self.normals };
        let next = known.len() + 1;
        let number = *known.entry(line.clone()).or_insert(next);
        if number == next {
            self.line(&line);
        }
        number
    }

    /// A flat face.
    fn face(&mut self, corners: &[DVec3]) {
        let numbers: Vec<_> = corners.iter().map(|c| self.number("v", *c, 3).to_string()).collect();
        self.line(&format!("f {}", numbers.join(" ")));
    }

    /// A face with normals.
    fn smooth(&mut self, corners: &[(DVec3, DVec3)]) {
        let mut line = String::from("f");
        for (position, normal) in corners {
            let (v, n) = (self.number("v", *position, 3), self.number("vn", *normal, 3));
            // Writing to a String cannot fail.
            let _ = write!(line, " {v}//{n}");
        }
        self.line(&line);
    }

    /// A block between two corners.
    fn block(&mut self, low: DVec3, high: DVec3) {
        let at = |x: bool, y: bool, z: bool| {
            let pick = |up: bool, low: f64, high: f64| if up { high } else { low };
            DVec3::new(pick(x, low.x, high.x), pick(y, low.y, high.y), pick(z, low.z, high.z))
        };
        let (o, i) = (false, true);
        self.face(&[at(i, o, i), at(i, o, o), at(i, i, o), at(i, i, i)]);
        self.face(&[at(o, o, o), at(o, o, i), at(o, i, i), at(o, i, o)]);
        self.face(&[at(o, i, i), at(i, i, i), at(i, i, o), at(o, i, o)]);
        self.face(&[at(o, o, o), at(i, o, o), at(i, o, i), at(o, o, i)]);
        self.face(&[at(o, o, i), at(i, o, i), at(i, i, i), at(o, i, i)]);
        self.face(&[at(i, o, o), at(o, o, o), at(o, i, o), at(i, i, o)]);
    }

    /// A column that stands at (x, z).
    fn column(&mut self, x: f64, z: f64) {
        let foot = DVec3::new(x, 0.0, z);
        let plinth = DVec3::new(0.52, 0.0, 0.52);
        self.block(foot - plinth, foot + plinth + DVec3::Y * 0.16);
        let point = |ring: usize, side: u32| {
            let (sin, cos) = (TAU * f64::from(side % AROUND) / f64::from(AROUND)).sin_cos();
            let (radius, height) = PROFILE[ring];
            // Across the profile, from its neighbours.
            let (r0, y0) = PROFILE[ring.saturating_sub(1)];
            let (r1, y1) = PROFILE[(ring + 1).min(PROFILE.len() - 1)];
            let across = DVec2::new(y1 - y0, r0 - r1).normalize();
            let out = DVec3::new(cos, 0.0, sin);
            (foot + out * radius + DVec3::Y * height, out * across.x + DVec3::Y * across.y)
        };
        for ring in 0..PROFILE.len() - 1 {
            for side in 0..AROUND {
                let corners = [(ring, side), (ring + 1, side), (ring + 1, side + 1), (ring, side + 1)];
                self.smooth(&corners.map(|(ring, side)| point(ring, side)));
            }
        }
        let (wide, top) = (DVec3::new(0.47, 0.0, 0.47), DVec3::Y * 4.4);
        self.block(foot - wide + DVec3::Y * 4.24, foot + wide + top);
    }

    /// A piece of a wall across x from `a` to `b`, from `base` to the ceiling along z from `from` to `to`, with an arched
    /// opening `clear` wide in its middle that begins at `sill` and whose arch begins at `spring`.
    fn bay(&mut self, [a, b]: [f64; 2], base: f64, [from, to]: [f64; 2], clear: f64, sill: f64, spring: f64) {
        let (middle, radius) = (0.5 * (from + to), 0.5 * clear);
        let (left, right) = (middle - radius, middle + radius);
        let arch = |i: u32| {
            let (sin, cos) = (PI * f64::from(i) / f64::from(ARCH)).sin_cos();
            (spring + radius * sin, middle - radius * cos)
        };
        for (x, out) in [(a, false), (b, true)] {
            let mut flat = |mut corners: Vec<(f64, f64)>| {
                if out {
                    corners.reverse();
                }
                let corners: Vec<_> = corners.iter().map(|(y, z)| DVec3::new(x, *y, *z)).collect();
                self.face(&corners);
            };
            let mut rectangle = |y0: f64, y1: f64, z0: f64, z1: f64| {
                if y1 > y0 && z1 > z0 {
                    flat(vec![(y0, z0), (y0, z1), (y1, z1), (y1, z0)]);
                }
            };
            rectangle(base, HEIGHT, from, left);
            rectangle(base, HEIGHT, right, to);
            rectangle(base, sill, left, right);
            for i in 0..ARCH {
                let (p, q) = (arch(i), arch(i + 1));
                flat(vec![p, q, (HEIGHT, q.1), (HEIGHT, p.1)]);
            }
        }
        let mut reveal = |p: (f64, f64), q: (f64, f64)| {
            let at = |x: f64, (y, z): (f64, f64)| DVec3::new(x, y, z);
            self.face(&[at(a, p), at(b, p), at(b, q), at(a, q)]);
        };
        for i in 0..ARCH {
            reveal(arch(i), arch(i + 1));
        }
        if sill < spring {
            reveal((sill, left), (spring, left));
            reveal((spring, right), (sill, right));
            reveal((sill, right), (sill, left));
        }
    }

    /// The far wall, with a round window of `radius` around the height `y`.
    fn rose(&mut self, y: f64, radius: f64) {
        let sides = 4 * ARCH;
        let edge = 1.35 * radius;
        let (near, far) = (-HALF.y, -HALF.y - THICK);
        let on = |i: u32, z: f64| {
            let (sin, cos) = (TAU * f64::from(i) / f64::from(sides) - 0.25 * PI).sin_cos();
            let square = edge / sin.abs().max(cos.abs());
            let at = |r: f64| DVec3::new(r * cos, y + r * sin, z);
            (at(radius), at(square))
        };
        for i in 0..sides {
            let ((c0, s0), (c1, s1)) = (on(i, near), on(i + 1, near));
            self.face(&[c0, s0, s1, c1]);
            let ((d0, _), (d1, _)) = (on(i, far), on(i + 1, far));
            self.face(&[d0, c0, c1, d1]);
        }
        let mut rectangle = |x0: f64, x1: f64, y0: f64, y1: f64| {
            self.face(&[(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(x, y)| DVec3::new(x, y, near)));
        };
        rectangle(-HALF.x, HALF.x, 0.0, y - edge);
        rectangle(-HALF.x, HALF.x, y + edge, HEIGHT);
        rectangle(-HALF.x, -edge, y - edge, y + edge);
        rectangle(edge, HALF.x, y - edge, y + edge);
    }
}

/// z of the end of a bay.
fn end(bay: u32) -> f64 {
    -HALF.y + 2.0 * HALF.y * f64::from(bay) / f64::from(BAYS)
}

fn hall(library: &str) -> String {
    let mut obj = Obj::default();
    obj.line("# The hall of colonnade.toml, made by formats/examples/colonnade.rs.");
    obj.line(&format!("mtllib {library}"));
    let (x, z) = (HALF.x, HALF.y);

    obj.line("usemtl floor");
    let wide = x + THICK;
    obj.face(&[(-wide, z), (wide, z), (wide, -z), (-wide, -z)].map(|(x, z)| DVec3::new(x, 0.0, z)));

    obj.line("usemtl plaster");
    obj.face(&[(-wide, -z), (wide, -z), (wide, z), (-wide, z)].map(|(x, z)| DVec3::new(x, HEIGHT, z)));
    obj.face(&[(-z, 0.0), (-z, HEIGHT), (z, HEIGHT), (z, 0.0)].map(|(z, y)| DVec3::new(-x, y, z)));
    obj.face(&[(-x, 0.0), (-x, HEIGHT), (wide, HEIGHT), (wide, 0.0)].map(|(x, y)| DVec3::new(x, y, z)));
    obj.rose(4.3, 1.3);
    for bay in 0..BAYS {
        let ends = [end(bay), end(bay + 1)];
        // The bay at the near end has no window, so that none shines past the eye.
        if bay + 1 < BAYS {
            obj.bay([x, x + THICK], 0.0, ends, 1.8, 1.1, 4.2);
        } else {
            obj.block(DVec3::new(x, 0.0, ends[0]), DVec3::new(x + THICK, HEIGHT, ends[1]));
        }
    }

    obj.line("usemtl stone");
    for row in [-ROW, ROW] {
        for bay in 0..BAYS {
            obj.bay([row - THIN, row + THIN], 4.4, [end(bay), end(bay + 1)], 3.16, 4.4, 4.4);
        }
        for place in 1..BAYS {
            obj.column(row, end(place));
        }
    }

    obj.line("usemtl wood");
    for place in 1..2 * BAYS {
        let middle = -z + z * f64::from(place) / f64::from(BAYS);
        let (low, high) = (DVec3::new(-x, HEIGHT - 0.34, middle - 0.12), DVec3::new(x, HEIGHT, middle + 0.12));
        obj.block(low, high);
    }
    obj.text
}

const MATERIALS: &str = "\
# Materials of colonnade.obj, made by formats/examples/colonnade.rs.
newmtl floor
Kd 0.36 0.31 0.27
Ks 0.08 0.08 0.08
Ns 80
newmtl plaster
Kd 0.68 0.64 0.57
Ks 0 0 0
Ns 32
newmtl stone
Kd 0.60 0.54 0.46
Ks 0.02 0.02 0.02
Ns 20
newmtl wood
Kd 0.26 0.16 0.09
Ks 0.02 0.02 0.02
Ns 20
";

fn write(path: &Path) -> std::io::Result<()> {
    let library = path.with_extension("mtl");
    let name = library.file_name().unwrap_or_default().to_string_lossy().into_owned();
    std::fs::write(path, hall(&name))?;
    std::fs::write(library, MATERIALS)
}

fn main() {
    let Some(out) = std::env::args_os().nth(1).map(PathBuf::from) else {
        eprintln!("usage: colonnade OUT.obj");
        std::process::exit(2);
    };
    if let Err(error) = write(&out) {
        eprintln!("{}: {error}", out.display());
        std::process::exit(1);
    }
}
