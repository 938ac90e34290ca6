//! The kernels of all backends are twins: files of the same names, which hold functions of the same names in the same
//! order. Needs no device.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use airlight::device::Helper;
use airlight::stage::Stage;

/// A backend's kernels: its folder, the ending of its files, and functions that it alone has or lacks.
struct Backend {
    folder: &'static str,
    ending: &'static str,
    /// File, function and why the other languages have none.
    own: &'static [(&'static str, &'static str, &'static str)],
    /// File, function and why this language has none.
    lacks: &'static [(&'static str, &'static str, &'static str)],
}

const MEMORY: &str =
    "finds the stage's memory and spreads the range over cores; generated, or done by the driver, elsewhere";
const CHECKED: &str = "checks a slice once, so that lookups need not";
const LANES: &str = "carries between memory and the lanes of packets";
const ALONE: &str = "lanes walk together, and whatever else happens to them happens to one alone";
const PLANE: &str =
    "a direction keeps its last two planes in the cache, with a border, so that packets load without asking";
const COLUMNS: &str = "columns of voxels serve all cells of a row";
const BLOCKS: &str = "a block of pixels reads those of the small film once";
const TOGETHER: &str = "several lookups or exponentials of a packet, which wait less for each other";
const GROUPS: &str = "lanes whose lookups fall between the same texels are looked up together";
const RAYS: &str = "rays of an invocation walk from box to box together";
const STEPS: &str = "several steps a turn, where drivers run both sides of every condition";
const OPPOSITE: &str = "opposite neighbours share a walk";
const CELL: &str = "an invocation takes a cell, where drivers run on processors";
const NEAR: &str = "boxes near a packet are kept in a list, where elsewhere walks begin at the first of them";
const SLICE: &str = "a slice is handed to the helper instead";

const CPU: Backend = Backend {
    folder: "backend-cpu/src/kernels",
    ending: "rs",
    own: &[
        ("reduce", "run", MEMORY),
        ("project", "run", MEMORY),
        ("propagate", "run", MEMORY),
        ("propagate", "numbered", LANES),
        ("propagate", "new", LANES),
        ("propagate", "packets", LANES),
        ("propagate", "places", LANES),
        ("propagate", "values", LANES),
        ("propagate", "inside", ALONE),
        ("relight", "run", MEMORY),
        ("relight", "lay", LANES),
        ("relight", "new", LANES),
        ("relight", "values", LANES),
        ("trace", "run", MEMORY),
        ("shade", "run", MEMORY),
        ("shadow", "run", MEMORY),
        ("march", "rows", "parameters are of one type elsewhere"),
        ("mesh", "new", CHECKED),
        ("mesh", "passed", NEAR),
        ("mesh", "within", NEAR),
        ("mesh", "is_empty", NEAR),
        ("mesh", "leaf", "a range of triangles, which loops elsewhere write out"),
        ("mesh", "triangle", "memory is indexed where it is needed elsewhere"),
        ("mesh", "triangles", "memory is indexed where it is needed elsewhere"),
        ("mesh", "places", LANES),
        ("maximum", "touched", COLUMNS),
        ("coarsen", "sums", COLUMNS),
        ("coarsen", "colored", COLUMNS),
        ("coarsen", "optics", COLUMNS),
        ("field", "pitch", COLUMNS),
        ("field", "stretch", COLUMNS),
        ("sky", "of", MEMORY),
        ("field", "at", "generated elsewhere"),
        ("field", "run", COLUMNS),
        ("upsample", "run", MEMORY),
        ("upsample", "new", BLOCKS),
        ("upsample", "span", BLOCKS),
        ("upsample", "level", BLOCKS),
        ("upsample", "between", BLOCKS),
        ("upsample", "pair", BLOCKS),
        ("upsample", "nearest", "what is rare stays out of the way of what is not"),
        ("upsample", "halves", BLOCKS),
        ("upsample", "inverses", BLOCKS),
        ("upsample", "beside", BLOCKS),
        ("upsample", "sums_of", BLOCKS),
        ("accumulate", "run", MEMORY),
        ("accumulate", "only", LANES),
        ("accumulate", "row", MEMORY),
        ("classify", "run", MEMORY),
        ("classify", "pair", LANES),
        ("classify", "mixed", LANES),
        ("coarsen", "run", MEMORY),
        ("illuminate", "run", MEMORY),
        ("obstruct", "run", MEMORY),
        ("sweep", "run", MEMORY),
        ("sweep", "gathered", MEMORY),
        ("sweep", "turned", PLANE),
        ("sweep", "new", PLANE),
        ("sweep", "row", PLANE),
        ("sweep", "load", PLANE),
        ("sweep", "copy", PLANE),
        ("sweep", "border", PLANE),
        ("sweep", "mix", PLANE),
        ("sweep", "groups", PLANE),
        ("sweep", "turn", PLANE),
        ("sweep", "store", PLANE),
        ("sweep", "own", PLANE),
        ("sweep", "upwind", PLANE),
        ("sweep", "packets", PLANE),
        ("sweep", "sources", PLANE),
        ("sweep", "add", LANES),
        ("sweep", "packet", LANES),
        ("path", "run", MEMORY),
        ("evaluate", "run", MEMORY),
        ("evaluate", "total", LANES),
        ("reconstruct", "run", MEMORY),
        ("reconstruct", "row", MEMORY),
        ("reconstruct", "singles", LANES),
        ("reconstruct", "single", LANES),
        ("reconstruct", "summed", LANES),
        ("reconstruct", "four", LANES),
        ("path", "turns", ALONE),
        ("path", "walks", ALONE),
        ("path", "open", LANES),
        ("path", "close", LANES),
        ("path", "happen", ALONE),
        ("path", "splat", LANES),
        ("random", "idle", LANES),
        ("random", "get", LANES),
        ("random", "set", LANES),
        ("walk", "new", CHECKED),
        ("walk", "idle", LANES),
        ("walk", "get", LANES),
        ("walk", "set", LANES),
        ("photons", "default", ALONE),
        ("photons", "push", ALONE),
        ("photons", "land_all", ALONE),
        ("photons", "run", MEMORY),
        ("photons", "shared", "elsewhere a type, or a function, says that integers are added to atomically"),
        ("march", "layered", "elsewhere each field has lookups of its own, generated"),
        ("inject", "run", MEMORY),
        ("inject", "rows", MEMORY),
        ("inject", "indices", LANES),
        ("inject", "base", "generated elsewhere, as texel_base"),
        ("inject", "separate", "packets share the exponentials of a brick, which invocations would have to exchange"),
        ("sample", "new", CHECKED),
        ("field", "new", CHECKED),
        ("field", "several", TOGETHER),
        ("segment", "decays", TOGETHER),
        ("march", "plain", "a medium of one channel has a loop of its own"),
        ("march", "stop", "books of a lane are kept in more than one place"),
        ("march", "open", "lanes are asked in more than one place"),
        ("march", "step", "a medium of one channel has a loop of its own"),
        ("march", "light", "a medium of one channel has a loop of its own"),
        ("march", "colored", "a medium of one channel has a loop of its own"),
        ("march", "make", "light is a function by itself, for the compiler's sake"),
        ("phong", "beside", "closures are compiled for no instruction set"),
        ("field", "size", "the size goes with the field"),
        ("field", "texel", "generated elsewhere"),
        ("field", "empty", "generated elsewhere"),
        ("field", "single", "what a path meets, it meets alone, and a packet of it would look up sixteen points"),
        ("field", "place", "the place of a lookup serves all layers"),
        ("field", "layer", "the place of a lookup serves all layers"),
        ("field", "mix", "colors are no packets; elsewhere an operator"),
        ("field", "packet", LANES),
        ("field", "places", GROUPS),
        ("field", "group", GROUPS),
        ("field", "sums", GROUPS),
        ("field", "add", GROUPS),
        ("field", "channel", GROUPS),
        ("field", "between", GROUPS),
    ],
    lacks: &[
        ("mesh", "first_within", NEAR),
        ("coarsen", "share", "it is in reduce"),
        ("propagate", "integrated", "the parameters say so"),
        ("propagate", "counted", "the parameters say so"),
        ("maximum", "gathered", COLUMNS),
        ("upsample", "small", BLOCKS),
        ("upsample", "first", BLOCKS),
        ("field", "nearest", GROUPS),
        ("phase", "phase_value", SLICE),
        ("phase", "phase_size", SLICE),
        ("harmonics", "harmonics_value", SLICE),
        ("march", "phase_value", SLICE),
        ("march", "phase_size", SLICE),
        ("march", "harmonics_value", SLICE),
        ("march", "blocks", "an Option says whether there are any"),
        ("shade", "blocks", "an Option says whether there are any"),
        ("illuminate", "harmonics_value", SLICE),
        ("illuminate", "blocks", "an Option says whether there are any"),
        ("sweep", "obstructs", "masks of four neighbours, made once a packet"),
        ("reconstruct", "harmonics_value", SLICE),
        ("path", "phase_value", SLICE),
        ("path", "phase_size", SLICE),
        ("path", "resume", "a path on its way has a file of its own"),
        ("path", "keep", "a path on its way has a file of its own"),
        ("photons", "phase_value", SLICE),
        ("photons", "phase_size", SLICE),
        ("photons", "harmonics_value", SLICE),
        ("project", "phase_value", SLICE),
        ("project", "phase_size", SLICE),
    ],
};

const WGPU: Backend = Backend {
    folder: "backend-wgpu/kernels",
    ending: "wgsl",
    own: &[
        ("propagate", "propagate_in_order", "an entry point of its own, in place of another way through one"),
        ("propagate", "propagate_pieces", "an entry point of its own, in place of another way through one"),
        ("propagate", "propagate_output", "an entry point of its own, in place of another way through one"),
        ("propagate", "known", "loops elsewhere"),
        ("march", "from_light", "two loops over lights share it"),
        ("propagate", "row", "loops elsewhere"),
        ("propagate", "weighed", "loops elsewhere"),
        ("propagate", "inside", ALONE),
        ("propagate", "face", "read where it is needed elsewhere"),
        ("propagate", "slot", "where a light's values begin is handed on elsewhere"),
        ("maximum", "following", "rows that are looked up together"),
        ("maximum", "four", "rows that are looked up together"),
        ("maximum", "largest", "rows that are looked up together"),
        ("mesh", "visited", "a step to the next box, which rays that walk together take before they look at triangles"),
        ("mesh", "crosses", RAYS),
        ("mesh", "together", RAYS),
        ("mesh", "reaches", RAYS),
        ("trace", "limit", RAYS),
        ("trace", "keep", RAYS),
        ("trace", "again", RAYS),
        ("obstruct", "either", OPPOSITE),
        ("obstruct", "beside", OPPOSITE),
        ("shadow", "sent", RAYS),
        ("shadow", "keep", RAYS),
        ("path", "step", STEPS),
        ("photons", "approach", STEPS),
        ("photons", "step", STEPS),
        ("relight", "relight_four", "four cells share the light where records are read by four"),
        ("relight", "lit", "four cells that share the light"),
        ("relight", "records_of_four", "four cells that share the light"),
        ("relight", "of_cell", "four cells that share the light"),
        ("relight", "keep", "four cells that share the light"),
        ("evaluate", "moments", "four invocations share eight rows where drivers run on processors"),
        ("evaluate", "arriving", "rows that share the light"),
        ("evaluate", "leave", "rows that invocations share"),
        ("evaluate", "joined", "rows that invocations share"),
        ("reconstruct", "reconstruct_four", "four cells wait together where their rows are read by four"),
        ("reconstruct", "keep", "four cells that wait together"),
        ("reconstruct", "cluster", "asked for before all else of four cells"),
        ("reconstruct", "four_of", "weights of four components that are read at once"),
        ("project", "taken", "cells in an order, those that hold the medium first, where several march together"),
        ("project", "together", "a workgroup takes a cell"),
        ("project", "alone", CELL),
        ("project", "held_records", CELL),
        ("project", "keep_records", CELL),
        ("project", "held_glows", CELL),
        ("project", "keep_glows", CELL),
        ("project", "middle_of", "cells that a workgroup or an invocation takes"),
        ("classify", "write", "four voxels share the control points and where they are"),
    ],
    lacks: &[],
};

const OPENCL: Backend = Backend {
    folder: "backend-opencl/kernels",
    ending: "cl",
    own: &[
        ("reduce", "shares", "the parts of a run of texels"),
        ("coarsen", "shares", "the parts of a run of texels"),
        ("coarsen", "zeros", "asked where colors vary and where none does"),
        ("field", "colors", LANES),
        ("field", "grouped", GROUPS),
        ("field", "between", GROUPS),
        ("segment", "decay", "packets do without a quotient where they can"),
        ("march", "cells_at", "an expression elsewhere"),
        ("upsample", "patch", BLOCKS),
        ("upsample", "side", BLOCKS),
        ("upsample", "level", BLOCKS),
        ("upsample", "between", BLOCKS),
        ("upsample", "nearest", "what is rare stays out of the way of what is not"),
        ("upsample", "inverses", BLOCKS),
        ("upsample", "neighbor", BLOCKS),
        ("upsample", "sums_of", BLOCKS),
        ("classify", "held", LANES),
        ("classify", "chosen", LANES),
        ("classify", "mixed", "a closure, or an operation on vectors, elsewhere"),
        ("reconstruct", "whole", "a work-item takes several cells where it is a core's"),
        ("reconstruct", "singles", "a work-item takes several cells where it is a core's"),
        ("trace", "places", LANES),
        ("march", "load", LANES),
        ("march", "full", "stands in several places of a packet's pixels"),
        ("inject", "separate", "packets share the exponentials of a brick, which invocations would have to exchange"),
        ("propagate", "cells_of", LANES),
        ("sweep", "planes", PLANE),
        ("sweep", "cells_of", PLANE),
        ("sweep", "turned", PLANE),
        ("sweep", "part", PLANE),
        ("sweep", "corner", PLANE),
        ("sweep", "load", PLANE),
        ("sweep", "enter", PLANE),
        ("sweep", "lay", PLANE),
        ("sweep", "between", PLANE),
        ("sweep", "summed", "four coefficients side by side, and the one that is left"),
    ],
    lacks: &[("field", "nearest", GROUPS)],
};

const BACKENDS: [Backend; 3] = [CPU, WGPU, OPENCL];

impl Backend {
    fn path(&self) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(self.folder)
    }

    /// Names of the files, without their ending.
    fn files(&self) -> BTreeSet<String> {
        let entries = fs::read_dir(self.path()).unwrap_or_else(|error| panic!("{}: {error}", self.folder));
        let name = |entry: std::io::Result<fs::DirEntry>| {
            let path = entry.unwrap().path();
            assert_eq!(path.extension().and_then(|e| e.to_str()), Some(self.ending), "{}", path.display());
            path.file_stem().unwrap().to_str().unwrap().to_owned()
        };
        entries.map(name).collect()
    }

    /// The functions of a file that the other languages have too, in order.
    fn functions(&self, file: &str) -> Vec<String> {
        let path = self.path().join(format!("{file}.{}", self.ending));
        let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let mut functions = declared(self.ending, &text);
        for (_, own, _) in self.own.iter().filter(|(of, ..)| *of == file) {
            assert!(functions.iter().any(|name| name == own), "{} lost its own {own}", path.display());
            functions.retain(|name| name != own);
        }
        functions
    }
}

/// The functions that a text defines, in order; one that stands for several types or fields counts where it is first.
fn declared(ending: &str, text: &str) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for line in text.lines() {
        // Rust's tests are no kernels.
        if line.starts_with("#[cfg(test)]") {
            break;
        }
        let name = match ending {
            "cl" => c_function(line),
            _ => line.split_once("fn ").filter(|(before, _)| before.trim().is_empty() || before.contains("pub")),
        };
        let Some((_, name)) = name else { continue };
        let name: String = name.chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '_').collect();
        // Helpers that stand once for each field; and in OpenCL C, the function that the generated entry point runs.
        let name = name.strip_suffix("_FIELD").unwrap_or(&name);
        let name = if ending == "cl" { name.strip_prefix("run_").unwrap_or(name) } else { name };
        if !name.is_empty() && !found.iter().any(|known| known == name) {
            found.push(name.to_owned());
        }
    }
    found
}

/// The type and the rest of a line `TYPE name(…) {`, which begins at its left edge, behind `INLINE` in some.
fn c_function(line: &str) -> Option<(&str, &str)> {
    let line = line.strip_prefix("INLINE ").unwrap_or(line);
    let (before, _) = line.split_once('(')?;
    let (kind, _) = before.split_once(' ')?;
    let is_type = kind.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') && !before.ends_with(' ');
    (is_type && !line.ends_with(';')).then(|| line.split_at(kind.len() + 1))
}

#[test]
fn every_stage_and_every_helper_has_a_file_in_every_language_and_no_other_has() {
    let names = Stage::NAMES.into_iter().chain(Helper::ALL.map(Helper::name));
    let expected: BTreeSet<String> = names.map(str::to_owned).collect();
    for backend in &BACKENDS {
        assert_eq!(backend.files(), expected, "{}", backend.folder);
    }
}

#[test]
fn files_hold_the_same_functions_in_the_same_order() {
    let mut all = 0;
    for file in WGPU.files() {
        let whole = WGPU.functions(&file);
        all += whole.len();
        for backend in &BACKENDS {
            let mut expected = whole.clone();
            for (_, lacks, _) in backend.lacks.iter().filter(|(of, ..)| *of == file) {
                expected.retain(|name| name != lacks);
            }
            assert_eq!(backend.functions(&file), expected, "{}/{file}.{}", backend.folder, backend.ending);
        }
    }
    // A scanner that finds nothing would find nothing wrong.
    assert!(all > 40, "{all} functions");
}

#[test]
fn functions_are_found_in_each_language() {
    let wgsl = "// fn no(\nfn one_FIELD(a: f32) {\n    let b = two(a);\n}\n@compute @workgroup_size(64)\nfn three(\n";
    assert_eq!(declared("wgsl", wgsl), ["one", "three"]);
    let cl = "float later(const Bound *bound);\nfloat one_FIELD(float a) {\n    float b = two(a);\n    if (b) {\n}\n\
              void run_three(const Bound *bound) {\n// Words (in brackets)\n#define FOUR(a) a\n";
    assert_eq!(declared("cl", cl), ["one", "three"]);
    let rs = "//! A fn no(\nimpl A {\n    pub(crate) fn one(&self) {\n    fn one(\nfn three<'a>(f: fn (u32)) {\n#[cfg(test)]\nfn no(\n";
    assert_eq!(declared("rs", rs), ["one", "three"]);
}
