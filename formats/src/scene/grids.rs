//! Grids of a volume file beside the density's: what scatters, absorbs and shines.

use std::fmt::Display;
use std::path::Path;
use std::sync::Arc;

use airlight_core::light::BlackBody;
use airlight_core::media::{Grid, GridMedium, IndexBox, MediumError};
use glam::DAffine3;

use super::error::Fault;
use super::table::{Field, Table};

/// Their keys.
pub(super) const KEYS: &[&str] = &[
    "albedo_grid",
    "absorption_grid",
    "emission_grid",
    "temperature_grid",
    "temperature_scale",
    "temperature_reference",
];

/// The temperature, in kelvin, that has unit luminance.
const REFERENCE: f64 = 1500.0;

/// The grids that a scene names.
pub(super) struct Grids<'a> {
    /// None, one, or one of each channel.
    albedo: Vec<Field<'a>>,
    absorption: Option<Field<'a>>,
    emission: Option<Field<'a>>,
    temperature: Option<Field<'a>>,
    /// Kelvin per unit of the temperature's grid.
    scale: f64,
    /// Kelvin.
    reference: f64,
}

/// Where the grids of a file go, and how fine they stay.
pub(super) struct Placement {
    /// Laid over each grid's own map.
    pub(super) map: Option<DAffine3>,
    /// Voxels along each axis that become one.
    pub(super) coarse: u32,
}

impl Placement {
    /// A grid as the scene has it.
    pub(super) fn lay(&self, grid: Grid) -> Result<Arc<Grid>, MediumError> {
        let grid = match self.map {
            Some(map) => {
                let to_world = map * grid.index_to_world();
                grid.placed_by(to_world)
            }
            None => grid,
        };
        Ok(Arc::new(if self.coarse > 1 { grid.coarsened(self.coarse)? } else { grid }))
    }
}

/// `medium.coarse`.
pub(super) fn coarse(medium: &Table<'_>) -> Result<u32, Fault> {
    medium.or("coarse", 1, |f| match f.whole(1..=8)? {
        side if side == 1 || Grid::COARSER.contains(&side) => Ok(side),
        _ => Err(f.wrong("it must be 1, 2, 4 or 8")),
    })
}

/// Reads the grid that a key names.
pub(super) type ReadGrid<'r> = &'r dyn Fn(&Field<'_>) -> Result<Grid, Fault>;

impl<'a> Grids<'a> {
    pub(super) fn parse(table: &Table<'a>) -> Result<Self, Fault> {
        let named = |key| -> Result<Option<Field<'a>>, Fault> {
            let Some(field) = table.wanted(key) else { return Ok(None) };
            field.text()?;
            Ok(Some(field))
        };
        let (emission, temperature) = (named("emission_grid")?, named("temperature_grid")?);
        for (field, says) in [(&emission, "says where the medium shines"), (&temperature, "colours what shines")] {
            if let (Some(field), None) = (field, table.get("emission")) {
                return Err(field.from(format!("{says}; give emission, as in emission = 1")));
            }
        }
        if temperature.is_none() {
            for key in ["temperature_scale", "temperature_reference"] {
                if let Some(field) = table.get(key) {
                    return Err(field.from("belongs to a temperature_grid; give that too"));
                }
            }
        }
        let (coldest, hottest) = (BlackBody::COLDEST, BlackBody::HOTTEST);
        let right = format!("from {coldest} to {hottest}");
        Ok(Self {
            albedo: albedo(table)?,
            absorption: named("absorption_grid")?,
            emission,
            temperature,
            scale: table.or("temperature_scale", 1.0, |f| f.number_where("above 0", |v| v > 0.0))?,
            reference: table.or("temperature_reference", REFERENCE, |f| {
                f.number_where(&right, |v| (coldest..=hottest).contains(&v))
            })?,
        })
    }

    /// Reads those that may reach past the density's box.
    pub(super) fn reaching(&self, read: ReadGrid<'_>) -> Result<Reaching, Fault> {
        let read = |field: &Option<Field<'_>>| field.as_ref().map(read).transpose();
        Ok(Reaching { absorption: read(&self.absorption)?, emission: read(&self.emission)? })
    }

    /// The medium of all.
    pub(super) fn medium(
        &self,
        (file, path): (&Field<'_>, &Path),
        (density, reaching): (Grid, Reaching),
        placement: &Placement,
        read: ReadGrid<'_>,
    ) -> Result<GridMedium, Fault> {
        let told = |key: &Field<'_>, error: MediumError| key.from(told_of(path, error));
        let lay = |key: &Field<'_>, grid: Grid| placement.lay(grid).map_err(|error| told(key, error));
        let Reaching { absorption, emission } = reaching;
        let emission = emission.map(|grid| lay(file, grid)).transpose()?;
        let mut medium = GridMedium::new(lay(file, density)?, emission).map_err(|error| told(file, error))?;
        if let (Some(key), Some(grid)) = (&self.absorption, absorption) {
            medium = medium.with_absorption(lay(key, grid)?).map_err(|error| told(key, error))?;
        }
        let shares = self.albedo.iter().map(|key| lay(key, read(key)?)).collect::<Result<Vec<_>, _>>()?;
        if let ([first, ..], [key, ..]) = (&shares[..], &self.albedo[..]) {
            let channel = |c: usize| Arc::clone(shares.get(c).unwrap_or(first));
            medium = medium.with_albedo([0, 1, 2].map(channel)).map_err(|error| told(key, error))?;
        }
        if let Some(key) = &self.temperature {
            let grid = lay(key, read(key)?)?;
            medium = medium.with_temperature(grid, self.scale, self.reference).map_err(|error| told(key, error))?;
        }
        Ok(medium)
    }
}

/// What a medium says of a file's grid.
pub(super) fn told_of(path: &Path, error: impl Display) -> String {
    format!("{}: {error}", path.display())
}

/// One name, or one for each channel.
fn albedo<'a>(table: &Table<'a>) -> Result<Vec<Field<'a>>, Fault> {
    let Some(field) = table.asked("albedo_grid") else { return Ok(Vec::new()) };
    if field.text().is_ok() {
        return Ok(vec![field]);
    }
    let channels = field.list().map_err(|_| field.wrong("it must be the name of a grid, or a list of three"))?;
    channels.iter().try_for_each(|name| name.text().map(drop))?;
    if channels.len() != 3 {
        return Err(field.wrong("it must be the name of a grid, or a list of three"));
    }
    Ok(channels)
}

/// Grids that make the medium's box larger where they reach past the density's.
pub(super) struct Reaching {
    absorption: Option<Grid>,
    emission: Option<Grid>,
}

impl Reaching {
    /// The indices that the medium covers.
    pub(super) fn window(&self, density: &Grid) -> IndexBox {
        let others = [&self.absorption, &self.emission].into_iter().flatten();
        others.fold(density.bounds(), |window, grid| window.union(grid.bounds()))
    }
}
