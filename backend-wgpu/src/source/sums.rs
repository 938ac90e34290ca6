//! The sums of `project` where an invocation takes a cell alone: variables of their own, because drivers that run on processors keep
//! those in registers or close by, and what is indexed elsewhere.

use std::fmt::Write as _;

use airlight_core::stage::{ProjectParams, Stage};

use super::WGSL;

/// How many values of a record and of the emission's moments an invocation has sums for, by twelve: three texels of weights, or one
/// that serves three channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct Sums {
    record: u32,
    /// None without emission.
    glow: u32,
    /// Whether one channel of weights serves three of transmittance.
    serves: bool,
}

impl Sums {
    /// Of records of one, three, six and ten bands in colour, so that few kernels are built.
    const SIZES: [u32; 4] = [1, 3, 9, 25];

    /// Those of a stage, of `project` alone.
    pub(crate) fn of(stage: &Stage) -> Self {
        let Stage::Project(project) = stage else { return Self::default() };
        let p: &ProjectParams = &project.params;
        let room = |values: u32| Self::SIZES.into_iter().find(|size| 12 * size >= values).unwrap_or(Self::SIZES[3]);
        Self {
            record: room(p.coefficients * p.record_channels()),
            glow: if p.emission_coefficients > 0 { room(3 * p.emission_coefficients) } else { 0 },
            serves: p.channels > p.weight_channels,
        }
    }

    /// The functions of both.
    pub(crate) fn text(self) -> String {
        let Self { record, glow, serves } = self;
        sums("Record", "records", "weights", record.max(1), serves)
            + &sums("Glow", "glows", "emission_weights", glow.max(1), true)
    }
}

/// The variables, `three_NAME`, which adds the weights from a float on times RGB to them, and `turned_NAME`, by which all are read and
/// written in a loop: the first four, for which others are put behind the last.
fn sums(kind: &str, name: &str, weights: &str, twelves: u32, serves: bool) -> String {
    let fours = 3 * twelves;
    let texels = if serves { twelves } else { fours };
    let declared: String = (0..fours).map(|n| format!("    s{n}: vec4<f32>,\n")).collect();
    let loads: String = (0..=texels).map(|n| format!("    let w{n} = read_four_{weights}(texel + {n}u);\n")).collect();
    let mut added = String::new();
    for n in 0..twelves {
        for (part, (spread, channels)) in [("xxxy", "xyzx"), ("yyzz", "yzxy"), ("zwww", "zxyz")].into_iter().enumerate()
        {
            let sum = 3 * n + part as u32;
            let (texel, spread) = if serves { (n, format!(".{spread}")) } else { (sum, String::new()) };
            // Writing to a String cannot fail.
            let _ = writeln!(
                added,
                "    (*sums).s{sum} += from_two(w{texel}, w{}, off){spread} * rgb.{channels};",
                texel + 1
            );
        }
    }
    let turned: String = (1..fours).map(|n| format!("    (*sums).s{} = (*sums).s{n};\n", n - 1)).collect();
    WGSL.integer(&format!("{}_FOURS", kind.to_uppercase()), fours)
        + &format!(
            "struct {kind}Sums {{\n{declared}}}\n\
             fn sum_{name}(sums: ptr<function, {kind}Sums>, texel: u32, off: u32, rgb: vec3<f32>) {{\n{loads}{added}}}\n\
             fn turned_{name}(sums: ptr<function, {kind}Sums>, last: vec4<f32>) -> vec4<f32> {{\n    let first = (*sums).s0;\n{turned}    \
             (*sums).s{} = last;\n    return first;\n}}\n",
            fours - 1
        )
}
