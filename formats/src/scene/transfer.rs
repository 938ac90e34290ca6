//! `estimate.all = { kind = "transfer" }`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use airlight_core::basis::{DiscreteSpherical, SphericalHarmonics};
use airlight_core::light::Prefilter;
use airlight_core::media::Phase;
use airlight_core::scene::{
    Deposit, LightBasis, Precompute, Records, TransferEstimate, TransferSolver, TransferSource, ViewDependence,
};
use airlight_core::stage::Photons;
use airlight_core::transfer::Transfer;

use super::error::Fault;
use super::estimate::orders;
use super::file::Slot;
use super::table::{Field, Table};
use crate::transfer::basis_text;

/// The keys of `transfer`.
pub(super) const TRANSFER: (&str, &[&str]) = (
    "transfer",
    &[
        "file",
        "view",
        "prefilter",
        "cells",
        "basis",
        "functions",
        "bands",
        "photons",
        "deposit",
        "radius",
        "solver",
        "directions",
        "orders",
        "tolerance",
        "clusters",
        "components",
    ],
);
/// A transfer that lies in a file.
pub(super) struct Plan<'a> {
    file: Field<'a>,
    options: Table<'a>,
    making: Precompute,
}

/// The options; and the file, where one is named.
pub(super) fn parse<'a>(options: Table<'a>) -> Result<(TransferEstimate, Option<Plan<'a>>), Fault> {
    let default = TransferEstimate::default();
    let views = [
        ("cell", Some(ViewDependence::Cell)),
        ("sample", Some(ViewDependence::Sample)),
        ("cluster", Some(ViewDependence::Cluster)),
    ];
    let view = options.or("view", default.view, |f| f.choice(&views))?;
    let prefilter = options.or("prefilter", default.prefilter, |f| prefilter(&f))?;
    let making = making(&options)?;
    let estimate = TransferEstimate { source: TransferSource::Making(making), view, prefilter };
    let Some(file) = options.wanted("file") else { return Ok((estimate, None)) };
    file.text()?;
    Ok((estimate, Some(Plan { file, options, making })))
}

impl Plan<'_> {
    /// Where the file is.
    pub(super) fn path(&self, folder: &Path) -> Result<PathBuf, Fault> {
        Ok(folder.join(self.file.text()?))
    }

    /// Reads the file, unless it is kept. It must be as the options say that are there.
    pub(super) fn load(
        &self,
        folder: &Path,
        phase: &Phase,
        kept: &mut Slot<Arc<Transfer>>,
        files: &mut Vec<PathBuf>,
        warnings: &mut Vec<String>,
    ) -> Result<Arc<Transfer>, Fault> {
        let transfer = kept.get(self.options.without(&["view", "prefilter"]), files, warnings, |files, _| {
            let path = self.path(folder)?;
            let transfer = crate::transfer::read(&path).map_err(|e| {
                let missing = !path.exists();
                let hint = if missing { "; make it with `airlight precompute`" } else { "" };
                self.file.from(format!("{e}{hint}"))
            })?;
            files.push(path);
            Ok(Arc::new(transfer))
        })?;
        let (shape, making) = (transfer.shape(), &self.making);
        let rows = shape.rows.len() as u32;
        let clusters = making.clusters.unwrap_or(rows).min(rows);
        let bands = making.bands.min(phase.reach().unwrap_or(u32::MAX));
        for (key, found, asked) in [
            ("cells", shape.cells.into_iter().max().unwrap_or(0).to_string(), making.cells.to_string()),
            ("basis", basis_text(shape.basis), basis_text(making.basis)),
            ("functions", basis_text(shape.basis), basis_text(making.basis)),
            ("bands", shape.bands.to_string(), bands.to_string()),
            ("clusters", shape.clusters.to_string(), clusters.to_string()),
            ("components", shape.components.to_string(), making.components.to_string()),
        ] {
            if let Some(field) = self.options.get(key).filter(|_| found != asked) {
                return Err(field.error(format!(
                    "estimate.all.{key} asks for {asked}, and {} was made with {found}; make it again with `airlight \
                     precompute`",
                    self.path(folder)?.display()
                )));
            }
        }
        Ok(transfer)
    }
}

fn prefilter(field: &Field<'_>) -> Result<Prefilter, Fault> {
    if field.is_none() {
        return Ok(Prefilter::None);
    }
    let (kind, table) = field.kinds(None, &[("energy", &[]), ("gaussian", &["width"]), ("none", &[])])?;
    Ok(match kind {
        "energy" => Prefilter::Energy,
        "gaussian" => {
            let width = table.or("width", 1.0, |f| {
                f.number_where("from 0.1 to 10 times the least angle between directions", |w| (0.1..=10.0).contains(&w))
            })?;
            Prefilter::Gaussian { width }
        }
        _ => Prefilter::None,
    })
}

fn making(options: &Table<'_>) -> Result<Precompute, Fault> {
    let default = Precompute::default();
    let basis = basis(options)?;
    let solvers = [("photons", Some(true)), ("ordinates", Some(false))];
    let photons = options.or("solver", true, |f| f.choice(&solvers))?;
    let foreign: &[&str] = if photons { &["directions"] } else { &["photons", "deposit", "radius"] };
    for key in foreign {
        if let Some(field) = options.get(key) {
            let solver = if photons { "ordinates" } else { "photons" };
            return Err(field.error(format!("estimate.all.{key} is an option of solver = \"{solver}\"")));
        }
    }
    let solver = if photons {
        let deposits = [
            ("track", Some(Deposit::Track)),
            ("collision", Some(Deposit::Collision)),
            ("absorption", Some(Deposit::Absorption)),
        ];
        TransferSolver::Photons {
            count: options.or("photons", Precompute::photons(basis), |f| {
                f.number_where("above 0 and at most 1e6", |n| n > 0.0 && n <= Precompute::MAX_PHOTONS)
            })?,
            deposit: options.or("deposit", Deposit::Track, |f| f.choice(&deposits))?,
            radius: options.or("radius", Photons::RADIUS, |f| {
                let farthest = f64::from(Photons::FARTHEST);
                f.number_where("from 1 to 16 cells", |r| (1.0..=farthest).contains(&r)).map(|r| r as f32)
            })?,
        }
    } else {
        TransferSolver::Ordinates {
            directions: options.or("directions", None, |f| f.whole(12..=12 * Records::MAX_NSIDE.pow(2)).map(Some))?,
        }
    };
    let clusters = options.or("clusters", default.clusters, |f| {
        if f.is_none() { Ok(None) } else { f.whole(1..=Precompute::MAX_CLUSTERS).map(Some) }
    })?;
    if let (None, Some(field)) = (clusters, options.get("components")) {
        return Err(
            field.error("estimate.all.components are those of clusters, and clusters = \"none\"; give one of them")
        );
    }
    Ok(Precompute {
        cells: options.or("cells", default.cells, |f| f.whole(1..=Precompute::MAX_CELLS))?,
        basis,
        bands: options.or("bands", default.bands, |f| f.whole(1..=Records::MAX_BANDS))?,
        solver,
        orders: orders(options, "estimate.all")?,
        clusters,
        components: options.or("components", default.components, |f| f.whole(0..=Precompute::MAX_COMPONENTS))?,
        memory: None,
    })
}

fn basis(options: &Table<'_>) -> Result<LightBasis, Fault> {
    let kinds = [("dsf", Some("dsf")), ("sh", Some("sh")), ("srbf", Some("srbf"))];
    let kind = options.or("basis", "dsf", |f| f.choice(&kinds))?;
    if kind == "sh" {
        let most = SphericalHarmonics::MAX_BANDS;
        let functions = options.or("functions", 36, |f| {
            let functions = f.whole(1..=most * most)?;
            let bands = functions.isqrt();
            match bands * bands == functions {
                true => Ok(functions),
                false => Err(f.wrong(&format!(
                    "spherical harmonics come in squares of bands; {} or {} would do",
                    bands * bands,
                    (bands + 1) * (bands + 1)
                ))),
            }
        })?;
        return Ok(LightBasis::Harmonics { bands: functions.isqrt() });
    }
    let functions = options.or("functions", 642, |f| {
        let functions = f.whole(1..=u32::MAX)?;
        let known = DiscreteSpherical::FUNCTIONS;
        match known.contains(&functions) {
            true => Ok(functions),
            false => Err(f.wrong(&format!("directions are those of a subdivided icosahedron: one of {known:?}"))),
        }
    })?;
    Ok(if kind == "dsf" { LightBasis::Discrete { functions } } else { LightBasis::Radial { functions } })
}
